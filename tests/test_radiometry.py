"""Analytic and oracle tests of the shared radiometry."""

import math

import numpy as np
import pytest
from scipy.special import betainc

from refgi import radiometry
from refgi.literal.light_flux import spot_share
from refgi.radiometry import (
    corner_solid_angle_paraboloid,
    corner_solid_angle_perspective,
    incident_light,
    lobe_fraction,
    orthonormal_basis,
    radiant_intensity,
    smooth_edge,
    spot_falloff,
)
from refgi.scene import DirectionalLight, PointLight, SpotLight, light_table
from refgi.scene.light import cone_row
from tests.naive import radiometry as naive

ROUNDING = {np.float32: 1e-6, np.float64: 1e-14}  # a dozen operations on numbers near 1
QUADRATURE = 1e-9  # the twins' quadrature, converged
LOBE = 1e-13  # continued fraction to 3e-16, times a handful of operations
SMALL_PART = 1e-11  # of itself: a continued fraction of up to 100 steps of 3e-16, an exponential of -25; scipy's alike


def rectangle(corner, x0, x1, y0, y1):
    return corner(x1, y1) - corner(x0, y1) - corner(x1, y0) + corner(x0, y0)


@pytest.mark.parametrize("falloff", ["smoothstep", "squared_ramp", "ramp"])
def test_spot_falloff_is_the_smoothstep_or_a_ramp(falloff):
    cone = cone_row(math.acos(0.9), math.acos(0.5), falloff)
    for cos_angle in np.linspace(-1.0, 1.0, 81):
        got = spot_falloff((0.0, math.sqrt(1 - cos_angle**2), cos_angle), (0.0, 0.0, 1.0), cone, math.inf)
        expected = spot_share(cos_angle, math.acos(0.9), math.acos(0.5), falloff)
        assert got == pytest.approx(expected, abs=ROUNDING[np.float64])


def test_spot_with_equal_cones_is_a_step():
    for outer in (1e-7, 0.3, 1.5):
        cone = cone_row(outer, outer)
        for angle, expected in ((0.0, 1.0), (0.999999 * outer, 1.0), (1.000001 * outer, 0.0), (3.0, 0.0)):
            assert spot_falloff((0.0, math.sin(angle), math.cos(angle)), (0.0, 0.0, 1.0), cone, math.inf) == expected


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_smooth_edge(real):
    for above, span, expected in ((0.5, 1, 0.5), (0.25, 1, 0.15625), (1, 1, 1), (2, 1, 1), (0, 1, 0), (-1, 1, 0),
                                  (0, 0, 1), (-1, 0, 0)):
        assert smooth_edge(real(above), real(span), 1.0, 0.0) == expected
    for above, span, expected in ((0.5, 1, 0.25), (0.25, 1, 0.0625), (1, 1, 1), (2, 1, 1), (0, 1, 0), (-1, 1, 0),
                                  (0, 0, 1), (-1, 0, 0)):
        assert smooth_edge(real(above), real(span), 0.0, 0.0) == expected


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_incident_light_by_hand(real):
    axis = np.array([0.0, -3.0, 4.0]) / 5
    table = light_table([
        SpotLight((1.0, 2.0, 3.0), tuple(axis), 0.3, 0.9, (1.0, 2.0, 4.0)),
        PointLight((0.0, 2.0, 0.0), (8.0, 4.0, 2.0)),
        DirectionalLight((0.0, 0.0, 2.0), (1.0, 2.0, 3.0)),
    ])
    point = np.array([1.5, 0.5, 4.0])
    got = np.array([incident_light(table, k, *(real(c) for c in point)) for k in range(3)])
    d = np.array([1.0, 2.0, 3.0]) - point
    r = np.linalg.norm(d)
    intensity = spot_share(-(d @ axis) / r, 0.3, 0.9) * np.array([1.0, 2.0, 4.0])
    assert got[0] == pytest.approx([*(d / r), r, *(intensity / r**2)], rel=10 * ROUNDING[np.float64])
    d = np.array([0.0, 2.0, 0.0]) - point
    r = np.linalg.norm(d)
    assert got[1] == pytest.approx([*(d / r), r, *(np.array([8.0, 4.0, 2.0]) / r**2)], rel=10 * ROUNDING[np.float64])
    assert got[2].tolist() == [0, 0, -1, math.inf, 1, 2, 3]


def test_no_light_at_the_light_itself():
    table = light_table([PointLight((1.0, 2.0, 3.0), (1.0, 1.0, 1.0))])
    assert incident_light(table, 0, 1.0, 2.0, 3.0) == (0,) * 7


@pytest.mark.feature("SII-01")
def test_spot_flux_is_its_closed_form():
    light = SpotLight((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.4, 1.1, (3.0, 0.0, 0.0))
    table = light_table([light])
    x, w = np.polynomial.legendre.leggauss(8)
    flux = 0.0
    for low, high in ((math.cos(1.1), math.cos(0.4)), (math.cos(0.4), 1.0)):
        for node, weight in zip(x, w, strict=True):
            z = 0.5 * (low + high) + 0.5 * (high - low) * node
            flux += radiant_intensity(table, 0, math.sqrt(1 - z * z), 0.0, z)[0] * weight * 0.5 * (high - low)
    # the smoothstep has mean 1/2 over the cosine
    expected = 3.0 * ((1 - math.cos(0.4)) + 0.5 * (math.cos(0.4) - math.cos(1.1)))
    assert flux == pytest.approx(expected, rel=1e-13)


@pytest.mark.feature("REF-01")
def test_solid_angles_of_rectangles(evidence):
    rng = np.random.default_rng(5)
    worst = 0.0
    for corner, density, span in (
        (corner_solid_angle_perspective, lambda x, y: (1 + x * x + y * y) ** -1.5, 2.0),
        (corner_solid_angle_paraboloid, lambda u, v: 4 / (1 + u * u + v * v) ** 2, 1.0),
    ):
        for _ in range(50):
            x0, x1, y0, y1 = (*np.sort(rng.uniform(-span, span, 2)), *np.sort(rng.uniform(-span, span, 2)))
            exact = naive.solid_angle_of_rectangle(density, x0, x1, y0, y1)
            worst = max(worst, abs(rectangle(corner, x0, x1, y0, y1) - exact))
    assert worst < QUADRATURE
    assert rectangle(corner_solid_angle_perspective, -1.0, 1.0, -1.0, 1.0) == pytest.approx(2 * math.pi / 3, rel=1e-14)
    assert rectangle(corner_solid_angle_paraboloid, -1.0, 1.0, -1.0, 1.0) == pytest.approx(6.96336, abs=5e-6)
    evidence(f"max error against quadrature {worst:.1e} sr over 100 rectangles; cube face 2 pi/3")


@pytest.mark.feature("SII-06")
def test_lobe_fraction_is_the_part_above_the_surface(evidence):
    for degrees, exponent, published in ((75, 10, 0.8034), (85, 100, 0.8093)):
        assert lobe_fraction(math.cos(math.radians(degrees)), float(exponent)) == pytest.approx(published, abs=5e-5)
    worst = 0.0
    for theta in (0.0, 0.3, 0.8, 1.2, 1.5, math.pi / 2):
        assert lobe_fraction(math.cos(theta), 0.0) == pytest.approx(1 - theta / math.pi, abs=LOBE)
        assert lobe_fraction(math.cos(theta), 1.0) == pytest.approx((1 + math.cos(theta)) / 2, abs=LOBE)
        for exponent in (0.0, 0.37, 1.0, 2.5, 10.0, 31.7, 100.0):
            worst = max(worst, abs(lobe_fraction(math.cos(theta), exponent) - naive.lobe_fraction(theta, exponent)))
    assert worst < QUADRATURE
    evidence(f"K(75, 10), K(85, 100) as tabled; max error against quadrature {worst:.1e}")


@pytest.mark.feature("SII-06")
def test_lobe_fraction_up_to_exponents_of_a_million():
    rng = np.random.default_rng(3)
    for exponent in np.r_[0.0, np.geomspace(1e-3, 1e6, 40)]:
        for cosine in np.r_[0.0, 1.0, rng.random(10), rng.random(10) / math.sqrt(exponent + 1)]:
            expected = 0.5 + 0.5 * betainc(0.5, (exponent + 1) / 2, cosine**2)
            assert lobe_fraction(float(cosine), exponent) == pytest.approx(expected, abs=LOBE)
            assert lobe_fraction(-float(cosine), exponent) == pytest.approx(1 - expected, abs=LOBE)


def test_lobe_fraction_keeps_float32():
    assert lobe_fraction(np.float32(0.25), np.float32(7.0)) == np.float32(lobe_fraction(0.25, 7.0))


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_orthonormal_basis(real):
    rng = np.random.default_rng(1)
    normals = rng.normal(size=(200, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    for n in [*normals, (0, 0, 1), (0, 0, -1), (1, 0, 0), (0, -1, 0), (1e-9, 0, -1)]:
        n = np.asarray(n, real)
        frame = np.array([*np.reshape(orthonormal_basis(*n), (2, 3)), n])
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=5 * ROUNDING[real])
        assert np.linalg.det(frame) == pytest.approx(1, abs=5 * ROUNDING[real])


@pytest.mark.parametrize("name", ["smooth_edge", "corner_solid_angle_perspective", "corner_solid_angle_paraboloid",
                                  "orthonormal_basis", "lobe_fraction"])
def test_kernels_keep_float32(name):
    function = getattr(radiometry, name)
    arguments = (np.float32(0.5),) * len(function.py_func.__annotations__.keys() - {"return"})
    function(*arguments)
    types = {str(s.return_type) for s in function.nopython_signatures if "float64" not in str(s.args)}
    assert all("float64" not in kind for kind in types)


@pytest.mark.feature("SII-06")
def test_a_small_part_of_a_lobe_above_the_surface_keeps_its_digits(evidence):
    """Lobes that point into the surface: K is half of the incomplete beta function, down to 1e-11."""
    assert lobe_fraction(-1 + 2.0**-40, 1.0) == pytest.approx(2.0**-41, rel=1e-14)  # (1 + cos th) / 2
    worst = 0.0
    for exponent in np.geomspace(1e-2, 1e4, 40):
        for cosine in np.linspace(0.1, 6.0, 20) / math.sqrt(exponent + 37):
            expected = 0.5 * betainc((exponent + 1) / 2, 0.5, (1 - cosine) * (1 + cosine))
            if expected > 1e-11:
                worst = max(worst, abs(lobe_fraction(-float(cosine), exponent) / expected - 1))
    assert worst < SMALL_PART
    evidence(f"parts down to 1e-11 of a lobe off by {worst:.1e} of themselves at most")
