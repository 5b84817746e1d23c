"""Stages of `multires` in the kit: the production method at their end, the literal text, rays by plane geometry."""

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.lights.selection import choose_lights
from refgi.pairs.settings import PairSettings
from refgi.splat import multires
from refgi.stages import observe
from refgi.vectors.cases.multires import FULL_PLANS, QUICK_PLANS, settings_of
from refgi.vectors.rows import Form
from refgi.vectors.spec import outputs_of
from tests.literal.whole.pairs import contributions
from tests.naive.crossings import LIFT, corners_of, face_normals, free
from tests.vectors.splat_ports import LARGEST_MASK, expect_within, made, masked_shares, named_as_given, stage_of

PLANS = QUICK_PLANS | FULL_PLANS
STORED = 2e-6  # of the picture's largest value: each of a dozen stages rounds its outputs to float32
SERIES = 1e-5  # past convolution shadow maps, whose 4th term turns by 7 pi over a map's depths: 5e-6 at two elements
ROUNDING = 1e-6  # of float64 results that are stored as float32
RAYS = "multires-rays"
MIPMAPS = {f"multires.{name}" for name in ("depth_ranges", "normal_ranges", "depth_slopes", "curvatures")}

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")


@pytest.mark.parametrize("id", PLANS)
def test_the_last_array_is_the_picture_of_the_method(id):
    plan = PLANS[id]()
    frame = Frame(plan.scene, width=plan.size[0], height=plan.size[1], dtype=np.float64, rsm_resolution=plan.maps)
    expected = multires(frame, settings_of(plan))
    case, known = made(id)
    got = known[case.stages[-1].writes[0]]
    rounded = SERIES if id == "multires-soft" else STORED
    np.testing.assert_allclose(got, expected, rtol=0, atol=rounded * expected.max())
    assert (got.max() > 0) != (id == "multires-no-flux")


@pytest.mark.parametrize("id", PLANS)
def test_stages_make_all_but_scene_and_views(id):
    assert [name for name in made(id)[0].given if not named_as_given(name)] == []


@pytest.mark.parametrize("id", ["multires-edge", "multires-published", "multires-slopes", "multires-rate"])
def test_mipmaps_are_asked_for_as_the_method_does(id):
    plan = PLANS[id]()

    def numbers(steps):
        frame = Frame(plan.scene, width=plan.size[0], height=plan.size[1], dtype=np.float64, rsm_resolution=plan.maps)
        with observe(record=True, steps=steps) as log:
            multires(frame, settings_of(plan))
        return {run.name: {key: one for key, one in run.arguments.items() if not isinstance(one, np.ndarray)}
                for run in log.runs if run.name in MIPMAPS}

    assert numbers(True) == numbers(False) != {}


@pytest.mark.parametrize("id", PLANS)
def test_rounding_decides_few_elements(id):
    assert max(masked_shares(id, "multires").values()) < LARGEST_MASK


@pytest.mark.parametrize("id", PLANS)
def test_the_literal_text_is_the_stage(id):
    case, known = made(id)
    for step in case.stages:
        for form in (one for one in step.variants if isinstance(one, Form) and step.name.startswith("multires")):
            for name, got in outputs_of(step, known, np.float64, form).items():
                scale = np.abs(known[name][np.isfinite(known[name])]).max(initial=0)
                np.testing.assert_allclose(got, known[name], rtol=ROUNDING, atol=ROUNDING * scale, err_msg=name)


def test_subsplats_see_what_plane_geometry_says():
    """Faces, blockers and light of each pair. Lights lie on triangles as well: what leaves below one is blocked."""
    known, plan = made(RAYS)[1], PLANS[RAYS]()
    frame = Frame(plan.scene, width=plan.size[0], height=plan.size[1], dtype=np.float64, rsm_resolution=plan.maps)
    lights, geometry = choose_lights(frame, settings_of(plan).lights), plan.scene.geometry
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
