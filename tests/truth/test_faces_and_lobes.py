"""What the truth must not lose or make where normals lie far off their triangles, and where lobes are near."""

import dataclasses

import numpy as np
import pytest

from refgi.scene import Material, SpotLight
from refgi.truth import TruthSettings
from tests.naive import light_tracing
from tests.truth.scenes import WHITE, at, rectangle, scene

ESTIMATORS = ["combined", "hemisphere", "light"]
SIGMAS = 4.5  # standard errors
SIDEWAYS = SpotLight((-1.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.3, 0.3, (1.0, 2.0, 3.0))
UPWARDS = SpotLight((-0.5, 0.2, 0.0), (0.5, 0.8, 0.0), 0.25, 0.3, (1.0, 2.0, 3.0))


def before_a_wall(height, normal):
    """Return what receivers at a height below a lit wall's upper end get; their face looks up, their normal askew."""
    floor = rectangle((-0.5, height, 0.5), (1, 0, 0), (0, 0, -1), WHITE)
    wall = rectangle((2, -1, -1), (0, 0, 2), (0, 2, 0), WHITE)
    return lambda **settings: at(scene([floor, wall], SIDEWAYS), [(0.0, height, 0.0)], [normal],
                                 TruthSettings(samples=24 * 20, visibility=False, **settings), repeat=64)


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_nothing_arrives_from_below_a_face(estimator):
    """A wall that the shading normal looks at and the face does not: exactly nothing, from above it something."""
    askew = np.array((0.95, 0.3, 0.0)) / np.hypot(0.95, 0.3)
    assert not before_a_wall(1.6, askew)(estimator=estimator).mean.any()
    assert before_a_wall(-1.6, askew)(estimator=estimator).mean.any()


@pytest.mark.parametrize("visibility", [True, False])
@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_nothing_leaves_through_the_back_of_a_face_that_hides(estimator, visibility):
    """A wall whose normals look up: a receiver behind it, before its normals, gets nothing but without visibility."""
    floor = rectangle((1, -2, 3), (4, 0, 0), (0, 0, -6), WHITE)
    wall = rectangle((2, -1, -1), (0, 0, 2), (0, 2, 0), WHITE)
    room = scene([floor, wall], SIDEWAYS)
    normals = np.tile((-0.1, 0.995, 0.0), (len(room.geometry.vertices), 1))
    room = dataclasses.replace(room, geometry=dataclasses.replace(room.geometry, vertex_normals=normals))
    settings = TruthSettings(samples=24 * 20, visibility=visibility, estimator=estimator)
    for x, lit in ((2.5, not visibility), (1.5, True)):
        result = at(room, [(x, 3.0, 0.0)], [(0.0, -1.0, 0.0)], settings, repeat=64)
        assert result.mean.any() == lit


@pytest.mark.slow("0.002", "0.1")
@pytest.mark.parametrize("bound", [0.002, 0.01, 0.1])
def test_lobes_beyond_the_bound_are_left_to_the_hemisphere(bound, evidence):
    """A lobe exceeds the bound where a diffuse surface cannot: E by NumPy, at the place that a mirror would light."""
    glossy = Material("glossy", (0.0, 0.0, 0.0), (0.9, 0.7, 0.5), 40.0)
    plate = rectangle((-1, 1, -1), (2, 0, 0), (0, 0, 2), glossy)
    room, place = scene([plate, rectangle((0.4, 0.2, 0.1), (0.2, 0, 0), (0, 0, -0.2), WHITE)], UPWARDS), (0.5, 0.2, 0.0)
    up, random = np.array([(0.0, 1.0, 0.0)]), np.random.default_rng(5)
    rounds = np.array([light_tracing.irradiance(room, (np.array([place]), up, up), light_tracing.Rules(), 40, random)
                       for _ in range(8)])[:, 0]
    result = at(room, [place], up, TruthSettings(samples=24 * 160, bound=bound, light_grid=12), triangle=2, repeat=64)
    error = np.sqrt(result.picture_variance + rounds.var(axis=0, ddof=1) / len(rounds))
    off = np.abs(result.picture_mean - rounds.mean(axis=0))
    evidence(f"bound {bound}: {(off / error).max():.1f} standard errors of {(error / rounds.mean(axis=0)).max():.1e}")
    assert (error < 0.03 * rounds.mean(axis=0)).all()
    assert (off < SIGMAS * error).all()
