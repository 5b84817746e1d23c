"""Stages of `vpl` in the kit: the production method at their end, the literal text at each."""


import numpy as np
import pytest

from refgi.frame import Frame
from refgi.literal.pairs import pair
from refgi.pairs.settings import PairSettings
from refgi.stages import observe
from refgi.truth.vpl import vpl
from refgi.vectors.cases.vpl import FULL_PLANS, QUICK_PLANS, settings_of
from refgi.vectors.recorded import leaves
from tests.vectors.splat_ports import LARGEST_MASK, expect_literal, made, masked_shares, stages_of

PLANS = QUICK_PLANS | FULL_PLANS
STEPS = 2e-7  # maps of float64 points in place of float32 distances
STORED = 5e-6  # of the largest value: places in float32, whose rounding near lights magnify
FLAT = PairSettings(clamp=None)


@pytest.mark.parametrize("id", PLANS)
def test_the_last_array_is_the_picture_of_the_method(id):
    plan = PLANS[id]()
    frame = Frame(plan.scene, width=plan.size[0], height=plan.size[1], dtype=np.float64, rsm_resolution=plan.maps)
    expected = vpl(frame, settings_of(plan))
    case, known = made(id)
    got = known[case.stages[-1].writes[0]]
    np.testing.assert_allclose(got, expected, rtol=0, atol=STORED * expected.max())
    assert (got.max() > 0) != (id == "vpl-no-flux")


@pytest.mark.parametrize("id", PLANS)
def test_steps_make_what_their_stage_makes(id):
    plan = PLANS[id]()
    frame = Frame(plan.scene, width=plan.size[0], height=plan.size[1], dtype=np.float64, rsm_resolution=plan.maps)
    with observe(record=True, steps=True) as log:
        vpl(frame, settings_of(plan))
    fused = [run for run in log.runs if run.steps is not None and run.name.startswith("vpl.")]
    assert {run.name for run in fused} == {"vpl.light"} | ({"vpl.imperfect_maps"} if "vpl-maps" in id else set())
    for run in fused:
        whole = dict(leaves(run.output))
        for leaf, array in leaves(run.steps):
            np.testing.assert_allclose(array, whole[leaf], rtol=STEPS)


@pytest.mark.parametrize("id", PLANS)
def test_only_scene_views_and_random_numbers_are_given(id):
    own = {one for one in made(id)[0].given if one.startswith("vpl.")}
    assert own == ({"vpl.scattered_points.shift"} if "vpl-maps" in id else set())


@pytest.mark.parametrize("id", PLANS)
def test_the_literal_text_is_the_stage(id):
    for name in stages_of(id, "vpl"):
        expect_literal(id, name)


@pytest.mark.parametrize("id", PLANS)
def test_rounding_decides_few_elements(id):
    assert max(masked_shares(id, "vpl").values()) < LARGEST_MASK


def test_something_is_in_shadow_everywhere_but_in_the_dark():
    for id in set(PLANS) - {"vpl-no-flux"}:
        case, known = made(id)
        position, normal, ids, visible, *lights = (known[name] for name in case.stages[-1].reads)
        covered = ids >= 0
        sent = pair(*(plane[:, covered].astype(float)[:, None] for plane in (position, normal)),
                    *(one[:, :, None].astype(float) for one in lights[:3]))
        assert 0.05 < visible[:, covered][sent.any(axis=0)].mean() < 0.95
