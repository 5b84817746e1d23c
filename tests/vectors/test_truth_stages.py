"""Statistical and oracle tests of the kit's path-traced truth: others agree, likely bugs do not and are named."""

import dataclasses

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.literal import truth
from refgi.settings import of
from refgi.truth.settings import TruthSettings
from refgi.truth.truth import trace_truth
from refgi.vectors.cases.visibility import TRUTH, TRUTH_FULL, truth_settings
from refgi.vectors.check import stage_of_array
from refgi.vectors.forms.truth import CELLS
from refgi.vectors.rows import edited, rows
from refgi.vectors.spec import as_read, outputs_of, stored
from tests.vectors.literal_port import form_of
from tests.vectors.made import made, stage_of

STAGE = "truth.path_traced"
NAMES = tuple(f"{STAGE}.{one}" for one in ("mean", "variance_of_mean", "samples"))
PLANS = {name: plan() for name, plan in {**TRUTH, **TRUTH_FULL}.items()}
AGREE = 2.0  # mean square of standardised differences: 1; to 1.7 where lobes are met by chance, which has heavy tails
DIFFER = 5.0  # a bug stands out
SAME = 0.1  # the same random numbers: paths differ by the rounding of receivers alone


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


@pytest.mark.slow("truth-two-bounces")
@pytest.mark.parametrize("name", PLANS)
def test_the_literal_text_agrees(name):
    """Every ray against every triangle, other random numbers."""
    known, step = made(name)[1], stage_of(name, STAGE)
    got = outputs_of(step, known, np.float64, form_of(step))
    assert 0.5 < deviation(*(one[array] for one in (known, got) for array in NAMES[:2])) < AGREE


def test_likely_bugs_of_a_port_with_random_numbers_of_its_own_are_named(kit):
    step = stage_of("truth-matte", STAGE)
    read, form = as_read(made("truth-matte")[1], step.reads, np.float64), form_of(step)
    cells = np.floor(form.numbers["xi"] * CELLS)
    xi = (cells + np.random.default_rng(3).random(cells.shape)) / CELLS
    named, unnamed = [], []
    for row in rows(truth.__name__):
        if row.cause in {bug.cause for bug in step.bugs}:
            port = dataclasses.replace(form, numbers={**form.numbers, "xi": xi}, function=edited(
                form.function, row.edits))
            verdict = stage_of_array(kit, "truth-matte", NAMES[0], stored(port(read, None)[NAMES[0]]))
            said = [one.cause for one in verdict.causes]
            (named if said[:1] == [row.cause] else unnamed).append(row.cause)
            assert not any("rounding" in one for one in said)
    assert len(named) > 15
    assert unnamed == [cause for cause in unnamed if cause.startswith("back faces are dark")]  # as little as the noise


def test_values_without_an_error_must_be_equal():
    zero, one = np.zeros((3, 1, 2)), np.ones((3, 1, 2))
    assert deviation(zero, zero, zero, zero) == 0.0
    assert deviation(zero, zero, one, zero) == np.inf
    assert deviation(zero, one, 2 * one, zero) == 4.0
