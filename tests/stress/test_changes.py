"""Changes of a scene: what they leave as it is, in closed form, and how a picture comes back."""

import dataclasses

import numpy as np
import pytest

from refgi import load_scene
from refgi.frame import Frame
from refgi.rsm.raster.projection import camera_projection
from refgi.scene import DirectionalLight, PointLight
from refgi.scene.values import BRIGHTEST
from refgi.stress import promises
from refgi.stress.changes import CHANGES, Changed, NotPromisedError, mapped
from tests.textured import floor

KNOWN = {change.name: change for change in CHANGES}
SIZE = 16, 12
ROUNDING = 1e-14


@pytest.fixture(scope="module")
def box():
    return load_scene("cornell_box")


def after(scene, name, size=SIZE):
    return KNOWN[name].apply(scene, *size)


def areas(scene):
    a, b, c = (scene.geometry.vertices[scene.geometry.faces[:, k]] for k in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return np.bincount(scene.geometry.material_of_face, area, len(scene.materials))


@pytest.mark.parametrize("power", [27, -27, 60, -60])
def test_lamps_of_a_power_of_two(box, power):
    changed = after(box, f"flux x 2^{power}")
    assert changed.flux == 2.0**power
    assert changed.scene.lights[0].intensity == tuple(2.0**power * c for c in box.lights[0].intensity)
    assert changed.scene.geometry is box.geometry


@pytest.mark.parametrize("power", [27, -27])
def test_another_unit_keeps_irradiance(box, power):
    """I / r^2 stays where lengths grow by f and intensity by f^2."""
    changed, factor = after(box, f"length x 2^{power}"), 2.0**power
    assert np.array_equal(changed.scene.geometry.vertices, box.geometry.vertices * factor)
    light, was = changed.scene.lights[0], box.lights[0]
    assert light.position == tuple(factor * c for c in was.position)
    assert light.intensity == tuple(factor**2 * c for c in was.intensity)
    assert changed.length == factor
    direct = [Frame(one, width=16, height=12).direct for one in (box, changed.scene)]
    assert np.array_equal(*direct)


@pytest.mark.parametrize("name", ["moved far", "moved aside", "quarter turn", "turned", "mirrored"])
def test_places_keep_their_distances_to_eye_and_lamp(box, name):
    changed = after(box, name).scene
    for place in (lambda scene: scene.camera.eye, lambda scene: scene.lights[0].position):
        before, now = (np.linalg.norm(scene.geometry.vertices - np.array(place(scene)), axis=1)
                       for scene in (box, changed))
        assert np.abs(now / before - 1).max() < (1e-9 if name == "moved far" else ROUNDING)
    assert np.abs(changed.geometry.vertices - box.geometry.vertices).max() > 0.1


def test_axes_of_a_spot_turn_with_it(box):
    for name in ("quarter turn", "turned", "mirrored"):
        changed = after(box, name).scene
        for scene in (box, changed):
            towards = np.subtract(scene.camera.target, scene.camera.eye)
            cosine = np.dot(towards / np.linalg.norm(towards), scene.lights[0].direction)
            assert cosine == pytest.approx(np.dot(
                np.subtract(box.camera.target, box.camera.eye) / np.linalg.norm(
                    np.subtract(box.camera.target, box.camera.eye)), box.lights[0].direction), abs=ROUNDING)


def test_a_mirrored_picture_comes_back():
    plane = np.arange(6.0).reshape(1, 2, 3)
    assert Changed(None, mirrored=True, flux=2.0).back(plane).tolist() == [[[1.0, 0.5, 0.0], [2.5, 2.0, 1.5]]]
    assert Changed(None, mirrored=True, flux=2.0).back(plane, light=False).tolist() == [[[2, 1, 0], [5, 4, 3]]]


@pytest.mark.parametrize(("name", "factor"), [("faces permuted", 1), ("faces split", 1), ("faces unwelded", 1),
                                              ("faces doubled", 2)])
def test_surfaces_stay(box, name, factor):
    changed = after(box, name).scene
    assert areas(changed) == pytest.approx(factor * areas(box), rel=ROUNDING)
    assert changed.face_count == {"faces split": 4, "faces doubled": 2}.get(name, 1) * box.face_count


def test_other_triangles_are_other_triangles(box):
    shape = box.geometry
    permuted, unwelded = (after(box, name).scene.geometry for name in ("faces permuted", "faces unwelded"))
    assert not np.array_equal(permuted.faces, shape.faces)
    assert {tuple(face) for face in permuted.faces.tolist()} == {tuple(face) for face in shape.faces.tolist()}
    assert np.bincount(unwelded.faces.ravel()).max() == 1 < np.bincount(shape.faces.ravel()).max()


def test_normals_go_with_their_vertices():
    stage = load_scene("stage:faces=3000")
    assert stage.geometry.vertex_normals is not None
    for name in ("faces permuted", "faces split", "faces unwelded", "faces doubled", "hidden plane"):
        frames = [Frame(one, width=16, height=12).gbuffer.normal for one in (stage, after(stage, name).scene)]
        assert np.abs(np.subtract(*frames)).max() < 1e-6, name
    turned = after(stage, "quarter turn").scene.geometry.vertex_normals
    assert np.allclose(turned[:, 0], stage.geometry.vertex_normals[:, 2], atol=ROUNDING)


def test_two_lamps_give_what_one_gave(box):
    lights = after(box, "two lamps of half").scene.lights
    assert len(lights) == 2
    assert np.array_equal(np.sum([light.intensity for light in lights], axis=0), box.lights[0].intensity)


def test_a_hidden_plane_is_far_larger_than_the_scene_and_hidden(box):
    changed = after(box, "hidden plane").scene
    corners = changed.geometry.vertices[len(box.geometry.vertices):]
    assert len(corners) == 4
    frame = Frame(changed, width=64, height=64)
    assert max(frame.gbuffer.triangle_id.max(), *(rsm.triangle_id.max() for rsm in frame.rsms)) < box.face_count


def test_a_plane_that_cannot_hide_is_not_asked():
    ball = load_scene("integrating_sphere:faces=1000")
    outside = ball.with_lights(DirectionalLight((0.3, -1, 0.2), (1, 1, 1)), PointLight((9, -9, 9), (1, 1, 1)),
                               PointLight((-9, 9, -9), (1, 1, 1))).with_camera(eye=(30.0, 30.0, 30.0))
    with pytest.raises(NotPromisedError, match="seen or lit"):
        after(outside, "hidden plane", (64, 64))


def test_a_crop_looks_where_its_pixels_looked(box):
    changed = after(box, "cropped")
    assert changed.options == {"width": 8, "height": 6}
    depth = Frame(box, width=16, height=12).gbuffer.depth
    part = Frame(changed.scene, width=8, height=6).gbuffer.depth
    assert np.allclose(depth[changed.part], part, rtol=1e-6)
    full, half = (camera_projection(scene.camera, *size) for scene, size in ((box, (16, 12)), (changed.scene, (8, 6))))
    assert type(full) is type(half)
    with pytest.raises(NotPromisedError, match="multiples of 4"):
        after(box, "cropped", (18, 12))


def test_what_leaves_the_range_of_scenes_is_not_asked(box):
    with pytest.raises(NotPromisedError, match="brighter"):
        after(box.with_lights(PointLight((0, 1, 0), (BRIGHTEST, 0, 0))), "flux x 2^27")
    with pytest.raises(NotPromisedError, match="1e\\+09"):
        after(mapped(box, lambda p: p * 100.0), "length x 2^27")


SEEN = {"faces permuted": 0.0, "faces unwelded": 0.0, "faces doubled": 0.0, "faces split": 1e-6, "hidden plane": 0.0}


@pytest.mark.parametrize("name", SEEN)
def test_the_albedo_stays(name: str) -> None:
    scene = floor(size=(32, 24))
    change = next(one for one in CHANGES if one.name == name)
    made = change.apply(scene, 32, 24).scene
    assert len(made.geometry.faces) >= len(scene.geometry.faces)
    assert made.geometry.uv is not None
    one, other = (Frame(each, dtype=np.float64).gbuffer.albedo for each in (scene, made))
    assert np.abs(one - other).max() <= SEEN[name]
    assert one.std() > 0.1


def test_paths_among_images_are_judged_as_estimates() -> None:
    """A place that is read is rounded with the hit: other senders are picked, of the same light."""
    painted = floor(size=(32, 24))
    plain = dataclasses.replace(painted, materials=tuple(
        dataclasses.replace(one, texture=None) for one in painted.materials))
    for change in CHANGES:
        if change.name == "cropped":  # nothing is promised
            continue
        kept, drawn = (promises.asked("truth", change, scene).promise for scene in (plain, painted))
        moved = change.name.startswith(("moved", "faces"))
        assert (drawn == "estimate") == (moved or kept == "estimate"), change.name
        assert not moved or kept in ("bits", "rounding")
        if moved:
            assert promises.asked("gather", change, painted).promise == kept


def test_lobes_on_bent_faces_pick_anew_where_faces_are_split() -> None:
    """Normals within a face are rounded otherwise, and cells of lobes with them; of what is diffuse none are asked."""
    split = next(one for one in CHANGES if one.name == "faces split")
    ring = load_scene("ring:faces=600")
    assert ring.geometry.vertex_normals is not None
    assert promises.asked("truth", split, ring).promise == "estimate"
    for other in (dataclasses.replace(ring, materials=tuple(dataclasses.replace(one, specular=(0.0, 0.0, 0.0))
                                                            for one in ring.materials)),
                  dataclasses.replace(ring, geometry=dataclasses.replace(ring.geometry, vertex_normals=None))):
        assert promises.asked("truth", split, other).promise == "rounding"
    assert promises.asked("sii", split, ring).promise == "rounding"
