"""Built-in scenes: asked and given face counts, closed surfaces, names and parameters, and the measured box."""

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from refgi.errors import InputError
from refgi.scene import Scene, builtin_scenes, load_scene
from refgi.scene.builtin.stage import vase
from refgi.scene.builtin.surfaces import balls_at, blob, field, gradient, ring_surface, sphere
from refgi.scene.model import Material, Mesh

NAMES = ("cornell_box", "cornell_sphere", "atrium", "textured_atrium", "leaf_grid", "integrating_sphere", "wedge",
         "parallel_plates", "ring", "glass_ball", "metaballs", "stage")
FACE_SHARE = 0.05  # grids have whole rows and columns
SMALL_FACE_SHARE = 0.1  # ... of which a form of a hundred faces has few


def body_of(scene: Scene, material: str) -> trimesh.Trimesh:
    """Return the faces of one material, welded by nothing but their indices."""
    number = [m.name for m in scene.materials].index(material)
    geometry = scene.geometry
    return trimesh.Trimesh(geometry.vertices, geometry.faces[geometry.material_of_face == number], process=False)


def test_the_table_lists_every_scene_with_a_line_and_its_faces() -> None:
    table = builtin_scenes()
    assert tuple(table) == NAMES
    for row in table.values():
        scene = row.build()
        assert scene.name == row.name
        assert row.summary
        assert abs(scene.face_count / row.faces - 1) < 0.02
        assert scene.lights
        assert np.isfinite(scene.geometry.vertices).all()


@pytest.mark.parametrize(("name", "faces"), [
    (name, faces) for name in ("cornell_sphere", "integrating_sphere", "ring", "glass_ball", "stage", "atrium")
    for faces in (100, 1000, 10_000, 33_333, 300_000) if name != "atrium" or faces >= 10_000
])
def test_faces_come_within_a_share_of_what_was_asked(name: str, faces: int) -> None:
    scene = load_scene(f"{name}:faces={faces}")
    assert abs(scene.face_count / faces - 1) < (FACE_SHARE if faces > 100 else SMALL_FACE_SHARE)


def test_the_textured_atrium_is_the_atrium_with_pictures() -> None:
    plain, scene = load_scene("atrium:faces=20000,seed=4"), load_scene("textured_atrium:faces=20000,seed=4,texels=64")
    for name in ("vertices", "faces", "material_of_face"):
        assert np.array_equal(getattr(plain.geometry, name), getattr(scene.geometry, name))
    assert scene.geometry.uv is not None
    assert plain.geometry.uv is None
    bare = [one.name for one in scene.materials if one.texture is None]
    assert bare == ["water"]
    for one, other in zip(plain.materials, scene.materials, strict=True):
        assert one.diffuse == other.diffuse
        if other.texture is not None:
            level = other.texture.image.linear()
            assert level.shape == (64, 64, 3)
            assert 0.3 < level.mean() < 1
            assert level.std() > 0.01
    # the floor's tiles are 1 m, and a picture lies on each: u and v grow by 1 a metre
    floor = scene.geometry.material_of_face == [one.name for one in scene.materials].index("pale_tile")
    corner = scene.geometry.vertices[scene.geometry.faces[floor]]
    flat = np.ptp(corner[..., 1], axis=1) == 0
    assert np.array_equal(scene.geometry.uv[floor][flat], corner[flat][..., [0, 2]])


def test_ten_million_faces_of_the_atrium() -> None:
    scene = load_scene("atrium:faces=10000000")
    assert abs(scene.face_count / 10_000_000 - 1) < 0.01
    assert scene.geometry.faces.dtype == np.int32


@pytest.mark.parametrize("name", NAMES)
def test_no_face_is_flat_and_every_index_is_used(name: str) -> None:
    from refgi.scene.repair import zero_area

    geometry = load_scene(name).geometry
    assert not zero_area(geometry.vertices, geometry.faces).any()
    assert len(np.unique(geometry.faces)) == len(geometry.vertices)
    if geometry.vertex_normals is not None:
        assert np.allclose(np.linalg.norm(geometry.vertex_normals, axis=1), 1.0, atol=1e-12)


@pytest.mark.parametrize("mesh", [
    sphere((1.0, 2.0, 3.0), 0.5, 8, Material(), "coarse"), sphere((1.0, 2.0, 3.0), 0.5, 5000, Material(), "ball"),
    ring_surface(0.1, (0.006, 0.022), 40, 12, Material(), "ring"), vase(2000), blob(balls_at(0.3), 20),
], ids=lambda mesh: mesh.name)
def test_closed_forms_are_watertight_with_normals_outward(mesh: Mesh) -> None:
    body = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert body.is_watertight
    assert body.is_winding_consistent
    assert body.volume > 0
    assert mesh.normals is not None
    assert (np.einsum("ij,ij->i", mesh.normals, body.vertex_normals) > 0.5).all()


def test_the_sphere_lies_on_its_sphere() -> None:
    mesh = sphere((1.0, 2.0, 3.0), 0.5, 5000, Material(), "ball")
    away = mesh.vertices - np.array([1.0, 2.0, 3.0])
    assert np.allclose(np.linalg.norm(away, axis=1), 0.5, atol=1e-15)
    assert np.allclose(mesh.normals, away / 0.5, atol=1e-15)
    volume = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).volume
    assert volume == pytest.approx(4 / 3 * math.pi * 0.125, rel=5e-3)  # facets lie inside


def test_metaballs_change_topology_and_repeat() -> None:
    forms = set()
    for t in np.arange(12) / 12:
        scene = load_scene(f"metaballs:t={t},resolution=20")
        body = body_of(scene, "metaballs")
        assert body.is_watertight
        pieces = body.body_count
        forms.add((pieces, pieces - body.euler_number // 2))  # pieces and holes
    assert len(forms) >= 3
    first, last = (blob(balls_at(t), 16) for t in (0.0, 1.0))
    assert np.allclose(first.vertices, last.vertices, atol=1e-12)


def test_metaball_vertices_lie_on_the_surface_and_normals_are_its_gradient() -> None:
    balls = balls_at(0.21)
    mesh = blob(balls, 24)
    steepest = np.linalg.norm(gradient(balls, mesh.vertices), axis=1)
    assert (np.abs(field(balls, mesh.vertices)) / steepest).max() < 1e-7  # m
    step = 1e-6
    for axis in range(3):
        offset = step * np.eye(3)[axis]
        slope = (field(balls, mesh.vertices + offset) - field(balls, mesh.vertices - offset)) / (2 * step)
        assert np.allclose(-slope / steepest, np.asarray(mesh.normals)[:, axis], atol=1e-7)


@pytest.mark.parametrize("t", np.arange(24) / 24)
def test_the_grid_holds_the_whole_blob(t: float) -> None:
    from refgi.scene.builtin.surfaces import HALF_SIZE, MIDDLE

    u = np.linspace(-HALF_SIZE, HALF_SIZE, 33)
    x, y = (a.ravel() for a in np.meshgrid(u, u))
    for axis in range(3):
        for side in (-HALF_SIZE, HALF_SIZE):
            wall = np.insert(np.stack([x, y], axis=1), axis, side, axis=1)
            assert field(balls_at(t), MIDDLE + wall).max() < 0


def test_glass_and_metal_bodies_are_closed() -> None:
    assert body_of(load_scene("glass_ball"), "glass").is_watertight
    assert body_of(load_scene("ring"), "metal").is_watertight
    assert load_scene("glass_ball").materials[-1].is_dielectric
    assert load_scene("stage").materials[-1].is_glossy


def test_cornell_box_equals_the_measured_file(data_dir: Path) -> None:
    scene, filed = load_scene("cornell_box"), load_scene(data_dir / "cornell_box.json")
    assert np.array_equal(scene.geometry.vertices.astype(np.float32), filed.geometry.vertices.astype(np.float32))
    assert np.array_equal(scene.geometry.faces, filed.geometry.faces)
    assert np.array_equal(scene.geometry.material_of_face, filed.geometry.material_of_face)
    assert scene.materials == filed.materials
    assert scene.camera == filed.camera
    assert scene.lights == filed.lights
    assert scene.exposure == filed.exposure


@pytest.mark.parametrize(("name", "file"), [("glass_ball", "glass_sphere"), ("ring", "caustic_ring"),
                                            ("metaballs", "metaballs")])
def test_lights_and_cameras_equal_those_of_the_files(data_dir: Path, name: str, file: str) -> None:
    scene, filed = load_scene(name), load_scene(data_dir / f"{file}.json")
    assert scene.camera == filed.camera
    assert scene.lights == filed.lights
    assert scene.materials == filed.materials
    assert np.allclose(scene.geometry.bounds, filed.geometry.bounds, atol=0.25)


def test_parallel_plates_have_the_closed_form_in_their_geometry() -> None:
    """Midpoint sum over the floor of I cos^3 / h^2 (the spot) times the kernel to the receiver's middle."""
    scene = load_scene("parallel_plates:height=2,half_angle_deg=35,albedo=0.4")
    light = scene.lights[0]
    height, edge = light.position[1], 2 * math.tan(math.radians(35))
    radius = (np.arange(20_000) + 0.5) / 20_000 * edge
    floor = height / (height**2 + radius**2) ** 1.5
    kernel = 4.0 / (4.0 + radius**2) ** 2
    total = (0.4 / math.pi * floor * kernel * 2 * math.pi * radius).sum() * edge / 20_000
    assert total == pytest.approx(0.4 * 0.4 / 4 * (1 - math.cos(math.radians(35)) ** 5), rel=5e-5)
    assert light.inner_half_angle == light.outer_half_angle == math.radians(35)
    assert light.intensity == (1, 1, 1)
    receiver = scene.geometry.vertices[scene.geometry.faces[2]]
    assert (receiver[:, 1] == 2.0).all()
    assert height < 2.0  # the receiver cannot block the light


@pytest.mark.parametrize("angle", [45.0, 90.0, 135.0])
def test_a_long_wedge_has_the_closed_form_in_its_geometry(angle: float) -> None:
    """Midpoint sum over the sender of the kernel to a point of the receiver, against the endless wedge."""
    sender = load_scene(f"wedge:angle_deg={angle},length=200").geometry.vertices[4:]
    lean, along = sender[2] - sender[0], sender[1] - sender[0]
    cos, sin, s = math.cos(math.radians(angle)), math.sin(math.radians(angle)), 0.5
    up = (np.arange(400) + 0.5) / 400
    # Points crowd where the kernel lives: z = 2 sinh(v).
    edge = math.asinh(np.linalg.norm(along) / 4)
    v = ((np.arange(600) + 0.5) / 600 * 2 - 1) * edge
    z, area = 2 * np.sinh(v), np.linalg.norm(lean) / 400 * 2 * np.cosh(v) * 2 * edge / 600
    x, y = up[:, None] * lean[0], up[:, None] * lean[1]
    kernel = y * s * sin / ((x - s) ** 2 + y**2 + z**2) ** 2 / math.pi
    total = (kernel * area).sum()
    assert total == pytest.approx((1 + (cos - s) / math.sqrt(1 + s * s - 2 * s * cos)) / 2, rel=1e-4)


@pytest.mark.parametrize("angle", [30.0, 90.0, 150.0])
def test_wedge_lights_one_plate_alone(angle: float) -> None:
    scene = load_scene(f"wedge:angle_deg={angle}")
    corners = scene.geometry.vertices[scene.geometry.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    cosines = -normals @ np.array(scene.lights[0].direction)
    assert np.allclose(cosines, [0, 0, math.sin(math.radians(angle)), math.sin(math.radians(angle))], atol=1e-15)
    # Both plates show the side on which they face each other to the camera.
    eye = np.array(scene.camera.eye)
    assert ((normals * (eye - corners[:, 0])).sum(axis=1) > 0).all()


def test_cameras_and_lights_of_all_scenes_are_in_the_open() -> None:
    """No surface closer to eye or light than 1 % of the scene, but for the receiver the light must hang below."""
    for name in NAMES:
        scene = load_scene(name)
        body = trimesh.Trimesh(scene.geometry.vertices, scene.geometry.faces, process=False)
        places = [scene.camera.eye, *(light.position for light in scene.lights if hasattr(light, "position"))]
        if name == "parallel_plates":
            places = places[:1]
        distance = trimesh.proximity.closest_point_naive(body, np.array(places))[1] if len(body.faces) < 1000 else \
            np.linalg.norm(body.vertices[None] - np.array(places)[:, None], axis=2).min(axis=1)
        assert (distance > 0.0 if name.startswith("cornell") else distance > 0.01 * scene.geometry.diagonal).all()


@pytest.mark.parametrize(("text", "said"), [
    ("cornel_box", "did you mean 'cornell_box'"), ("nothing_like_it", "expected one of cornell_box"),
    ("atrium:face=20000", "did you mean 'faces'"), ("atrium:faces", "key=value"), ("atrium:faces=", "key=value"),
    ("atrium:faces=ten", "expected a number, got 'ten'"), ("atrium:faces=9999", "faces: expected 10000 to"),
    ("atrium:faces=1e12", "faces: expected 10000 to"), ("atrium:faces=10000.5", "an integer"),
    ("atrium:faces=nan", "an integer"), ("atrium:faces=20000,faces=30000", "each parameter once"),
    ("atrium:seed=-1", "seed"), ("cornell_box:faces=3", "expected a parameter among none"),
    ("integrating_sphere:albedo=1.5", "diffuse"), ("integrating_sphere:radius=0", "radius"),
    ("integrating_sphere:radius=inf", "radius"), ("wedge:angle_deg=180", "angle_deg"),
    ("parallel_plates:half_angle_deg=90", "half_angle_deg"), ("metaballs:resolution=1", "resolution"),
    ("metaballs:resolution=100000", "resolution"), ("metaballs:t=nan", "t: expected a finite number"), ("", "scene"),
    (":", "scene"), ("atrium.blend", "suffix '.blend'"), ("tests", "a folder"),
])
def test_names_and_parameters_that_cannot_be(text: str, said: str) -> None:
    with pytest.raises(InputError) as error:
        load_scene(text)
    assert said in str(error.value)


def test_parameters_in_any_notation() -> None:
    assert load_scene("atrium: faces = 2e4 , seed=3").face_count == load_scene("atrium:faces=20_000,seed=3").face_count
    assert builtin_scenes()["atrium"].build(faces=20_000).face_count == load_scene("atrium:faces=20000").face_count


@pytest.mark.parametrize("faces", [10_000, 250_000])
def test_the_atrium_keeps_its_measures_at_any_density(faces: int) -> None:
    scene = load_scene(f"atrium:faces={faces}")
    low, high = scene.geometry.bounds
    assert np.allclose(high, (4 * 3.0 + 3.25, 10.5, 3.0 + 3.25), atol=1e-12)
    assert np.allclose(low, (-high[0], 0.0, -high[2]), atol=0.02)  # tiles are worn into the floor by 15 mm
    eye, light = np.array(scene.camera.eye), scene.lights[0]
    assert (np.abs(eye[[0, 2]]) < (12, 3)).all()
    assert 0 < eye[1] < 4
    # The spot's axis passes the opening between the cornices at 9.5 m and meets the floor of the courtyard.
    for height, reach in ((9.5, 3.0 - 0.58), (0.0, 3.0)):
        along = (light.position[1] - height) / -light.direction[1]
        place = np.array(light.position) + along * np.array(light.direction)
        assert abs(place[0]) < 12
        assert abs(place[2]) < reach
    names = [material.name for material in scene.materials]
    assert {"red_cloth", "green_cloth", "blue_cloth", "gold_cloth"} < set(names)
    columns = scene.geometry.faces[scene.geometry.material_of_face == names.index("column")]
    corners = scene.geometry.vertices[np.unique(columns)]
    for x in np.arange(-12, 12.1, 3):
        for z in (-3, 3):  # a column of either storey stands here
            near = np.hypot(corners[:, 0] - x, corners[:, 2] - z) < 0.36
            assert near.any()
            assert corners[near, 1].min() < 1
            assert corners[near, 1].max() > 7


def test_the_seed_of_the_atrium_changes_its_cloth_alone() -> None:
    one, two, same = (load_scene(f"atrium:faces=20000,seed={seed}") for seed in (1, 2, 1))
    assert np.array_equal(one.geometry.vertices, same.geometry.vertices)
    assert not np.array_equal(one.geometry.vertices, two.geometry.vertices)
    assert one.camera == two.camera


@settings(deadline=None)  # a scene may be built
@given(st.text(max_size=30))
def test_any_name_is_built_or_refused(text: str) -> None:
    try:
        scene = load_scene(text)
    except InputError:
        return
    assert scene.face_count > 0


@settings(deadline=None)
@given(st.fixed_dictionaries({}, optional={"faces": st.floats() | st.integers(), "albedo": st.floats(),
                                           "radius": st.floats(), "other": st.just(1)}))
def test_any_parameters_are_taken_or_refused(parameters: dict[str, Any]) -> None:
    if 60_000 < parameters.get("faces", 0) <= 50_000_000:
        parameters["faces"] = 60_000  # valid and slow
    try:
        scene = builtin_scenes()["integrating_sphere"].build(**parameters)
    except InputError:
        return
    assert np.isfinite(scene.geometry.vertices).all()


def test_a_built_in_scene_with_another_camera_or_light_shares_its_geometry() -> None:
    scene = load_scene("cornell_box")
    camera = dataclasses.replace(scene.camera, width=100)
    assert load_scene("cornell_box", camera=camera).camera.width == 100
    assert scene.with_camera(width=7).geometry is scene.geometry
    assert scene.with_lights(*scene.lights, *scene.lights).geometry is scene.geometry
