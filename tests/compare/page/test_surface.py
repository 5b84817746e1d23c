"""Radiance from irradiance: the emission and reflectance that pictures were made with are found again."""

import math

import numpy as np
import pytest

from refgi.compare.page.album import SurfaceFit, follows
from refgi.errors import InputError

RNG = np.random.default_rng(5)
EMITTED, ALBEDO = RNG.uniform(0, 3, (3, 4, 5)), RNG.uniform(0.05, 1, (3, 4, 5))
PICTURES = RNG.uniform(0, 2, (4, 3, 4, 5)).astype(np.float32)


def seen(irradiance):
    return (EMITTED + ALBEDO / math.pi * irradiance).astype(np.float32)


def solved(pictures):
    fit = SurfaceFit(EMITTED.shape)
    for picture in pictures:
        fit.add(picture, seen(picture))
    return fit.solve()


def test_emission_and_reflectance_are_found():
    emitted, reflectance = solved(PICTURES)
    assert emitted == pytest.approx(EMITTED, rel=1e-4, abs=1e-4)
    assert reflectance == pytest.approx(ALBEDO / math.pi, rel=1e-4, abs=1e-4)
    assert all(follows(picture, seen(picture), (emitted, reflectance)) for picture in PICTURES)


@pytest.mark.parametrize("pictures", [PICTURES[:1], [PICTURES[0], PICTURES[0]],
                                      [PICTURES[0], PICTURES[0] * np.float32(1 + 2e-7)]])
def test_pictures_that_agree_are_reproduced_whatever_the_reflectance(pictures):
    surface = solved(pictures)
    assert all(follows(picture, seen(picture), surface) for picture in pictures)
    assert (surface[0] >= 0).all()
    assert ((surface[1] >= 0) & (surface[1] <= 1 / math.pi)).all()


def test_emission_is_never_negative_and_reflectance_no_more_than_that_of_white():
    """Pictures that differ by rounding alone have any slope: here 0.3 and 3 where light itself allows 0.01 at most."""
    fit = SurfaceFit((3, 1, 1))
    for shift in (0.0, 1e-4):
        irradiance = np.full((3, 1, 1), 1 + shift)
        fit.add(irradiance, np.array([0.01 + 0.3 * shift, 0.01 + 3 * shift, 5 + 3 * shift]).reshape(3, 1, 1))
    emitted, reflectance = (part.ravel() for part in fit.solve())
    assert (emitted >= 0).all()
    assert reflectance == pytest.approx([0.01, 0.01, 1 / math.pi], rel=0.02)
    assert emitted + reflectance == pytest.approx([0.01, 0.01, 5], rel=0.02)


def test_pixels_that_are_not_finite_do_not_count():
    broken = PICTURES.copy()
    broken[0, :, 1, 2] = np.nan
    broken[1, 0, 0, 0] = np.inf
    emitted, reflectance = solved(broken)
    assert emitted == pytest.approx(EMITTED, rel=1e-3, abs=1e-3)
    assert follows(broken[0], seen(broken[0]), (emitted, reflectance))


def test_other_radiance_does_not_follow():
    surface, other = solved(PICTURES), seen(PICTURES[0])
    other[1, 2, 3] *= 1.01
    assert not follows(PICTURES[0], other, surface)


def test_pictures_of_other_sizes_are_refused():
    with pytest.raises(InputError, match="shape"):
        SurfaceFit((3, 4, 5)).add(np.zeros((3, 4, 4)), np.zeros((3, 4, 4)))
