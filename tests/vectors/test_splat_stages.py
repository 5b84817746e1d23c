"""Stages of splatting, gathering and visible pixel lights: the method at their end, the literal text at each."""

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.lights.selection import choose_lights
from refgi.literal.pairs import pair
from refgi.methods import find_method
from refgi.pairs.settings import PairSettings
from refgi.stages import observe
from refgi.vectors.cases.scenes import Planned
from refgi.vectors.leaves import leaves
from refgi.vectors.spec import as_read
from tests.literal.whole.pairs import contributions
from tests.naive.crossings import LIFT, corners_of, face_normals, free
from tests.vectors.made import (
    CASES,
    LARGEST_MASK,
    expect_literal,
    expect_within,
    made,
    masked_shares,
    named_as_given,
    stage_of,
    stages_of,
)

STARTS = {"pairs": "pairs.", "sii": ("lights.", "sii.", "pairs."), "gather": "gather", "vpl": "vpl",
          "multires": "multires"}  # of the names of a method's own stages
ALL = [id for id in CASES if id.partition("-")[0] in STARTS]
PLANNED = [id for id in ALL if isinstance(CASES[id], Planned)]
OWN = [id for id in ALL if not id.startswith(("pairs-", "sii-")) or "-range-" in id]  # sii's own stages are its range's
STORED = {"multires": 2e-6, "multires-soft": 1e-5}  # of the largest value: a dozen stages rounded to float32; a series
NEAR = 5e-6  # of other methods: places in float32, whose rounding near lights magnify
MAGNIFIED = ("sii-far", "sii-bytes")  # places in float32 at 50 m; steps of 8 bits, to either side of which they round
ON_EDGE = 1  # pixels at which rounding decides: the pair that defines the reference length lies on the threshold
STEPS = 2e-7  # maps of float64 points in place of float32 distances
EXACT = {"multires": (1e-6, 0.0)}  # of float64 results stored as float32, and elements beyond
RAYS = "multires-rays"
MIPMAPS = {f"multires.{name}" for name in ("depth_ranges", "normal_ranges", "depth_slopes", "curvatures")}
GIVEN = {"gather": {"gather.pattern.xi"}, "vpl-maps": {"vpl.scattered_points.shift"}}

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")


def picture(make):
    """Return what a planned method makes of its scene in float64."""
    plan = make.plan()
    frame = Frame(plan.scene, width=plan.size[0], height=plan.size[1], dtype=np.float64, rsm_resolution=plan.maps)
    return find_method(make.method).function(frame, make.settings(plan))


@pytest.mark.parametrize("id", [id for id in PLANNED if id not in MAGNIFIED])
def test_the_last_array_is_the_picture_of_the_method(id):
    expected, (case, known) = picture(CASES[id]), made(id)
    got = known[case.stages[-1].writes[-1 if case.method == "gather" else 0]]
    limit = STORED.get(id, STORED.get(case.method, NEAR))
    out = (np.abs(got - expected) > limit * expected.max()).any(axis=0)
    assert out.sum() <= ON_EDGE * ("-range-" in id)
    assert (got.max() > 0) != id.endswith("-no-flux")


@pytest.mark.parametrize("id", ALL)
def test_the_literal_text_is_the_stage(id):
    names = stages_of(id, STARTS[id.partition("-")[0]])
    assert names
    for name in names:
        expect_literal(id, name, *EXACT.get(id.partition("-")[0], ()))


@pytest.mark.parametrize("id", [id for id in OWN if id in PLANNED])
def test_only_scene_views_and_random_numbers_are_given(id):
    method = CASES[id].method
    own = {one for one in made(id)[0].given if not named_as_given(one)} - {"lights.halton_points0.shifts"}
    if method == "sii":
        assert own == ({"sii.low_irradiance.length"} if id == "sii-range-length" else set())
    else:
        assert own == GIVEN.get("vpl-maps" if "vpl-maps" in id else method, set())


@pytest.mark.parametrize("id", OWN)
def test_rounding_decides_few_elements(id):
    start = STARTS[id.partition("-")[0]] if not id.startswith("sii-") else "sii."
    assert max(masked_shares(id, start).values()) < LARGEST_MASK


@pytest.mark.parametrize("id", [id for id in PLANNED if id.startswith("vpl-")])
def test_steps_make_what_their_stage_makes(id):
    with observe(record=True, steps=True) as log:
        picture(CASES[id])
    fused = [run for run in log.runs if run.steps is not None and run.name.startswith("vpl.")]
    assert {run.name for run in fused} == {"vpl.light"} | ({"vpl.imperfect_maps"} if "vpl-maps" in id else set())
    for run in fused:
        whole = dict(leaves(run.output))
        for leaf, array in leaves(run.steps):
            np.testing.assert_allclose(array, whole[leaf], rtol=STEPS)


@pytest.mark.parametrize("id", ["multires-edge", "multires-published", "multires-slopes", "multires-rate"])
def test_mipmaps_are_asked_for_as_the_method_does(id):
    def numbers(steps):
        with observe(record=True, steps=steps) as log:
            picture(CASES[id])
        return {run.name: {key: one for key, one in run.arguments.items() if not isinstance(one, np.ndarray)}
                for run in log.runs if run.name in MIPMAPS}

    assert numbers(True) == numbers(False) != {}


def test_cases_hold_both_sides_of_what_they_decide():
    """Property: pairs that are cut and kept, pixels that are interpolated or not, lights in shadow and in view."""
    for id in (id for id in PLANNED if "-range-" in id and "no-flux" not in id):
        known = made(id)[1]
        ids = next(name for name in stage_of(id, "sii.strengths").reads if name.startswith("rsm.visible_triangles"))
        counts = [known[f"sii.kept.{part}_kept"][:, known[ids] >= 0] for part in ("diffuse", "glossy")
                  if f"sii.kept.{part}_kept" in known]
        assert 0.02 < np.mean(counts) < 0.9, id
    assert 0.1 < made("gather-interpolated")[1]["gather.interpolate.interpolated"].mean() < 0.9
    for id in (id for id in PLANNED if id.startswith("vpl-") and id != "vpl-no-flux"):
        case, known = made(id)
        position, normal, ids, visible, *lights = (known[name] for name in case.stages[-1].reads)
        covered = ids >= 0
        sent = pair(*(plane[:, covered].astype(float)[:, None] for plane in (position, normal)),
                    *(one[:, :, None].astype(float) for one in lights[:3]))
        assert 0.05 < visible[:, covered][sent.any(axis=0)].mean() < 0.95


def test_subsplats_see_what_plane_geometry_says():
    """Faces, blockers and light of each pair. Lights lie on triangles as well: what leaves below one is blocked."""
    known, plan = made(RAYS)[1], CASES[RAYS].plan()
    frame = Frame(plan.scene, width=plan.size[0], height=plan.size[1], dtype=np.float64, rsm_resolution=plan.maps)
    lights, geometry = choose_lights(frame, CASES[RAYS].settings(plan).lights), plan.scene.geometry
    facing, seen_by, light = (stage_of(RAYS, f"multires.{name}") for name in (
        "subsplat_facing", "lights_seen", "seen_irradiance"))
    place, normal, up = (known[name].T.astype(float) for name in (*light.reads[:2], facing.writes[0]))
    triangle = frame.gbuffer.triangle_id.reshape(-1)[known["multires.subsplats.pixel"]]
    expect_within(RAYS, facing.name, {facing.writes[0]: face_normals(geometry, triangle, normal).T})
    seen = np.zeros((lights.flux.shape[1], len(place)), bool)
    for k in range(len(seen)):
        triangle = frame.rsms[lights.map_index[k]].triangle_id.reshape(-1)[lights.texel[k]]
        leaving = lights.normal[:, k]
        side = face_normals(geometry, np.array([triangle]), leaving[None])[0]
        toward = lights.position[:, k] - place
        counts = ((toward * up).sum(axis=1) > 0) & ((toward * normal).sum(axis=1) > 0)
        counts &= (toward @ leaving < 0) & (toward @ side < 0)
        counts[counts] = free(corners_of(geometry), place[counts] + LIFT * up[counts],
                              lights.position[:, k] + LIFT * side)
        seen[k] = counts
    expect_within(RAYS, seen_by.name, {seen_by.writes[0]: seen})
    each = contributions(place, normal, lights, PairSettings(clamp=None))
    total = (each * known[seen_by.writes[0]][..., None]).sum(axis=0).T
    expect_within(RAYS, light.name, {light.writes[0]: total})


@pytest.mark.parametrize("id", ["multires-soft", "multires-rays", "multires-lights", "multires-rate"])
def test_likely_bugs_of_the_forms_that_the_full_kit_adds_run(id):
    """An exporter ends at one that does not: what a list edits must be what the stage runs."""
    known = made(id)[1]
    for name in stages_of(id, "multires"):
        for bug in stage_of(id, name).bugs:
            assert bug.run(as_read(known, stage_of(id, name).reads, np.float64), np.float64), (name, bug.cause)
