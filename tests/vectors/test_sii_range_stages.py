"""Stages of the range of pixel lights in the kit: the production method at their end, the literal text at each."""

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.splat import sii
from refgi.vectors.cases.sii_range import FULL_PLANS, QUICK_PLANS, settings_of
from tests.vectors.splat_ports import LARGEST_MASK, expect_literal, made, masked_shares, stage_of, stages_of

PLANS = QUICK_PLANS | FULL_PLANS
STORED = 5e-6  # of the largest value: places in float32, whose rounding near lights magnify
ON_EDGE = 1  # pixels at which rounding decides: the pair that defines the reference length lies on the threshold

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")


@pytest.mark.parametrize("id", PLANS)
def test_the_last_array_is_the_picture_of_the_method(id):
    plan = PLANS[id]()
    frame = Frame(plan.scene, width=plan.size[0], height=plan.size[1], dtype=np.float64, rsm_resolution=plan.maps)
    expected, got = sii(frame, settings_of(plan)), made(id)[1]["sii.range_sum"]
    out = np.abs(got - expected).max(axis=0) > STORED * expected.max()
    assert out.sum() <= ON_EDGE
    assert (got.max() > 0) != (id == "sii-range-no-flux")


@pytest.mark.parametrize("id", [*PLANS, "sii-range-bounds", "pairs-diffuse", "pairs-glossy"])
def test_the_literal_text_is_the_stage(id):
    for name in stages_of(id, ("sii.", "pairs.")):
        expect_literal(id, name)


@pytest.mark.parametrize("id", PLANS)
def test_rounding_decides_few_elements(id):
    assert max(masked_shares(id, "sii.").values()) < LARGEST_MASK


def test_some_pairs_are_cut_and_some_are_not():
    for id in set(PLANS) - {"sii-range-no-flux"}:
        known = made(id)[1]
        ids = next(name for name in stage_of(id, "sii.strengths").reads if name.startswith("rsm.visible_triangles"))
        covered = known[ids] >= 0
        counts = [known[f"sii.kept.{part}_kept"][:, covered] for part in ("diffuse", "glossy")
                  if f"sii.kept.{part}_kept" in known]
        assert 0.02 < np.mean(counts) < 0.9, id
