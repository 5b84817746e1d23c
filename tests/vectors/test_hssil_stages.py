"""Oracle tests of the kit's screen-space stages: the chain is the method, the literal text is a port."""

from functools import cache

import numpy as np
import pytest

from refgi.diagnostics import diagnosing
from refgi.frame import Frame
from refgi.sssil.hssil import hssil
from refgi.sssil.temporal import Sequence
from refgi.stages import observe
from refgi.vectors.bounds import isolated_bounds, large_value
from refgi.vectors.cases import hssil as cases
from refgi.vectors.leaves import leaves
from tests.vectors import made as shared

CASES = {**cases.QUICK, **cases.FULL}
VIEWS = {**cases.QUICK_PLANS, **cases.FULL_PLANS}
CHAIN = 2e-5  # of the large values: some 20 stages, each rounded to float32 (6e-8) and some divided by small numbers
FLIPPED = 0.005  # share of values that rounding decides otherwise in the chain: ties between equally near texels
MASKED = 0.05  # share of an array that rounding may decide
LOOSE = 1e-4  # of the large values: most bounds beyond this would hide bugs
AMPLIFIED = 0.005  # share of bounds beyond: means over texels that weigh next to nothing
STEPS = 1e-12  # of the large values: a stage's sums in another order than its steps'


@cache
def made(name):
    """Return a case, all its arrays and the bounds of what it writes."""
    case, known = shared.made(name)
    bounds = (isolated_bounds(case, step, known, 1) for step in case.stages)
    return case, known, {key: bound for some in bounds for key, bound in some.items()}


def picture(plan):
    """Return what the method makes of a plan."""
    frame = Frame(plan.scene, width=plan.size[0], height=plan.size[1], dtype=np.float64, shadows=plan.shadows,
                  rsm_resolution=plan.maps)
    return hssil(frame, cases.settings_of(plan))


def sequence(name):
    """Return the frames of the production method in double precision."""
    width, height = cases.TEMPORAL_SIZE
    return Sequence(cases.frames_of(name), cases.SEQUENCE, cases.TEMPORAL[name], width=width, height=height,
                    dtype=np.float64, rsm_resolution=cases.MAPS)


@pytest.mark.feature("HSS-02")
@pytest.mark.filterwarnings("ignore:radius")
@pytest.mark.parametrize("name", VIEWS)
def test_the_chain_is_the_method(name):
    case, known, _ = made(name)
    expected, found = picture(VIEWS[name]()), known[case.stages[-1].writes[0]]
    off = np.abs(found - expected) > CHAIN * (large_value(expected) + np.abs(expected))
    assert off.mean() <= FLIPPED
    assert expected.any() == (name != "hssil-dark")


@pytest.mark.feature("HSS-13")
@pytest.mark.parametrize("name", cases.TEMPORAL)
def test_the_blend_is_that_of_a_sequence(name):
    case, known, _ = made(name)
    with diagnosing(False):
        expected = [*sequence(name)][-1].irradiance
    off = np.abs(known["sssil.blend.irradiance"] - expected) > CHAIN * large_value(expected)
    assert off.mean() <= FLIPPED
    step = next(one for one in case.stages if one.name == "sssil.reprojection")
    ids = known[next(one for one in step.reads if one.startswith("rsm.visible_triangles") and "projection" not in one)]
    assert (known["sssil.reprojection.weight"][ids >= 0] == 0).any(), "no pixel is disoccluded"
    assert not (ids >= 0).all()


@pytest.mark.feature("HSS-05")
@pytest.mark.filterwarnings("ignore:radius")
@pytest.mark.parametrize("name", [*VIEWS, *cases.TEMPORAL])
def test_steps_make_what_their_stage_makes(name):
    """Levels and sums of the fused stages, with samples that float32 shifts do not move to another texel."""
    with observe(record=True, steps=True) as log, diagnosing(False):
        if name in VIEWS:
            picture(VIEWS[name]())
        else:
            list(sequence(name))
    compared = set()
    for run in (one for one in log.runs if one.steps is not None and one.name.startswith("sssil.")):
        whole, steps = dict(leaves(run.output)), dict(leaves(run.steps))
        assert set(steps) <= set(whole)
        for leaf, array in steps.items():
            np.testing.assert_allclose(array, whole[leaf], rtol=0, atol=STEPS * max(large_value(whole[leaf]), 1e-300))
        compared.add(run.name)
    assert compared == {"sssil.pyramid", "sssil.gather"} | ({"sssil.temporal"} if name in cases.TEMPORAL else set())


@pytest.mark.parametrize("name", CASES)
def test_bounds_are_near_rounding_and_masks_are_few(name):
    _, known, bounds = made(name)
    for key, bound in ((key, bound) for key, bound in bounds.items() if key.startswith("sssil.")):
        assert bound.masked.mean() < MASKED, key
        assert (bound.limit > LOOSE * large_value(known[key])).mean() <= AMPLIFIED or not known[key].any(), key


@pytest.mark.parametrize("name", CASES)
def test_the_literal_text_is_the_stages(name):
    """Bugs, which are edits of it, are wrong by what they say alone."""
    case, known, bounds = made(name)
    for step in case.stages:
        if step.name.startswith("sssil.") and step.name != "sssil.senders":
            read = {key: known[key].astype(float) if known[key].dtype.kind == "f" else known[key] for key in step.reads}
            assert len(step.variants) == (3 if step.name.startswith("sssil.clamp") else 1), step.name
            for key, array in step.variants[0](read, np.float64).items():
                same(np.where(bounds[key].masked, known[key], array), known[key])


@pytest.mark.parametrize("name", CASES)
def test_only_scene_views_and_random_numbers_are_given(name):
    case = made(name)[0]
    own = {one for one in case.given if one.startswith("sssil.") and ".projection." not in one}
    before = {f"sssil.reprojection.{key}" for key in ("irradiance", "frames")} | (
        {"sssil.motion.before", "sssil.reprojection.depth", "sssil.reprojection.normal_before"}
        if name == "hssil-moving" else set())
    assert all(one.endswith((".start", ".shifts")) for one in own - before)
    assert own & before == set() if name in VIEWS else "sssil.reprojection.irradiance" in own


def same(array, expected):
    """Compare to the rounding of float32."""
    finite = np.isfinite(expected)
    np.testing.assert_array_equal(np.isfinite(array), finite)
    if expected.dtype.kind != "f":
        np.testing.assert_array_equal(array, expected)
    off = np.abs(np.asarray(array)[finite] - expected[finite]).max(initial=0)
    assert off <= 1e-5 * max(large_value(expected), 1e-30)
