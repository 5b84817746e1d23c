"""Phong lobes against 60 digits and the incomplete beta function, up to the sharpest that a scene may have."""

import math
from decimal import Decimal, localcontext
from pathlib import Path

import numpy as np
import pytest
from scipy.special import betainc, betaincc

import refgi
from refgi.radiometry import inverse_fraction, lobe_direction, lobe_fraction, lobe_gap, lobe_norm, lobe_power
from refgi.scene.material import SHARPEST

EXPONENTS = [0.0, 0.5, 1.0, 7.0, 100.0, 1e4, 1e6, 1e8, 1e12, 1e16, SHARPEST]
ULP = 2.0**-53
FRACTION = 1e-11  # of K: its asymptotic form begins at P = 1e6, off by less than 1e-12
SINGLE = 2.0**-24


def literal_power(r, w, exponent):
    """<r.w>^P of the given doubles, as exact numbers: r and w are normalised in 60 digits."""
    with localcontext() as context:
        context.prec = 60
        r, w = [Decimal(float(c)) for c in r], [Decimal(float(c)) for c in w]
        cosine = sum(a * b for a, b in zip(r, w, strict=True)) / (sum(a * a for a in r) * sum(b * b for b in w)).sqrt()
        return 0.0 if cosine <= 0 else float((Decimal(exponent) * cosine.ln()).exp())


def pair(random, angle):
    """A random unit vector and one at an angle from it, of no particular length."""
    r = random.normal(size=3)
    r /= np.linalg.norm(r)
    across = np.cross(r, random.normal(size=3))
    across /= np.linalg.norm(across)
    return r, (math.cos(angle) * r + math.sin(angle) * across) * random.uniform(0.5, 2)


@pytest.mark.parametrize("exponent", EXPONENTS)
def test_the_power_against_sixty_digits(exponent, evidence):
    random, worst = np.random.default_rng(5), 0.0
    width = 1 / math.sqrt(exponent + 1)
    for angle in (0.0, *(width * np.array([0.01, 0.1, 0.5, 1, 2, 4])), 0.3, 1.2):
        r, w = pair(random, angle)
        got, expected = lobe_power(lobe_gap(*r, *w), exponent), literal_power(r, w, exponent)
        # r and w are off by some roundings each, which move h by the angle times that; h itself is rounded
        bound = ULP * (20 + exponent * (8 * angle + 8 * ULP) + 20 * exponent * angle**2)
        assert abs(got - expected) <= min(1.0, expected * math.expm1(min(bound, 700)) + 1e-300)
        worst = max(worst, abs(got - expected))
    evidence(f"P = {exponent:g}: within {worst:.1e} of the peak")


def test_the_power_in_float32_keeps_its_type_and_is_good_to_an_exponent_of_a_million():
    random = np.random.default_rng(6)
    for exponent in (1.0, 50.0, 1e4, 1e6):
        for angle in np.array([0.0, 0.3, 1.0, 2.0]) / math.sqrt(exponent + 1):
            r, w = (v.astype(np.float32) for v in pair(random, angle))
            got = lobe_power(lobe_gap(*r, *w), np.float32(exponent))
            assert type(got) is float or got.dtype == np.float32
            bound = SINGLE * (20 + exponent * (8 * angle + 8 * SINGLE) + 20 * exponent * angle**2)
            assert abs(got - literal_power(r, w, exponent)) < math.expm1(bound)


def test_a_right_angle_and_beyond_get_nothing():
    for exponent in (0.0, 1.0, SHARPEST):
        assert lobe_power(1.0, exponent) == 0
        assert lobe_power(1.7, exponent) == 0
        assert lobe_power(0.0, exponent) == 1


@pytest.mark.parametrize("exponent", EXPONENTS)
def test_the_norm_is_that_of_the_part_above_the_surface(exponent):
    for tilt in (-0.7, *(np.array([-6.0, -3, -1, -0.1, 0, 0.2, 1, 3]) / math.sqrt(exponent + 1)), 0.8, 1.0):
        cosine = float(np.clip(tilt, -1, 1))
        half = (exponent + 1) / 2
        # on either side by the form that keeps its digits; both equal I(cos^2; 1/2, (P + 1) / 2)
        above = 0.5 * (betaincc if cosine < 0 else betainc)(0.5, half, cosine**2) + (0.0 if cosine < 0 else 0.5)
        if above < 1e-12:
            assert lobe_norm(cosine, exponent) == inverse_fraction(cosine, exponent) == 0
        elif above > 1e-6:
            assert lobe_norm(cosine, exponent) == pytest.approx((exponent + 1) / (2 * math.pi * above), rel=1e-9)
            assert inverse_fraction(cosine, exponent) == pytest.approx(1 / above, rel=1e-9)
        assert np.isfinite(lobe_norm(cosine, exponent))


def test_the_two_forms_of_the_fraction_meet():
    for cosine in np.r_[0.0, np.geomspace(1e-6, 1, 30)]:
        for side in (-1.0, 1.0):
            below, above = lobe_fraction(side * cosine, 1e6 * (1 - 1e-9)), lobe_fraction(side * cosine, 1e6)
            # K moves by at most 0.25 of the relative change of the exponent
            assert below == pytest.approx(above, abs=FRACTION + 0.25e-9)


@pytest.mark.parametrize("exponent", EXPONENTS[1:])
@pytest.mark.parametrize("stretch", [0.0, 1e-7, -1e-7])
def test_a_lobe_sends_its_flux_whatever_the_length_of_directions_rounds_to(exponent, stretch, evidence):
    """Midpoint rule over q = (1 - h)^(P + 1), of which equal steps hold equal flux; the rest is the kernel's value."""
    random, steps = np.random.default_rng(7), 400
    flux = 0.0
    for k in range(steps):
        q = (k + 0.5) / steps
        gap = -math.expm1(math.log(q) / (exponent + 1))
        r, w = pair(random, 2 * math.asin(math.sqrt(gap / 2)))
        value = lobe_norm(1.0, exponent) * lobe_power(lobe_gap(*r, *(w * (1 + stretch))), exponent)
        flux += value * 2 * math.pi / (exponent + 1) / (q / (1 - gap)) / steps
    # vectors of 53 bits: an angle of 1e-10 has 6 digits, and errors of both signs average
    assert flux == pytest.approx(1, abs=2e-5)
    evidence(f"P = {exponent:g}: flux {flux:.7f} of 1")


@pytest.mark.parametrize("exponent", EXPONENTS)
def test_sampled_directions_have_the_density_of_the_lobe(exponent):
    random = np.random.default_rng(8)
    count = 4000
    u, v = random.random(count), random.random(count)
    drawn = np.array([lobe_direction(a, b, exponent) for a, b in zip(u, v, strict=True)])
    assert np.linalg.norm(drawn, axis=1) == pytest.approx(1, abs=4 * ULP)
    across = np.hypot(drawn[:, 0], drawn[:, 1])
    share = -np.expm1((exponent + 1) / 2 * np.log1p(-np.minimum(across**2, 1)))  # flux within the angle; uniform
    np.testing.assert_allclose(1 - share, u, rtol=1e-6, atol=1e-6)
    for moment in (1, 2):
        assert (share**moment).mean() == pytest.approx(1 / (moment + 1), abs=4 / math.sqrt(12 * count))
    assert np.abs(np.exp(1j * np.arctan2(drawn[:, 1], drawn[:, 0])).mean()) < 4 / math.sqrt(count)


def test_nobody_else_norms_a_lobe():
    home = Path(refgi.__file__).parent
    users = {str(p.relative_to(home)) for p in home.rglob("*.py") if "lobe_fraction" in p.read_text(encoding="utf-8")}
    assert users == {"radiometry.py", "ledger.py"}  # the ledger asks what is lost below
