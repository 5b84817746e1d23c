"""Oracle tests of the kit's screen-space stages: the chain is the method, the literal text is a port."""

import re
from functools import cache

import numpy as np
import pytest

from refgi.diagnostics import diagnosing
from refgi.frame import Frame
from refgi.sssil.crown.pattern import samples_at, shared_offsets
from refgi.sssil.hssil import hssil
from refgi.vectors.bounds import distance, isolated_bounds, large_value
from refgi.vectors.cases import hssil as cases
from refgi.vectors.spec import expected_of

CASES = {**cases.QUICK, **cases.FULL}
CHAIN = 2e-5  # of the large values: some 20 stages, each rounded to float32 (6e-8) and some divided by small numbers
FLIPPED = 0.005  # share of values that rounding decides otherwise in the chain: ties between equally near texels
MASKED = 0.05  # share of an array that rounding may decide
LOOSE = 1e-4  # of the large values: most bounds beyond this would hide bugs
AMPLIFIED = 0.005  # share of bounds beyond: means over texels that weigh next to nothing
LITERAL = {"level", "points of samples", "shifts of samples", "samples", "gather", "blur", "light", "picture", "motion",
           "reprojected", "entering", "clamp", "temporal"}
NO_LEVEL = re.compile(r"\d")


@cache
def made(name):
    """Return a case, all its arrays and the bounds of what it writes."""
    case = CASES[name]()
    known = expected_of(case)
    bounds = (isolated_bounds(case, step, known, 1) for step in case.stages)
    return case, known, {key: bound for some in bounds for key, bound in some.items()}


def outside(array, expected, bound):
    """Return which elements of an array lie outside their bounds, those that may differ at will left out."""
    if np.shape(array) != expected.shape:
        return np.ones(expected.shape, bool)
    return (distance(array, expected) > bound.limit) & ~bound.masked


@pytest.mark.feature("HSS-02")
@pytest.mark.filterwarnings("ignore:radius")
@pytest.mark.parametrize("name", cases.VIEWS)
def test_the_chain_is_the_method(name):
    case, known, _ = made(name)
    scene, (width, height), shadows = cases.VIEWS[name]
    frame = Frame(scene, width=width, height=height, dtype=np.float64, shadows=shadows, rsm_resolution=32)
    expected, found = hssil(frame, cases.SETTINGS[name]), known[case.stages[-1].writes[0]]
    off = np.abs(found - expected) > CHAIN * (large_value(expected) + np.abs(expected))
    assert off.mean() <= FLIPPED
    assert expected.any() == (name != "hssil-dark")


@pytest.mark.feature("HSS-13")
@pytest.mark.parametrize("name", cases.TEMPORAL)
def test_the_blend_is_that_of_a_sequence(name):
    case, known, _ = made(name)
    with diagnosing(False):
        expected = [*cases.sequence(name, cases.frames_of(name))][-1].irradiance
    assert np.abs(known["temporal.irradiance"] - expected).max() < CHAIN * expected.max()
    covered, weight = known["gbuffer.triangle_id"] >= 0, known["reprojected.weight"]
    assert (weight[covered] == 0).any(), "no pixel is disoccluded"
    assert not covered.all()
    assert case.stages[-1].name == "temporal"


@pytest.mark.feature("HSS-05")
@pytest.mark.parametrize("name", cases.VIEWS)
def test_samples_are_those_of_the_method(name):
    """Shifts kept in float32 move no sample to another texel."""
    case, known, _ = made(name)
    sampling = cases.SETTINGS[name].sampling
    for index in range(case.facts["hssil"]["levels"]):
        rows, columns = known[f"level{index}.depth"].shape
        number, radius = sampling.first_level + index, case.facts[f"samples{index}"]["radius"]
        if sampling.pattern == "pixel":
            each = [[samples_at(sampling, index, number, i, j, radius) for j in range(columns)] for i in range(rows)]
            offsets, weight = (np.array([[one[k] for one in row] for row in each]) for k in (0, 1))
            weight = weight if sampling.density != "uniform" else weight[:1, :1]
        else:
            offsets, weight = shared_offsets(sampling, index, number, rows, radius)
        np.testing.assert_array_equal(known[f"samples{index}.offsets"], offsets)
        np.testing.assert_allclose(known[f"samples{index}.weight"], weight, atol=1e-6 * weight.max())


@pytest.mark.parametrize("name", CASES)
def test_bounds_are_near_rounding_and_masks_are_few(name):
    _, known, bounds = made(name)
    for key, bound in bounds.items():
        assert bound.masked.mean() < MASKED, key
        assert (bound.limit > LOOSE * large_value(known[key])).mean() <= AMPLIFIED or not known[key].any(), key


@pytest.mark.parametrize("name", CASES)
def test_the_literal_text_is_the_stages(name):
    """Bugs, which are edits of it, are wrong by what they say alone."""
    case, known, bounds = made(name)
    for step in case.stages:
        if NO_LEVEL.sub("", step.name) in LITERAL:
            read = {key: known[key].astype(float) if known[key].dtype.kind == "f" else known[key] for key in step.reads}
            assert len(step.variants) == 1, step.name
            for key, array in step.variants[0](read, np.float64).items():
                same(np.where(bounds[key].masked, known[key], array), known[key])


def same(array, expected):
    """Compare to the rounding of float32."""
    finite = np.isfinite(expected)
    np.testing.assert_array_equal(np.isfinite(array), finite)
    if expected.dtype.kind != "f":
        np.testing.assert_array_equal(array, expected)
    off = np.abs(np.asarray(array)[finite] - expected[finite]).max(initial=0)
    assert off <= 1e-5 * max(large_value(expected), 1e-30)
