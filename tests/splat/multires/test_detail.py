"""Surface detail put back by the angle to the camera (Eq. 3)."""

import math

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.jit import threads
from refgi.splat.multires.upsample import surface_detail

EYE = (0.3, 1.2, 4.0)
ROUNDING = {np.float32: 2e-6, np.float64: 4e-15}  # values up to 4 times a factor of a few roundings


def surfaces(real, height=33, width=29, seed=0):
    """Random light, points, unit normals on either side, and what is covered."""
    rng = np.random.default_rng(seed)
    irradiance, position = rng.random((3, height, width)) * 4, rng.normal(size=(3, height, width))
    normal = rng.normal(size=(3, height, width))
    planes = irradiance, position, normal / np.linalg.norm(normal, axis=0)
    return *(plane.astype(real) for plane in planes), rng.random((height, width)) < 0.8


def formula(irradiance, position, normal, covered, a):
    """Eq. (3), pixel by pixel."""
    result = np.zeros(irradiance.shape)
    for i, j in zip(*np.nonzero(covered), strict=True):
        view = [EYE[c] - float(position[c, i, j]) for c in range(3)]
        length = math.sqrt(sum(v * v for v in view))
        cosine = max(0.0, sum(v * float(normal[c, i, j]) for c, v in enumerate(view)) / length)
        result[:, i, j] = irradiance[:, i, j] * (a * cosine + (1 - a))
    return result


@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.feature("AMS-14")
def test_it_is_the_formula_and_only_darkens(real, evidence):
    """Oracle and property: Eq. (3); the factor stays in [1 - a, 1]."""
    planes = surfaces(real)
    covered = planes[-1]
    got = surface_detail(*planes, EYE, 0.5)
    assert got.dtype == real
    assert np.abs(got - formula(*planes, 0.5)).max() < ROUNDING[real]
    assert not got[:, ~covered].any()
    flat = surface_detail(np.ones_like(planes[0]), *planes[1:], EYE, 0.5)[0, covered]
    evidence(f"a = 0.5, {np.dtype(real).name}: factors {flat.min():.4f} to {flat.max():.4f}, mean {flat.mean():.3f}")
    assert 0.5 == flat.min() < 0.6 < 0.95 < flat.max() <= 1.0


@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.feature("AMS-14")
def test_ends_of_the_range(real, evidence):
    """Analytic: a = 0 changes nothing to the bit, a wall seen head on keeps its light, one from the side has 1 - a."""
    irradiance, position, normal, covered = surfaces(real)
    assert np.array_equal(surface_detail(irradiance, position, normal, covered, EYE, 0.0), irradiance * covered)
    eye, one = np.array(EYE, real), np.ones((3, 1, 3), real)
    toward = np.array([[0.0, 0, 1], [0.6, 0, 0.8], [1, 0, 0]], real)
    away = eye + np.array([[0.0, 0, -2], [0, 0, -2], [0, 0, -2]], real)
    for a in (0.5, 1.0):
        got = surface_detail(one, away.T[:, None], toward.T[:, None], np.ones((1, 3), bool), EYE, a)[0, 0]
        assert np.allclose(got, [1, 1 - 0.2 * a, 1 - a], atol=ROUNDING[real], rtol=0)
    here = surface_detail(one, np.ones((3, 1, 3), real) * eye[:, None, None], one, np.ones((1, 3), bool), EYE, 1.0)
    assert np.array_equal(here, one)
    evidence(f"{np.dtype(real).name}: head on 1, side on 1 - a, a = 0 to the bit")


@pytest.mark.feature("AMS-14")
def test_rounding_adds_no_energy(evidence):
    """Property: normals towards the eye, whose float32 cosines are at times above 1."""
    _, position, _, covered = surfaces(np.float32, 60, 70)
    view = np.array(EYE, np.float32)[:, None, None] - position
    normal = view / np.sqrt((view * view).sum(axis=0))
    got = surface_detail(np.ones_like(position), position, normal, np.ones_like(covered), EYE, 1.0)
    evidence(f"seen head on with a = 1 in float32: factors {got.min():.7f} to {got.max():.7f}")
    assert 1 - ROUNDING[np.float32] < got.min() < got.max() == 1.0


def test_it_does_not_depend_on_threads_and_takes_any_size():
    for size in ((1, 1), (1, 9), (130, 1)):
        planes = surfaces(np.float32, *size)
        pictures = []
        for count in (1, 2):
            with threads(count):
                pictures.append(surface_detail(*planes, EYE, 0.5))
        assert np.array_equal(*pictures)


def test_a_that_is_no_share_is_refused():
    with pytest.raises(InputError, match="a: expected a share"):
        surface_detail(*surfaces(np.float32), EYE, 1.5)
