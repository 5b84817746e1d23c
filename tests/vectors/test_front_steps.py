"""Steps of the front end: they make what fused stages make, nothing but inputs is given, each has a literal form."""

import re

import numpy as np
import pytest

from refgi import stages
from refgi.frame import Frame
from refgi.settings import of
from refgi.splat import sii
from refgi.splat.sii.settings import SiiSettings
from refgi.vectors.cases.scenes import AWAY, BULB, SPOT, SUN, room
from refgi.vectors.cases.splat import RANGE, SII, SII_FULL
from refgi.vectors.leaves import leaves
from refgi.vectors.rows import Form
from tests.vectors.made import made

SAME = 1e-12  # of the largest value: sums of pairs in another order
PLANS = (*SII, *SII_FULL, *RANGE)
INPUTS = re.compile(r"scene\.|materials\.|.*\.(projection|lamp)\.|lights\.(halton_points0?\.shifts|warp\d?\.points)$")
SETTINGS = ({}, {"seed": 5}, {"filtered": True, "pattern": "grid", "warp": "A"},
            {"warp": "B"}, {"pattern": "grid"}, {"pattern": "grid", "warp": "A"}, {"pattern": "random"},
            {"filtered": True, "pattern": "grid"}, {"filtered": True}, {"pattern": "all"}, {"lights": 2},
            {"warp": "A", "warp.renormalise_weights": True}, {"cut": "relative"},
            {"cut": "absolute", "cut.irradiance": 0.02}, {"cut": "relative", "reach.stochastic": True})

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")


@pytest.mark.parametrize("changed", SETTINGS, ids=str)
def test_steps_make_what_the_fused_stages_make(changed):
    frame = Frame(room(SPOT, BULB, SUN, AWAY), width=24, height=18, dtype=np.float64, rsm_resolution=16)
    with stages.observe(record=True, steps=True) as log:
        sii(frame, of(SiiSettings, **{"lights": 40, **changed}))
        assert frame.direct.any()
    compared = set()
    for run in log.runs:
        steps, output = (dict(leaves(value)) for value in (run.steps, run.output))
        for name in steps.keys() & output.keys() if run.steps is not None else ():
            large = np.abs(output[name][np.isfinite(output[name])].astype(float)).max(initial=0)
            np.testing.assert_allclose(steps[name], output[name], rtol=0, atol=SAME * large, err_msg=run.name)
            compared.add(run.name)
    assert compared >= {"rsm.gbuffer", "rsm.reflective_shadow_map", "lights.draw", "lights.choose", "lights.areas",
                        "rsm.shadow_map_visibility", *(["sii.splat"] if "cut" in changed else [])}


@pytest.mark.parametrize("id", PLANS)
def test_all_but_inputs_is_made_and_every_step_has_a_literal_form(id):
    case = made(id)[0]
    given = [name for name in case.given if not INPUTS.match(name)]
    others = {"sii-range-length": ["sii.low_irradiance.length"], "sii-occluded": ["lights.occlude.openness"]}
    assert given == others.get(id, [])  # of the settings, of rays
    assert [step.name for step in case.stages if not any(isinstance(one, Form) for one in step.variants)] == []
