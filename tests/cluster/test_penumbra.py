"""The chain of soft shadows behind a straight edge: its filter is a disc as wide as the light, or a mip map's.

Its ramp is compared with an integral over the disc, and with eight texels read by hand, of the edge itself.
"""

import dataclasses
import math
from functools import partial

import numpy as np
import pytest

from refgi.cluster.back_projection import CELLS
from refgi.cluster.maps import shadow_maps
from refgi.cluster.reference import back_projection_visibility, rectangle_visibility
from refgi.cluster.visibility.shadow import visibility
from refgi.frame import Frame
from refgi.literal import val_filters, val_maps, val_series, val_visibility
from refgi.settings import replaced
from tests.cluster.edge import EDGE, RECEIVER, SETTINGS, receivers, scene, square_light, width_of

FARTHEST = math.sqrt(27)  # of the ceiling's corners
PLACES = (0.0, 0.07, 0.19, 0.31)  # of the edge, m: 0 is where texels of all levels of a map meet
# A map of 1024 knows the edge to half a texel, 1/68 and 1/170 of the penumbra: where the ramp of a disc is steepest,
# (4 / pi) / 68 = 0.019 and 0.0075. Half of that again for which texels are in the disc, and in that of the search.
FINE = 1024
STEP = {0.2: 0.028, 0.5: 0.012}
# the same texel as a share of the width from V = 0.1 to 0.9: a filter half or twice as wide is off by 0.5 and 1
WIDTH = {0.2: 0.03, 0.5: 0.015}
ROUNDING = 2e-4  # float32: depths through c_k, and levels of a mip map
CURVED = 0.02  # of the width, for an edge on the axis: the plate is farther from the light beside it
PLACES_IN_DISC = 2000
LEVELS = 256  # texels of the map that mip levels are made of


def disc_ramp(u):
    """Return the share of a unit disc that an edge at u leaves free."""
    u = np.clip(u, -1, 1)
    return 0.5 + (np.arcsin(u) + u * np.sqrt(1 - u * u)) / math.pi


def radial_depth(s, t, edge):
    """Return the distance of what is seen at places of the map: the plate, the ceiling or nothing."""
    square = s * s + t * t
    x, y, z = 2 * s / (1 + square), 2 * t / (1 + square), (1 - square) / (1 + square)

    def plane(height, low, high, half):
        r = height / np.maximum(z, 1e-9)
        return np.where((r * x >= low) & (r * x <= high) & (np.abs(r * y) <= half), r, np.inf)

    return np.minimum(plane(EDGE, edge - 3, edge, 2.5), plane(RECEIVER, -3, 3, 3))


def region(point, angle):
    """Return the disc of a cone around a receiver, (1, 3, 1, 1)."""
    one = np.ones((1, 1, 1))
    return val_visibility.disc(np.reshape(point, (3, 1, 1, 1)), np.linalg.norm(point) * one, angle * one)


def places(point, angle):
    """Return places spread evenly over the disc that a cone around a receiver is on the map (Vogel's spiral)."""
    s, t, radius = region(point, angle).ravel()
    k = np.arange(PLACES_IN_DISC) + 0.5
    r, turn = radius * np.sqrt(k / PLACES_IN_DISC), math.pi * (3 - math.sqrt(5)) * k
    return s + r * np.cos(turn), t + r * np.sin(turn)


def filter_angle(delta, d, z):
    return math.atan(delta * (d - z) / (2 * d * z))


def step_share(point, delta, edge):
    """Return V by depth tests over the whole disc (PCSS): blockers within the cone, then the share of the disc."""
    d = np.linalg.norm(point)

    def plate(angle):
        s, t = places(point, angle)
        z, square = radial_depth(s, t, edge), s * s + t * t
        w = np.stack([2 * s, 2 * t, 1 - square]) / (1 + square)
        return z, z * w, z * w[2] < EDGE + 1e-6

    z, at, found = plate(filter_angle(delta, d, EDGE))
    along = point @ at / d
    found &= np.linalg.norm(at - along * point[:, None] / d, axis=0) <= delta / 2 * (1 - along / d)
    if not found.any():
        return 1.0
    return 1 - plate(filter_angle(delta, d, z[found].mean()))[2].mean()


def series_share(point, delta, terms, scale, means_of):
    """Return V by the series (Sec. 4.1) with `means_of(point, angle)` the means of its channels over a filter."""
    weight, bias, _ = val_series.series(terms)
    d = float(np.linalg.norm(point))

    def mean(angle):
        return means_of(point, angle)[None, :, None, None]

    shaded, z_avg, _, t = val_series.csm_penumbra(
        np.reshape(point, (3, 1, 1)), np.zeros((1, 3)), np.eye(3)[None], np.array([delta]), np.array([EDGE]),
        *depths(terms, scale), weight, bias, np.ones((1, 1, 1), bool), mean(filter_angle(delta, d, EDGE)),
        scale == "log_map")
    z = z_avg[0, 0, 0] if shaded.all() else d
    return val_series.csm(shaded, t, mean(filter_angle(delta, d, z))[:, : 2 * terms], weight, bias)[0, 0, 0]


def depths(terms, scale):
    """Return origin, slope and end of the series' depths."""
    end = val_series.series(terms)[2]
    return *val_maps.depth_scale(np.array([EDGE]), np.array([FARTHEST]), np.array([FARTHEST]), end, scale), end


def channels(depth, terms, scale):
    """Return S, C, SZ, CZ and Z of depths, (4 M + 1, ...)."""
    sheet = np.atleast_2d(np.minimum(depth, 1e9))[None]
    t = val_series.series_depth(sheet, *depths(terms, scale), scale == "log_map")
    return val_maps.basis(t, terms, False)[0].reshape(-1, *np.shape(depth))


def over_the_disc(edge, terms, scale):
    """Return what takes means over whole discs."""
    return lambda point, angle: channels(radial_depth(*places(point, angle), edge), terms, scale).mean(axis=1)


def from_levels(edge, terms, scale, n):
    """Return what reads levels of half the disc's diameter between texels."""
    grid = (np.arange(n) + 0.5) * 2 / n - 1
    texels = channels(radial_depth(*np.meshgrid(grid, grid), edge), terms, scale)
    levels = [texels[None], *val_filters.mip_levels(texels[None])]
    return lambda point, angle: val_filters.mip_means(np.ones((1, 1, 1), bool), region(point, angle), terms, True,
                                                      levels)[0, :, 0, 0]


def chain(delta, edge, points, facing, resolution, **settings):
    settings = replaced(SETTINGS, {"maps_resolution": resolution, "occluders_alone": False} | settings)
    areas = square_light(delta)
    maps = shadow_maps(scene(edge).geometry, areas, settings.maps, np.float32)
    return visibility(maps, areas, 0, points.astype(np.float32), facing.astype(np.float32), settings)


def compare(delta, edge, resolution, share, **settings):
    """Return the width of V over that of the light's ramp, of refgi and of `share`, and how far they are apart."""
    points, facing, _, width = receivers(delta, edge, 41)
    found, expected = chain(delta, edge, points, facing, resolution, **settings), np.array([*map(share, points.T)])
    return (*(width_of(points[0], v) / width for v in (found, expected)), np.abs(found - expected).max())


def told(figures):
    return ", ".join(f"{got:.3f} (expected {right:.3f}), V off by {off:.4f}" for got, right, off in figures)


@pytest.mark.feature("VAL-19")
@pytest.mark.parametrize("delta", [0.2, 0.5])
def test_depth_tests_give_the_ramp_of_a_disc(delta, evidence):
    """Analytic: a disc as wide as the square hides its first and last tenth sooner."""
    u = np.linspace(-1, 1, 1001)
    closed = width_of(u, disc_ramp(u)) / 2
    figures = [compare(delta, edge, FINE, partial(step_share, delta=delta, edge=edge), visibility="pcss")
               for edge in PLACES]
    evidence(f"Delta {delta}, PCSS: width over Delta (d - z) / z, a disc's {closed:.3f}: {told(figures)}")
    assert figures[0][0] == pytest.approx(closed, rel=CURVED)
    for got, right, off in figures:
        assert off < STEP[delta]
        assert got == pytest.approx(right, rel=WIDTH[delta])


@pytest.mark.feature("VAL-19")
@pytest.mark.parametrize("delta", [0.2, 0.5])
@pytest.mark.parametrize(("terms", "scale"), [(4, "scene"), (16, "scene"), (4, "log_map")])
def test_the_series_is_filtered_by_the_same_disc(delta, terms, scale, evidence):
    """Its plateaus and its average blocker make the ramp wider or narrower, as an integral over the disc says."""
    figures = [compare(delta, edge, FINE, partial(series_share, delta=delta, terms=terms, scale=scale,
                                                  means_of=over_the_disc(edge, terms, scale)),
                       terms=terms, depth_scale=scale, prefilter="brute") for edge in PLACES[:2]]
    evidence(f"Delta {delta}, CSM, M = {terms}, {scale}: width over Delta (d - z) / z {told(figures)}")
    for got, right, off in figures:
        assert off < STEP[delta]
        assert got == pytest.approx(right, rel=WIDTH[delta])


@pytest.mark.feature("VAL-16", "VAL-19")
@pytest.mark.parametrize("delta", [0.2, 0.5])
def test_levels_of_half_the_disc_read_between_texels(delta, evidence):
    """The mip map's filter is as wide as the disc on average, half to more than once as texels happen to lie."""
    figures = [compare(delta, edge, LEVELS, partial(series_share, delta=delta, terms=4, scale="scene",
                                                    means_of=from_levels(edge, 4, "scene", LEVELS)), prefilter="mip")
               for edge in PLACES]
    evidence(f"Delta {delta}, CSM, M = 4, mip: width over Delta (d - z) / z {told(figures)}")
    for got, right, off in figures:
        assert off < ROUNDING
        assert got == pytest.approx(right, rel=10 * ROUNDING)


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
