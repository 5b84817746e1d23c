"""Eq. 3: flux of Phong lobes over spheres, norms, the clamp to the surface, widening."""

import itertools
import math

import numpy as np
import pytest

from refgi.jit import threads
from refgi.literal import pairs as literal
from refgi.pairs.lobe_sum import add_lobes
from refgi.pairs.pixel_lights import (
    CLAMPED,
    FULL_LOBE,
    NO_NORM,
    Range,
    lobe_norm_factor,
    pack_clamp,
    pack_lobes,
    pack_widening,
)
from refgi.pairs.ranged_sum import LANES
from refgi.settings import of
from refgi.splat import PairSettings, Receivers, irradiance
from tests.naive.radiometry import lobe_fraction
from tests.pairs import sets

EXPONENTS = (0.0, 0.37, 1.0, 2.0, 10.0, 100.0, 1e4, 1e6)
TILTS = (0.0, 30.0, 60.0, 75.0, 85.0, 90.0)
FLUX = 1e-9  # the quadrature over a sphere, converged
# float32: 1 - r.w keeps 7 digits of a lobe's shape, the tilt of float32 axes moves its edge
SINGLE = 2e-4


def axis_at(degrees):
    tilt = math.radians(degrees)
    return np.array([[math.sin(tilt)], [0.0], [math.cos(tilt)]])


def sphere_around(axis, exponent, degrees, nodes=150):
    """Return directions and solid-angle weights that integrate a lobe cut off by the surface z > 0.

    Around the axis at angle a, with the arc above the surface apart from the arc below; a by pieces that end where
    the surface cuts in, and spread to the lobe's width.
    """
    x, w = np.polynomial.legendre.leggauss(nodes)
    edge = math.pi / 2 - math.radians(degrees)
    width = min(math.pi / 2, 12 / math.sqrt(exponent + 1))  # beyond it less than e^-70 is left
    ends = sorted({0.0, width, math.pi / 2} | ({edge} if 0 < edge < math.pi / 2 else set()))
    tilt = math.radians(degrees)
    turn = math.pi * (x + 1) / 2  # a = low .. high with all derivatives tame at the ends
    a = np.concatenate([low + (high - low) * (1 - np.cos(turn)) / 2 for low, high in itertools.pairwise(ends)])
    da = np.concatenate([(high - low) / 2 * np.sin(turn) * w * math.pi / 2 for low, high in itertools.pairwise(ends)])
    ratio = -math.cos(tilt) * np.cos(a) / np.maximum(math.sin(tilt) * np.sin(a), 1e-300)
    above = np.arccos(np.clip(ratio, -1, 1))  # half the arc above the surface
    tangent = np.array([[-math.cos(tilt)], [0], [math.sin(tilt)]])
    # the lobe is constant on each arc: its middle stands for it
    directions = [axis * np.cos(a) + side * tangent * np.sin(a) for side in (1, -1)]
    weights = [da * np.sin(a) * 2 * half for half in (above, math.pi - above)]
    return np.concatenate(directions, axis=1), np.concatenate(weights)


def flux_through(radius, exponent, degrees, real=np.float64, **settings):
    axis = axis_at(degrees)
    directions, weights = sphere_around(axis, exponent, degrees)
    light = sets.glossy(np.zeros((3, 1)), np.array([[0.0], [0], [1]]), axis, exponent, real=real)
    got = irradiance(sets.receivers(radius * directions, -directions, real), light, of(PairSettings, **settings))
    return radius**2 * float((got[0, 0].astype(np.float64) * weights).sum())


@pytest.mark.feature("SII-05")
def test_flux_of_every_lobe_is_phi(evidence):
    worst = max(abs(flux_through(2.0, p, t) - 1) for p in EXPONENTS for t in TILTS)
    assert worst < FLUX
    single = max(abs(flux_through(2.0, p, t, np.float32) - 1) for p in EXPONENTS for t in TILTS)
    assert single < SINGLE
    evidence(f"flux = Phi for P = 0 .. 1e6 and tilts 0 .. 90 deg: to {worst:.1e}, in float32 to {single:.1e}")


@pytest.mark.feature("SII-05")
@pytest.mark.feature("SII-06")
def test_other_norms_lose_what_they_should(evidence):
    for p in (0.0, 1.0, 10.0, 100.0):
        for t in TILTS:
            above = lobe_fraction(math.radians(t), p)
            assert flux_through(1.0, p, t, lobe_norm="full_lobe") == pytest.approx(above, rel=1e-7)
            printed = flux_through(1.0, p, t, lobe_norm="none")
            assert printed == pytest.approx(2 * math.pi * above / (p + 1), rel=1e-7)
    evidence("full_lobe keeps K of the flux, none 2 pi K / (P + 1): 24 cases to 1e-7")


@pytest.mark.feature("SII-05")
def test_exponent_one_on_the_normal_is_the_diffuse_light(evidence):
    rng = np.random.default_rng(1)
    receivers, lights = sets.room(rng, 200)
    shiny = sets.glossy(lights.position, lights.normal, lights.normal, 1.0)._replace(lobe_flux=lights.flux)
    diffuse = irradiance(receivers, lights, PairSettings())
    error = np.abs(irradiance(receivers, shiny, PairSettings()) - diffuse).max() / diffuse.mean()
    assert error < 1e-12
    evidence(f"P = 1, axis = normal: diffuse light to {error:.1e} of the mean")


@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.feature("SII-05")
def test_sum_is_that_of_the_twin(real, evidence):
    rng = np.random.default_rng(2)
    receivers, lights = sets.room(rng, 25)
    axis = sets.random_directions(rng, 25)
    axis *= np.sign((axis * lights.normal).sum(axis=0))
    worst = 0.0
    for exponent in (0.5, 7.0, 300.0):
        shiny = sets.glossy(lights.position, lights.normal, axis, exponent, real=real)
        single = Receivers(*(part.astype(real) for part in receivers[:2]), receivers.covered)
        got = irradiance(single, shiny, PairSettings())[0, 0]
        expected = literal.irradiance(*receivers[:2], np.zeros((1, 25)), lights.position, lights.normal,
                                      np.zeros((3, 25)), np.ones((3, 25)), axis, np.full(25, exponent))[0, 0]
        worst = max(worst, np.abs(got - expected).max() / np.mean(expected))
    assert worst < (1e-4 if real is np.float32 else 1e-9)  # twin's K by quadrature; float32 as SINGLE
    evidence(f"{np.dtype(real).name}: max error against the literal sum {worst:.1e} of its mean")


@pytest.mark.feature("SII-06")
def test_nothing_leaves_below_the_surface(evidence):
    rng = np.random.default_rng(3)
    directions = sets.random_directions(rng, 3000)
    light = sets.glossy(np.zeros((3, 1)), np.array([[0.0], [0], [1]]), axis_at(85.0), 3.0)
    got = irradiance(sets.receivers(directions, -directions), light, PairSettings())[0, 0]
    assert not got[directions[2] <= 0].any()
    assert (got[(directions[2] > 0) & (directions[0] > 0.1)] > 0).all()
    evidence(f"{(directions[2] <= 0).sum()} receivers below the surface of a lobe at 85 deg: 0")


@pytest.mark.parametrize("norm", [NO_NORM, FULL_LOBE, CLAMPED])
def test_norm_factor_keeps_float32(norm):
    got = lobe_norm_factor(np.float32(0.5), np.float32(12.0), norm)
    assert got == pytest.approx(lobe_norm_factor(0.5, 12.0, norm), rel=3e-7)
    single = [s for s in lobe_norm_factor.nopython_signatures if [str(arg) for arg in s.args[:2]] == ["float32"] * 2]
    assert {str(s.return_type) for s in single} == {"float32"}


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_exponents_up_to_a_million_stay_finite(real):
    rng = np.random.default_rng(4)
    receivers, lights = sets.room(rng, 300, real)
    receivers.position[:, 0, :50] = lights.position[:, :50]  # coincident ones among them
    for exponent in (0.0, 1e-3, 1.0, 1e3, 1e6):
        shiny = sets.glossy(lights.position, lights.normal, lights.normal, exponent, real=real)
        for widening in (0.0, 0.5):
            got = irradiance(receivers, shiny, of(PairSettings, widening=widening))
            assert np.isfinite(got).all()
            assert (got >= 0).all()


@pytest.mark.feature("SII-07")
def test_widened_lobes_keep_their_flux_on_every_sphere(evidence):
    """P' = P min(1, r / a), so on the sphere of radius r the lobe is that of P' with the norm of P'."""
    worst, a = 0.0, 0.8
    for t in (0.0, 60.0, 85.0):
        for p in (1.0, 20.0, 1000.0):
            for radius in (1e-6, 0.1, 0.4, 0.79, 0.8, 3.0):
                axis, here = axis_at(t), p * min(1.0, radius / a)
                directions, weights = sphere_around(axis, here, t)
                light = sets.glossy(np.zeros((3, 1)), np.array([[0.0], [0], [1]]), axis, p)
                got = irradiance(sets.receivers(radius * directions, -directions), light, of(PairSettings, widening=a))
                worst = max(worst, abs(radius**2 * float((got[0, 0] * weights).sum()) - 1))
    assert worst < 1e-8
    evidence(f"flux on spheres r = 1e-6 a .. 4 a, P = 1 .. 1000: Phi to {worst:.1e}")


@pytest.mark.feature("SII-07")
def test_widened_exponent_is_whole_at_a_and_zero_at_the_light(evidence):
    axis, a = axis_at(40.0), 0.5
    light = sets.glossy(np.zeros((3, 1)), np.array([[0.0], [0], [1]]), axis, 30.0)
    directions = sets.random_directions(np.random.default_rng(5), 400)
    directions = directions[:, (directions[2] > 0) & ((axis * directions).sum(axis=0) > 0)]
    for radius in (a, 2 * a):
        where = sets.receivers(radius * directions, -directions)
        plain, widened = (irradiance(where, light, of(PairSettings, widening=w)) for w in (0.0, a))
        np.testing.assert_allclose(widened, plain, rtol=1e-13)
    near = irradiance(sets.receivers(1e-9 * directions, -directions), light, of(PairSettings, widening=a))[0, 0] * 1e-18
    flat = 1 / (2 * math.pi * lobe_fraction(math.radians(40.0), 0.0))
    np.testing.assert_allclose(near, flat, rtol=1e-5)
    evidence("P'(a) = P; r^2 E at r = 2e-9 a is that of P' = 0 in all directions to 1e-5")


@pytest.mark.feature("SII-07")
def test_widening_tames_the_spike_at_a_wall(evidence):
    """A glossy light next to a wall it grazes: the largest irradiance falls by the widening and stays finite."""
    z = np.geomspace(1e-4, 1, 400)
    wall = np.stack([np.full_like(z, 0.02), np.zeros_like(z), z])
    light = sets.glossy(np.zeros((3, 1)), np.array([[0.0], [0], [1]]), sets.unit(np.array([[1.0], [0], [0.1]])), 500.0)
    receivers = sets.receivers(wall, np.tile([[-1.0], [0], [0]], 400))
    peaks = {a: irradiance(receivers, light, of(PairSettings, widening=a))[0].max() for a in (0.0, 0.1, 0.5, 2.0)}
    assert all(np.isfinite(peak) for peak in peaks.values())
    assert peaks[0.0] > peaks[0.1] > peaks[0.5] > peaks[2.0]
    evidence("peak near the wall for a = 0, 0.1, 0.5, 2 m: " + ", ".join(f"{p:.0f}" for p in peaks.values()))


@pytest.mark.feature("SII-07")
def test_published_widenings_by_their_own_formula(evidence):
    axis, a, p = axis_at(20.0), 0.7, 12.0
    light = sets.glossy(np.zeros((3, 1)), np.array([[0.0], [0], [1]]), axis, p)
    c = (p + 1) / (2 * math.pi * lobe_fraction(math.radians(20.0), p))
    shares = {"sii_widening_unnorm": lambda r: min(1, r / a), "sii_widening": lambda r: min(1, 1 / r / a)}
    for switch, share in shares.items():
        for radius in (0.1, 0.5, 1.0, 1.6, 4.0):
            w = sets.unit(np.array([[0.1], [0.2], [1.0]]))
            got = irradiance(sets.receivers(radius * w, -w), light,
                             of(PairSettings, widening=a, as_published=frozenset({switch})))
            expected = c * float((axis * w).sum()) ** (p * share(radius)) / radius**2
            assert got[0, 0, 0] == pytest.approx(expected, rel=1e-9)
    evidence("P' = P min(1, r/a) and min(P, P/(r a)) without renormalisation, five distances each, to 1e-9")


@pytest.mark.feature("REF-05")
def test_linear_in_flux_and_scale_to_the_bit(evidence):
    rng = np.random.default_rng(6)
    receivers, lights = sets.room(rng, 100, np.float32)
    shiny = sets.glossy(lights.position, lights.normal, lights.normal, 9.0, real=np.float32)
    once = irradiance(receivers, shiny, PairSettings())
    np.testing.assert_array_equal(irradiance(receivers, shiny._replace(lobe_flux=shiny.lobe_flux * 2), PairSettings()),
                                  2 * once)
    far = irradiance(receivers._replace(position=receivers.position * 2), shiny._replace(position=shiny.position * 2),
                     PairSettings())
    np.testing.assert_array_equal(far, once / 4)
    evidence("lobes: twice the flux is twice E, twice the lengths a quarter of E, to the bit")


@pytest.mark.parametrize("widening", [0.0, 0.6])
@pytest.mark.feature("REF-19")
def test_same_bits_for_any_threads_and_tiles(widening, evidence):
    rng = np.random.default_rng(7)
    receivers, lights = sets.room(rng, 700, np.float32)
    both = lights._replace(lobe_flux=lights.flux, lobe_axis=lights.normal,
                           lobe_exponent=rng.uniform(0, 50, 700).astype(np.float32))
    how = of(PairSettings, widening=widening)
    whole = irradiance(receivers, both, how)
    with threads(1):
        np.testing.assert_array_equal(irradiance(receivers, both, how), whole)
    sides = [irradiance(Receivers(*(np.ascontiguousarray(part[..., side]) for part in receivers)), both, how)
             for side in (np.s_[:333], np.s_[333:])]
    np.testing.assert_array_equal(np.concatenate(sides, axis=-1), whole)
    evidence(f"diffuse and lobes, a = {widening}: equal bits for 1 and 2 threads and a cut")


@pytest.mark.feature("REF-20")
def test_the_switch_without_pi_is_pi_times_the_default(evidence):
    receivers, lights = sets.room(np.random.default_rng(8), 100)
    plain = irradiance(receivers, lights, PairSettings())
    printed = irradiance(receivers, lights, of(PairSettings, as_published=frozenset({"sii_no_pi"})))
    ratio = printed.sum() / plain.sum()
    assert ratio == pytest.approx(math.pi, rel=1e-13)
    evidence(f"sii_no_pi: image ratio {ratio:.6f}")


def test_black_lobes_run_no_lobe_code_and_change_nothing():
    receivers, lights = sets.room(np.random.default_rng(9), 50)
    dark = lights._replace(lobe_flux=np.zeros((3, 50)), lobe_axis=np.zeros((3, 50)), lobe_exponent=np.zeros(50))
    np.testing.assert_array_equal(irradiance(receivers, dark, PairSettings()),
                                  irradiance(receivers, lights, PairSettings()))


def wall_and_lobes(real, count=300, side=64):
    """Return a wall of side^2 receivers, block by block of 8 x 8 in 16 x 16, and sharp and blunt lobes above it."""
    rng = np.random.default_rng(10)
    index = np.arange(side * side).reshape(side // 16, 2, 8, side // 16, 2, 8).transpose(0, 3, 1, 4, 2, 5).reshape(-1)
    across = (np.arange(side) + 0.5) / side
    x, y = (part.reshape(-1)[index] for part in np.meshgrid(across, across))
    facing = np.zeros((3, side * side))
    facing[2] = 1
    wall = sets.receivers(np.stack([x, y, 0.05 * np.sin(9 * x)]), facing, real)
    place = np.concatenate([rng.uniform(-0.2, 1.2, (2, count)), rng.uniform(0.05, 0.6, (1, count))])
    axis = sets.unit(np.concatenate([rng.normal(0, 0.6, (2, count)), np.full((1, count), -1.0)]))
    normal = sets.unit(axis + 0.3 * sets.random_directions(rng, count))
    lights = sets.glossy(place, normal, axis, 1.0, real=real)
    return wall, lights._replace(lobe_exponent=(10 ** rng.uniform(-2, 6, count)).astype(real),
                                 lobe_flux=rng.random((3, count)).astype(real))


def sum_of(wall, lights, reach=None, order=None, **how):
    """Call the kernel on receivers in a given order and put the result back into theirs; ranges come with lists."""
    settings, every = of(PairSettings, **how), np.ones(lights.position.shape[1], bool)
    real = wall.position.dtype
    order = np.arange(wall.position.shape[2]) if order is None else order
    listed = None if reach is None else np.ones((-(-len(order) // LANES), len(every)), bool)
    position, normal = (np.ascontiguousarray(part[:, 0, order]) for part in wall[:2])
    got = np.zeros_like(position)
    add_lobes(position, normal, pack_lobes(lights, settings, real, every),
              pack_clamp(settings, None, every, len(every), real), pack_widening(lights, settings, real, every), reach,
              listed, got)
    back = np.empty_like(got)
    back[:, order] = got
    return back


def some_range(lights, real, outside=False, stochastic=False):
    """Return thresholds that cut most of each lobe."""
    rng, count = np.random.default_rng(11), lights.position.shape[1]
    square = (10 ** rng.uniform(-2, 2, count)).astype(real)
    scale = (1 - rng.random(count) if stochastic else np.ones(count)).astype(real)
    return Range(square, scale, outside)


@pytest.mark.slow("5.0-float64")
@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.parametrize("widening", [0.0, 5.0])  # 5 m: all lobes are much blunter than their exponent
@pytest.mark.feature("SII-18")
def test_lights_and_parts_passed_over_change_no_bit(real, widening, evidence):
    """Receivers of a tile lie together or, shuffled, all over the wall, where no light can be passed over."""
    wall, lights = wall_and_lobes(real)
    shuffled = np.random.default_rng(12).permutation(wall.position.shape[2])
    for reach in (None, some_range(lights, real), some_range(lights, real, stochastic=True)):
        together, apart = (sum_of(wall, lights, reach, order, widening=widening) for order in (None, shuffled))
        np.testing.assert_array_equal(together, apart)
        assert (together > 0).any()
    evidence(f"{np.dtype(real).name}, a = {widening}: tiles of 16 x 16 or of scattered pixels, equal bits, with and "
             "without a range")


@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.feature("SII-18")
def test_the_range_keeps_the_pairs_with_b_above_the_threshold(real, evidence):
    """Procedure P3, pair by pair in float64: inside where R_0^2 (r . w)^P >= xi r^2, there times max(1, I_low / B)."""
    wall, lights = wall_and_lobes(real, count=40, side=32)
    for stochastic in (False, True):
        reach = some_range(lights, real, stochastic=stochastic)
        d = wall.position[:, 0, :, None].astype(float) - lights.position[:, None].astype(float)
        r = np.sqrt((d**2).sum(axis=0))
        w = d / r
        cosine = (lights.lobe_axis[:, None] * w).sum(axis=0)
        above = ((lights.normal[:, None] * w).sum(axis=0) > 0) & (cosine > 0)
        shape = np.where(above, np.maximum(cosine, 0) ** lights.lobe_exponent, 0)
        b = reach.square * shape / r**2
        factor = np.where(b >= reach.scale, np.maximum(1, 1 / np.maximum(b, 1e-300)), 0)
        term = shape * np.maximum(0, -w[2]) / r**2
        sharp = lights.lobe_exponent * np.finfo(real).eps * 1e3 > 0.1  # lobes that this naive cosine cannot follow
        doubtful = (np.abs(b / reach.scale - 1) < 1e-3).any(axis=1)  # receivers that rounding may decide
        weak = lights._replace(lobe_flux=lights.lobe_flux * ~sharp)
        got = sum_of(wall, weak, reach, lobe_norm="none")
        np.testing.assert_allclose(got[:, ~doubtful], (weak.lobe_flux @ (term * factor).T)[:, ~doubtful], rtol=2e-3)
        assert (factor > 0).mean() < 0.5
        assert doubtful.mean() < 0.5
    evidence(f"{np.dtype(real).name}: sums over pairs with B >= xi I_low are those of the naive twin, with xi too")


@pytest.mark.parametrize("stochastic", [False, True])
@pytest.mark.feature("SII-21")
def test_what_is_kept_and_what_is_cut_is_all(stochastic, evidence):
    wall, lights = wall_and_lobes(np.float64)
    kept, cut = (sum_of(wall, lights, some_range(lights, np.float64, outside, stochastic)) for outside in (False, True))
    whole = sum_of(wall, lights)
    error = np.abs(kept + cut - whole).max() / np.abs(whole).max()
    assert error < 1e-14
    assert stochastic or (cut >= 0).all()
    assert np.abs(cut).sum() / whole.sum() > 0.01
    evidence(f"xi {'drawn' if stochastic else '1'}: kept + cut = all to {error:.0e}; cut {cut.sum() / whole.sum():.1%}")
