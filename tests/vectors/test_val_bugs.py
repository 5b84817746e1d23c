"""Literal forms of the stages of clustered visibility, into which bugs are put: without one they are the stages."""

import numpy as np
import pytest

from refgi.vectors.bounds import distance, isolated_bounds
from refgi.vectors.bugs.val_basis import chain_by
from refgi.vectors.bugs.val_cone import Cone, searched_by
from refgi.vectors.bugs.val_lookup import Lookup
from refgi.vectors.bugs.val_lookup import means_by as looked_up_by
from refgi.vectors.bugs.val_mip import levels_by, mean_of_four
from refgi.vectors.bugs.val_pcf import DepthTests, depth_tests_by
from refgi.vectors.bugs.val_series import Penumbra, Verdict, penumbra_by, verdict_by
from refgi.vectors.cases.val import SETUPS
from refgi.vectors.spec import expected_of, outputs_of

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # that is told: tests/pairs/test_loss


def literal_forms(name):
    """Return the literal form of each stage of a case that has one."""
    settings = SETUPS[name].settings
    kind = settings.visibility
    forms = {"hard": depth_tests_by("hard", 1, DepthTests()), "search": searched_by(Cone())}
    if name in ("val-single", "val-interleaved"):
        return forms | {"visibility": depth_tests_by("visibility", 5 if name == "val-interleaved" else 1, DepthTests())}
    if name == "val-pcss":
        return forms
    levels = [one for step in SETUPS[name].case().stages if step.name == "mip" for one in step.writes]
    return forms | {
        "series": chain_by(kind.terms), "mip": levels_by(levels, mean_of_four),
        "search.means": looked_up_by("search", "search.pending", Lookup()),
        "penumbra.means": looked_up_by("penumbra", "penumbra.shaded", Lookup()),
        "penumbra": penumbra_by(kind, Penumbra()), "visibility": verdict_by(1.0, Verdict())}


@pytest.mark.parametrize("name", SETUPS)
def test_the_forms_that_bugs_are_put_into_have_none_of_their_own(name):
    """Oracle: each literal form without a knob is the stage, within the bounds of a port."""
    case, forms = SETUPS[name].case(), literal_forms(name)
    known = expected_of(case)
    for step in case.stages:
        if step.name not in forms:
            continue
        bounds = isolated_bounds(case, step, known, 1)
        made = outputs_of(step, known, np.float64, forms[step.name])
        for one, bound in bounds.items():
            off = (distance(made[one], known[one]) > bound.limit) & ~bound.masked
            assert not off.any(), (step.name, one, int(off.sum()))


@pytest.mark.parametrize("name", SETUPS)
def test_no_cause_is_named_twice_in_a_stage(name):
    for step in SETUPS[name].case().stages:
        causes = [bug.cause for bug in step.bugs]
        assert len(set(causes)) == len(causes), step.name
