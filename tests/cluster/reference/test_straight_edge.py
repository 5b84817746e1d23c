"""Rays to a square light behind a straight edge, and its map projected back: V is a ramp, Delta (d - z) / z wide."""

import dataclasses

import numpy as np
import pytest

from refgi.cluster.back_projection import CELLS
from refgi.cluster.maps import shadow_maps
from refgi.cluster.reference import back_projection_visibility, rectangle_visibility
from refgi.frame import Frame
from refgi.settings import replaced
from tests.cluster.reference.edge import SETTINGS, receivers, scene, square_light, width_of

# 256 points hide behind an edge along a side one by one
RAYS = 1.01 / 256
# half a texel of 256 by which patches reach over the edge, as a share of the penumbra on the map, and half a cell of 32
PROJECTED = {0.2: 0.05, 0.5: 0.05}
SHIFT = 0.02  # cells: a shift by half a cell of 32 is 0.5, by half a texel of 128 1.5
GAPS = 0.012  # of V; where patches of unlike depth leave gaps


@pytest.mark.feature("VAL-19", "REF-15")
@pytest.mark.parametrize("delta", [0.2, 0.5])
def test_rays_and_the_map_projected_back_give_the_ramp(delta, evidence):
    frame, areas = Frame(scene(), dtype=np.float64), square_light(delta)
    points, facing, exact, width = receivers(delta)
    traced = rectangle_visibility(frame.tracer, frame.scene.geometry, areas, SETTINGS.maps)(0, points, facing)
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
