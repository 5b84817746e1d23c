"""Oracle tests of the kit's screen-space stages: the chain is the method, the twins are a port, bugs are seen."""

import re
from functools import cache

import numpy as np
import pytest

from refgi.diagnostics import diagnosing
from refgi.frame import Frame
from refgi.rsm.raster.projection import camera_projection
from refgi.sssil.crown.pattern import samples_at, shared_offsets
from refgi.sssil.hssil import hssil
from refgi.vectors.bounds import distance, isolated_bounds, large_value
from refgi.vectors.bugs import (
    averaged,
    bilateral,
    blur,
    crown_gather,
    crown_points,
    crown_sample,
    crown_set,
    nearest_texels,
)
from refgi.vectors.cases import hssil as cases
from refgi.vectors.spec import expected_of
from refgi.vectors.stages import levels, reprojection
from tests.vectors import screen_space_port as port

CASES = {**cases.QUICK, **cases.FULL}
CHAIN = 2e-5  # of the large values: some 20 stages, each rounded to float32 (6e-8) and some divided by small numbers
FLIPPED = 0.005  # share of values that rounding decides otherwise in the chain: ties between equally near texels
MASKED = 0.05  # share of an array that rounding may decide
LOOSE = 1e-4  # of the large values: most bounds beyond this would hide bugs
AMPLIFIED = 0.005  # share of bounds beyond: means over texels that weigh next to nothing
UNCOVERED = {"gbuffer.ids", "gbuffer.surface", "before.ids", "before.surface", "rsm.ids", "rsm.surface"}
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
def test_twins_are_a_port(name):
    """Stages of ids and surfaces have twins of their own (tests/rsm); all others are covered."""
    case, known, bounds = made(name)
    for step in case.stages:
        read = {key: known[key].astype(float) if known[key].dtype.kind == "f" else known[key] for key in step.reads}
        written = port.outputs(case, step, read)
        if written is None:
            assert NO_LEVEL.sub("", step.name) in UNCOVERED
            continue
        for key in step.writes:
            wrong = outside(written[key], known[key], bounds[key])
            assert not wrong.any(), f"{step.name}, {key}: {int(wrong.sum())} of {wrong.size}"


@pytest.mark.parametrize("name", CASES)
def test_bounds_are_near_rounding_and_masks_are_few(name):
    _, known, bounds = made(name)
    for key, bound in bounds.items():
        assert bound.masked.mean() < MASKED, key
        assert (bound.limit > LOOSE * large_value(known[key])).mean() <= AMPLIFIED or not known[key].any(), key


@pytest.mark.parametrize("name", ["hssil-default", "hssil-paper", "hssil-odd"])
def test_literal_forms_without_a_bug_are_the_stages(name):
    """Bugs are wrong by what they say alone."""
    case, known, _ = made(name)
    exact = {key: array.astype(float) if array.dtype.kind == "f" else array for key, array in known.items()}
    facts, settings = case.facts, cases.SETTINGS[name]
    for index in range(facts["hssil"]["levels"]):
        one = facts[f"samples{index}"]
        key, counts = f"samples{index}", (one["disc"], one["crown"])
        same(crown_points.sequence(*counts), known[f"{key}.points"])
        same(crown_points.shifted(exact[f"{key}.shift"], tuple(one["tile"]), counts[1]), known[f"{key}.shifts"])
        offsets, weight = crown_sample.crown_samples(exact[f"{key}.points"], exact[f"{key}.shifts"], counts[0],
                                                          one["radius"], one["density"])
        np.testing.assert_array_equal(offsets, known[f"{key}.offsets"])
        same(weight, known[f"{key}.weight"])
        same(crown_gather.gathered(exact, index), known[f"gather{index}.irradiance"])
        view, first = camera_projection(case.scene.camera, *cases.VIEWS[name][1]), facts["hssil"]["first level"]
        made_of = nearest_texels.coarser_level(exact, index, first + index, (view.height, view.width)) if index else \
            nearest_texels.first_level(exact, view, first)
        for key, array in made_of.items():
            same(array, known[f"level{index}.{key}"])
        if settings.blur is not None:
            planes = levels.level_names(index, "position", "normal", "depth")
            same(blur.boxed(exact, f"gather{index}.irradiance", planes, settings.blur),
                 known[f"blur{index}.irradiance"])
    for step in case.stages:
        if step.name.startswith(("light", "picture")):
            coarse, *guides = step.reads[:5]
            light = bilateral.bilateral(exact, coarse, tuple(guides[:2]), tuple(guides[2:]), settings.upsampling)
            same(light + (exact[step.reads[5]] if len(step.reads) > 5 else 0), known[step.writes[0]])


@pytest.mark.parametrize("name", ["hssil-average", "hssil-radiance", "hssil-all"])
def test_literal_means_and_sets_without_a_bug_are_the_stages(name):
    case, known, _ = made(name)
    exact = {key: array.astype(float) if array.dtype.kind == "f" else array for key, array in known.items()}
    view, sampling = camera_projection(case.scene.camera, *cases.VIEWS[name][1]), cases.SETTINGS[name].sampling
    first, mode = sampling.first_level, cases.SETTINGS[name].senders.downsample
    for index in range(case.facts["hssil"]["levels"]):
        side, facts = (1 << first) if index == 0 else 2, case.facts[f"samples{index}"]
        if mode == "average":
            found = averaged.averaged(averaged.finer(exact, view, index), side)
        else:
            found = averaged.counted_level(exact, view, index, first + index) if mode == "closest_average" else {}
        for key, array in found.items():
            same(array, known[f"level{index}.{key}"])
        if sampling.pattern == "fixed":
            offsets, weight = crown_set.mirrored_set(exact[f"samples{index}.shift"], (facts["disc"], facts["crown"]),
                                                     facts["radius"], sampling.density)
            np.testing.assert_array_equal(offsets[None, None], known[f"samples{index}.offsets"])
            same(weight[None, None], known[f"samples{index}.weight"])
        if sampling.pattern == "all":
            found = crown_set.every(facts["radius"] if index else 0.0, 2 * facts["radius"])
            np.testing.assert_array_equal(found[None, None], known[f"samples{index}.offsets"])


@pytest.mark.parametrize("name", cases.TEMPORAL)
def test_literal_reprojection_without_a_bug_is_the_stage(name):
    case, known, _ = made(name)
    points = next(step.reads[:2] for step in case.stages if step.name == "reprojected")
    for key, array in reprojection._reprojected(known, points, cases.TEMPORAL[name]).items():
        same(array, known[key])


def same(array, expected):
    """Compare to the rounding of float32."""
    finite = np.isfinite(expected)
    np.testing.assert_array_equal(np.isfinite(array), finite)
    off = np.abs(np.asarray(array)[finite] - expected[finite]).max(initial=0)
    assert off <= 1e-5 * max(large_value(expected), 1e-30)
