"""Importance maps: their formula, the floor under 1 - openness, and defensive sampling."""

import math

import hypothesis
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from refgi.errors import InputError
from refgi.lights import Warp, choose_pixel_lights, importance
from refgi.rsm import reflective_shadow_map
from refgi.scene import Material, SpotLight, load_scene, material_table
from tests.naive import warp as naive
from tests.rsm.shapes import sphere

ROUNDING = 1e-12
STANDARD_ERRORS = 4.0  # of a mean: one in 16,000 means of unbiased estimates is farther off
GLOSSY = Material(diffuse=(0.1, 0.5, 0.2), specular=(0.3, 0.1, 0.5), exponent=20.0)


def box_map(resolution=32):
    box = load_scene("cornell_box")
    return reflective_shadow_map(box.geometry, material_table(box.materials, np.float64), box.lights[0], resolution,
                                 np.float64)  # fmt: skip


def glossy_map():
    light = SpotLight((0, 0, 0), (0, -1, 0), 0.4, 0.8, (1, 1, 1))
    return reflective_shadow_map(sphere(10, 2.0), material_table([GLOSSY], np.float64), light, 16, np.float64)


def with_flux(flux):
    """A map of equal channels of flux."""
    flux = np.asarray(flux, np.float64)
    rsm = box_map(flux.shape[0])
    return rsm._replace(flux=np.stack([flux] * 3))


@pytest.mark.feature("SII-14")
def test_it_is_the_largest_channel_of_flux_times_lobe_peak_times_hidden_share(evidence):
    rsm = glossy_map()
    openness = np.random.default_rng(0).random(rsm.depth.shape)
    openness[0] = 1.0
    for kind in ("flux", "peak", "openness"):
        got = importance(rsm, kind, openness if kind == "openness" else None, floor=0.1)
        for row in range(16):
            for column in range(16):
                peak = 1.0 if kind == "flux" else (rsm.lobe_exponent[row, column] + 1) / 2
                expected = max(float(rsm.flux[c, row, column]) + peak * float(rsm.lobe_flux[c, row, column])
                               for c in range(3))  # fmt: skip
                if kind == "openness":
                    expected *= max(0.1, 1 - openness[row, column])
                assert got[row, column] == pytest.approx(expected, rel=ROUNDING)
    evidence("lobe of P = 20 beside a diffuse part: Phi_d + 10.5 Phi_l, its largest channel, times max(eps, 1 - O)")


@pytest.mark.feature("SII-14")
@pytest.mark.parametrize("kind", ["flux", "peak", "openness"])
def test_as_printed_a_lobe_counts_by_its_exponent(kind):
    """Oracle: p = Phi (1 - O) P; the flux alone knows no lobes."""
    rsm = glossy_map()
    openness = np.random.default_rng(0).random(rsm.depth.shape)
    got = importance(rsm, kind, openness if kind == "openness" else None, as_printed=True)
    weight = 1.0 if kind == "flux" else rsm.lobe_exponent
    expected = (rsm.flux + weight * rsm.lobe_flux).max(axis=0)
    hidden = np.maximum(0.05, 1 - openness) if kind == "openness" else 1.0
    np.testing.assert_allclose(got, expected * hidden, rtol=ROUNDING)


@pytest.mark.feature("SII-14")
def test_it_is_zero_only_where_the_flux_is():
    for rsm in (box_map(), glossy_map()):
        lit = rsm.flux.any(axis=0) if rsm.lobe_flux is None else rsm.flux.any(axis=0) | rsm.lobe_flux.any(axis=0)
        for kind in ("flux", "peak", "openness"):
            worth = importance(rsm, kind, np.ones(rsm.depth.shape) if kind == "openness" else None)
            np.testing.assert_array_equal(worth > 0, lit)
        assert (importance(rsm, defensive=0.1) > 0).all()


@pytest.mark.feature("SII-14")
def test_without_the_floor_flux_in_the_open_is_lost_and_with_it_is_not(evidence):
    """E-SII-09: with 43.2 % of the flux at O = 1 the estimate without floor is 0.568 of the truth."""
    flux = np.random.default_rng(1).random((16, 16)) + 0.2
    open_part = np.zeros((16, 16), bool)
    open_part[:, 9:] = True
    flux[open_part] *= 0.432 / 0.568 * flux[~open_part].sum() / flux[open_part].sum()
    rsm = with_flux(flux)
    openness = np.where(open_part, 1.0, 0.3)
    means = {}
    for floor in (0.0, 0.05):
        worth = importance(rsm, "openness", openness, floor)
        sums = [choose_pixel_lights([rsm], count=64, pattern="random", seed=seed, warp=Warp("A", 4),
                                    importance=[worth]).flux[0].sum() / flux.sum() for seed in range(1, 400)]
        means[floor] = np.mean(sums), np.std(sums, ddof=1) / math.sqrt(len(sums))
    assert means[0.0][0] == pytest.approx(0.568, rel=ROUNDING)  # at full depth without variance
    assert abs(means[0.05][0] - 1) < STANDARD_ERRORS * means[0.05][1]
    evidence(f"43.2 % of the flux at O = 1: {means[0.0][0]:.3f} of it without floor, "
             f"{means[0.05][0]:.3f} +- {means[0.05][1]:.3f} with 0.05")


@pytest.mark.feature("REF-13")
@hypothesis.settings(max_examples=30)
@given(st.integers(0, 10_000), st.floats(0.05, 1.0), st.integers(1, 3))
def test_second_moments_are_never_above_those_of_uniform_samples_over_the_share(seed, beta, levels):
    """For any f: E[(w Phi f)^2] <= 1/beta of the uniform one, since q >= beta / T at every level (method A)."""
    rng = np.random.default_rng(seed)
    flux = rng.random((8, 8)) ** 6 * (rng.random((8, 8)) < 0.6)
    worth = importance(with_flux(flux), defensive=beta)
    q = np.array(naive.probabilities(worth.tolist(), levels, "A"))
    assert q.sum() == pytest.approx(1, rel=ROUNDING)
    assert (q * 64 >= beta * (1 - ROUNDING)).all()
    values = flux * rng.random((8, 8)) ** 4
    assert (values**2 / q).sum() <= 64 * (values**2).sum() / beta * (1 + ROUNDING)


@pytest.mark.feature("REF-13")
def test_a_defensive_share_bounds_the_variance_of_what_the_importance_misses(evidence):
    """What counts sits where the importance is 1e-4: plain warping is far worse than uniform, a share is not.

    E[X^2] <= 1/beta of the uniform one gives Var <= Var_u / beta + (1/beta - 1) mean^2, and no better: were X constant
    under uniform samples, Var_u would be 0.
    """
    rng = np.random.default_rng(3)
    flux = np.where(np.arange(32)[:, None] < 24, 1.0, 1e-4) * (0.5 + rng.random((32, 32)))
    rsm = with_flux(flux)
    seen = np.where(flux < 0.1, 1e4, 0.0)  # receivers see the dim part alone, from nearby
    uniform = naive.variance_of_one((flux * seen).tolist(), np.full((32, 32), 1 / 1024).tolist())
    ratios, bounds = [], []
    for beta in (0.0, 0.05, 0.2, 0.5):
        worth = importance(rsm, defensive=beta)
        ratio = []
        for levels in (2, 5):
            q = naive.probabilities(worth.tolist(), levels, "A")
            ratio.append(naive.variance_of_one((flux * seen).tolist(), q) / uniform)
        lights = [choose_pixel_lights([rsm], count=256, pattern="random", seed=seed, warp=Warp("A", 5),
                                      importance=[worth]) for seed in range(60)]
        sums = [(one.flux[0] * seen.reshape(-1)[one.texel]).sum() for one in lights]
        if beta:
            bound = 1 / beta + (1 / beta - 1) * (flux * seen).sum() ** 2 / uniform
            assert max(ratio) <= bound
            bounds.append(f"{bound:.3g}")
            z = (np.mean(sums) - (flux * seen).sum()) / (np.std(sums, ddof=1) / math.sqrt(len(sums)))
            assert abs(z) < STANDARD_ERRORS
        ratios.append(f"{ratio[1]:.3g}")
    assert float(ratios[0]) > 100
    evidence(f"variance over uniform's for beta 0, 0.05, 0.2, 0.5: {', '.join(ratios)}; "
             f"bounds -, {', '.join(bounds)}")


@pytest.mark.feature("REF-13")
def test_a_defensive_share_keeps_the_support_without_a_floor(evidence):
    rsm = with_flux(np.ones((8, 8)))
    openness = np.zeros((8, 8))
    openness[4:] = 1.0
    for beta, expected in ((0.0, 0.5), (0.1, 1.0)):
        worth = importance(rsm, "openness", openness, floor=0.0, defensive=beta)
        sums = [choose_pixel_lights([rsm], count=100, pattern="halton", seed=seed, warp=Warp("A", 3),
                                    importance=[worth]).flux[0].sum() / 64 for seed in range(1, 200)]
        assert np.mean(sums) == pytest.approx(expected, abs=0.01)  # its standard error is 0.002
    evidence("half of the flux at O = 1, no floor: 0.5 of it found, all of it with beta = 0.1")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"kind": "power"}, "kind: expected flux or peak or openness, got 'power'"),
        ({"kind": "openness"}, r"openness: expected shape \(32, 32\) for the kind 'openness', got None"),
        ({"kind": "openness", "openness": np.ones((3, 3))}, r"openness: expected shape \(32, 32\)"),
        ({"kind": "openness", "openness": np.full((32, 32), 1.5)}, "openness: expected numbers from 0 to 1"),
        ({"kind": "openness", "openness": np.full((32, 32), np.nan)}, "openness: expected numbers from 0 to 1"),
        ({"floor": -0.1}, "floor: expected 0 to 1, got -0.1"),
        ({"defensive": 1.1}, "defensive: expected 0 to 1, got 1.1"),
    ],
)
def test_errors_name_what_is_wrong(options, message):
    with pytest.raises(InputError, match=message):
        importance(box_map(), **options)
