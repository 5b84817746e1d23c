"""sii on whole scenes: closed forms, number and pattern of lights, filtering, presets, moving lamps."""

import dataclasses
import math

import numpy as np
import pytest

from refgi.compare.metrics import flicker
from refgi.errors import InputError
from refgi.frame import Frame
from refgi.lights.selection import light_areas, pixel_lights
from refgi.lights.settings import LightSettings
from refgi.scene import PointLight, SpotLight, load_scene
from refgi.settings import of, replaced
from refgi.splat import SiiSettings, sii
from refgi.splat.sii import METHOD
from refgi.stages import observe
from tests import lamps

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # that is told: tests/pairs/test_loss

ALL = of(SiiSettings, pattern="all", clamp="none")  # the sum without a cut
DRAWS = 400
STANDARD_ERRORS = 4.0  # of a mean: one in 16,000 means of unbiased estimates is farther off
TELLING = 0.1  # largest standard error: another map's share is 6 times or a sixth of the own


@pytest.fixture(scope="module")
def plates():
    return Frame(load_scene("parallel_plates"), width=24, height=24, rsm_resolution=128)


@pytest.fixture(scope="module")
def box():
    return Frame(load_scene("cornell_box"), width=48, height=48, rsm_resolution=128)


def rms(image, reference):
    return float(np.sqrt(((image - reference) ** 2).mean()) / reference.mean())


@pytest.mark.parametrize(("real", "limit"), [(np.float32, 1e-3), (np.float64, 1e-3)])
@pytest.mark.feature("REF-06")
def test_integrating_sphere_scene(real, limit, evidence):
    """The tessellated sphere lies inside its circumsphere: E differs by its sagitta, 2 pi / sqrt(3 faces) squared."""
    scene = load_scene("integrating_sphere:faces=20000,albedo=0.6")
    frame = Frame(scene, width=32, height=32, dtype=real, rsm_resolution=128)
    light = scene.lights[0]
    half = math.cos(light.inner_half_angle), math.cos(light.outer_half_angle)
    flux = light.intensity[0] * 2 * math.pi * ((1 - half[0]) + 0.5 * (half[0] - half[1]))
    expected = 0.6 * flux / (4 * math.pi)
    got = sii(frame, ALL)
    bulb = Frame(scene.with_lights(PointLight(light.position, (1.0, 1.0, 1.0))), width=8, height=8, dtype=real,
                 rsm_resolution=128)
    cells = sii(bulb, of(SiiSettings, pattern="grid", lights=6 * 32**2, clamp="none"))  # T/N of a cube's six faces
    assert np.median(cells) == pytest.approx(0.6, rel=limit)
    away = np.abs(got / expected - 1)
    # lights within a few texels of a receiver see the facets, not the sphere
    assert np.quantile(away, 0.95) < limit
    assert abs(np.median(got) / expected - 1) < limit
    evidence(f"{np.dtype(real).name}: median E / (rho Phi0 / 4 pi R^2) - 1 = {np.median(got) / expected - 1:+.1e}, "
             f"95 % of pixels within {np.quantile(away, 0.95):.1e}")


@pytest.mark.feature("SII-13")
def test_irradiance_does_not_depend_on_the_number_of_lights(plates, evidence):
    """T/N: over 200 draws the mean is that of all texels, at every N; without it E would fall by 16 and 256."""
    reference, found = sii(plates, ALL).mean(), []
    for count in (16, 64, 256):
        runs = np.array([sii(plates, of(SiiSettings, lights=count, pattern="random", seed=s, clamp="none")).mean()
                         for s in range(200)])
        error = runs.std() / math.sqrt(200)
        assert abs(runs.mean() - reference) < 4 * error
        found.append(f"N = {count}: {runs.mean() / reference - 1:+.2%} +- {error / reference:.2%}")
    evidence("mean of 200 random sets against all texels: " + ", ".join(found))


@pytest.mark.slow("{'pattern': 'random'}")
@pytest.mark.feature("SII-13")
@pytest.mark.parametrize("how", [{"pattern": "random"}, {"pattern": "random", "warp": "A", "warp_levels": 2}], ids=str)
def test_no_lamps_light_depends_on_the_number_of_lights(how, evidence):
    """T/N is each map's own: three lamps of unlike kind and power, of one colour each, channel by channel."""
    frame, clamp, found = lamps.corner(), {"clamp": "distance", "clamp_value": 0.2}, []
    whole = sii(frame, of(SiiSettings, pattern="all", **clamp)).mean(axis=(1, 2))
    for count in (9, 48, 384):
        draws = np.array([sii(frame, of(SiiSettings, lights=count, seed=seed, **how, **clamp)).mean(axis=(1, 2))
                          for seed in range(DRAWS)]) / whole
        error = draws.std(axis=0, ddof=1) / math.sqrt(DRAWS)
        assert (error < TELLING).all()
        assert (np.abs(draws.mean(axis=0) - 1) < STANDARD_ERRORS * error).all()
        found.append(f"N = {count}: " + ", ".join(f"{m - 1:+.1%} +- {e:.1%}"
                                                  for m, e in zip(draws.mean(axis=0), error, strict=True)))
    evidence("spot, point and sun, mean of many sets against all texels: " + "; ".join(found))


@pytest.mark.feature("SII-10")
def test_error_slopes_of_random_and_low_discrepancy_patterns(plates, evidence):
    # 3^5 texels: cells of 3, 9 and 27 lights a side have a middle texel; else a grid would be off by half a texel
    plates = Frame(plates.scene, width=24, height=24, rsm_resolution=243)
    reference = sii(plates, ALL)
    counts = (9, 81, 729)
    slopes = {}
    for pattern in ("random", "halton", "grid"):
        seeds = range(100) if pattern != "grid" else range(1)
        errors = [math.sqrt(np.mean([rms(sii(plates, of(SiiSettings, lights=n, pattern=pattern, seed=s, clamp="none")),
                                         reference) ** 2 for s in seeds])) for n in counts]
        slopes[pattern] = float(np.polyfit(np.log(counts), np.log(errors), 1)[0])
    assert slopes["random"] == pytest.approx(-0.5, abs=0.1)
    assert slopes["halton"] < slopes["random"] - 0.15
    assert slopes["grid"] < slopes["random"] - 0.15
    evidence("RMSE ~ N^s: " + ", ".join(f"{pattern} {slope:.2f}" for pattern, slope in slopes.items()))


@pytest.mark.feature("SII-26")
def test_presets_come_nearer_to_the_sum_over_all_texels(box, evidence):
    clamp = {"clamp": "distance", "clamp_value": 0.05}  # else the nearest pair alone decides the error
    reference = sii(box, replaced(ALL, clamp))
    presets = (108, 256, 768, 1000, 4096)
    errors = [math.sqrt(np.mean([rms(sii(box, of(SiiSettings, lights=n, seed=s, **clamp)), reference) ** 2
                                 for s in range(1, 9)])) for n in presets]
    assert errors == sorted(errors, reverse=True)
    evidence("RMSE / mean: " + ", ".join(f"{n} lights {e:.3f}" for n, e in zip(presets, errors, strict=True)))


@pytest.mark.feature("SII-27")
@pytest.mark.feature("REF-08")
def test_clamps_and_offset_on_a_scene(box, evidence):
    plain = sii(box, ALL)
    found = []
    for how in ({"clamp": "distance", "clamp_value": 0.1}, {"clamp": "geometry", "clamp_value": 50.0},
                {"clamp": "disc"}, {"clamp": "sphere"}, {"offset": 0.02}):
        got = sii(box, replaced(ALL, how))
        assert np.isfinite(got).all()
        if how.get("clamp") == "sphere":  # reaches over horizons, where the plain term is 0
            assert got.max() < plain.max()
        elif "offset" not in how:
            assert (got <= plain * (1 + 1e-5)).all()
        found.append(f"{how} max {got.max():.3g} mean {got.mean() / plain.mean() - 1:+.1%}")
    evidence(f"none max {plain.max():.3g}; " + "; ".join(found))


def test_footprints_are_the_lit_area(plates):
    """A spot of 40 degrees straight down on a floor at height 1 (and just below the upper plate) lights a disc."""
    (light,) = plates.scene.lights
    area = light_areas(plates, ALL.lights)
    assert len(area) == pixel_lights(plates.rsms, ALL.lights).position.shape[1]
    disc = math.pi * (light.position[1] * math.tan(light.outer_half_angle)) ** 2
    assert area.sum() == pytest.approx(disc, rel=0.03)  # whole texels on the rim
    few = light_areas(plates, of(LightSettings, count=256, seed=1))
    assert len(few) == pixel_lights(plates.rsms, of(LightSettings, count=256, seed=1)).position.shape[1]
    assert few.sum() == pytest.approx(disc, rel=0.1)


@pytest.mark.feature("REF-05")
def test_several_lights_add_up(box):
    first = box.scene.lights[0]
    second = SpotLight((0.3, 0.4, 0.3), (1.0, -0.5, 0.0), 0.2, 0.5, (1.0, 2.0, 3.0))
    parts = [sii(Frame(box.scene.with_lights(*lights), width=16, height=16, rsm_resolution=64), ALL)
             for lights in ((first,), (second,), (first, second))]
    np.testing.assert_allclose(parts[2], parts[0] + parts[1], rtol=1e-5)


def test_lobe_code_is_skipped_without_glossy_materials(box):
    with observe() as log:
        sii(box, SiiSettings())
    assert log.status("pairs.lobes") == ["skipped"]
    assert log.status("pairs.sum") == ["ran"]


@pytest.mark.feature("REF-20")
@pytest.mark.parametrize("lamps", [1, 2])
def test_without_the_weight_a_picture_has_its_lights_share_of_the_texels(box, lamps, evidence):
    """Section 0: what the paper leaves out is T/N."""
    frame = Frame(box.scene.with_lights(*[box.scene.lights[0]] * lamps), width=12, height=12, rsm_resolution=64)
    printed, calibrated = (sii(frame, of(SiiSettings, lights=64, as_published=names)).astype(float)
                           for names in ({"sii_no_tn"}, ()))
    factor = printed.sum() / calibrated.sum()
    assert factor == pytest.approx(64 / (lamps * 64**2), rel=1e-6)
    evidence(f"sii_no_tn, {lamps} maps of 64^2, 64 lights: {factor:.6g} = N/T to {factor * lamps * 64 - 1:.0e}")


def test_scene_without_glass_is_not_searched_for_refraction(box):
    with observe() as log:
        with_it = sii(box, of(SiiSettings, lights=64))
    assert set(log.status("lights.refraction")) == {"skipped"}
    np.testing.assert_array_equal(with_it, sii(box, of(SiiSettings, lights=64, refraction="none")))


def test_settings_are_checked():
    for change in ({"lights": 0}, {"lights": 1 << 28}, {"pattern": "spiral"}, {"seed": -1}, {"offset": 1e300},
                   {"cut_share": -1}, {"cut_share": math.nan}, {"reference_length": 0}, {"reference_length": -1.0},
                   {"reference_length": math.inf}, {"cut_irradiance": math.inf},
                   {"bound": "box"}, {"bound_faces": 12}, {"source": "rays"}, {"warp": "C"}, {"warp_levels": -1},
                   {"importance": "luck"}, {"defensive": 2}, {"openness_radius": -1}, {"openness_rays": 0},
                   {"openness_floor": math.nan}, {"openness_flux": "on"}, {"refraction": "front"},
                   {"refraction_exponent": -1}, {"bounces": 2}, {"warp": "A", "source": "walk"},
                   {"pattern": "grid", "source": "walk"},
                   {"filtered": True, "source": "walk"}, {"as_published": {"sii_no_tn"}, "source": "walk"},
                   {"warp": "A", "pattern": "all"}, {"clamp": "disc", "source": "walk"},
                   {"bound": "quad", "half_resolution": True}, {"openness_flux": "roulette", "clamp": "disc"},
                   {"as_published": {"sii_no_luck"}}, {"lights": 10.5}, {"openness_rays": 2.5}, {"warp_levels": 33},
                   {"bounces": 1.5, "source": "walk"}, {"seed": 1.5}, {"seed": 1 << 32},
                   {"openness_floor": 0, "openness_flux": "roulette"}, {"reference_length": 1e-300}):
        with pytest.raises(InputError, match=next(iter(change)).replace("_", ".")):
            of(SiiSettings, **change)


@pytest.mark.feature("SII-03", "SII-21", "SII-26")
def test_preset_of_the_paper_is_its_printed_values(box):
    """Sec. 4 and Fig. 12: 768 lights with filtered flux, cut at 5 %; the default cuts nothing."""
    paper = METHOD.preset("paper")
    assert paper == of(SiiSettings, lights=768, filtered=True, cut_share=0.05, bound="ellipsoid", clamp="none",
                       lightcuts=None)
    by_hand = sii(box, of(SiiSettings, filtered=True, cut_share=0.05, bound="full", clamp="none"))
    np.testing.assert_array_equal(sii(box, paper), by_hand)
    assert METHOD.preset("default").reach.cut is None


@pytest.mark.feature("SII-03")
def test_filtered_flux_is_steadier_under_a_moving_light(box, evidence):
    """The light turns by a quarter of a texel a step. A texel enters or leaves the grid's choice at once, a cell's
    sum by little."""
    scene, light = box.scene, box.scene.lights[0]
    step = 2 * math.tan(light.outer_half_angle) / 128 / 4
    means = {False: [], True: []}
    for k in range(24):
        turned = np.asarray(light.direction) / np.linalg.norm(light.direction) + [k * step, 0, 0]
        moved = scene.with_lights(dataclasses.replace(light, direction=tuple(turned)))
        frame = Frame(moved, width=16, height=16, rsm_resolution=128)
        for filtered in means:
            how = of(SiiSettings, lights=64, pattern="grid", filtered=filtered, clamp="distance", clamp_value=0.05)
            means[filtered].append(sii(frame, how).mean(axis=(1, 2)))

    def unsteady(values):
        return float(np.diff(values, 2, axis=0).std() / np.mean(values))  # what is left of a smooth change: nothing

    plain, steady = unsteady(means[False]), unsteady(means[True])
    assert steady < plain / 2
    sums = [pixel_lights(box.rsms, of(LightSettings, count=64, pattern="grid", filtered=True)).flux.sum(axis=1),
            box.rsms[0].flux.sum(axis=(1, 2))]
    np.testing.assert_allclose(*sums, rtol=1e-5)  # float32 sums
    evidence(f"std of the second difference of E over 24 quarter-texel steps: {plain:.3%} unfiltered, "
             f"{steady:.3%} filtered; flux sum kept")


@pytest.mark.feature("REF-18", "SII-28")
def test_lights_that_hold_their_places_on_the_map_flicker_less(box, evidence):
    """The flicker metric against every texel's pictures, of a lamp that glides by 1 mm a frame.

    Errors of fresh patterns know nothing of each other, so that theirs is the root of 2 times the error itself.
    """
    light, clamp = box.scene.lights[0], {"clamp": "distance", "clamp_value": 0.05}
    x, y, z = light.position
    moved = [box.scene.with_lights(dataclasses.replace(light, position=(x + 1e-3 * k, y, z))) for k in range(12)]
    frames = [Frame(scene, width=24, height=24, rsm_resolution=128) for scene in moved]
    exact = [sii(frame, replaced(ALL, clamp)) for frame in frames]
    found, error = {}, {}
    for name, how in (("fresh", {"pattern": "random"}), ("fixed", {}), ("filtered", {"filtered": True})):
        seeds = range(len(frames)) if name == "fresh" else [1] * len(frames)
        pictures = [sii(frame, of(SiiSettings, lights=256, seed=seed, **clamp, **how))
                    for frame, seed in zip(frames, seeds, strict=True)]
        found[name] = flicker(pictures, exact)
        error[name] = math.sqrt(np.mean([(one - other) ** 2 for one, other in zip(pictures, exact, strict=True)]))
    mean = np.mean(exact)
    assert found["fresh"] == pytest.approx(math.sqrt(2) * error["fresh"] / mean, rel=0.15)
    assert found["filtered"] < found["fixed"] < 0.1 * found["fresh"]
    evidence("flicker, and error: " + ", ".join(f"{name} {value:.1%}, {error[name] / mean:.1%}"
                                                for name, value in found.items()))
