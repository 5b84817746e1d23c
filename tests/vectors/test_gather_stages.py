"""Stages of `gather` in the kit: the production method at their end, the literal text at each."""


import numpy as np
import pytest

from refgi.frame import Frame
from refgi.splat.gather import gather
from refgi.vectors.cases.gather import FULL, FULL_PLANS, QUICK, QUICK_PLANS, settings_of
from tests.vectors.splat_ports import LARGEST_MASK, expect_literal, made, masked_shares, named_as_given, stages_of

PLANS = QUICK_PLANS | FULL_PLANS
ALL = [*QUICK, *FULL]
STORED = 5e-6  # of the largest value: places in float32, whose rounding near texels magnify

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")


@pytest.mark.parametrize("id", PLANS)
def test_the_last_array_is_the_picture_of_the_method(id):
    plan = PLANS[id]()
    frame = Frame(plan.scene, width=plan.size[0], height=plan.size[1], dtype=np.float64, rsm_resolution=plan.maps)
    expected = gather(frame, settings_of(plan))
    case, known = made(id)
    got = known[case.stages[-1].writes[-1]]
    np.testing.assert_allclose(got, expected, rtol=0, atol=STORED * expected.max())
    assert (got.max() > 0) != (id == "gather-no-flux")


@pytest.mark.parametrize("id", ALL)
def test_the_literal_text_is_the_stage(id):
    for name in stages_of(id, "gather"):
        expect_literal(id, name)


@pytest.mark.parametrize("id", PLANS)
def test_stages_make_all_but_scene_views_and_random_numbers(id):
    assert [name for name in made(id)[0].given if not named_as_given(name)] == ["gather.pattern.xi"]


def test_some_pixels_are_interpolated_and_some_are_not():
    assert 0.1 < made("gather-interpolated")[1]["gather.interpolate.interpolated"].mean() < 0.9


@pytest.mark.parametrize("id", ALL)
def test_rounding_decides_few_elements(id):
    assert max(masked_shares(id, "gather").values()) < LARGEST_MASK
