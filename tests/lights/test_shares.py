"""How lights are shared out among lamps: against a twin, by hand, in the mean; the areas that texels stand for."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from refgi.frame import Frame
from refgi.lights import choose_pixel_lights
from refgi.lights.selection import choose_lights, footprints
from refgi.lights.settings import LightSettings, most_lights
from refgi.lights.shares import lamp_shares, map_flux, map_shares, texel_areas
from refgi.lights.walk import _shares
from refgi.methods import METHODS, render
from refgi.rays import Tracer
from refgi.scene import DirectionalLight, PointLight, SpotLight, light_table, load_scene, material_table
from refgi.settings import of
from refgi.splat import SiiSettings
from tests.lights.test_pixel_lights import box_map, cube_map, with_flux
from tests.naive.shares import nearest_grid, shares_of

MISSES = SpotLight((50.0, 60.0, 70.0), (1.0, 1.0, 1.0), 0.1, 0.2, (5.0, 5.0, 5.0))
SMALL = {"width": 24, "height": 24, "rsm_resolution": 32}
BOX = load_scene("cornell_box")
LAMPS = 5
STANDARD_ERRORS = 4.0


@pytest.mark.feature("SII-13")
@given(st.lists(st.one_of(st.just(0.0), st.integers(1, 1000).map(float)), min_size=1, max_size=12), st.integers(0, 99))
def test_shares_are_those_of_the_twin(flux, more):
    lit = sum(one > 0 for one in flux) or len(flux)
    expected = shares_of(lit + more, flux if any(flux) else [1.0] * len(flux))
    shares, gains = lamp_shares(lit + more, np.array(flux))
    assert (shares, set(gains)) == (expected, {1.0})
    assert sum(shares) == lit + more


@pytest.mark.feature("SII-26")
@pytest.mark.parametrize(("count", "flux", "shares"), [
    (768, [1, 1], [384, 384]), (7, [1, 1], [4, 3]), (10, [4, 0, 1], [8, 0, 2]), (10, [1000, 1, 1], [8, 1, 1]),
    (3, [1000, 1, 1], [1, 1, 1]), (40, [0, 0], [20, 20])])
def test_shares_by_hand(count, flux, shares):
    assert lamp_shares(count, np.array(flux, float))[0] == shares


def test_fewer_lights_than_lamps_are_drawn_with_the_mean_of_their_flux():
    """Systematic sampling: floor or ceiling of the quota each, the count in all, and n / q has the mean 1."""
    flux = np.array([8.0, 1.0, 0.0, 3.0, 1.0, 2.0, 1.0])
    quota = 3 * flux / flux.sum()
    drawn = np.array([lamp_shares(3, flux, seed)[0] for seed in range(1, 4001)])
    assert (drawn.sum(axis=1) == 3).all()
    assert ((drawn == np.floor(quota)) | (drawn == np.ceil(quota))).all()
    error = np.sqrt((quota % 1) * (1 - quota % 1) / 4000)
    assert (np.abs(drawn.mean(axis=0) - quota) <= STANDARD_ERRORS * error + 1e-12).all()
    shares, gains = lamp_shares(3, flux, 5)
    np.testing.assert_allclose([g for s, g in zip(shares, gains, strict=True) if s],
                               [s / q for s, q in zip(shares, quota, strict=True) if s], rtol=1e-12)


@pytest.mark.feature("SII-13")
@pytest.mark.parametrize("options", [{"pattern": "halton"}, {"pattern": "random"},
                                     {"pattern": "halton", "filtered": True}, {"pattern": "grid", "filtered": True}])
def test_fewer_lights_than_lamps_keep_the_flux_in_the_mean(options, evidence):
    """Filtered, so that a map's flux has no noise of its own, the flux is that of the lamps that were drawn."""
    rsms = [with_flux(box_map(8), k + 1.0) for k in range(LAMPS)]
    seeds = range(1, 1001)
    sums = np.array([choose_pixel_lights(rsms, count=2, seed=seed, **options).flux.sum() for seed in seeds])
    error = sums.std() / math.sqrt(len(seeds))
    z = (sums.mean() - sum(range(1, LAMPS + 1))) / error if error > 1e-9 else 0.0
    assert abs(z) < STANDARD_ERRORS
    if options.get("filtered"):
        np.testing.assert_allclose(sums, 15.0, rtol=1e-9)
    evidence(f"{options}: 2 lights of {LAMPS} lamps, mean of {len(seeds)} draws {z:.1f} standard errors off")


@pytest.mark.feature("SII-13")
def test_the_flux_of_a_map_is_that_of_its_texels():
    rsm = cube_map(20)
    assert map_flux(rsm) == pytest.approx(float(rsm.flux.sum()), rel=1e-12)
    large = box_map(512)
    assert map_flux(large) == pytest.approx(float(large.flux.sum()), rel=0.01)  # a texel of 16
    alone = np.zeros_like(large.flux)
    alone[:, 3, 7] = 2.0  # not on the grid of texels that are looked at
    assert map_flux(large._replace(flux=alone)) == 6.0
    lobe = np.full_like(rsm.flux, 0.5)
    assert map_flux(rsm._replace(lobe_flux=lobe)) == pytest.approx(float(rsm.flux.sum() + lobe.sum()), rel=1e-12)


def test_a_dark_map_takes_no_number_of_the_patterns():
    rsms = [box_map(), with_flux(box_map(), 3.0)]
    dark = rsms[0]._replace(flux=np.zeros_like(rsms[0].flux))
    assert map_shares([dark, rsms[1]], 9, "halton") == [(0, 1.0, 0), (9, 1.0, 0)]
    plain, after = (choose_pixel_lights(maps, count=9, pattern="halton") for maps in ([rsms[1]], [dark, rsms[1]]))
    np.testing.assert_array_equal(plain.flux, after.flux)
    assert (after.map_index == 1).all()
    assert choose_pixel_lights([dark, dark], count=9, pattern="halton").flux.shape == (3, 0)


@pytest.mark.parametrize("method", ["sii", "multires", "val", "gather", "vpl"])
@pytest.mark.filterwarnings("ignore:.* of the indirect light")
def test_a_lamp_that_hits_nothing_changes_nothing(method):
    lamps = BOX.lights
    pictures = [render(BOX.with_lights(*some), method, **SMALL).irradiance
                for some in (lamps, (*lamps, MISSES), (MISSES, *lamps))]
    assert pictures[0].any()
    np.testing.assert_array_equal(pictures[0], pictures[1])
    np.testing.assert_array_equal(pictures[0], pictures[2])


@pytest.mark.parametrize("how", [{"source": "walk"}, {"source": "walk", "bounces": 2}, {"warp": "A"},
                                 {"pattern": "grid"}, {"filtered": True}, {"as_published": {"sii_no_tn"}}])
def test_lights_of_every_source_leave_a_dark_lamp_out(how):
    settings = of(LightSettings, count=40, **how)
    found = [choose_lights(Frame(BOX.with_lights(*some), **SMALL), settings)
             for some in (BOX.lights, (MISSES, *BOX.lights))]
    for field in ("position", "flux", "drawn", "half"):
        np.testing.assert_array_equal(getattr(found[0], field), getattr(found[1], field))


@pytest.mark.feature("SII-17")
def test_paths_go_where_the_flux_is():
    """A lamp of three times the power at the same place has three times the paths, and carries as much a path."""
    lamp = PointLight((0.278, 0.4, -0.2), (1.0, 1.0, 1.0))
    strong = dataclasses.replace(lamp, intensity=(3.0, 3.0, 3.0))
    lights = choose_lights(Frame(BOX.with_lights(lamp, strong), **SMALL), of(LightSettings, count=80, source="walk"))
    first = choose_lights(Frame(BOX.with_lights(lamp), **SMALL), of(LightSettings, count=20, source="walk"))
    np.testing.assert_allclose(lights.flux[:, : first.flux.shape[1]], first.flux, rtol=1e-12)


@pytest.mark.feature("SII-17")
def test_fewer_paths_than_lamps_keep_the_flux():
    """In a closed sphere every path reflects albedo times its share: 2 paths of 4 lamps carry the flux of all."""
    scene = load_scene("integrating_sphere:faces=500,albedo=0.6")
    lamps = [PointLight(scene.lights[0].position, (k, k, k)) for k in (1.0, 2.0, 3.0, 4.0)]
    for seed in range(1, 6):
        lights = choose_lights(Frame(scene.with_lights(*lamps), **SMALL),
                               of(LightSettings, count=2, seed=seed, source="walk"))
        np.testing.assert_allclose(lights.flux.sum(axis=1), 0.6 * 4 * math.pi * 10, rtol=1e-6)


def test_a_lamp_whose_trial_meets_nothing_has_one_path_beyond_the_number():
    """Nothing of a scene that only dark lamps light is drawn anew: they share the number."""
    lamps, geometry = light_table((MISSES, *BOX.lights)), BOX.geometry
    tracer, materials = Tracer(geometry), material_table(BOX.materials)
    assert _shares(tracer, geometry, materials, lamps, 40, 0) == [(0, 1, 1.0), (1, 40, 1.0)]
    dark = light_table((MISSES, MISSES))
    assert _shares(tracer, geometry, materials, dark, 40, 0) == [(0, 20, 1.0), (1, 20, 1.0)]


@pytest.mark.parametrize("how", [{"pattern": "halton"}, {"pattern": "grid"}, {"source": "walk", "bounces": 3},
                                 {"pattern": "all"}, {"pattern": "all", "projection": "cube"}])
@pytest.mark.parametrize("count", [1, 3, 40])
def test_there_are_no_more_lights_than_memory_is_planned_for(how, count):
    lamps = (BOX.lights[0], PointLight((0.278, 0.4, -0.2), (1.0, 1.0, 1.0)), BOX.lights[0])
    frame = Frame(BOX.with_lights(*lamps), **SMALL)
    settings = of(LightSettings, count=count, **how)
    most = most_lights(settings, 8, 32**2)
    maps = 8 * 6 if "cube" in how.values() else 8
    limit = maps * 32**2 if "all" in how.values() else maps + 3 * count
    assert choose_lights(frame, settings).flux.shape[1] <= most <= limit


def test_methods_say_that_the_count_is_a_total():
    for name in ("sii", "multires", "val", "vpl"):
        assert "all lamps together" in str(METHODS[name].settings().lights.__dataclass_fields__["count"].metadata)


ROUNDING = 3e-7  # float32: solid angle, position and normal are rounded once each
KINDS = {"spot": BOX.lights[0], "cube": PointLight((0.3, 0.3, 0.2), (1.0, 2.0, 0.0)),
         "directional": DirectionalLight((0.1, -0.9, 0.3), (1.0, 1.0, 1.0))}


def by_hand(rsm, light):
    """Return O d^2 / cos of every texel that reflects, 0 elsewhere."""
    lobe = 0 if rsm.lobe_flux is None else rsm.lobe_flux
    areas = np.zeros(rsm.solid_angle.shape)
    for i, j in zip(*np.nonzero((rsm.flux + lobe).any(axis=0)), strict=True):
        if isinstance(light, DirectionalLight):
            towards, square = -np.asarray(light.direction, float), 1.0
        else:
            towards = np.asarray(light.position, float) - rsm.position[:, i, j]
            square = towards @ towards
        cosine = abs(towards @ rsm.normal[:, i, j]) / np.linalg.norm(towards)
        areas[i, j] = rsm.solid_angle[i, j] * square / max(cosine, 1e-3)
    return areas


def whole(rsm):
    """Return the areas of all texels, (H, W)."""
    return texel_areas(rsm, np.arange(rsm.texels)).reshape(rsm.projection.shape)


@pytest.mark.feature("REF-08")
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("kind", [*KINDS, "glossy"])
def test_areas_are_those_of_the_formula(kind, dtype):
    scene = load_scene("ring") if kind == "glossy" else BOX.with_lights(KINDS[kind])
    rsm = Frame(scene, rsm_resolution=40, dtype=dtype).rsms[0]
    areas, expected = whole(rsm), by_hand(rsm, scene.lights[0])
    assert areas.dtype == dtype
    assert expected.any()
    np.testing.assert_allclose(areas, expected, rtol=ROUNDING, atol=0)


def test_lobes_alone_have_an_area():
    rsm = Frame(load_scene("ring"), rsm_resolution=40).rsms[0]
    assert rsm.lobe_flux is not None
    mirror = rsm._replace(flux=np.zeros_like(rsm.flux))
    np.testing.assert_array_equal(whole(mirror) > 0, rsm.lobe_flux.any(axis=0))


@pytest.mark.feature("AMS-17")
@pytest.mark.parametrize(("pattern", "count"), [("grid", 256), ("halton", 256), ("halton", 1)])
def test_each_light_has_its_texels_area_times_the_texels_it_stands_for(pattern, count):
    """By hand, on a spot's and a point light's map of other flux; one light stands for its own map alone."""
    frame = Frame(BOX.with_lights(KINDS["spot"], KINDS["cube"]), rsm_resolution=40)
    settings = of(SiiSettings, lights=count, pattern=pattern, clamp="disc", seed=4)
    lights, area = choose_lights(frame, settings.lights), footprints(frame, settings.lights, settings.pairs)
    shares = [1, 1] if count == 1 else shares_of(count, [float(rsm.flux.sum()) for rsm in frame.rsms])
    cells = shares if pattern == "halton" else map(nearest_grid, shares, (1, 6))
    assert len(area) >= count / 2
    for index, (rsm, drawn) in enumerate(zip(frame.rsms, cells, strict=True)):
        here = lights.map_index == index
        expected = by_hand(rsm, frame.scene.lights[index]).ravel()[lights.texel[here]] * rsm.texels / drawn
        np.testing.assert_allclose(area[here], expected, rtol=ROUNDING)


@pytest.mark.feature("SII-13")
@pytest.mark.parametrize(("pattern", "count"), [("grid", 256), ("halton", 1)])  # a grid that is rounded; drawn lamps
def test_lights_without_their_weight_have_their_texels_flux(pattern, count):
    frame = Frame(BOX.with_lights(KINDS["spot"], KINDS["cube"]), rsm_resolution=40)
    lights = choose_lights(frame, of(LightSettings, count=count, pattern=pattern, seed=1, as_published={"sii_no_tn"}))
    assert lights.flux.any()
    for index, rsm in enumerate(frame.rsms):
        here = lights.map_index == index
        np.testing.assert_allclose(lights.flux[:, here], rsm.flux.reshape(3, -1)[:, lights.texel[here]], rtol=ROUNDING)
