"""The literal forms that bugs of `multires` are put into have none of their own."""

import numpy as np
import pytest

from refgi.vectors.bugs.detail import literal_detail
from refgi.vectors.bugs.list import literal_list
from refgi.vectors.bugs.marks import literal_marks
from refgi.vectors.bugs.ranges import literal_ranges
from refgi.vectors.bugs.slopes import depth_steps, literal_differences, normal_chords
from refgi.vectors.bugs.states import literal_states
from refgi.vectors.bugs.subsplat import literal_points
from refgi.vectors.bugs.upsample import literal_nearest
from refgi.vectors.cases.multires import FULL_PLANS, QUICK_PLANS, settings_of
from refgi.vectors.stages.multires_ranges import of_levels
from tests.vectors.splat_ports import expect_within, made, stages_of

PLANS = QUICK_PLANS | FULL_PLANS

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")


def settings(id):
    return settings_of(PLANS[id]()).subsplats


def top_of(id):
    return made(id)[0].facts["multires"]["coarsest_level"]


def exact(id):
    return {name: array.astype(np.float64) if array.dtype.kind == "f" else array for name, array in made(id)[1].items()}


def ranges(id, what):
    known, criteria = exact(id), settings(id).criteria
    planes = known["gbuffer.depth"][None] if what == "depth" else known["gbuffer.normal"][
        : len(criteria.normal.components)]
    return literal_ranges(planes, known["gbuffer.triangle_id"], what, top_of(id), criteria.rim)


def slopes(id):
    relative = settings(id).criteria.derivative.measure != "absolute"
    return dict(zip(of_levels("slope", top_of(id)), literal_differences(
        exact(id), depth_steps, top_of(id), relative=relative), strict=True))


def curvatures(id):
    return dict(zip(of_levels("curvature", top_of(id)), literal_differences(
        exact(id), normal_chords, top_of(id), join=np.maximum), strict=True))


def marks(id):
    return literal_marks(exact(id), of_levels("discontinuous", top_of(id)), settings(id).criteria, settings(id).finest)


def states(id):
    return literal_states(exact(id), settings(id).criteria.diagonal, of_levels("discontinuous", top_of(id)),
                          of_levels("state", top_of(id)))


LITERAL = {
    "depth_ranges": lambda id: ranges(id, "depth"), "normal_ranges": lambda id: ranges(id, "normal"), "slopes": slopes,
    "curvatures": curvatures, "discontinuities": marks, "states": states,
    "subsplats": lambda id: literal_list(exact(id), of_levels("state", top_of(id))),
    "points": lambda id: literal_points(exact(id), settings(id).representative),
    "detail": lambda id: {"multires.detailed": literal_detail(exact(id), made(id)[0].facts["multires.detail"])}}


@pytest.mark.parametrize("id", PLANS)
def test_the_stages_that_bugs_are_put_into_have_none_of_their_own(id):
    for name in stages_of(id, "multires"):
        key = name.split(".")[1]
        if key in LITERAL and not (key == "curvatures" and settings(id).criteria.curvature.name() == "rate"):
            expect_within(id, name, LITERAL[key](id))


def test_the_nearest_subsplats_light_has_no_bug_of_its_own():
    expect_within("multires-wall", "multires.upsample", {"multires.upsampled.0": literal_nearest(exact(
        "multires-wall"))})
