"""The cut sum: literal twin, same bits for every bound, what it loses, its random range, its counts."""

import dataclasses
import math

import numba
import numpy as np
import pytest

from refgi.errors import InputError
from refgi.frame import Frame
from refgi.jit import threads
from refgi.lights import choose_pixel_lights
from refgi.lights.selection import choose_lights
from refgi.pairs.ranged_sum import LANES, range_factor
from refgi.scene import Geometry, Material, load_scene, merge
from refgi.settings import of, replaced
from refgi.splat import PairSettings, Receivers, irradiance
from refgi.splat.sii.bounds import covered_pixels, light_solids, screen_quads
from refgi.splat.sii.fragments import fragments, gather_bits
from refgi.splat.sii.settings import SiiSettings
from refgi.splat.sii.sii import cut_irradiance, splat
from refgi.splat.sii.threshold import low_irradiance
from tests import lamps
from tests.naive import bounds as naive
from tests.naive.radiometry import lobe_fraction
from tests.pairs import sets
from tests.truth.scenes import rectangle

CUT = of(SiiSettings, cut_irradiance=0.05)
BOUNDS = ("full", "quad", "ellipsoid", "tangent", "mesh")
ROUNDING = {np.float32: 3e-6, np.float64: 1e-14}  # as of the full sum
TOGETHER = 1e-6  # kept and cut are rounded by themselves, in float32, before they are added
EDGE = 2e-4  # quadrature of a step: half a sample of 4000 on either side of it
CHANCE = 4.5  # standard errors; 1 in 150,000 for one of the means
FRAGMENTS = 1.3  # pairs evaluated over fragments, what the tiles are meant to keep to


@pytest.fixture(scope="module")
def corner():
    """A picture of the Cornell box, its map and 96 lights."""
    frame = Frame(load_scene("cornell_box"), width=160, height=128, rsm_resolution=64)
    lights = choose_pixel_lights(frame.rsms, count=96, pattern="halton")
    return Receivers(*frame.gbuffer.resolve("position", "normal", "covered")), lights, frame.gbuffer.projection


def row(array):
    return array[:, 0].astype(np.float64)


@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.feature("SII-18", "SII-23")
def test_sum_is_that_of_the_twin(real, evidence):
    rng = np.random.default_rng(1)
    receivers, lights = sets.room(rng, 60, real)
    args = (row(part) for part in receivers[:2])
    twin = sets.lights(*(part.astype(np.float64) for part in lights[:3]))
    inside, outside, overdraw = naive.irradiance(*args, twin, CUT.reach.cut.irradiance)
    for got, expected in ((splat(receivers, lights, CUT), inside), (cut_irradiance(receivers, lights, CUT), outside)):
        assert not row(got)[expected == 0].any()
        assert np.abs(row(got) - expected).max() < 100 * ROUNDING[real] * (inside + outside).mean()
    counted = fragments(receivers, lights, CUT)
    np.testing.assert_array_equal(counted.overdraw[0], overdraw)
    assert 0.05 < overdraw.mean() / 60 < 0.6
    evidence(f"{np.dtype(real).name}: the twin's {overdraw.sum()} of {60 * 60} pairs count")


@pytest.mark.feature("SII-21")
@pytest.mark.parametrize("clamp", [{}, {"clamp": "distance", "clamp_value": 0.2}, {"clamp": "geometry",
                         "clamp_value": 3.0}, {"clamp": "disc"}, {"clamp": "sphere"}])
def test_kept_and_cut_make_the_full_sum(corner, clamp):
    receivers, lights, _ = corner
    footprint = np.full(lights.flux.shape[1], 1e-3)
    how = of(SiiSettings, cut_share=0.05, reference_length=0.1, **clamp)
    full = irradiance(receivers, lights, of(PairSettings, **clamp), footprint)
    for settings in (how, replaced(how, {"stochastic": True, "seed": 5})):
        kept = splat(receivers, lights, settings, footprint)
        cut = cut_irradiance(receivers, lights, settings, footprint)
        scale = np.abs(kept).max() + np.abs(cut).max() + full.max()
        assert np.abs(kept.astype(float) + cut - full).max() < TOGETHER * scale
        assert kept.any()
        assert cut.any()


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_without_a_threshold_nothing_changes(corner, real):
    receivers, lights, _ = corner
    receivers = Receivers(receivers.position.astype(real), receivers.normal.astype(real), receivers.covered)
    full = irradiance(receivers, lights, PairSettings())
    for how in ({}, {"cut_irradiance": 1e-20}, {"cut_irradiance": 1e-300}):
        np.testing.assert_array_equal(splat(receivers, lights, of(SiiSettings, **how)), full)
    assert not cut_irradiance(receivers, lights, SiiSettings()).any()
    assert not cut_irradiance(receivers, lights, of(SiiSettings, cut_irradiance=1e-20)).any()
    assert not splat(receivers, lights, of(SiiSettings, cut_irradiance=1e20)).any()


@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.parametrize("glossy", [False, True])
@pytest.mark.feature("SII-18")
def test_every_bound_gives_the_same_picture(corner, real, glossy, evidence):
    receivers, lights, view = corner
    receivers = Receivers(receivers.position.astype(real), receivers.normal.astype(real), receivers.covered)
    five_percent = of(SiiSettings, cut_share=0.05, reference_length=0.15)
    cases = [of(SiiSettings, cut_irradiance=low_irradiance(lights, five_percent))]
    if glossy:
        rng = np.random.default_rng(2)
        axis = sets.unit(lights.normal + 0.5 * sets.random_directions(rng, lights.flux.shape[1]))
        lights = lights._replace(lobe_flux=lights.flux[::-1], lobe_axis=axis,
                                 lobe_exponent=np.geomspace(0.5, 300, axis.shape[1]))
        if real == np.float32:
            cases += [replaced(cases[0], {"widening": 0.2}),
                      replaced(cases[0], {"widening": 5.0, "as_published": {"sii_widening"}})]
    for how in cases:
        pictures, counts = {}, {}
        for bound in BOUNDS if how is cases[0] else BOUNDS[:-1]:
            settings = replaced(how, {"bound": bound})
            pictures[bound] = splat(receivers, lights, settings, None, view)
            np.testing.assert_array_equal(pictures[bound], pictures["full"])
            if bound != "mesh":
                counts[bound] = fragments(receivers, lights, settings, None, view)
                np.testing.assert_array_equal(counts[bound].overdraw, counts["full"].overdraw)
        order = [count.evaluated for count in counts.values()]
        assert how.pairs.lobe.widening > 0 or order[0] > order[1] > order[2] > order[3]
        assert not np.array_equal(pictures["full"], irradiance(receivers, lights, how.pairs))
        figures = ", ".join(f"{bound} {counts[bound].evaluated / counts['full'].total:.2f}" for bound in counts)
        evidence(f"{np.dtype(real).name}{', lobes' * glossy}: equal bits; pairs evaluated a fragment: {figures}")


@pytest.mark.feature("SII-18")
def test_fewer_pixels_are_drawn_by_tighter_bounds(corner, evidence):
    """Fragments that hardware would shade: the whole screen, quads, meshes of the ellipsoids, and those needed."""
    receivers, lights, view = corner
    settings = of(SiiSettings, cut_share=0.05, reference_length=0.1)
    square = lights.flux.max(axis=0) / math.pi / low_irradiance(lights, settings)
    top, bottom, left, right = screen_quads(view, lights.position, np.sqrt(square))
    row, column = np.mgrid[: view.height, : view.width][..., None] + 0.5
    covered = receivers.covered
    quads = ((row >= top) & (row <= bottom) & (column >= left) & (column <= right))[covered].sum()
    solids = light_solids(lights.position, lights.normal, np.ones(len(square)), square, "ellipsoid")
    meshes = sum(covered_pixels(view, solids, k, 320, True)[covered].sum() for k in range(len(square)))
    needed = fragments(receivers, lights, settings).total
    everything = covered.sum() * len(square)
    assert everything > quads > meshes > needed
    evidence(f"drawn for each fragment that counts: full {everything / needed:.1f}, quad {quads / needed:.1f}, "
             f"ellipsoid {meshes / needed:.1f}")


@pytest.mark.feature("SII-30")
def test_fragments_off_the_surface_seen_are_not_shaded(evidence):
    """Fragments of meshes with and without early depth, in the open and behind slats: the same bits, less to shade."""
    room, left, evaluated = load_scene("cornell_box"), {}, {}
    lights = choose_pixel_lights(Frame(room, rsm_resolution=64).rsms, count=96, pattern="halton")
    settings = of(SiiSettings, cut_irradiance=low_irradiance(lights, of(SiiSettings, cut_share=0.05,
                                                                        reference_length=0.15)))
    square = lights.flux.max(axis=0) / math.pi / settings.reach.cut.irradiance
    solids = light_solids(lights.position, lights.normal, np.ones(len(square)), square, "ellipsoid")
    for name, scene in {"in the open": room, "among occluders": behind_slats(room)}.items():
        buffer = Frame(scene, width=80, height=64).gbuffer
        receivers, view = Receivers(*buffer.resolve("position", "normal", "covered")), buffer.projection
        shaded = [sum(covered_pixels(view, solids, k, 80, True, seen)[buffer.covered].sum()
                      for k in range(len(square))) for seen in (None, buffer.visibility.inverse_depth)]
        left[name] = shaded[1] / shaded[0]
        expected = splat(receivers, lights, replaced(settings, {"bound": "full"}), None, view)
        for bound in ("mesh", "quad"):
            how = replaced(settings, {"bound": bound})
            np.testing.assert_array_equal(splat(receivers, lights, how, None, view), expected)
            evaluated[name, bound] = fragments(receivers, lights, how, None, view).evaluated
        assert evaluated[name, "mesh"] < evaluated[name, "quad"]
        assert shaded[1] >= fragments(receivers, lights, settings).total
    assert left["among occluders"] < 0.5 * left["in the open"] < 0.5
    evidence("fragments left by early depth: " + ", ".join(f"{name} {share:.0%}" for name, share in left.items())
             + "; pairs evaluated over those of quads, which know no depth: "
             + ", ".join(f"{evaluated[name, 'mesh'] / evaluated[name, 'quad']:.2f}" for name in left))


@pytest.mark.feature("SII-30")
def test_a_bound_before_the_surface_seen_lists_no_tile():
    """A light whose range ends before all surfaces: its quad lists tiles, its mesh none."""
    buffer = Frame(load_scene("cornell_box"), width=80, height=64).gbuffer
    receivers = Receivers(*buffer.resolve("position", "normal", "covered"))
    place, ahead, flux = (np.array(part, np.float32)[:, None] for part in ((0.278, 0.44, 0.3), (0, 0, 1), (1, 1, 1)))
    lights = sets.PixelLights(place, ahead, flux, None, None, None, 1)
    how = of(SiiSettings, cut_irradiance=1 / math.pi / 0.05**2)  # R_0 = 5 cm
    evaluated = {bound: fragments(receivers, lights, replaced(how, {"bound": bound}), None, buffer.projection).evaluated
                 for bound in ("quad", "mesh")}
    assert evaluated["quad"] > evaluated["mesh"] == 0


def behind_slats(scene, distance=0.1, count=9):
    """The scene seen between upright slats that hide two thirds of the picture."""
    eye, up = np.array(scene.camera.eye), np.array(scene.camera.up)
    ahead = sets.unit(np.subtract(scene.camera.target, eye)[:, None])[:, 0]
    half = 1.5 * distance * math.tan(scene.camera.vfov / 2)
    right, step = np.cross(ahead, up), 2 * half / count
    slats = [rectangle(eye + distance * ahead + (k * step - half) * right - half * up, 2 / 3 * step * right,
                       2 * half * up) for k in range(count)]
    extra, _ = merge(slats)
    old = scene.geometry
    return dataclasses.replace(scene, geometry=Geometry(
        np.concatenate([old.vertices, extra.vertices]), np.concatenate([old.faces, extra.faces + len(old.vertices)]),
        np.concatenate([old.material_of_face, extra.material_of_face])))


@pytest.mark.feature("SII-20")
def test_meshes_that_are_not_inflated_lose_pixels(corner):
    receivers, lights, view = corner
    how = of(SiiSettings, cut_share=0.05, reference_length=0.02, bound="mesh", bound_faces=8, bound_inflate=False)
    kept = splat(receivers, lights, how, None, view)
    whole = splat(receivers, lights, replaced(how, {"bound_inflate": True}), None, view)
    assert (kept <= whole).all()
    assert (kept < whole).any()


@pytest.mark.parametrize("how", [{}, {"stochastic": True}])
def test_bits_do_not_depend_on_threads_or_neighbours(how):
    rng = np.random.default_rng(4)
    receivers, lights = sets.room(rng, 1111, np.float32)
    settings = of(SiiSettings, cut_irradiance=0.3, **how)
    with threads(1):
        whole = splat(receivers, lights, settings)
    with threads(min(2, numba.config.NUMBA_NUM_THREADS)):
        np.testing.assert_array_equal(splat(receivers, lights, settings), whole)
    for cut in (1, LANES - 1, LANES, 300):
        sides = [splat(Receivers(*(np.ascontiguousarray(part[..., side]) for part in receivers)), lights, settings)
                 for side in (np.s_[:cut], np.s_[cut:])]
        np.testing.assert_array_equal(np.concatenate(sides, axis=-1), whole)
    covered = rng.random((1, 1111)) < 0.4
    np.testing.assert_array_equal(splat(receivers._replace(covered=covered), lights, settings), whole * covered)


@pytest.mark.parametrize("length", [1e-6, 1.0, 1e6])
def test_range_scales_with_the_scene(length):
    """From micrometres to a thousand kilometres, with the threshold along: the same pairs, no overflow."""
    receivers, lights = sets.room(np.random.default_rng(5), 200, np.float32)
    power = np.float32(2.0 ** round(math.log2(length)))
    there = Receivers(receivers.position * power, receivers.normal, receivers.covered)
    far = lights._replace(position=lights.position * power, flux=lights.flux * power**2)
    plain = fragments(receivers, lights, CUT)
    np.testing.assert_array_equal(fragments(there, far, CUT).overdraw, plain.overdraw)
    np.testing.assert_allclose(splat(there, far, CUT), splat(receivers, lights, CUT), rtol=1e-5)


@pytest.mark.feature("SII-21")
def test_threshold_is_one_irradiance_for_all_lights():
    light = sets.lights(np.zeros((3, 3)), np.array([[0.0] * 3, [0] * 3, [1] * 3]), [[1.0, 2, 3], [9, 1, 0], [0, 0, 5]])
    settings = of(SiiSettings, cut_share=0.1, reference_length=2.0)
    assert low_irradiance(light, settings) == pytest.approx(0.1 * 9 / math.pi / 4)
    assert low_irradiance(light, replaced(settings, {"cut": "absolute", "cut_irradiance": 7.0})) == 7
    no_pi = replaced(settings, {"as_published": {"sii_no_pi"}})
    assert low_irradiance(light, no_pi) == pytest.approx(0.1 * 9 / 4)
    lobe = sets.glossy(np.zeros((3, 1)), np.array([[0.0], [0], [1]]), np.array([[0.0], [0], [1]]), 10.0, 2.0)
    assert low_irradiance(lobe, settings) == pytest.approx(0.1 * 2 * 11 / (2 * math.pi) / 4)  # K = 1 upright
    none = sets.PixelLights(*(part[:, :0] for part in light[:3]), None, None, None, 0)
    assert low_irradiance(none, settings) == 0


@pytest.mark.parametrize("how", [{"cut_irradiance": 1e-320}, {"cut_share": 1e-320, "reference_length": 1e9},
                                 {"cut_share": 1e-320, "reference_length": 1.0, "as_published": {"per_light_ilow"}}])
def test_thresholds_near_0_cut_nothing(how):
    receivers, lights = sets.room(np.random.default_rng(31), 50)
    settings = of(SiiSettings, **how)
    np.testing.assert_array_equal(splat(receivers, lights, settings), irradiance(receivers, lights, settings.pairs))
    assert not cut_irradiance(receivers, lights, settings).any()


@pytest.mark.feature("SII-21")
def test_range_of_a_light_is_that_of_its_flux():
    """On the axis a light counts up to sqrt(I_0 / I_low); as published, all up to x^(-1/2) reference lengths."""
    z = np.linspace(0.01, 5, 4000)
    receivers = sets.receivers(np.stack([0 * z, 0 * z, z]), np.stack([0 * z, 0 * z, -1 + 0 * z]))
    two = sets.lights(np.zeros((3, 2)), np.array([[0.0, 0], [0, 0], [1, 1]]), [[1.0, 0.25], [0, 0], [0, 0]])
    for published, expected in ((set(), (4, 2)), ({"per_light_ilow"}, (4, 4))):
        settings = of(SiiSettings, cut_share=1 / 16, reference_length=1.0, as_published=published)
        overdraw = fragments(receivers, two, settings).overdraw[0]
        reach = [z[overdraw >= least].max() for least in (1, 2)]
        np.testing.assert_allclose(reach, expected, atol=2e-3)


def plane(distance, count=4000):
    """Receivers on the plane z = distance above the origin at midpoints of equal shares of sin^2 alpha; areas."""
    share = (np.arange(count) + 0.5) / count
    rho = distance * np.sqrt(share / (1 - share))
    area = math.pi * distance**2 / (1 - share) ** 2 / count  # d(pi rho^2)
    zero = np.zeros(count)
    return sets.receivers(np.stack([rho, zero, zero + distance]), np.stack([zero, zero, zero - 1])), area


@pytest.mark.feature("SII-21")
def test_loss_follows_the_closed_form(evidence):
    """A light that faces a plane loses (D / R_0)^(2 (n + 1) / (n + 2)) of its flux (E-SII-15)."""
    up = np.array([[0.0], [0], [1]])
    found = []
    for exponent, sums in ((1.0, (0.046, 0.136, 0.170, 0.215)), (10.0, None), (100.0, None)):
        diffuse = sets.lights(np.zeros((3, 1)), up, 1.0)
        light = diffuse if exponent == 1 else sets.glossy(np.zeros((3, 1)), up, up, exponent)
        for i, x in enumerate((0.01, 0.05, 0.07, 0.10)):
            for distance in (1.0, 0.5):
                receivers, area = plane(distance)
                settings = of(SiiSettings, cut_share=x, reference_length=1.0)
                full = (row(irradiance(receivers, light, settings.pairs))[0] * area).sum()
                lost = (row(cut_irradiance(receivers, light, settings))[0] * area).sum() / full
                expected = (distance * math.sqrt(x)) ** (2 * (exponent + 1) / (exponent + 2))
                assert lost == pytest.approx(expected, abs=EDGE * (exponent + 1))
                if i == 1:
                    assert 1 - lost == pytest.approx(naive.captured_share(distance, x**-0.5, exponent),
                                                     abs=EDGE * (exponent + 1))
                if sums is not None and distance == 1:
                    assert lost == pytest.approx(sums[i], abs=6e-4)
                    found.append(f"{lost:.1%}")
    evidence("diffuse, D = 1, lost at 1, 5, 7, 10 %: " + ", ".join(found) + "; lobes of n = 10, 100 by the same law")


@pytest.mark.feature("SII-21")
def test_fragments_grow_as_one_over_the_threshold_until_the_screen_is_full(corner, evidence):
    """On a wall through the light's axis the range is a curve of area ~ R_0^2; in a room it saturates."""
    side = np.linspace(-2, 2, 801)
    x, z = (part.reshape(-1) for part in np.meshgrid(side, side))
    receivers = sets.receivers(np.stack([x, 0 * x + 1e-3, z]), np.stack([0 * x, 0 * x - 1, 0 * x]))
    light = sets.lights(np.zeros((3, 1)), np.array([[0.0], [0], [1]]), 1.0)
    lows = np.array([8.0, 4, 2, 1])
    cuts = [of(SiiSettings, cut_share=low, reference_length=1.0) for low in lows]
    counts = np.array([fragments(receivers, light, cut).total for cut in cuts])
    np.testing.assert_allclose(counts * lows / (counts * lows)[-1], 1, rtol=0.02)
    room, lights, _ = corner
    shares = (0.1, 0.07, 0.05, 0.01, 1e-3, 1e-5, 1e-6)
    means = [fragments(room, lights, of(SiiSettings, cut_share=x, reference_length=0.1)).overdraw[room.covered].mean()
             for x in shares]
    assert (np.diff(means) > 0).all()
    assert means[-1] < lights.flux.shape[1]  # what lies behind a light never counts
    slopes = np.diff(np.log(means)) / -np.diff(np.log(shares))
    assert slopes[0] > 1  # most ranges still end in the air
    assert (np.diff(slopes) < 0).all()
    assert slopes[-1] < 0.02
    table = ", ".join(f"{x:.4g} %: {mean:.1f}" for x, mean in zip(np.multiply(100, shares), means, strict=True))
    spread = np.ptp(counts * lows) / (counts * lows)[-1]
    evidence(f"wall: fragments times I_low within {spread:.1%}; room: mean overdraw {table}; "
             f"slopes {slopes[0]:.1f} to {slopes[-1]:.2f}")


@pytest.mark.feature("SII-23", "SII-24")
def test_counts_and_traffic(corner, evidence):
    receivers, lights, view = corner
    counted = fragments(receivers, lights, of(SiiSettings, cut_share=0.05, reference_length=0.1), None, view)
    assert counted.overdraw.sum() == counted.of_light.sum() == counted.total
    assert not counted.overdraw[~receivers.covered].any()
    assert counted.bits == 72 * counted.total
    # Sec. 6: P O 72 and P S 112 bits
    pixels = 512 * 512
    assert pixels * 125 * 72 == 2_359_296_000
    assert gather_bits(pixels, 308) == pixels * 308 * 112
    assert round(pixels * 125 / 768, -2) == 42_700  # the caption of Fig. 8 cuts it to 42,600
    off = fragments(receivers, lights, of(SiiSettings))
    assert off.total == off.evaluated == np.count_nonzero(receivers.covered) * lights.flux.shape[1]
    evidence(f"map sums to {counted.total} fragments = sum over lights; {counted.bits} bits at 72 each; evaluated "
             f"{counted.evaluated / counted.total:.2f} a fragment; Fig. 8: 281 MB a frame, 308 samples: 1078 MiB")


def alone(lights, k, part):
    """Return one light's diffuse part or its lobe."""
    one = type(lights)(*(None if array is None else array[..., k : k + 1] for array in lights[:6]), 1)
    return one._replace(lobe_flux=None, lobe_axis=None, lobe_exponent=None) if part == "diffuse" else one._replace(
        flux=np.zeros_like(one.flux))


def lobe_peak(cosine, exponent):
    """Return the peak of a lobe of unit flux, (P + 1) / (2 pi K)."""
    return (exponent + 1) / (2 * math.pi * lobe_fraction(math.acos(min(1.0, cosine)), exponent))


def turned_to(receivers, place):
    """Return receivers that all face a place, so that no light there is below their horizon."""
    toward = place[:, :, None] - receivers.position
    return receivers._replace(normal=toward / np.linalg.norm(toward, axis=0))


@pytest.mark.feature("SII-23")
def test_the_map_sums_to_the_fragments_that_are_drawn(evidence):
    """Each part of each light is drawn alone on receivers turned towards it: where it leaves light is a fragment."""
    frame = lamps.corner(material=Material("glossy", (0.5, 0.4, 0.3), (0.3, 0.4, 0.5), 12.0), width=40, height=30)
    settings = of(SiiSettings, lights=60, cut_share=0.05, reference_length=2.0)
    receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
    lights = choose_lights(frame, settings.lights)
    counted = fragments(receivers, lights, settings)
    drawn, of_light = np.zeros_like(counted.overdraw), np.zeros_like(counted.of_light)
    parts = (lights.flux.T, lights.lobe_flux.T, lights.normal.T, lights.lobe_axis.T)
    peaks = [max(naive.peak(flux), naive.peak(lobe, lobe_peak(normal @ axis, 12.0)))
             for flux, lobe, normal, axis in zip(*parts, strict=True)]
    absolute = of(SiiSettings, cut_irradiance=0.05 * max(peaks) / 2.0**2)
    for k in range(lights.flux.shape[1]):
        for part in ("diffuse", "lobe"):
            one = alone(lights, k, part)
            lit = splat(turned_to(receivers, one.position), one, absolute).any(axis=0)
            drawn += lit
            of_light[k] += np.count_nonzero(lit)
    np.testing.assert_array_equal(counted.overdraw, drawn)
    np.testing.assert_array_equal(counted.of_light, of_light)
    pairs = 2 * lights.flux.shape[1] * np.count_nonzero(receivers.covered)
    assert 0.05 < drawn.sum() / pairs < 0.6
    evidence(f"three lamps, {of_light.size} lights with lobes: the map's {counted.overdraw.sum()} are the "
             f"{drawn.sum()} fragments drawn, pixel by pixel and light by light, of {pairs} pairs")


@pytest.mark.parametrize("widening", [0.0, 0.7])
@pytest.mark.feature("SII-23")
def test_lobes_are_counted_as_the_twin_counts_them(widening, evidence):
    rng = np.random.default_rng(9)
    receivers, lights = sets.room(rng, 60, np.float32)
    exponent, low = 6.0, 0.05
    lights = sets.glossy(lights.position, lights.normal, sets.random_directions(rng, 60), exponent, real=np.float32)
    how = of(SiiSettings, cut_irradiance=low, lobe_norm="full_lobe", widening=widening)
    expected = np.zeros(60, int)
    for i, k in np.ndindex(60, 60):
        x, p = row(receivers.position)[:, i], lights.position[:, k]
        r = np.linalg.norm(x - p)
        here = exponent * min(1, r / widening) if widening else exponent
        if lights.normal[:, k] @ (x - p) > 0:
            expected[k] += naive.counts(x, p, lights.lobe_axis[:, k], here, (here + 1) / (2 * math.pi), low)
    counted = fragments(receivers, lights, how)
    np.testing.assert_array_equal(counted.of_light, expected)
    assert counted.overdraw.sum() == expected.sum() > 100
    evidence(f"lobes, a = {widening:g} m: the twin's {expected.sum()} fragments, light by light")


@pytest.mark.parametrize(("scene", "length"), [("cornell_horse", 0.1667), ("sponza", 8.37), ("quake_e1m1", 4.38)])
@pytest.mark.feature("SII-23")
def test_tiles_keep_to_the_fragments(data_dir, scene, length, evidence):
    """768 lights, mean overdraw near the paper's 125."""
    frame = Frame(load_scene(data_dir / f"{scene}.json"), width=512, height=512)
    lights = choose_pixel_lights(frame.rsms, count=768, pattern="halton")
    receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
    counted = fragments(receivers, lights, of(SiiSettings, cut_share=0.05, reference_length=length))
    mean = counted.overdraw[receivers.covered].mean()
    assert 100 < mean < 200
    assert counted.evaluated < FRAGMENTS * counted.total
    evidence(f"{scene}: mean overdraw {mean:.0f}, {counted.evaluated / counted.total:.3f} pairs evaluated a fragment")


@pytest.mark.parametrize("glossy", [False, True])
@pytest.mark.feature("REF-12")
def test_stochastic_range_has_the_mean_of_the_full_sum(glossy, evidence):
    rng = np.random.default_rng(7)
    receivers, lights = sets.room(rng, 48)
    if glossy:
        lights = sets.glossy(lights.position, lights.normal, lights.normal, 5.0)
    settings = of(SiiSettings, cut_irradiance=0.3, stochastic=True)
    mean = np.mean([row(splat(receivers, lights, replaced(settings, {"seed": seed})))[0] for seed in range(400)],
                   axis=0)
    # a pair with B < I_low is kept with the chance p = B / I_low, times 1 / p: its variance is E^2 (1 / p - 1)
    full, variance = np.zeros(48), np.zeros(48)
    for k in range(48):
        one = type(lights)(*(None if part is None else part[..., k : k + 1] for part in lights[:6]), 1)
        term = row(irradiance(receivers, one, PairSettings()))[0]
        d = row(receivers.position) - one.position
        r = np.linalg.norm(d, axis=0)
        cosine = np.maximum((one.normal * d).sum(axis=0) / r, 1e-9)
        peak = 6 / (2 * math.pi) if glossy else naive.peak(one.flux)
        chance = np.minimum(1, peak * cosine ** (5 if glossy else 1) / r**2 / 0.3)
        full, variance = full + term, variance + term**2 * (1 / chance - 1)
    z = (mean - full)[variance > 0] / np.sqrt(variance[variance > 0] / 400)
    plain = row(splat(receivers, lights, replaced(settings, {"stochastic": False})))[0]
    assert np.abs(z).max() < CHANCE
    bias = 1 - plain.sum() / full.sum()
    assert bias > 0.1
    evidence(f"{'lobes' if glossy else 'diffuse'}: 400 seeds, largest z {np.abs(z).max():.1f}; the plain cut loses "
             f"{bias:.0%}")


@pytest.mark.feature("REF-12")
def test_factor_of_a_pair():
    """R_0 = 2; on the axis B / I_low = 4 / r^2."""
    cases = (1.0, 0.5, 1.0), (2.0, 1.0, 1.0), (2.5, 1.0, 0.0), (2.5, 0.5, 2.5**2 / 4), (3.0, 0.5, 0.0)
    for r, scale, expected in cases:
        got = range_factor(0.0, 0.0, -r, 0.0, 0.0, -1.0, 4.0, scale, False)
        assert got == pytest.approx(expected)
        assert range_factor(0.0, 0.0, -r, 0.0, 0.0, -1.0, 4.0, scale, True) == pytest.approx(1 - expected)
    assert range_factor(0.0, 0.0, 1.0, 0.0, 0.0, -1.0, 4.0, 1.0, False) == 0  # behind
    assert range_factor(0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 4.0, 1.0, False) == 0  # on the spot


@pytest.mark.parametrize("bound", ["quad", "mesh"])
def test_bounds_on_the_screen_need_its_map(corner, bound):
    receivers, lights, _ = corner
    with pytest.raises(InputError, match=f"projection: expected the camera's map for the bound '{bound}'"):
        splat(receivers, lights, of(SiiSettings, cut_share=0.05, bound=bound))


def test_nothing_to_light_or_to_light_with():
    receivers, lights = sets.room(np.random.default_rng(8), 5)
    none = sets.PixelLights(*(part[:, :0] for part in lights[:3]), None, None, None, 0)
    dark = receivers._replace(covered=np.zeros((1, 5), bool))
    for how in (CUT, SiiSettings(), of(SiiSettings, cut_share=0.05, stochastic=True)):
        assert not splat(receivers, none, how).any()
        assert not splat(dark, lights, how).any()
        assert fragments(receivers, none, how).total == 0
        assert fragments(dark, lights, how).total == 0
