"""The temporal filter: its variance, what it converges to, ghosts, moving objects and the speed they have."""

import dataclasses
import math

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.frame import Frame
from refgi.jit import threads
from refgi.literal.temporal import recursion
from refgi.scene import load_scene
from refgi.scene.motion import faces_of, moved, rotation_about
from refgi.sssil.motion import previous_points
from refgi.sssil.temporal import Sequence, TemporalSettings
from refgi.sssil.temporal_filter import clamp_to_neighbourhood, first_light, history_of, temporal_filter

SIZE = {"width": 40, "height": 30}
QUICK = {"rsm_resolution": 8}  # of no effect on indirect light that is made up
# 2,400 values or more of 40 frames' noise: the variance's own standard error is 2 to 3 %, four of them
VARIANCE_OFF = 0.12
# rounding of float32 places in a room a metre across, twice
PLACE_OFF = 2.5e-7


@pytest.fixture(scope="module")
def room():
    return load_scene("cornell_box").with_camera(**SIZE)


def noise(seed=0):
    generator = np.random.default_rng(seed)

    def light(frame, _):
        return generator.random((3, frame.height, frame.width)).astype(frame.dtype)

    return light


def constant(value):
    return lambda frame, _: np.full((3, frame.height, frame.width), value, frame.dtype)


def filtered(scenes, light, **changed):
    return list(Sequence(scenes, None, TemporalSettings(**changed), method=light, dtype=np.float64, **QUICK))


def turned(scene, angle, selected=None, move=(0.0, 0.0, 0.0)):
    geometry = scene.geometry
    selected = np.ones(len(geometry.faces), np.bool_) if selected is None else selected
    geometry = moved(geometry, selected, rotation_about((0.3, 1, 0.2), angle), (0.278, 0.273, 0.28), move)
    return dataclasses.replace(scene, geometry=geometry)


def at_rest(frame, lights, settings):
    """Light of a frame that is rendered again and again."""
    results, history = [], None
    for new in lights:
        light = first_light(new, settings)
        if history is not None:
            light, reused = temporal_filter(new, frame, frame.scene.geometry, history, settings)
            assert reused == 1
        printed = settings.form == "printed"
        history = history_of(frame, frame.scene.geometry, np.concatenate([new, light[3:]]) if printed else light)
        results.append(light[:3, frame.gbuffer.covered])
    return results


@pytest.mark.feature("HSS-13")
@pytest.mark.parametrize(("form", "a"), [("recursive", 0.9), ("recursive", 0.5), ("printed", 0.9)])
def test_variance_that_stays(room, evidence, form, a):
    frame, settings = Frame(room, dtype=np.float64), TemporalSettings(form=form, weight=a)
    frames = 40 if form == "recursive" else 3  # a^40 of the first is left
    last = at_rest(frame, np.random.default_rng(0).random((frames, 3, 30, 40)), settings)[-1]
    left, expected = last.var() * 12, a**2 + (1 - a) ** 2 if form == "printed" else (1 - a) / (1 + a)
    assert settings.variance == pytest.approx(expected)
    assert abs(left / expected - 1) < VARIANCE_OFF
    assert last.mean() == pytest.approx(0.5, abs=4 * math.sqrt(expected / 12 / last.size))  # 4 standard errors
    evidence(f"{form}, a = {a}: {left:.3f} of the variance stays, {expected:.3f} in theory")


@pytest.mark.feature("HSS-13")
def test_a_static_camera_converges(room, evidence):
    frame = Frame(room, dtype=np.float64)
    lights = np.random.default_rng(1).random((8, 3, 30, 40))
    covered = frame.gbuffer.covered
    cold = TemporalSettings(warm_up=False)
    error = np.abs(at_rest(frame, lights, cold)[-1] - recursion(lights, 0.9)[:, covered]).max()
    assert error < 1e-14
    steady = [lights[0]] + [lights[1]] * 12
    left = [np.abs(light - lights[1][:, covered]).max() for light in at_rest(frame, steady, cold)]
    assert left[12] / left[0] == pytest.approx(0.9**12, rel=1e-9)
    evidence(f"equals the recursion to {error:.0e}; steady light: the first frame's share after 12 is 0.9^12")


@pytest.mark.feature("HSS-13")
def test_warming_up_is_the_mean_of_all_frames_until_a_is_less(room, evidence):
    """n / (n + 1) makes F the mean of n + 1 frames; from n = 9 on a = 0.9 is less, and F decays as without."""
    frame, frames = Frame(room, dtype=np.float64), 16
    lights, covered = np.random.default_rng(2).random((frames, 3, 30, 40)), frame.gbuffer.covered
    made = at_rest(frame, lights, TemporalSettings())
    for n in range(10):
        np.testing.assert_allclose(made[n], lights[: n + 1].mean(axis=0)[:, covered], rtol=1e-13)
    later = recursion([lights[:10].mean(axis=0), *lights[10:]], 0.9)
    np.testing.assert_allclose(made[-1], later[:, covered], rtol=1e-13)
    left = [12 * at_rest(frame, lights[:10], TemporalSettings(warm_up=warm))[-1].var() for warm in (True, False)]
    assert left[0] == pytest.approx(0.1, rel=VARIANCE_OFF)
    cold = 0.9**18 + 0.1**2 * sum(0.9 ** (2 * k) for k in range(9))  # of F_9: the weights' squares
    assert left[1] == pytest.approx(cold, rel=VARIANCE_OFF)
    evidence(f"after 10 frames {left[0]:.3f} of the variance is left, {left[1]:.3f} without warm-up (1/10, {cold:.3f})")


@pytest.mark.feature("HSS-13")
def test_a_surface_that_is_new_starts_at_one(room):
    """Frames are counted for each pixel: one that was not found again has its new light alone, and half of it next."""
    looking, away = (Frame(room.with_camera(target=target), dtype=np.float64) for target in
                     (room.camera.target, (9.0, 9.0, 9.0)))
    settings = TemporalSettings()
    light = np.ones((3, 30, 40))
    history = history_of(away, room.geometry, first_light(light, settings))
    first = temporal_filter(light, looking, room.geometry, history, settings)
    assert (first.frames[looking.gbuffer.covered] == 1).any()
    second = temporal_filter(3 * light, looking, room.geometry,
                             history_of(looking, room.geometry, first.light), settings)
    new = looking.gbuffer.covered & (first.frames == 1)
    np.testing.assert_array_equal(second.frames[new], 2)
    np.testing.assert_allclose(second.irradiance[:, new], 2.0, rtol=1e-15)


@pytest.mark.feature("HSS-13")
def test_clamping_bounds_what_lags(evidence):
    """Analytic: mean and deviation of 3 x 3 pixels of which one column in three shines."""
    new = np.zeros((3, 6, 6))
    new[:, :, 1::2] = 2.0
    earlier, covered = np.full((3, 6, 6), 9.0), np.ones((6, 6), np.bool_)
    clamp_to_neighbourhood(new, covered, 0.5, 1, earlier)
    share = 1 / 3  # of columns 0 to 2
    mean, deviation = 2 * share, 2 * math.sqrt(share * (1 - share))
    assert earlier[0, 3, 1] == pytest.approx(mean + 0.5 * deviation, rel=1e-14)
    low = np.full((3, 6, 6), -9.0)
    clamp_to_neighbourhood(new, covered, 0.5, 1, low)
    assert low[2, 3, 1] == pytest.approx(mean - 0.5 * deviation, rel=1e-14)
    within = np.full((3, 6, 6), mean)
    clamp_to_neighbourhood(new, covered, 0.5, 1, within)
    assert within[1, 3, 1] == mean
    evidence("9 is clamped to the mean and half a standard deviation of 3 x 3 pixels")


def test_equal_light_stays_equal_to_the_bit(room):
    x, y, z = room.camera.eye
    scenes = [room.with_camera(eye=(x + 0.01 * i, y, z)) for i in range(4)]
    for step in Sequence(scenes, method=constant(0.1), **QUICK):
        assert (step.irradiance[:, step.frame.gbuffer.covered] == np.float32(0.1)).all()


@pytest.mark.feature("HSS-13")
def test_ghosts_after_disocclusion_are_bounded(evidence):
    """A bright sphere leaves its place; its light is 1 there and 0 all around."""
    scene = load_scene("cornell_sphere").with_camera(**SIZE)
    sphere = faces_of(scene, "sphere")
    scenes = [turned(scene, 0, sphere, (0.03 * i, 0, 0)) for i in range(6)]

    def light(frame, _):
        seen = frame.gbuffer.triangle_id
        return np.broadcast_to((seen >= 0) & sphere[seen], (3, *seen.shape)).astype(frame.dtype)

    shown, worst, ghost = None, 0.0, 0.0
    for step in filtered(scenes, light):
        on = light(step.frame, None)[0] > 0
        if shown is not None:
            left = shown & ~on & step.frame.gbuffer.covered
            assert left.any()
            worst = max(worst, step.irradiance[:, left].max())
            # what is on the sphere keeps its light, but for what its rim finds on the wall: nothing
            assert step.irradiance[:, on].min() == 1
        elsewhere = ~on & step.frame.gbuffer.covered
        ghost = max(ghost, step.irradiance[:, elsewhere].max())
        shown = on
    assert worst == ghost == 0
    evidence("a sphere of light 1 moves on by 1.5 pixels a frame: light left behind 0, light on it 1")


@pytest.mark.feature("HSS-14")
@pytest.mark.parametrize(("name", "side"), [("cornell_box", 1), ("cornell_box", -1), ("cornell_sphere", 1)])
def test_rigid_motion_is_undone(name, side, evidence):
    """Flat normals, triangles seen from behind, smooth normals."""
    scene = load_scene(name).with_camera(**SIZE)
    geometry = dataclasses.replace(scene.geometry, faces=np.ascontiguousarray(scene.geometry.faces[:, ::side]))
    scene = dataclasses.replace(scene, geometry=geometry)
    before, after = scene, turned(scene, 0.2, move=(0.03, -0.02, 0.05))
    rotation, center = rotation_about((0.3, 1, 0.2), 0.2), np.array([0.278, 0.273, 0.28])
    figures = {}
    for dtype, bound in ((np.float32, PLACE_OFF), (np.float64, 1e-15)):
        buffer = Frame(after, dtype=dtype).gbuffer
        back = previous_points(buffer, after.geometry, before.geometry)
        covered = buffer.covered
        place = buffer.position[:, covered].T.astype(np.float64)
        expected = (place - center - (0.03, -0.02, 0.05)) @ rotation + center
        normal = buffer.normal[:, covered].T.astype(np.float64) @ rotation
        figures[dtype.__name__] = np.abs(back.position[:, covered].T - expected).max()
        assert figures[dtype.__name__] < bound
        assert np.abs(back.normal[:, covered].T - normal).max() < (1e-6 if dtype == np.float32 else 1e-12)
    evidence(f"{name}, side {side}, turned by 11 degrees: warp off by {figures['float32']:.0e} m (float32), "
             f"{figures['float64']:.0e} m (float64)")


@pytest.mark.feature("HSS-14")
def test_light_stays_on_a_turning_object(evidence):
    """A light that is a function of the place on the object alone is found again by its own motion, not without."""
    scene = load_scene("cornell_sphere").with_camera(width=80, height=60)
    sphere = faces_of(scene, "sphere")
    scenes = [turned(scene, 0.08 * i, sphere) for i in range(4)]
    center = np.array([0.278, 0.273, 0.28])

    def painted(frame, number):
        unturned = np.einsum("ij,jhw->ihw", rotation_about((0.3, 1, 0.2), 0.08 * number).T,
                             frame.gbuffer.position - center[:, None, None])
        return 1 + np.sin(20 * unturned)

    errors = {}
    for own in (True, False):
        frames = [Frame(s, dtype=np.float64) for s in scenes]
        lights = [painted(frame, i) for i, frame in enumerate(frames)]
        now = frames[1]
        geometry = scenes[1].geometry if own else scenes[0].geometry
        history = history_of(frames[0], geometry if not own else scenes[0].geometry, lights[0])
        zero = np.zeros_like(lights[1])
        result = temporal_filter(zero, now, geometry, history, TemporalSettings(weight=0.5, speed=1e6)).irradiance
        on = (now.gbuffer.triangle_id >= 0) & sphere[now.gbuffer.triangle_id] & (result[0] > 0)
        errors[own] = np.abs(2 * result - lights[1])[:, on].mean()
    assert errors[True] < 0.01  # what bilinear interpolation makes of the pattern
    assert errors[False] > 5 * errors[True]
    evidence(f"pattern on a sphere that turns by 4.6 degrees: {errors[True]:.4f} off with its motion, "
             f"{errors[False]:.4f} without")


@pytest.mark.feature("HSS-14")
def test_a_bent_mesh_is_followed_by_its_vertices(room):
    """Skinned motion: each triangle has its own affine map."""
    vertices = np.array(room.geometry.vertices)
    bent = dataclasses.replace(room.geometry, vertices=vertices + 0.02 * np.sin(9 * vertices[:, [1, 2, 0]]))
    now = Frame(dataclasses.replace(room, geometry=bent), dtype=np.float64)
    back = previous_points(now.gbuffer, bent, room.geometry)
    for i, j in np.argwhere(now.gbuffer.covered)[::37]:
        face = room.geometry.faces[now.gbuffer.triangle_id[i, j]]
        corners, old = bent.vertices[face], vertices[face]
        place = [*now.gbuffer.position[:, i, j], 1]
        weights = np.linalg.lstsq(np.vstack([corners.T, np.ones(3)]), place, rcond=None)[0]
        assert np.allclose(back.position[:, i, j], weights @ old, atol=1e-12)
        normal = np.cross(old[1] - old[0], old[2] - old[0])
        assert abs(back.normal[:, i, j] @ normal) == pytest.approx(np.linalg.norm(normal))


def test_what_rests_keeps_its_bits(room):
    selected = faces_of(room, "red")
    after = turned(room, 0.1, selected)
    buffer = Frame(after).gbuffer
    back = previous_points(buffer, after.geometry, room.geometry)
    resting = buffer.covered & ~selected[buffer.triangle_id]
    assert resting.any()
    assert (~resting & buffer.covered).any()
    assert np.array_equal(back.position[:, resting], buffer.position[:, resting])
    assert np.array_equal(back.normal[:, resting], buffer.normal[:, resting])
    assert not back.speed[resting].any()


@pytest.mark.feature("HSS-14")
def test_the_weight_falls_with_the_speed(room, evidence):
    """The room moves: v is how far its points go on the image plane, H / (2 tan(fov / 2)) pixels wide a unit."""
    step = np.array([0.01, 0.004, 0.02])
    after = turned(room, 0, move=tuple(step))
    frame, before = Frame(after, dtype=np.float64), Frame(room, dtype=np.float64)
    seen = frame.gbuffer.position - np.reshape(room.camera.eye, (3, 1, 1))  # the camera looks along +z
    earlier = seen - step[:, None, None]
    covered = frame.gbuffer.covered
    seen, earlier = (place[:2] / np.where(covered, place[2], 1) for place in (seen, earlier))
    expected = 15 / math.tan(room.camera.vfov / 2) * np.hypot(*(seen - earlier))
    back = previous_points(frame.gbuffer, after.geometry, room.geometry)
    assert np.allclose(back.speed[covered], expected[covered], rtol=1e-9)
    history = history_of(before, room.geometry, np.zeros((3, 30, 40)))
    result = temporal_filter(np.ones((3, 30, 40)), frame, after.geometry, history,
                             TemporalSettings(weight=0.8, speed=0.4))
    found = covered & (result.irradiance[0] < 1)
    share = 1 - result.irradiance[0][found]
    error = np.abs(share / (0.8 * np.exp(-expected[found] / 0.4)) - 1).max()
    assert found.sum() > 0.9 * covered.sum()
    assert error < 1e-12
    assert result.reused == pytest.approx(found.sum() / covered.sum())
    evidence(f"a = 0.8 exp(-v / 0.4) to {error:.0e} for v = {expected[found].min():.2f} to "
             f"{expected[found].max():.2f} pixels")


@pytest.mark.feature("HSS-14")
def test_a_camera_that_moves_leaves_the_weight(room):
    x, y, z = room.camera.eye
    frame = Frame(room.with_camera(eye=(x + 0.1, y, z)), dtype=np.float64)
    history = history_of(Frame(room, dtype=np.float64), room.geometry, np.zeros((3, 30, 40)))
    result = temporal_filter(np.ones((3, 30, 40)), frame, room.geometry, history, TemporalSettings(weight=0.8))
    assert set(np.round(np.unique(result.irradiance[:, frame.gbuffer.covered]), 12)) == {0.2, 1.0}


def test_a_point_that_was_behind_the_camera_is_new(room):
    after = turned(room, 0, move=(0.0, 0.0, 3.0))
    back = previous_points(Frame(after).gbuffer, after.geometry, turned(room, 0, move=(0, 0, -3.0)).geometry)
    assert np.isinf(back.speed[Frame(after).gbuffer.covered]).all()
    frame = Frame(after)
    history = history_of(Frame(room), turned(room, 0, move=(0, 0, -3.0)).geometry, np.zeros((3, 30, 40), np.float32))
    result = temporal_filter(np.ones((3, 30, 40), np.float32), frame, after.geometry, history, TemporalSettings())
    assert (result.irradiance[:, frame.gbuffer.covered] == 1).all()


def test_scenes_far_from_the_origin_are_alike(room):
    """Frames that were moved near the origin, by different distances, find each other's points."""
    far = 2.0**20
    scenes = [turned(room, 0, move=(0.01 * i, 0, 0)) for i in range(3)]
    moved_scenes = []
    for i, scene in enumerate(scenes):
        away = (far + 0.21 + 0.01 * i, 0.0, 0.0)  # the box's middle crosses the line between two grid places
        geometry = dataclasses.replace(scene.geometry, vertices=scene.geometry.vertices + away)
        camera = {key: tuple(np.add(getattr(scene.camera, key), away)) for key in ("eye", "target")}
        lights = [dataclasses.replace(light, position=tuple(np.add(light.position, away))) for light in scene.lights]
        moved_scenes.append(dataclasses.replace(scene, geometry=geometry).with_camera(**camera).with_lights(*lights))
    origins = {Frame(scene).origin[0] for scene in moved_scenes}
    assert len(origins) == 2
    pairs = zip(filtered(scenes, noise(), speed=1e6), filtered(moved_scenes, noise(), speed=1e6), strict=True)
    for near, away in pairs:
        both = near.frame.gbuffer.covered & away.frame.gbuffer.covered
        same = np.isclose(near.irradiance, away.irradiance, atol=1e-3).all(axis=0)[both]
        assert same.mean() > 0.95  # places are 2^-33 m apart there; a few pixels fall to other triangles
        assert abs(near.reused - away.reused) < 0.02


def test_the_same_bits_on_any_number_of_threads(room):
    results = []
    for count in (1, 2):
        with threads(count):
            scenes = [turned(room, 0.02 * i, faces_of(room, "white")) for i in range(3)]
            results.append([s.irradiance for s in Sequence(scenes, method=noise(), **QUICK)])
    assert all(map(np.array_equal, *results))


def test_nothing_but_background(room):
    away = room.with_camera(target=(0.278, 0.273, -9.0))
    for step in Sequence([away, away], method=constant(0.0), **QUICK):
        assert not step.irradiance.any()
        assert step.reused == 0


def test_other_triangles_are_refused(room):
    other = load_scene("wedge").with_camera(**SIZE)
    with pytest.raises(InputError, match="vertices of the frame before"):
        filtered([room, other], constant(1.0))
    faces = room.geometry.faces[:, ::-1]
    with pytest.raises(InputError, match="triangles of the frame before"):
        filtered([room, dataclasses.replace(room, geometry=dataclasses.replace(room.geometry, faces=faces))],
                 constant(1.0))
    smooth = dataclasses.replace(room.geometry, vertex_normals=np.ones_like(room.geometry.vertices))
    with pytest.raises(InputError, match="vertex normals in all or in none"):
        filtered([room, dataclasses.replace(room, geometry=smooth)], constant(1.0))


@pytest.mark.parametrize("wrong", [{"weight": 1.0}, {"weight": -0.1}, {"form": "mean"}, {"speed": 0.0},
                                   {"fetch": "cubic"}, {"depth_tolerance": math.nan}, {"normal_cosine": 2}])
def test_settings_that_are_refused(wrong):
    with pytest.raises(InputError, match=next(iter(wrong))):
        TemporalSettings(**wrong)
