"""Every setting of a sequence's temporal filter: its pictures are those of the loops, and heeding the setting shows."""

import dataclasses
import math

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.settings import of, replaced
from refgi.sssil.hssil import hssil
from refgi.sssil.settings import HssilSettings, TemporalSettings
from refgi.sssil.temporal import Sequence
from tests.literal.whole import temporal
from tests.wiring.cases import SCENES, Case, uncovered
from tests.wiring.features import TEMPORAL, featured
from tests.wiring.fold import fold

ROUNDING = 1e-9  # of the brightest pixel: float64 in another order
COUNTS = 1e-3  # of the brightest pixel: a key that is not heeded
NOISY = of(HssilSettings, levels=2, radius=2.0, samples=6, pattern="pixel", seed=7)
OPTIONS = {"width": 17, "height": 13, "rsm_resolution": 16, "dtype": np.float64}

CASES = {
    "half of the frame before": Case({"weight": 0.5}),
    "as printed": Case({"form": "printed"}),
    "little tolerance": Case({"depth_tolerance": 0.001}),
    "any normal": Case({"normal_cosine": -1.0}),
    "slow": Case({"speed": 2.0}),
    "the nearest texel": Case({"fetch": "nearest"}),
    "no warm-up": Case({"warm_up": False}),
    "little of the frame before from the first": Case({"weight": 0.4}, {"warm_up": False}),
    "the camera's speed": Case({"entering_speed": 2.0}),
    "clamped": Case({"clamp": 0.5}),
    "clamped to few pixels": Case({"clamp_radius": 1}, {"clamp": 0.5}),
    "clamped at the edge": Case({"clamp": 0.3}, {"entering_speed": 5.0}),
}
FOLDED = fold(TemporalSettings, CASES)


def scenes():
    """Return three frames of a room whose ball, camera and lamps move."""
    room = SCENES["smooth"]()
    ball = [material.name for material in room.materials].index("ball")
    moving = np.unique(room.geometry.faces[room.geometry.material_of_face == ball])
    for step in range(3):
        vertices, normals = room.geometry.vertices.copy(), room.geometry.vertex_normals.copy()
        turn = rotation(0.2 * step)
        middle = vertices[moving].mean(axis=0)
        vertices[moving] = (vertices[moving] - middle) @ turn.T + middle + step * np.array([0.05, 0.03, 0.08])
        normals[moving] = normals[moving] @ turn.T
        geometry = dataclasses.replace(room.geometry, vertices=vertices, vertex_normals=normals)
        eye = np.add(room.camera.eye, step * np.array([0.03, -0.02, 0.04]))
        spot, point, sun = room.lights
        spot = dataclasses.replace(spot, position=tuple(np.add(spot.position, (0.1 * step, 0.0, 0.0))))
        target = np.add(room.camera.target, step * np.array([0.0, 0.1, 0.0]))  # the picture's edge moves on
        yield dataclasses.replace(room, geometry=geometry, lights=(spot, point, sun)).with_camera(
            eye=tuple(eye), target=tuple(target))


def rotation(angle):
    """Return a turn about an axis that no plane of the room is square to."""
    axis = np.array([0.36, 0.48, 0.8])
    across = np.cross(np.eye(3), axis)
    return np.eye(3) - math.sin(angle) * across + (1 - math.cos(angle)) * across @ across


@pytest.fixture(scope="module")
def computed():
    """Return frames and the light of each by itself, whose random numbers differ from frame to frame."""
    frames = [Frame(scene, **OPTIONS) for scene in scenes()]
    return frames, [hssil(frame, replaced(NOISY, {"seed": 7 + k})) for k, frame in enumerate(frames)]


def rendered(settings):
    return [step.irradiance for step in Sequence(scenes(), NOISY, settings, **OPTIONS)]


@pytest.fixture(scope="module", params=CASES)
def made(request):
    settings = CASES[request.param].settings(TemporalSettings)
    return CASES[request.param], settings, rendered(settings)


pytestmark = pytest.mark.filterwarnings("ignore:radius")  # crowns that end before the picture does


def test_every_field_has_a_case():
    assert uncovered(TemporalSettings, CASES) == set()


@pytest.mark.parametrize("name", featured(FOLDED, TEMPORAL))
def test_the_literal_text(name, computed, evidence):
    settings = FOLDED[name].settings(TemporalSettings)
    expected = temporal.filtered(*computed, settings)
    off = max(np.abs(a - b).max() / b.max() for a, b in zip(rendered(settings), expected, strict=True))
    evidence(f"{FOLDED[name].parts}: off by {off:.0e} of the brightest pixel")
    assert off < ROUNDING


def test_each_key_counts(made, evidence):
    case, _, pictures = made
    for key, settings in case.without(TemporalSettings):
        change = np.abs(pictures[-1] - rendered(settings)[-1]).max() / pictures[-1].max()
        evidence(f"{key}: {change:.1e} of the brightest pixel")
        assert change > COUNTS


def test_without_a_filter_each_frame_is_by_itself(computed):
    for light, expected in zip(rendered(None), computed[1], strict=True):
        np.testing.assert_array_equal(light, expected)
