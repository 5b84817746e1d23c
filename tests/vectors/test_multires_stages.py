"""Stages of `multires` in the kit: the production method at their end, the literal text, rays by plane geometry."""

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.pairs.settings import PairSettings
from refgi.splat import multires
from refgi.vectors.cases.multires import FULL_PLANS, QUICK_PLANS, settings_of
from refgi.vectors.rows import Form
from refgi.vectors.spec import outputs_of
from refgi.vectors.stages.lights import pixel_lights_of
from tests.naive.crossings import LIFT, corners_of, face_normals, free
from tests.naive.pair_term import contributions
from tests.vectors.splat_ports import LARGEST_MASK, expect_within, made, masked_shares

PLANS = QUICK_PLANS | FULL_PLANS
STORED = 2e-6  # of the picture's largest value: each of a dozen stages rounds its outputs to float32
ROUNDING = 1e-6  # of float64 results that are stored as float32
RAYS = "multires-rays"

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")


@pytest.mark.parametrize("id", PLANS)
def test_the_last_array_is_the_picture_of_the_method(id):
    plan = PLANS[id]()
    frame = Frame(plan.scene, width=plan.size[0], height=plan.size[1], dtype=np.float64, rsm_resolution=plan.maps)
    expected = multires(frame, settings_of(plan))
    case, known = made(id)
    got = known[case.stages[-1].writes[0]]
    np.testing.assert_allclose(got, expected, rtol=0, atol=STORED * expected.max())
    assert (got.max() > 0) != (id == "multires-no-flux")


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
    known, geometry = made(RAYS)[1], PLANS[RAYS]().scene.geometry
    place, normal, up = (known[f"multires.{key}"].T.astype(float) for key in ("point", "normal", "facing"))
    triangle = known["gbuffer.triangle_id"].reshape(-1)[known["multires.pixel"]]
    expect_within(RAYS, "multires.facing", {"multires.facing": face_normals(geometry, triangle, normal).T})
    lights = pixel_lights_of(known, np.float64)
    seen = np.zeros((lights.flux.shape[1], len(place)), bool)
    for k in range(len(seen)):
        triangle = known[f"rsm{known['lights.map'][k]}.triangle_id"].reshape(-1)[known["lights.texel"][k]]
        leaving = lights.normal[:, k]
        side = face_normals(geometry, np.array([triangle]), leaving[None])[0]
        toward = lights.position[:, k] - place
        counts = ((toward * up).sum(axis=1) > 0) & ((toward * normal).sum(axis=1) > 0)
        counts &= (toward @ leaving < 0) & (toward @ side < 0)
        counts[counts] = free(corners_of(geometry), place[counts] + LIFT * up[counts],
                              lights.position[:, k] + LIFT * side)
        seen[k] = counts
    expect_within(RAYS, "multires.visible", {"multires.visible": seen})
    each = contributions(place, normal, lights, PairSettings(clamp=None))
    light = (each * known["multires.visible"][..., None]).sum(axis=0).T
    expect_within(RAYS, "multires.irradiance", {"multires.irradiance": light})
