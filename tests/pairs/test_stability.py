"""Glossy and diffuse pairs where numbers are extreme: sharp lobes, touching, grazing, tiny, huge, far away."""

import dataclasses
import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refgi import Frame, load_scene
from refgi.methods import find_method, render
from refgi.pairs.pixel_lights import HEADROOM, PixelLights, pack
from refgi.scene import DirectionalLight
from refgi.settings import of, replaced
from refgi.splat import PairSettings, SiiSettings, irradiance
from refgi.splat.sii.sii import splat
from refgi.splat.sii.threshold import all_peaks, light_range, low_irradiance
from tests.pairs import sets

U = 2.0**-24  # unit of rounding of float32
SMALLEST = 2.0**-126  # a lobe below this share of its peak is 0
SUBNORMAL = 2.0**-149  # steps of float32 near 0
EXPONENTS = (0.0, 1e-3, 0.5, 1.0, 2.0, 7.3, 50.0, 1000.0, 1e4, 1e5, 1e6)
SIZE = {"width": 48, "height": 48, "rsm_resolution": 96}
# a move by no whole number of the grid lets places round anew, by U of the scene's size; edges may move by a pixel
MOVED_TYPICAL, MOVED_WORST = 1e-5, 1e-3
RESIZED = 1e-3  # the same of a scene whose size is no power of 2 times the other's


def bound_of_a_term(term, shape, square, h, exponent):
    """Return by how much a float32 term may be off, from the roundings of its operations one by one.

    Of w: 6.5 U, hence of h = |r - w|^2 / 2: 6.5 U sqrt(2 h) + 5 U h, which (1 - h)^P multiplies by P / (1 - h); of
    log2(1 - h) and its product with P: 7 U, times the logarithm; of exp2, r^2, the division and the flux: 17 U in all;
    of c_x, a sum that may cancel: 4 U of 1. Far away, terms are subnormal numbers.
    """
    condition = exponent * (np.sqrt(2 * h) + h) / (1 - h)
    logarithm = -exponent * np.log2(1 - h)
    rounding = U * (term * (17 + 5 * logarithm + 6.5 * condition) + 4 * shape / square)
    return rounding + 2 * SMALLEST / square + 4 * SUBNORMAL


def bundle(rng, exponent, size, count):
    """Return one lobe and receivers in its light, 1e-6 of `size` to 3 times it away, 1e-5 rad off axis and more."""
    normal, axis = sets.random_directions(rng, 2).T[..., None]
    axis *= np.sign((axis * normal).sum())
    angle, reach = 10 ** rng.uniform(-5, 0.2, count), size * 10 ** rng.uniform(-6, 0.5, count)
    across = sets.unit(np.cross(axis.T, rng.normal(size=(count, 3))).T)
    place = (size * rng.uniform(-1, 1, (3, 1))).astype(np.float32)
    position = place + reach * (axis * np.cos(angle) + across * np.sin(angle))
    light = sets.glossy(place, normal, axis, exponent, real=np.float32)
    return sets.receivers(position, sets.random_directions(rng, count), np.float32), light


def widened(receivers, lights):
    """Return both in float64, the numbers those of float32."""
    double = [None if part is None else np.asarray(part, np.float64) for part in lights[:6]]
    return (receivers._replace(position=receivers.position.astype(float), normal=receivers.normal.astype(float)),
            type(lights)(*double, *lights[6:]))


def off_by(receivers, lights, exponent):
    """Return errors of float32 terms over their bound; 0 at the edge of the hemispheres, where rounding may decide."""
    how = of(PairSettings, lobe_norm="none")
    single = irradiance(receivers, lights, how)[0, 0].astype(float)
    exact, light = widened(receivers, lights)
    term = irradiance(exact, light, how)[0, 0]
    d = exact.position[:, 0] - light.position
    square = (d**2).sum(axis=0)
    w = d / np.sqrt(square)
    h, above = ((light.lobe_axis - w) ** 2).sum(axis=0) / 2, (light.normal * w).sum(axis=0)
    edge = (np.abs(above) < 8 * U) | (np.abs(1 - h) < 1e-3)
    h = np.minimum(h, 1 - 1e-3)
    shape = np.where(above > 0, (1 - h) ** exponent, 0)
    assert np.isfinite(single).all()
    assert (single >= 0).all()
    return np.where(edge, 0, np.abs(single - term) / bound_of_a_term(term, shape, square, h, exponent))


@pytest.mark.feature("SII-05")
def test_every_float32_term_is_within_its_bound(evidence):
    rng = np.random.default_rng(1)
    worst = {p: max(off_by(*bundle(rng, p, 10 ** rng.uniform(-6, 6), 2000), p).max() for _ in range(12))
             for p in EXPONENTS}
    assert max(worst.values()) < 1
    evidence(f"P = 0 .. 1e6, 264,000 pairs 1e-12 m to 3e6 m apart: errors up to {max(worst.values()):.2f} of the bound")


@pytest.mark.feature("SII-04")
def test_every_float32_term_of_diffuse_lights_is_within_its_bound(evidence):
    """14 U for r^2 twice, two divisions and products; 4 U of 1 for each cosine, a sum that may cancel."""
    rng, worst = np.random.default_rng(6), 0.0
    for _ in range(40):
        receivers, lobe = bundle(rng, 1.0, 10 ** rng.uniform(-6, 6), 2000)
        light = sets.lights(lobe.position, lobe.normal, 1.0, np.float32)
        single = irradiance(receivers, light, PairSettings())[0, 0].astype(float)
        exact, double = widened(receivers, light)
        d = exact.position[:, 0] - double.position
        square = (d**2).sum(axis=0)
        cosines = [np.maximum(0, (n * d).sum(axis=0) / np.sqrt(square)) for n in (double.normal, -exact.normal[:, 0])]
        term = irradiance(exact, double, PairSettings())[0, 0]
        bound = U * (14 * term + 4 * (sum(cosines) + 4 * U) / (math.pi * square)) + 4 * SUBNORMAL
        worst = max(worst, (np.abs(single - term) / bound).max())
    assert worst < 1
    evidence(f"80,000 diffuse pairs, 1e-12 m to 3e6 m apart: errors up to {worst:.2f} of the bound")


@settings(max_examples=60)
@given(exponent=st.floats(0, 1e6), size=st.floats(-6, 6), seed=st.integers(0, 1 << 20))
def test_terms_of_any_exponent_are_within_their_bound(exponent, size, seed):
    exponent = float(np.float32(exponent))
    assert off_by(*bundle(np.random.default_rng(seed), exponent, 10**size, 300), exponent).max() < 1


@pytest.mark.feature("SII-05")
def test_sums_lose_no_more_than_their_groups(evidence):
    """64 terms of one sign round by 63 U at most, their compensated total by 2 U: 66 U of E with the last product."""
    rng = np.random.default_rng(2)
    worst = 0.0
    for exponent in (0.5, 20.0, 1000.0):
        receivers, lights = sets.room(rng, 900, np.float32)
        shiny = sets.glossy(lights.position, lights.normal, lights.normal, exponent, real=np.float32)
        how = of(PairSettings, lobe_norm="none")
        terms = np.zeros(900)
        for k in range(900):
            one = type(shiny)(*(None if part is None else np.ascontiguousarray(part[..., k : k + 1])
                                for part in shiny[:6]), 1, *shiny[7:])
            terms += irradiance(receivers, one, how)[0, 0]
        total = irradiance(receivers, shiny, how)[0, 0]
        worst = max(worst, (np.abs(total - terms) / np.maximum(terms, 1e-30)).max() / U)
    assert worst < 66
    evidence(f"900 lights: sums off by up to {worst:.0f} U of E beyond their terms; bound 66 U")


@pytest.mark.feature("SII-04")
def test_a_sum_of_very_many_lights_loses_no_more_than_a_group(evidence):
    """The same light again and again: what is added to the total is compensated, group after group."""
    count = 300_001
    receivers, lights = sets.room(np.random.default_rng(3), 200, np.float32)
    one = lights.selected(slice(1))
    many = one._replace(**{name: np.repeat(part, count, axis=-1) for name, part in one._asdict().items()
                           if isinstance(part, np.ndarray)})
    term, total = (irradiance(receivers, some, PairSettings())[0, 0].astype(float) for some in (one, many))
    worst = (np.abs(total / count - term)[term > 0] / term[term > 0]).max() / U
    assert worst < 66
    evidence(f"{count} times the same light: off by {worst:.0f} U; bound 66 U")


@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.parametrize("how", [PairSettings(), of(PairSettings, widening=0.3), of(SiiSettings, cut_share=0.05)])
@pytest.mark.feature("SII-07")
def test_no_place_no_exponent_and_no_size_leaves_the_numbers(how, real, evidence):
    """Lights on receivers, 1e-6 m off them, and at grazing angles both ways, in scenes of 1e-6, 1 and 1e6 m."""
    rng, count = np.random.default_rng(3), 120
    for size in (1e-6, 1.0, 1e6):
        places, normal = size * rng.uniform(-1, 1, (3, count)), sets.random_directions(rng, count)
        tangent = sets.unit(np.cross(normal.T, rng.normal(size=(count, 3))).T)
        here = sets.receivers(places, normal, real)
        for off in (0 * normal, 1e-6 * normal, 1e-6 * tangent, size * tangent, size * (tangent + 1e-7 * normal)):
            for axis in (normal, tangent, sets.unit(tangent - 1e-4 * normal), -normal):  # the last one into the light
                lights = sets.glossy(places + off, -normal, axis, 0, real=real)
                lights = lights._replace(flux=np.ones((3, count), real),
                                         lobe_exponent=np.resize(EXPONENTS, count).astype(real))
                got = (splat if isinstance(how, SiiSettings) else irradiance)(here, lights, how)
                assert np.isfinite(got).all()
                assert (got >= 0).all()
    evidence(f"{np.dtype(real).name}, {how}: 60 sets of 120 x 120 pairs finite")


@cache
def lit_room():
    receivers, lights = sets.room(np.random.default_rng(4), 260, np.float32)
    rng = np.random.default_rng(5)
    return receivers, lights._replace(lobe_flux=lights.flux[::-1].copy(), lobe_axis=lights.normal,
                                      lobe_exponent=(10 ** rng.uniform(-1, 6, 260)).astype(np.float32))


@pytest.mark.parametrize("how", [PairSettings(), of(PairSettings, widening=0.5), SiiSettings(),
                                 of(SiiSettings, cut_share=0.05, reference_length=1.0),
                                 of(SiiSettings, cut_share=0.05, reference_length=1.0, stochastic=True)])


@pytest.mark.parametrize("factor", [2.0, 4.0, 0.5, 1024.0, 2.0**-29])
@pytest.mark.feature("REF-05")
def test_powers_of_two_scale_to_the_bit(how, factor, evidence):
    receivers, lights = lit_room()
    add = splat if isinstance(how, SiiSettings) else irradiance
    once = add(receivers, lights, how)
    more = lights._replace(flux=lights.flux * np.float32(factor), lobe_flux=lights.lobe_flux * np.float32(factor))
    np.testing.assert_array_equal(add(receivers, more, how), once * np.float32(factor))
    widening = (how.pairs if isinstance(how, SiiSettings) else how).lobe.widening
    there = {"widening": widening * factor}
    if isinstance(how, SiiSettings) and how.reach.cut:
        there["reference_length"] = how.reach.cut.reference_length * factor
    longer = add(receivers._replace(position=receivers.position * np.float32(factor)),
                 lights._replace(position=lights.position * np.float32(factor)), replaced(how, there))
    np.testing.assert_array_equal(longer, once / np.float32(factor**2))
    evidence(f"{type(how).__name__}, a = {widening}: flux x {factor:g} gives E x {factor:g}, "
             f"lengths x {factor:g} give E / {factor**2:g}, to the bit")


def changed(scene, shift=(0, 0, 0), scale=1.0, brightness=1.0):
    def place(point):
        return tuple(float(scale * x + offset) for x, offset in zip(point, shift, strict=True))

    vertices = scale * scene.geometry.vertices + np.asarray(shift, float)
    camera = dataclasses.replace(scene.camera, eye=place(scene.camera.eye), target=place(scene.camera.target))
    lights = tuple(light if isinstance(light, DirectionalLight) else dataclasses.replace(
        light, position=place(light.position), intensity=tuple(brightness * x for x in light.intensity))
        for light in scene.lights)
    return dataclasses.replace(scene, geometry=dataclasses.replace(scene.geometry, vertices=vertices), camera=camera,
                               lights=lights)


# without the pilot, whose counts of free picks jump with the last bit of a coordinate and move all rays a little
METHODS = {"sii": {"lights": 48, "clamp": "none"}, "vpl": {"lights": 48},
           "truth": {"samples": 32, "uniform_share": 1.0}}


@cache
def at_the_origin(method):
    return draw(load_scene("cornell_box"), method)


def draw(scene, method, **how):
    return render(scene, method, of(find_method(method).settings, **METHODS[method], **how), **SIZE)


def apart(picture, reference):
    """Return relative differences of indirect and direct light, dim pixels by a hundredth of the mean."""
    pairs = (picture.irradiance, reference.irradiance), (picture.frame.direct, reference.frame.direct)
    return [np.abs(a - b) / np.maximum(b, b.mean() / 100) for a, b in pairs]


@pytest.mark.parametrize("method", list(METHODS))
@pytest.mark.parametrize("shift", [(1e5, -1e5, 1e5), (12345.678, 1e5 + 0.3, -77777.77)])
@pytest.mark.feature("REF-05")
def test_a_scene_moved_by_1e5_m_gives_the_same_picture(method, shift, evidence):
    picture = draw(changed(load_scene("cornell_box"), shift), method)
    assert picture.frame.origin != (0, 0, 0)
    errors = apart(picture, at_the_origin(method))
    assert max(np.quantile(e, 0.99) for e in errors) < MOVED_TYPICAL
    assert max(e.max() for e in errors) < MOVED_WORST
    evidence(f"{method} moved by {shift} m: 99 % of pixels within {max(np.quantile(e, 0.99) for e in errors):.0e}, "
             f"all within {max(e.max() for e in errors):.0e}")


@pytest.mark.parametrize("method", list(METHODS))
@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_a_scene_of_another_size_gives_the_same_picture(method, scale):
    """With flux kept, E goes as the inverse square of lengths."""
    brightness = scale**2
    picture = draw(changed(load_scene("cornell_box"), scale=scale, brightness=brightness), method)
    assert np.isfinite(picture.radiance).all()
    errors = apart(picture, at_the_origin(method))
    assert max(np.quantile(e, 0.99) for e in errors) < RESIZED


@pytest.mark.parametrize("factor", [2.0, 0.25])
def test_powers_of_two_scale_whole_pictures_to_the_bit(factor):
    scene, plain = load_scene("cornell_box"), at_the_origin("sii")
    brighter = draw(changed(scene, brightness=factor), "sii")
    np.testing.assert_array_equal(brighter.irradiance, plain.irradiance * np.float32(factor))
    larger = draw(changed(scene, scale=factor), "sii")
    np.testing.assert_array_equal(larger.irradiance, plain.irradiance / np.float32(factor**2))


def test_buffers_of_a_moved_scene_count_from_its_origin():
    scene = load_scene("cornell_box")
    frame, plain = (Frame(one, **SIZE) for one in (changed(scene, (1e5, 0, -64.0)), scene))
    there = frame.gbuffer.position + np.reshape(frame.origin, (3, 1, 1))
    np.testing.assert_allclose(there - np.reshape((1e5, 0, -64.0), (3, 1, 1)), plain.gbuffer.position, atol=1e-6)
    assert math.dist(frame.origin, (1e5, 0, -64.0)) < 2 * scene.geometry.diagonal


UP = np.array([[0.0], [1.0], [0.0]], np.float32)
NORMS = ("none", "full_lobe", "clamped")
SETTINGS = ({}, {"clamp": "disc"}, {"clamp": "sphere", "clamp_value": 1e18}, {"clamp": "distance", "clamp_value": 1e18},
            {"widening": 1e9}, {"cut_share": 1e9, "reference_length": 1e-9}, {"cut_irradiance": 1e300},
            {"as_published": {"per_light_ilow"}, "reference_length": 1e-9})


def odd_lights(flux: float, exponent: float, axis: tuple[float, float, float]) -> PixelLights:
    def planes(values):
        return np.ascontiguousarray(np.broadcast_to(np.asarray(values, np.float32).reshape(3, -1), (3, 3)))

    return PixelLights(planes([1e9] * 3), planes(UP), planes([flux] * 3), planes([flux] * 3), planes(axis),
                       np.full(3, exponent, np.float32), 3)


@pytest.mark.parametrize("flux", [0.0, 1e-45, 1.0, 1e20, 1e38])
@pytest.mark.parametrize("exponent", [0.0, 1e20])
@pytest.mark.parametrize("axis", [(0, 1, 0), (0, -1, 0), (1, -1e-3, 0), (0, 0, 0)])
@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_all_that_is_packed_is_finite(flux, exponent, axis, real):
    lights = odd_lights(flux, exponent, axis)
    for norm in NORMS:
        for options in SETTINGS:
            settings = of(SiiSettings, lobe_norm=norm, **options)
            for footprint in (0.0, 3e38):
                packed = pack(lights, settings.pairs, np.full(3, footprint), real)
                assert np.isfinite(packed.diffuse).all()
                assert packed.lobes is None or np.isfinite(packed.lobes.lights).all()
                assert packed.spheres is None or np.isfinite(packed.spheres).all()
                low = low_irradiance(lights, settings)
                assert math.isfinite(low)
                for peak in all_peaks(packed):
                    assert np.isfinite(light_range(peak, low, settings.reach, 0, real).square).all()


def test_peaks_within_the_dtype_are_as_the_equation_says():
    lights = odd_lights(2.0, 9.0, (0, 1, 0))
    packed = pack(lights, of(PairSettings, lobe_norm="full_lobe"), None, np.float64)
    assert packed.lobes.lights[10:13] == pytest.approx(np.full((3, 3), 2 * 10 / (2 * math.pi)), rel=1e-12)
    beyond = pack(odd_lights(1e20, 1e20, (0, 1, 0)), of(PairSettings, lobe_norm="full_lobe"), None, np.float32)
    assert beyond.lobes.lights[10:13].max() == np.float32(np.finfo(np.float32).max / HEADROOM)


def test_a_tiny_share_cuts_nothing_for_any_light():
    settings = of(SiiSettings, as_published={"per_light_ilow"}, cut_share=1e-300, reference_length=1.0)
    reach = light_range(np.array([1.0, 0.0, 1e-30]), 0.0, settings.reach, 0, np.float32)
    farthest = math.sqrt(np.finfo(np.float32).max)
    assert reach.square.tolist() == [np.float32(farthest), 0.0, np.float32(farthest)]
