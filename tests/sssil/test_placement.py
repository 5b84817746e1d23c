"""Cameras are put where they see what the picture misses, in free space, always the same ones."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.rays import Tracer
from refgi.rsm.raster.projection import camera_projection
from refgi.scene import load_scene
from refgi.scene.builtin.surfaces import rectangle
from refgi.scene.model import BLACK, Camera, Material, Scene, SpotLight, merge
from refgi.sssil.cameras import (
    Points,
    Views,
    _candidate_views,
    _greedy,
    _wide_views,
    equal_flux_points,
    place_cameras,
    sampling_quality,
    transport,
    unoccluded,
    visible_points,
)
from refgi.stages import observe
from tests.sssil.hidden_side import BACK, HALF_ANGLE, LIGHT, hidden_side

LOW_DISCREPANCY = 0.02  # some hundred points of a Halton sequence; a turn and a half would be off by 0.16
CENTRES = 2e-3  # 256 points of equal flux against the disc they stand for; texels of a map of 64


def small(scene, **options):
    return Frame(scene, **{"width": 40, "height": 30, "rsm_resolution": 64} | options)


@pytest.mark.feature("HSS-15")
def test_the_camera_placed_first_faces_the_side_that_the_picture_misses(evidence):
    """Analytic: the lit disc's middle lies inside its picture, and so does some of the wall."""
    frame = small(hidden_side())
    (camera,) = place_cameras(frame, 1)
    view = camera_projection(camera)
    seen = np.array([(0.0, 0.5, BACK), (0.0, 1.2, -2.0)]) - camera.eye
    right, down, depth = view.frame[0] @ seen.T
    assert -2 < camera.eye[2] < BACK
    assert (depth > 0).all()
    assert abs(right[0]) < view.half[0] * depth[0]
    assert abs(down[0]) < view.half[1] * depth[0]
    assert camera.up[1] > 0
    assert (camera.width, camera.height) == (40, 30)
    evidence(f"Fig. 9: eye at {np.round(camera.eye, 2).tolist()}, between the lit side and the wall")


@pytest.mark.parametrize("name", ["cornell_box", "atrium:faces=10000"])
def test_eyes_are_in_free_space(name):
    """Property: each sees a place that the picture shows as well, from the side that the picture shows."""
    frame = small(load_scene(name))
    points = visible_points(frame.gbuffer)
    offset = frame.tracer.offsets(points.position)[:, None]
    cameras = place_cameras(frame, 4)
    assert len(cameras) > 1
    for camera in cameras:
        facing = ((camera.eye - points.position) * points.normal).sum(axis=1) > 0
        lifted = (points.position + offset * points.normal)[facing]
        assert unoccluded(frame.tracer, np.broadcast_to(camera.eye, lifted.shape), lifted).any()


def test_no_eye_lies_inside_a_solid():
    """Property: rays from within a closed box would meet its faces from behind."""
    frame = small(hidden_side())
    for camera in place_cameras(frame, 16):
        x, y, z = camera.eye
        assert not (abs(x) <= 0.5 and 0 <= y <= 1 and abs(z) <= 0.4)
        assert y > 0


@pytest.mark.feature("HSS-15")
def test_gains_are_over_all_cameras_chosen_so_far():
    """By hand: 6.5 by the last, then 1 by the second and 0.5 by the first, which beside the second alone brings 4."""
    gathered = np.array([[4.0, 0.0, 0.0], [0.0, 3.0, 0.0], [3.5, 2.0, 1.0]])
    assert _greedy(gathered, np.zeros(3), 0.1, 3) == [2, 1, 0]
    assert _greedy(gathered, np.zeros(3), 0.6, 3) == [2, 1]
    assert _greedy(gathered, np.full(3, 2.5), 0.1, 3) == [0, 1]


@pytest.mark.feature("HSS-15")
def test_each_camera_adds_to_those_before_it_and_the_first_are_the_same():
    frame = small(load_scene("cornell_box"))
    one, three = place_cameras(frame, 1), place_cameras(frame, 3)
    assert three[:1] == one
    assert len(set(three)) == 3


def nothing_missed():
    """Return one lit plate, whose light cannot reach itself."""
    plate = rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2), Material("plate", (0.5, 0.5, 0.5)), "plate")
    geometry, materials = merge([plate])
    light = SpotLight((0, 1, 0), (0, -1, 0), 0.3, 0.4, (1, 1, 1))
    return Scene("plate", geometry, materials, Camera((0, 2, 2), (0, 0, 0)), (light,))


@pytest.mark.parametrize("scene", [
    nothing_missed(),
    nothing_missed().with_camera(target=(0, 9, 9)),  # all background
    nothing_missed().with_lights(SpotLight((0, 1, 0), (0, 1, 0), 0.3, 0.4, (1, 1, 1))),  # nothing is lit
    nothing_missed().with_lights(SpotLight((0, 1, 0), (0, -1, 0), 0.3, 0.4, BLACK)),
    load_scene("wedge"),  # all that is lit is seen
], ids=["nothing is lit twice", "background", "light into nowhere", "black light", "all seen"])
def test_where_nothing_is_to_be_gained_there_are_no_cameras(scene):
    with observe() as log:
        assert place_cameras(small(scene, width=200, height=150), 3) == ()
    assert any(run.status == "skipped" and "shows all surfaces that light it" in run.reason for run in log.runs)


def test_a_view_straight_down_has_an_upward_direction():
    scene = hidden_side().with_camera(eye=(0, 5, -0.3), target=(0, 0, -0.3), up=(0, 0, -1))
    for camera in place_cameras(small(scene), 4):
        assert math.isfinite(sum(camera.up))


@pytest.mark.parametrize("up", [(0.0, 1.0, 0.0), (0.6, 0.0, -0.8)])
@pytest.mark.parametrize("ahead", [(0.0, 1.0, 0.0), (0.6, 0.0, -0.8), (0.8, 0.0, 0.6), (1e-4, -1.0, 0.0)])
def test_every_direction_has_a_view(up, ahead):
    """Property: right, down and forward are a right-handed frame, also for a view along the upward direction."""
    frame = Frame(hidden_side().with_camera(eye=(0.0, 0.3, 5.0), target=(0.1, 0.0, 0.0), up=up), width=8, height=6)
    ahead = np.array([ahead]) / np.linalg.norm(ahead)
    axes = _wide_views(frame.gbuffer.projection, frame.scene.camera.up, np.zeros((1, 3)), ahead).axes[0]
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(axes[2], ahead[0], atol=1e-12)
    assert np.linalg.det(axes) > 0


@pytest.mark.parametrize("size", [(1, 1), (1, 50), (50, 1), (24, 16)])
def test_pictures_of_any_shape(size):
    frame = small(hidden_side(), width=size[0], height=size[1])
    half, longer = math.tan(frame.scene.camera.vfov / 2), max(1.0, size[0] / size[1])
    wider = max(half, math.tan(math.radians(44)) / longer)  # the longer side sees 88 degrees at least
    for camera in place_cameras(frame, 2):
        assert (camera.width, camera.height) == size
        assert math.tan(camera.vfov / 2) == pytest.approx(wider)


def test_candidates_lie_in_every_direction_alike():
    """Closed form: about one pair of points in open space, directions of mean 0 and second moments 1/3."""
    def nothing(origins, _):
        return SimpleNamespace(distance=np.full(len(origins), np.inf))

    here = Points(np.zeros((1, 3)), np.array([[0.0, 1.0, 0.0]]))
    there = Points(np.array([[0.0, 2.0, 0.0]]), np.array([[0.0, -1.0, 0.0]]))
    eyes, ahead = _candidate_views(SimpleNamespace(closest=nothing), here, there, np.ones((1, 1)), 0.5)
    away = eyes - (0.0, 1.0, 0.0)
    far = np.linalg.norm(away, axis=1)
    direction = away / far[:, None]
    assert far.max() < 0.5
    np.testing.assert_allclose(direction.mean(axis=0), 0.0, atol=LOW_DISCREPANCY)
    np.testing.assert_allclose(direction.T @ direction / len(direction), np.eye(3) / 3, atol=LOW_DISCREPANCY)
    np.testing.assert_allclose(np.linalg.norm(ahead, axis=1), 1.0)


@pytest.mark.feature("HSS-15")
def test_lit_points_share_the_flux_that_the_side_reflects():
    """Analytic: a cone's flux times the albedo's sum, around the cone's middle, on the disc it lights."""
    points, flux = equal_flux_points(small(hidden_side()))
    cone = 2 * math.pi * (1 - math.cos(HALF_ANGLE)) * 3.0
    assert flux * len(points.position) == pytest.approx(cone * 1.1, rel=1e-4)
    np.testing.assert_allclose(points.position[:, 2], BACK, atol=1e-6)
    np.testing.assert_allclose(points.normal, np.broadcast_to((0, 0, -1), points.normal.shape), atol=1e-6)
    np.testing.assert_allclose(points.position.mean(axis=0)[:2], LIGHT[:2], atol=CENTRES)


@pytest.mark.feature("HSS-15")
def test_transport_is_that_of_a_point_light_and_heeds_what_blocks():
    """Analytic: Phi / pi cos cos / r^2 by hand; 0 behind a plate; nearer pairs as if at the least distance."""
    plate = rectangle((-1, -1, 0.5), (2, 0, 0), (0, 1.2, 0), Material("plate", (0.5,) * 3), "plate")
    tracer = Tracer(merge([plate])[0])
    ahead, back = np.array([(0.0, 0.0, 1.0)]), np.array([(0.0, 0.0, -1.0)])
    to = Points(np.array([(0.0, 0.5, 0.0), (0.0, -0.5, 0.0), (0.0, 0.5, 0.0)]), np.concatenate([ahead, ahead, back]))
    lit = Points(np.array([(0.0, 0.5, 1.0), (0.6, 0.5, 0.8)]), np.concatenate([back, back]))
    passing = transport(tracer, to, lit, 2.0, 0.1)
    np.testing.assert_allclose(passing[0], np.array([1.0, 0.8 * 0.8]) * 2 / math.pi, rtol=1e-12)
    assert passing[1, 0] == 0
    assert not passing[2].any()
    np.testing.assert_allclose(transport(tracer, to, lit, 2.0, 2.0)[0, 0], 2 / math.pi / 4, rtol=1e-12)


@pytest.mark.feature("HSS-15")
def test_sight_falls_with_distance_and_towards_grazing_views():
    """Analytic: 1 / (1 + (pixel z / (coarsest cos))^2); 0 outside, behind, hidden or facing away."""
    plate = rectangle((1.5, -1, 1), (0.3, 0, 0), (0, 2, 0), Material("plate", (0.5,) * 3), "plate")
    tracer = Tracer(merge([plate])[0])
    view = Views(np.zeros((1, 3)), np.array([[(1.0, 0, 0), (0, -1.0, 0), (0, 0, 1.0)]]), np.array((2.0, 1.0)), 0.1)
    toward, slanted = (0.0, 0.0, -1.0), (0.0, 0.8, -0.6)
    points = Points(np.array([(0, 0, 2), (0, 0, 2), (0, 0, -2), (0, 2.1, 2), (3.9, 0, 2), (5, 0, 2), (0, 0, 2)], float),
                    np.array([toward, slanted, toward, toward, toward, toward, (0, 0, 1)], float))
    np.testing.assert_allclose(sampling_quality(tracer, view, points, 0.4)[0],
                               [1 / (1 + 0.25), 1 / (1 + (0.2 / 0.24) ** 2), 0, 0,
                                1 / (1 + (0.2 / 0.4 * math.hypot(3.9, 2) / 2) ** 2), 0, 0], rtol=1e-12)
    points = Points(np.array([(3.3, 0, 2.0)]), np.array([toward]))  # behind the plate
    assert sampling_quality(tracer, view, points, 0.4)[0, 0] == 0
