"""Stages of `vpl` in the kit: the production method at their end, the literal twin as a port, bugs."""

import math

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.pairs.settings import PairSettings
from refgi.settings import of
from refgi.truth.vpl import VplSettings, vpl
from refgi.vectors.cases.vpl import FULL_PLANS, QUICK_PLANS
from refgi.vectors.stages.lights import pixel_lights_of
from tests.naive import imperfect
from tests.naive.crossings import LIFT, corners_of, face_normals, free
from tests.naive.pair_term import contributions
from tests.vectors.splat_ports import LARGEST_MASK, expect_within, made, masked_shares, stages_of

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


class Given:
    """The stored arrays of a case, receivers as rows."""

    def __init__(self, id):
        known = made(id)[1]
        self.known, self.geometry, self.shape = known, PLANS[id]().scene.geometry, known["gbuffer.triangle_id"].shape
        self.at = np.nonzero(known["gbuffer.triangle_id"] >= 0)
        self.position, self.normal = (known[f"gbuffer.{key}"][:, *self.at].T.astype(float) for key in (
            "position", "normal"))
        self.lights = pixel_lights_of(known, np.float64)
        count = self.lights.flux.shape[1]
        self.light = contributions(self.position, self.normal, self.lights, FLAT) if count else np.zeros((0, 1, 3))
        self.count = count

    def picture(self, values, kind):
        """Return (..., h, w) of values (..., n) at the covered pixels."""
        whole = np.zeros((*values.shape[:-1], *self.shape), kind)
        whole[..., *self.at] = values
        return whole


def facing(id):
    given = Given(id)
    normals = face_normals(given.geometry, given.known["gbuffer.triangle_id"][given.at], given.normal)
    return {"vpl.facing": given.picture(normals.T, float)}


def points(id):
    """Places and faces by the twin, a face found by its number among those of the twin's normals."""
    known = made(id)[1]
    corners = known["scene.vertices"][known["scene.faces"]].astype(float)
    area = [np.linalg.norm(np.cross(b - a, c - a)) / 2 for a, b, c in corners]
    count, shifts = made(id)[0].facts["vpl.maps"]["points"], known["vpl.shift"].astype(float)
    place, face = np.zeros((len(shifts), count, 3)), np.zeros((len(shifts), count), int)
    for i, (x, a, b) in enumerate(shifts):
        for k in range(count):
            share = (k + x) / count
            place[i, k], _ = imperfect.point_of(corners, area, share, (a + k / imperfect.GROWTH) % 1,
                                                (b + k / imperfect.GROWTH**2) % 1)
            face[i, k] = next(f for f in range(len(area)) if share * sum(area) < sum(area[: f + 1]))
    return {"vpl.point": place, "vpl.point_face": face,
            "vpl.point_radius": np.array([math.sqrt(sum(area) / count / math.pi)])}


def frames(id):
    normals = made(id)[1]["lights.normal"].T.astype(float)
    return {"vpl.frame": np.array([[*imperfect.basis(n), n] for n in normals])}


def maps(id):
    """The twin's maps of points of its own: those of the case, whose random numbers are the method's."""
    known, facts, settings = made(id)[1], made(id)[0].facts["vpl.maps"], of(VplSettings, **PLANS[id]().choices).maps
    corners = known["scene.vertices"][known["scene.faces"]].astype(float)
    lights = zip(known["lights.position"].T.astype(float), known["lights.normal"].T.astype(float), strict=True)
    return {"vpl.depth": np.array([imperfect.depth_map(corners, place, normal, k, facts["points"], settings.resolution,
                                                       0, 0, settings.splat)[0]
                                   for k, (place, normal) in enumerate(lights)])}


def filled(id):
    case, known = made(id)
    return {"vpl.filled": np.array([imperfect.filled(one.astype(float), case.facts["vpl.maps"]["levels"])
                                    for one in known["vpl.depth"]])}


def looked_up(id):
    given, facts = Given(id), made(id)[0].facts["vpl.maps"]
    known = given.known
    depth, radius = known["vpl.filled" if facts["levels"] else "vpl.depth"], float(known["vpl.point_radius"][0])
    up = known["vpl.facing"][:, *given.at].T.astype(float)
    seen = np.zeros((given.count, len(given.position)), bool)
    for k, n in np.ndindex(*seen.shape):
        place, leaving = given.lights.position[:, k], given.lights.normal[:, k]
        toward = place - given.position[n]
        if min(toward @ up[n], toward @ given.normal[n], -toward @ leaving) > 0:
            seen[k, n] = not imperfect.is_hidden(depth[k], radius, facts["bias"], given.position[n], up[n], place,
                                                 leaving)
    return {"vpl.visible": given.picture(seen, bool)}


def visible(id):
    """Lights lie on triangles as well: what leaves below one is blocked by it."""
    given = Given(id)
    known, corners = given.known, corners_of(given.geometry)
    up = known["vpl.facing"][:, *given.at].T.astype(float)
    seen = np.zeros((len(given.light), len(given.position)), bool)
    for k in range(given.count):
        triangle = known[f"rsm{known['lights.map'][k]}.triangle_id"].reshape(-1)[known["lights.texel"][k]]
        place, leaving = given.lights.position[:, k], given.lights.normal[:, k]
        side = face_normals(given.geometry, np.array([triangle]), leaving[None])[0]
        toward = place - given.position
        counts = ((toward * up).sum(axis=1) > 0) & ((toward * given.normal).sum(axis=1) > 0)
        counts &= (toward @ leaving < 0) & (toward @ side < 0)
        counts[counts] = free(corners, given.position[counts] + LIFT * up[counts], place + LIFT * side)
        seen[k] = counts
    return {"vpl.visible": given.picture(seen, bool)}


def total(id):
    given = Given(id)
    seen = given.known["vpl.visible"][:, *given.at]
    light = (given.light * seen[..., None]).sum(axis=0) if len(given.light) else np.zeros((len(given.position), 3))
    return {"vpl.irradiance": given.picture(light.T, float)}


@pytest.mark.parametrize("id", PLANS)
def test_the_literal_twin_as_a_port_is_within_bounds(id):
    by_maps = "vpl.maps" in made(id)[0].facts
    port = {"vpl.facing": facing, "vpl.points": points, "vpl.frames": frames, "vpl.depth": maps, "vpl.filled": filled,
            "vpl.visible": looked_up if by_maps else visible, "vpl.sum": total}
    for name in stages_of(id, "vpl"):
        expect_within(id, name, port[name](id))


@pytest.mark.parametrize("id", PLANS)
def test_rounding_decides_few_elements(id):
    assert max(masked_shares(id, "vpl").values()) < LARGEST_MASK


def test_something_is_in_shadow_everywhere_but_in_the_dark():
    for id in set(PLANS) - {"vpl-no-flux"}:
        given = Given(id)
        lit = given.light.any(axis=2)
        assert 0.05 < given.known["vpl.visible"][:, *given.at][lit].mean() < 0.95
