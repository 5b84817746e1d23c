"""Statistical and oracle tests of the kit's path-traced truth: another estimate agrees, likely bugs do not."""

from functools import cache

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.settings import of
from refgi.truth.settings import TruthSettings
from refgi.truth.truth import trace_truth
from refgi.vectors.cases import truth as cases
from refgi.vectors.spec import expected_of
from refgi.vectors.stages.truth import NAMES, deviation
from tests.naive.truth import one_bounce

CASES = {**cases.QUICK, **cases.FULL}
AGREE = 2.0  # mean square of standardised differences: 1; to 1.7 where lobes are met by chance, which has heavy tails
DIFFER = 5.0  # a bug stands out
SAME = 0.1  # the same random numbers: paths differ by the rounding of receivers alone
CELLS, QUADRATURE = 32, 0.03  # of the light's cone along a side; what their midpoint rule is off by, of the mean


@cache
def made(name):
    case = CASES[name]()
    return case, expected_of(case)


def frame_of(name):
    width, height = cases.SIZE
    return Frame(cases.VIEWS[name][0], width=width, height=height, dtype=np.float64, shadows="exact")


def against(known, result):
    return deviation(known[NAMES[0]], known[NAMES[1]], result.mean, result.variance_of_mean)


@pytest.mark.parametrize("name", CASES)
def test_the_chain_is_the_method(name):
    known, settings = made(name)[1], cases.VIEWS[name][1]
    assert against(known, trace_truth(frame_of(name), settings)) < SAME
    assert known[NAMES[0]].mean() > 0
    assert (known[NAMES[2]] == settings.samples * (known["gbuffer.triangle_id"] >= 0)).all()


@pytest.mark.parametrize("name", [name if name in cases.QUICK else pytest.param(name, marks=pytest.mark.slow)
                                  for name in CASES])
def test_another_estimator_agrees(name):
    """Vertices of light paths and directions of the hemisphere, combined, with other random numbers."""
    known, settings = made(name)[1], cases.VIEWS[name][1]
    other = of(TruthSettings, seed=9, samples=768, bounces=settings.bounces, visibility=settings.visibility,
               emitters=settings.emitters, light_grid=16, interleave=1)
    assert 0.5 < against(known, trace_truth(frame_of(name), other)) < AGREE


def test_a_sum_over_the_light_s_cone_agrees():
    """The twin: a midpoint rule over directions of the lamp, each ray against every triangle."""
    known = made("truth-matte")[1]
    light = cases.VIEWS["truth-matte"][0].lights[0]
    arrays = {key: array.astype(float) if array.dtype.kind == "f" else array for key, array in known.items()}
    albedo = arrays["materials.diffuse"][arrays["scene.material_of_face"]]
    pixels = np.argwhere(arrays["gbuffer.triangle_id"] >= 0)[3::30]
    apart = []
    for at in (tuple(pixel) for pixel in pixels):
        exact = one_bounce(arrays["scene.vertices"], arrays["scene.faces"], albedo, light,
                           arrays["gbuffer.position"][:, *at], arrays["gbuffer.normal"][:, *at], CELLS)
        error = arrays[NAMES[1]][:, *at] + (QUADRATURE * known[NAMES[0]].mean()) ** 2
        apart.append((arrays[NAMES[0]][:, *at] - exact) ** 2 / error)
    assert len(apart) >= 4
    assert np.mean(apart) < AGREE


def test_values_without_an_error_must_be_equal():
    zero, one = np.zeros((3, 1, 2)), np.ones((3, 1, 2))
    assert deviation(zero, zero, zero, zero) == 0.0
    assert deviation(zero, zero, one, zero) == np.inf
    assert deviation(zero, one, 2 * one, zero) == 4.0
