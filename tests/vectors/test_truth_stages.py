"""Statistical and oracle tests of the kit's path-traced truth: another estimate agrees, likely bugs do not."""

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.settings import of
from refgi.truth.settings import TruthSettings
from refgi.truth.truth import trace_truth
from refgi.vectors.cases.visibility import TRUTH, TRUTH_FULL, truth_settings
from tests.naive.truth import one_bounce
from tests.vectors.made import made

NAMES = tuple(f"truth.path_traced.{one}" for one in ("mean", "variance_of_mean", "samples"))
PLANS = {name: plan() for name, plan in {**TRUTH, **TRUTH_FULL}.items()}
AGREE = 2.0  # mean square of standardised differences: 1; to 1.7 where lobes are met by chance, which has heavy tails
DIFFER = 5.0  # a bug stands out
SAME = 0.1  # the same random numbers: paths differ by the rounding of receivers alone
CELLS, QUADRATURE = 32, 0.03  # of the light's cone along a side; what their midpoint rule is off by, of the mean


def frame_of(name):
    plan, (width, height) = PLANS[name], PLANS[name].size
    return Frame(plan.scene, width=width, height=height, dtype=np.float64, shadows="exact")


def against(known, result):
    return deviation(known[NAMES[0]], known[NAMES[1]], result.mean, result.variance_of_mean)


def deviation(mean, variance, other_mean, other_variance):
    """Return the mean square of what two estimates differ by over the standard error of both: about 1 if they agree.

    Values that neither has an error of, such as pixels without surface, must be equal: inf if they are not.
    """
    both = np.asarray(variance, np.float64) + other_variance
    apart = np.asarray(mean, np.float64) - other_mean
    if np.any(apart[both == 0] != 0):
        return np.inf
    return float((apart[both > 0] ** 2 / both[both > 0]).mean()) if np.any(both > 0) else 0.0


@pytest.mark.slow("truth-two-bounces")
@pytest.mark.parametrize("name", PLANS)
def test_the_chain_is_the_method(name):
    known, settings = made(name)[1], truth_settings(PLANS[name])
    assert against(known, trace_truth(frame_of(name), settings)) < SAME
    assert known[NAMES[0]].mean() > 0
    assert (known[NAMES[2]] == settings.samples * (known["rsm.visible_triangles"] >= 0)).all()


@pytest.mark.slow("truth-visible")
@pytest.mark.parametrize("name", [name if name in TRUTH else pytest.param(name, marks=pytest.mark.slow)
                                  for name in PLANS])
def test_another_estimator_agrees(name):
    """Vertices of light paths and directions of the hemisphere, combined, with other random numbers."""
    known, settings = made(name)[1], truth_settings(PLANS[name])
    other = of(TruthSettings, seed=9, samples=768, bounces=settings.bounces, visibility=settings.visibility,
               emitters=settings.emitters, light_grid=16, interleave=1)
    assert 0.5 < against(known, trace_truth(frame_of(name), other)) < AGREE


@pytest.mark.slow
def test_a_sum_over_the_light_s_cone_agrees():
    """The twin: a midpoint rule over directions of the lamp, each ray against every triangle."""
    known = made("truth-matte")[1]
    light = PLANS["truth-matte"].scene.lights[0]
    arrays = {key: array.astype(float) if array.dtype.kind == "f" else array for key, array in known.items()}
    albedo = arrays["materials.diffuse"][arrays["scene.material_of_face"]]
    pixels = np.argwhere(arrays["rsm.visible_triangles"] >= 0)[3::30]
    apart = []
    for at in (tuple(pixel) for pixel in pixels):
        exact = one_bounce(arrays["scene.vertices"], arrays["scene.faces"], albedo, light,
                           arrays["rsm.surface.position"][:, *at], arrays["rsm.surface.normal"][:, *at], CELLS)
        error = arrays[NAMES[1]][:, *at] + (QUADRATURE * known[NAMES[0]].mean()) ** 2
        apart.append((arrays[NAMES[0]][:, *at] - exact) ** 2 / error)
    assert len(apart) >= 4
    assert np.mean(apart) < AGREE


def test_values_without_an_error_must_be_equal():
    zero, one = np.zeros((3, 1, 2)), np.ones((3, 1, 2))
    assert deviation(zero, zero, zero, zero) == 0.0
    assert deviation(zero, zero, one, zero) == np.inf
    assert deviation(zero, one, 2 * one, zero) == 4.0
