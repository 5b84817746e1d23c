"""All pixel lights under the visibility of their area lights: limits, the literal sum, sameness of both ways."""

import numpy as np
import pytest

from refgi.cluster import clustered_irradiance
from refgi.cluster.interleave import RUNS, assigned_subsets
from refgi.cluster.kmeans import cluster
from refgi.cluster.maps import shadow_maps
from refgi.cluster.rectangle import AreaLights, area_lights
from refgi.cluster.settings import ValSettings
from refgi.cluster.visibility.shadow import visibility
from refgi.errors import InputError
from refgi.frame import Frame
from refgi.jit import threads
from refgi.lights import PixelLights
from refgi.lights.selection import choose_lights
from refgi.literal.pairs import pair
from refgi.literal.val_areas import interleaving
from refgi.pairs.irradiance import Receivers, irradiance
from refgi.pairs.settings import PairSettings
from refgi.rsm import facing_normals
from refgi.scene import load_scene
from refgi.settings import of
from tests.cluster.lights import hard_visibility
from tests.pairs import sets

ROUNDING = 1e-12  # of sums over some hundred lights in another order, relative to the largest
ROUNDING_SINGLE = 2e-6  # the same in float32
NOT_SHADOWED = of(ValSettings, visibility="none")


def picture(points, height, width):
    """Return receivers of (3, 1, n) as a picture."""
    position, normal, covered = points
    return Receivers(position.reshape(3, height, width), normal.reshape(3, height, width),
                     covered.reshape(height, width))


def grouped(of, count):
    """Return area lights that say no more than whose lights are whose."""
    none = np.zeros((3, count))
    return AreaLights(none, none, np.zeros((count, 3, 3)), none[:2], np.zeros((count, 2, 3)), none[:2], none[0],
                      none[0], np.bincount(of, minlength=count), np.asarray(of, np.int32))


def striped(m, points, _):
    """V of an area light that depends on both in a way of its own."""
    return 0.5 + 0.5 * np.sin(3 * points[0] + points[1] + m)


@pytest.mark.feature("VAL-01")
@pytest.mark.parametrize("kind", ["none", "distance", "geometry", "disc", "sphere", "lobes"])
@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_unshadowed_it_is_the_sum_over_all_lights(kind, real, evidence):
    rng = np.random.default_rng(1)
    to, lights = sets.room(rng, 300, real)
    if kind == "lobes":
        axis = sets.random_directions(rng, 300)
        lights = lights._replace(lobe_flux=lights.flux[:, ::-1].copy(), lobe_axis=axis.astype(real),
                                 lobe_exponent=rng.uniform(0, 40, 300).astype(real))
    clamp = {"clamp_value": 0.2} if kind in ("distance", "geometry") else {}
    settings = of(ValSettings, visibility="none", clamp="none" if kind == "lobes" else kind, **clamp)
    footprint = rng.uniform(0, 0.1, 300)
    expected = irradiance(to, lights, settings.pairs, footprint)
    areas = grouped(rng.integers(0, 7, 300), 9)
    result = clustered_irradiance(to, to.normal, lights, areas, None, settings, footprint=footprint)
    error = np.abs(result - expected).max() / expected.max()
    assert error < (ROUNDING_SINGLE if real is np.float32 else ROUNDING)
    evidence(f"{kind}, {np.dtype(real).name}: {error:.1e} off the sum of sii")


@pytest.mark.feature("VAL-04", "VAL-23")
@pytest.mark.parametrize("assignment", ["index", "cluster"])
@pytest.mark.parametrize(("side", "count"), [(1, 60), (3, 60), (8, 200), (8, 5)])
def test_every_pixel_sums_its_lights_under_their_visibility(side, count, assignment, evidence):
    """Oracle: E = n^2 sum over the pixel's lights of E_i V_C(i), pair by pair."""
    rng = np.random.default_rng(side)
    to, lights = sets.room(rng, 17 * 19)
    to = picture(to, 17, 19)
    to.covered[rng.random((17, 19)) < 0.2] = False
    lights = PixelLights(*(None if part is None else part[:, :count] for part in lights[:3]), None, None, None, count)
    owner = rng.integers(0, 6, count)
    settings = of(ValSettings, visibility="none", assignment=assignment)
    result = clustered_irradiance(to, to.normal, lights, grouped(owner, 6), None, settings, visibility_of=striped,
                                  interleaving=side)
    expected, subset = np.zeros_like(result), interleaving(owner, side, assignment)
    for y, x in np.argwhere(to.covered):
        at, up = to.position[:, y, x], to.normal[:, y, x]
        for i in np.flatnonzero(subset == y % side * side + x % side):
            share = pair(at, up, lights.position[:, i], lights.normal[:, i], lights.flux[:, i])
            expected[:, y, x] += side**2 * share * striped(owner[i], at, up)
    error = np.abs(result - expected).max() / expected.max()
    assert error < ROUNDING
    evidence(f"n = {side}, {count} lights by {assignment}: {error:.1e} off the literal sum")


@pytest.mark.feature("VAL-23")
@pytest.mark.parametrize("assignment", ["index", "cluster"])
@pytest.mark.parametrize(("side", "count"), [(1, 9), (3, 60), (8, 1000), (8, 5), (64, 1024), (5, 0)])
def test_every_light_is_assigned_once(side, count, assignment, evidence):
    of = np.random.default_rng(count).integers(0, 30, count)
    subset = assigned_subsets(of, side, assignment)
    share = np.bincount(subset, minlength=side**2)
    assert len(share) == side**2
    assert share.sum() == count
    assert np.ptp(share) <= (1 if assignment == "index" else RUNS)
    if side == 8 and count == 1000:
        met = len(np.unique(subset * 30 + of)) / side**2
        assert (met > 10) if assignment == "index" else (met < 4)
        evidence(f"{count} lights by {assignment}: a pixel meets {met:.1f} of 30 area lights")


@pytest.mark.feature("VAL-23")
@pytest.mark.parametrize(("real", "assignment"), [(np.float32, "index"), (np.float32, "cluster"),
                                              (np.float64, "cluster")])
def test_a_block_of_equal_pixels_has_the_full_sum_as_its_mean(real, assignment, evidence):
    rng = np.random.default_rng(2)
    to, lights = sets.room(rng, 1024, real)
    at = Receivers(*(np.ascontiguousarray(np.broadcast_to(part[:, :, :1], (3, 24, 16))) for part in to[:2]),
                   np.ones((24, 16), bool))
    areas = grouped(rng.integers(0, 30, 1024), 30)
    settings = of(ValSettings, visibility="none", assignment=assignment)
    full, eighth = (clustered_irradiance(at, at.normal, lights, areas, None, settings, visibility_of=striped,
                                         interleaving=side) for side in (1, 8))
    means = np.stack([eighth[:, y : y + 8, x : x + 8].mean(axis=(1, 2), dtype=np.float64)
                      for y in range(0, 17, 3) for x in range(0, 9, 4)])
    error = np.abs(means / full[:, 0, 0] - 1).max()
    assert error < (ROUNDING_SINGLE if real is np.float32 else ROUNDING)
    assert eighth.std() > 0.1 * eighth.mean()
    evidence(f"{assignment}, {np.dtype(real).name}: means of 8 x 8 pixels at any place {error:.1e} off the full sum")


@pytest.fixture(scope="module", params=[np.float32, pytest.param(np.float64, marks=pytest.mark.slow)])
def scene(request):
    frame = Frame(load_scene("cornell_sphere:faces=200"), width=37, height=29, rsm_resolution=64, dtype=request.param)
    settings = of(ValSettings, lights=48, maps_resolution=32)
    to = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
    facing = facing_normals(frame.scene.geometry, frame.gbuffer.triangle_id, frame.gbuffer.normal)
    return frame, choose_lights(frame, settings.lights), to, facing


def shadowed(frame, lights, count, settings):
    geometry = frame.scene.geometry
    clusters = cluster(lights.position, lights.normal, count, diagonal=geometry.diagonal)
    areas = area_lights(lights, clusters, settings.area)
    return areas, shadow_maps(geometry, areas, settings.maps, frame.dtype)


@pytest.mark.feature("VAL-04")
def test_an_area_light_for_each_light_is_a_hard_shadow_for_each(scene, evidence):
    """M = N: the sum over lights, each under its own hard test."""
    frame, lights, to, facing = scene
    count = lights.position.shape[1]
    areas, maps = shadowed(frame, lights, count, of(ValSettings, maps_resolution=32))
    assert (areas.delta == 0).all()
    result = clustered_irradiance(to, facing, lights, areas, maps, of(ValSettings, maps_resolution=32))
    expected, shadows = np.zeros(to.position.shape), 0
    flat, up = to.position.reshape(3, -1), facing.reshape(3, -1)
    for i in range(count):
        one = PixelLights(*(part[:, i : i + 1] for part in lights[:3]), None, None, None, 1)
        visible = hard_visibility(maps, areas, int(areas.of[i]), flat, up).reshape(to.covered.shape)
        expected += irradiance(to, one, PairSettings()) * visible
        shadows += (visible == 0).sum()
    assert shadows > 0
    error = np.abs(result - expected).max() / expected.max()
    assert error < (ROUNDING_SINGLE if frame.dtype == np.float32 else ROUNDING)
    evidence(f"{frame.dtype.name}: M = N = {count}: {error:.1e} off the sum of lights with hard shadows")


@pytest.mark.feature("VAL-04", "VAL-12", "VAL-14", "VAL-15", "VAL-16", "VAL-17", "VAL-18")
@pytest.mark.parametrize("how", [
    {"visibility": "csm"}, {"visibility": "pcss"}, {"visibility": "pcf"}, {"visibility": "hard"}, {"terms": 2},
    {"depth_scale": "scene", "bias": 0.1}, {"quantisation": "published", "as_published": ("val_search_solid_angle",)},
    {"depth_scale": "map", "as_published": ("val_alpha_over_pi",)}, {"rescale": "scale2", "attenuation": 1.0},
    {"visibility": "pcss", "cone": False, "blocker_depth": "axial"}, {"visibility": "pcf", "texels": 3}], ids=str)
def test_tile_by_tile_has_the_bits_of_lists_of_receivers(scene, how):
    """Fast = slow: V through `visibility_of` takes the long way, which tests/wiring has by loops for each setting."""
    frame, lights, to, facing = scene
    settings = of(ValSettings, maps_resolution=32, **how)
    areas, maps = shadowed(frame, lights, 5, settings)
    blue = lights._replace(flux=lights.flux * np.array([[0], [0], [1]], lights.flux.dtype))
    for side, some in ((1, lights), (3, blue)):  # what looks at red alone takes the latter for no light
        fast = clustered_irradiance(to, facing, some, areas, maps, settings, interleaving=side)
        slow = clustered_irradiance(to, facing, some, areas, maps, settings, interleaving=side,
                                    visibility_of=lambda m, at, up: visibility(maps, areas, m, at, up, settings))
        assert np.array_equal(fast, slow)
        with threads(1):
            assert np.array_equal(fast, clustered_irradiance(to, facing, some, areas, maps, settings,
                                                             interleaving=side))
        assert fast.any()
        assert (fast[:, ~to.covered] == 0).all()


def test_visibility_is_asked_for_where_there_is_light_alone():
    rng = np.random.default_rng(6)
    to, lights = sets.room(rng, 200)
    of = rng.integers(0, 4, 200)
    asked = {}

    def given(m, points, facing):
        assert points.shape == facing.shape
        asked[m] = points.shape[1]
        return np.ones(points.shape[1])

    clustered_irradiance(to, to.normal, lights, grouped(of, 5), None, NOT_SHADOWED, visibility_of=given)
    for m in range(4):
        some = PixelLights(*(part[:, of == m] for part in lights[:3]), None, None, None, 1)
        assert asked[m] == irradiance(to, some, PairSettings()).any(axis=0).sum()
    assert 4 not in asked


def test_odd_pictures_and_no_lights():
    rng = np.random.default_rng(7)
    to, lights = sets.room(rng, 6)
    no_lights = PixelLights(*(part[:, :0] for part in lights[:3]), None, None, None, 0)
    one = PixelLights(*(part[:, :1] for part in lights[:3]), None, None, None, 1)
    for side in (1, 8):
        none = clustered_irradiance(to, to.normal, no_lights, grouped([], 0), None, NOT_SHADOWED, interleaving=side)
        assert not none.any()
        dark = clustered_irradiance(to._replace(covered=np.zeros((1, 6), bool)), to.normal, lights,
                                    grouped([0] * 6, 1), None, NOT_SHADOWED, interleaving=side)
        assert not dark.any()
        pixel = Receivers(to.position[:, :, :1], to.normal[:, :, :1], to.covered[:, :1])
        single = clustered_irradiance(pixel, pixel.normal, one, grouped([0], 1), None, NOT_SHADOWED, interleaving=side)
        expected = irradiance(pixel, one, PairSettings()) * side**2
        np.testing.assert_allclose(single, expected, rtol=ROUNDING)


def test_what_does_not_fit_is_an_error():
    rng = np.random.default_rng(8)
    to, lights = sets.room(rng, 6)
    with pytest.raises(InputError, match=r"areas\.of"):
        clustered_irradiance(to, to.normal, lights, grouped([0] * 5, 1), None, NOT_SHADOWED)
    with pytest.raises(InputError, match="facing"):
        clustered_irradiance(to, to.normal[:, :, :3], lights, grouped([0] * 6, 1), None, NOT_SHADOWED)
    with pytest.raises(InputError, match="interleaving"):
        clustered_irradiance(to, to.normal, lights, grouped([0] * 6, 1), None, NOT_SHADOWED, interleaving=65)
