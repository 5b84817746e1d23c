"""Literal forms of the stages of clustered visibility, into which bugs are put: without one they are the stages."""

import numpy as np
import pytest

from refgi.cluster.settings import Csm
from refgi.vectors.bounds import distance, isolated_bounds, large_value
from refgi.vectors.bugs.val_depth import basis_by, depths_by
from refgi.vectors.bugs.val_facing import faced_by
from refgi.vectors.bugs.val_kmeans import Metric, assigned_by, mean_of, means_by, unit_sum
from refgi.vectors.bugs.val_sum import summed_by
from refgi.vectors.cases.val import FULL_SETUPS, SETUPS
from refgi.vectors.spec import expected_of, outputs_of

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # that is told: tests/pairs/test_loss

LITERAL = ("series", "mip", "search", "search.means", "penumbra", "penumbra.means", "hard", "visibility", "blur")
EQUAL = 1e-6  # float32 in which arrays are stored, some 8 times


def literal_forms(name):
    """Return the literal form of each stage of a case that has one."""
    settings = SETUPS[name].settings
    kind, clusters = settings.visibility, settings.clusters
    forms = {f"kmeans.assign{k}": assigned_by(k, (clusters.position_weight, clusters.normal_weight), Metric())
             for k in (0, 1)}
    forms |= {f"kmeans.means{k}": means_by(k, f"kmeans.of{k - 1}", mean_of, unit_sum) for k in (1, 2)}
    if SETUPS[name].scene.geometry.vertex_normals is not None:
        forms |= {"facing": faced_by()}
    forms |= {"sum": summed_by(lambda parts, share: (parts * share).sum(axis=0))}
    if not isinstance(kind, Csm):
        return forms
    return forms | {"maps.t": depths_by(kind), "basis": basis_by(lambda k: (2 * k - 1) * np.pi, kind.terms)}


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


@pytest.mark.parametrize("name", SETUPS | FULL_SETUPS)
def test_the_literal_text_of_a_stage_is_the_stage(name):
    """Oracle: kernels, in float64."""
    case = (SETUPS | FULL_SETUPS)[name].case()
    known = expected_of(case)
    for step in case.stages:
        for form in step.variants if step.name in LITERAL else ():
            for one, made in outputs_of(step, known, np.float64, form).items():
                off = distance(made, known[one]) > EQUAL * (np.abs(known[one]) + large_value(known[one]))
                assert not off.any(), (step.name, one, int(off.sum()))


@pytest.mark.parametrize("name", SETUPS)
def test_no_cause_is_named_twice_in_a_stage(name):
    for step in SETUPS[name].case().stages:
        causes = [bug.cause for bug in step.bugs]
        assert len(set(causes)) == len(causes), step.name
