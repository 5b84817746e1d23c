"""Stages of `vpl` in the kit: the production method at their end, the literal text at each."""


import numpy as np
import pytest

from refgi.frame import Frame
from refgi.literal.pairs import pair
from refgi.pairs.settings import PairSettings
from refgi.settings import of
from refgi.truth.vpl import VplSettings, vpl
from refgi.vectors.cases.vpl import FULL_PLANS, QUICK_PLANS
from tests.vectors.splat_ports import LARGEST_MASK, expect_literal, made, masked_shares, stages_of

PLANS = QUICK_PLANS | FULL_PLANS
STORED = 5e-6  # of the largest value: places in float32, whose rounding near lights magnify
FLAT = PairSettings(clamp=None)


@pytest.mark.parametrize("id", PLANS)
def test_the_last_array_is_the_picture_of_the_method(id):
    plan = PLANS[id]()
    frame = Frame(plan.scene, width=plan.size[0], height=plan.size[1], dtype=np.float64, rsm_resolution=plan.maps)
    expected = vpl(frame, of(VplSettings, **{"lights": plan.lights * len(plan.scene.lights), **plan.choices}))
    case, known = made(id)
    got = known[case.stages[-1].writes[0]]
    np.testing.assert_allclose(got, expected, rtol=0, atol=STORED * expected.max())
    assert (got.max() > 0) != (id == "vpl-no-flux")


@pytest.mark.parametrize("id", PLANS)
def test_the_literal_text_is_the_stage(id):
    for name in stages_of(id, "vpl"):
        expect_literal(id, name)


@pytest.mark.parametrize("id", PLANS)
def test_rounding_decides_few_elements(id):
    assert max(masked_shares(id, "vpl").values()) < LARGEST_MASK


def test_something_is_in_shadow_everywhere_but_in_the_dark():
    for id in set(PLANS) - {"vpl-no-flux"}:
        known = made(id)[1]
        covered = known["gbuffer.triangle_id"] >= 0
        at = {key: known[f"gbuffer.{key}"][:, covered].astype(float) for key in ("position", "normal")}
        sent = pair(at["position"][:, None], at["normal"][:, None], *(
            known[f"lights.{key}"][:, :, None].astype(float) for key in ("position", "normal", "flux")))
        assert 0.05 < known["vpl.visible"][:, covered][sent.any(axis=0)].mean() < 0.95
