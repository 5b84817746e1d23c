"""A square light behind a straight edge: the penumbra is Delta (d - z) / z wide, and V across it is a ramp."""

import dataclasses
import math

import numpy as np
import pytest

from refgi.cluster.clustering.rectangle import AreaLights, map_frames
from refgi.cluster.maps.shadow_maps import shadow_maps
from refgi.cluster.reference import back_projection_visibility, rectangle_visibility
from refgi.cluster.reference.back_projection import CELLS
from refgi.cluster.settings import ValSettings
from refgi.frame import Frame
from refgi.scene import Camera, Geometry, Material, Scene, SpotLight
from refgi.settings import of, replaced

EDGE, RECEIVER = 1.0, 3.0  # distances of the edge and the receivers from the light, m
PLACES = (0.0, 0.07, 0.19, 0.31)  # of the edge, m: 0 is where texels of all levels of a map meet
SETTINGS = of(ValSettings, depth_scale="scene", near_distance=0.5, maps_resolution=256)
# 256 points hide behind an edge along a side one by one
RAYS = 1.01 / 256
# half a texel of 256 by which patches reach over the edge, as a share of the penumbra on the map, and half a cell of 32
PROJECTED = {0.2: 0.05, 0.5: 0.05}
# The map knows the edge to half a texel, 1/17 and 1/42 of the penumbra: 0.075 and 0.030 where the ramp of a disc is
# steepest. Blockers off the axis lie deeper than the edge as well.
STEP = {0.2: 0.10, 0.5: 0.05}  # from the ramp of a disc, which is 0.050 from that of the square
SHIFT = 0.02  # cells: a shift by half a cell of 32 is 0.5, by half a texel of 128 1.5
GAPS = 0.012  # of V; where patches of unlike depth leave gaps
# from the ramp of the square; the series adds its bias and ripple, and the mip map its levels: between texels it is a
# tent twice as wide as at their border, which is where the first edge lies
LIMITS = {("pcss", 4, "brute"): {0.2: 0.14, 0.5: 0.10}, ("csm", 16, "brute"): {0.2: 0.16, 0.5: 0.16},
          ("csm", 4, "brute"): {0.2: 0.16, 0.5: 0.12}, ("csm", 4, "mip"): {0.2: 0.30, 0.5: 0.23}}  # fmt: skip


def square(x, y, z, half_x, half_y):
    """Return corners of a rectangle at height z."""
    return [(x - half_x, y - half_y, z), (x + half_x, y - half_y, z), (x + half_x, y + half_y, z),
            (x - half_x, y + half_y, z)]


def scene(edge=0.0):
    """A plate with the light, one with an edge above it, and a ceiling of receivers."""
    vertices = [*square(0, 0, 0, 2, 2), *square(edge - 1.5, 0, EDGE, 1.5, 2.5), *square(0, 0, RECEIVER, 3, 3)]
    faces = [f for k in range(3) for f in ((4 * k, 4 * k + 1, 4 * k + 2), (4 * k, 4 * k + 2, 4 * k + 3))]
    geometry = Geometry(np.array(vertices, np.float64), np.array(faces, np.int32), np.zeros(6, np.int32))
    return Scene("edge", geometry, (Material("grey", (0.5, 0.5, 0.5)),), Camera((0, -9, 1), (0, 0, 1), up=(0, 0, 1)),
                 (SpotLight((0, 0, 2), (0, 0, -1), 0.3, 0.4, (1, 1, 1)),))


def square_light(delta):
    """Return one area light around the origin."""
    normal = np.array([[0.0], [0.0], [1.0]])
    frame = map_frames(normal)
    return AreaLights(np.zeros((3, 1)), normal, frame, np.full((2, 1), delta), frame[:, :2], np.zeros((2, 1)),
                      np.array([delta]), np.array([delta / math.sqrt(2)]), np.array([4]), np.zeros(4, np.int32))


def receivers(delta, edge=0.0, count=101):
    """Return points along x over twice the penumbra, which way they face, V in closed form and the penumbra's width."""
    width = delta * (RECEIVER - EDGE) / EDGE
    x = np.linspace(-width, width, count)
    points = np.stack([x + edge * RECEIVER / EDGE, np.zeros(count), np.full(count, RECEIVER)])
    facing = np.repeat([[0.0], [0.0], [-1.0]], count, axis=1)
    return points, facing, np.clip(0.5 + x / width, 0, 1), width


def width_of(x, v):
    """Return the width of a penumbra from where V is 0.1 and 0.9; of a ramp, all of it."""
    rising = np.maximum.accumulate(v)
    return (np.interp(0.9, rising, x) - np.interp(0.1, rising, x)) / 0.8


def disc_ramp(u):
    """Return the share of a unit disc that an edge at u leaves free."""
    u = np.clip(u, -1, 1)
    return 0.5 + (np.arcsin(u) + u * np.sqrt(1 - u * u)) / math.pi


@pytest.mark.feature("VAL-19", "REF-15")
@pytest.mark.parametrize("delta", [0.2, 0.5])
def test_rays_and_the_map_projected_back_give_the_ramp(delta, evidence):
    frame, areas = Frame(scene(), dtype=np.float64), square_light(delta)
    points, facing, exact, width = receivers(delta)
    traced = rectangle_visibility(frame, areas, SETTINGS.maps)(0, points, facing)
    maps = shadow_maps(frame.scene.geometry, areas, SETTINGS.maps, np.float64)
    projected = back_projection_visibility(areas, maps)(0, points, facing)
    off = np.abs(traced - exact).max(), np.abs(projected - exact).max()
    evidence(f"Delta {delta}: penumbra {width:.2f} m, rays {width_of(points[0], traced):.3f}, map projected back "
             f"{width_of(points[0], projected):.3f}; V at most {off[0]:.4f} and {off[1]:.3f} off the ramp")
    assert off[0] < RAYS
    assert off[1] < PROJECTED[delta]
    assert width_of(points[0], traced) == pytest.approx(width, rel=0.02)


def mean_excess(turn, delta=0.5):
    """Return by how much V of the map projected back exceeds the ramp in the penumbra, with all but the light turned.

    The mean over places of the edge, which texels cut by chance.
    """
    areas, excess = square_light(delta), []
    for edge in np.linspace(0, 0.31, 16):
        points, facing, exact, _ = receivers(delta, edge)
        geometry = scene(edge).geometry
        turned = dataclasses.replace(geometry, vertices=np.ascontiguousarray(geometry.vertices @ turn.T))
        maps = shadow_maps(turned, areas, replaced(SETTINGS, {"maps_resolution": 128}).maps, np.float64)
        v = back_projection_visibility(areas, maps)(0, np.ascontiguousarray(turn @ points), facing)
        excess.append((v - exact)[(exact > 0.1) & (exact < 0.9)].mean())
    return float(np.mean(excess))


@pytest.mark.feature("REF-15")
@pytest.mark.parametrize("along", [np.eye(3), np.eye(3)[[1, 0, 2]]], ids=["y", "x"])
def test_the_map_projected_back_is_in_its_place(along, evidence):
    """Property: an edge and its mirror image leave as much light; a shift gives to one what it takes from the other."""
    one, other = (mean_excess(along @ np.diag([side, 1.0, 1.0])) for side in (1.0, -1.0))
    shift, gaps = (one - other) / 2 * CELLS, (one + other) / 2
    evidence(f"V as of a light {shift:+.2f} cells of {CELLS} aside; gaps between patches leave {gaps:+.4f} more of it")
    assert abs(shift) < SHIFT
    assert abs(gaps) < GAPS


@pytest.mark.feature("VAL-19")
@pytest.mark.parametrize("delta", [0.2, 0.5])
def test_the_chain_follows_the_ramp(delta, evidence):
    from refgi.cluster.visibility.evaluate import visibility

    areas, figures = square_light(delta), {}
    for edge in PLACES:
        points, facing, exact, width = receivers(delta, edge)
        maps, disc = shadow_maps(scene(edge).geometry, areas, SETTINGS.maps, np.float32), disc_ramp(2 * exact - 1)
        for mode, terms, prefilter in LIMITS:
            series = {"terms": terms, "prefilter": prefilter} if mode == "csm" else {}
            settings = replaced(SETTINGS, {"visibility": mode} | series)
            v = visibility(maps, areas, 0, points, facing, settings)
            figures.setdefault((mode, terms, prefilter), []).append(
                (width_of(points[0], v) / width, np.abs(v - exact).max(), np.abs(v - disc).max()))
    evidence(f"Delta {delta}, penumbra {width:.2f} m, {width_of(points[0], disc) / width:.3f} of it for a disc: "
             + "; ".join(f"{mode}{'' if mode == 'pcss' else f' M={terms} {prefilter}'} {min(r):.3f} to {max(r):.3f} "
                         f"of it, V at most {max(off):.3f} off" for (mode, terms, prefilter), found in figures.items()
                         for r, off, _ in [zip(*found, strict=True)]))
    for kind, limit in LIMITS.items():
        assert max(off for _, off, _ in figures[kind]) < limit[delta]
    assert max(off for _, _, off in figures["pcss", 4, "brute"]) < STEP[delta]
