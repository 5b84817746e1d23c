"""Pairs with lobes: one pixel light by hand, for every exponent and for lobes that point into the surface."""

import math

import numpy as np
import pytest

from refgi.lights import PixelLights
from refgi.pairs.shadow_rays import RayReceivers, shadowed_sum
from refgi.rays import Tracer
from refgi.scene import Geometry
from tests.test_lobes import literal_power

NOTHING = Geometry(np.zeros((0, 3)), np.zeros((0, 3), np.int32), np.zeros(0, np.int32))
ROUNDED = 1e-5  # worth is float32; h of an angle of 1e-6 keeps that in float64


def lobe(axis, exponent):
    zero = np.zeros((3, 1))
    return PixelLights(zero, np.array([[0.0], [1.0], [0.0]]), zero, np.array([[2.0], [3.0], [5.0]]),
                       np.reshape(axis, (3, 1)).astype(np.float32), np.array([exponent], np.float32), 1)


def receiver(position, normal):
    at, up = (np.reshape(v, (3, 1)).astype(np.float32) for v in (position, normal))
    return RayReceivers(np.array([0]), at, up, up, at)


@pytest.mark.feature("SII-05")
@pytest.mark.parametrize("exponent", [0.0, 3.0, 1e3, 1e6, 1e12])
def test_one_lobe_by_hand(exponent, evidence):
    axis = np.array([0.3, 0.8, -0.2])
    axis = (axis / np.linalg.norm(axis)).astype(np.float32)
    assert np.linalg.norm(axis.astype(float)) != 1  # the length of a rounded axis is off by some 1e-8
    worst = 0.0
    for angle in np.array([0.0, 0.5, 1.5]) / math.sqrt(exponent + 1):
        w = axis + angle * np.cross(axis, (0.0, 0.6, 0.8))
        to = receiver(2 * w, -w / np.linalg.norm(w))
        d = to.position[:, 0].astype(float)
        cosine = -(to.normal[:, 0] @ d) / np.linalg.norm(d)
        power = literal_power(axis, d, float(np.float32(exponent)))
        expected = (np.float32(exponent) + 1.0) / (2 * math.pi) * power * cosine / (d @ d)
        if exponent == 0:
            expected /= 1 - math.acos(axis[1] / np.linalg.norm(axis)) / math.pi  # K of a lobe of P = 0
        elif exponent == 3:
            c = axis[1] / np.linalg.norm(axis.astype(float))
            expected /= 0.5 + c * (3 - c * c) / 4  # K of a lobe of P = 3
        got = shadowed_sum(Tracer(NOTHING), to, lobe(axis, exponent))[:, 0]
        np.testing.assert_allclose(got, expected * np.array([2.0, 3.0, 5.0]), rtol=ROUNDED)
        worst = max(worst, np.abs(got / (expected * np.array([2.0, 3.0, 5.0])) - 1).max())
    evidence(f"P = {exponent:g}: within {worst:.1e}")


@pytest.mark.feature("SII-06")
@pytest.mark.parametrize("exponent", [50.0, 1e4, 1e12])
def test_a_lobe_that_points_into_the_surface_sends_nothing(exponent):
    down = np.array([0.5, -math.sqrt(0.75), 0.0])
    for position in ((0.5, 1.0, 0.0), (1.0, 1e-6, 0.0)):
        got = shadowed_sum(Tracer(NOTHING), receiver(position, (-0.7, -0.7, 0.0)), lobe(down, exponent))
        assert (got == 0).all() if exponent > 1e3 else np.isfinite(got).all()
