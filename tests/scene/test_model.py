"""The model: what it refuses, how meshes are joined and placed, and the tables that kernels read."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refgi.errors import InputError, RefgiWarning
from refgi.scene import (
    Camera,
    DirectionalLight,
    Geometry,
    Material,
    Mesh,
    PointLight,
    Scene,
    SpotLight,
    light_table,
    material_table,
    merge,
)
from refgi.scene.motion import affine, transformed_all
from refgi.scene.placed import default_camera, default_light
from refgi.scene.repair import lights_with_power, repaired, zero_area

VERTICES = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
FACES = np.array([[0, 1, 2]])


def test_merge_keeps_order_and_shares_equal_materials() -> None:
    red, blue = Material("red", (1, 0, 0)), Material("blue", (0, 0, 1))
    geometry, materials = merge([Mesh(VERTICES, FACES, material=m) for m in (red, blue, Material("red", (1, 0, 0)))])
    assert materials == (red, blue)
    assert geometry.material_of_face.tolist() == [0, 1, 0]
    assert geometry.faces.tolist() == [[0, 1, 2], [3, 4, 5], [6, 7, 8]]
    assert geometry.vertices.dtype == np.float64
    assert geometry.faces.dtype == np.int32
    assert geometry.vertex_normals is None


def test_merge_gives_face_normals_where_a_mesh_has_none() -> None:
    smooth = Mesh(VERTICES, FACES, np.array([[0.0, 0.6, 0.8]] * 3))
    geometry, _ = merge([smooth, Mesh(VERTICES, FACES)], smooth=True)
    assert geometry.vertex_normals is not None
    assert geometry.vertex_normals.tolist() == [[0, 0.6, 0.8]] * 3 + [[0, 0, 1]] * 3


@pytest.mark.parametrize(("mesh", "said"), [
    (Mesh(VERTICES * np.nan, FACES), "vertex 0: expected finite"), (Mesh(VERTICES + 1e10, FACES), "vertex 0"),
    (Mesh(VERTICES, FACES + 1), r"face 0: expected vertex indices from 0 to 2, got \[1, 2, 3\]"),
    (Mesh(VERTICES, FACES - 1), "face 0"), (Mesh(VERTICES, FACES[:0]), "at least one triangle"),
    (Mesh(VERTICES[:0], FACES), "vertices"), (Mesh(VERTICES[:, :2], FACES), "vertices"),
    (Mesh(VERTICES, FACES.astype(float)), "faces"), (Mesh(VERTICES, FACES, VERTICES[:2]), "normals"),
    (Mesh(VERTICES.astype(str), FACES), "vertices"),
])
def test_merge_refuses_unsound_meshes(mesh: Mesh, said: str) -> None:
    with pytest.raises(InputError, match=said):
        merge([mesh])


@pytest.mark.parametrize("make", [
    lambda: Material(diffuse=(0.5, 0.5, 1.01)), lambda: Material(diffuse=(0.5, 0.5)), lambda: Material(exponent=-1),
    lambda: Material(diffuse=(math.nan, 0, 0)), lambda: Material(ior=0.9), lambda: Material(emission=(0, 0, -1)),
    lambda: Camera((0, 0, 0), (0, 0, 0)), lambda: Camera((0, 0, 0), (0, 1, 0)),
    lambda: Camera((0, 0, 0), (0, 0, math.inf)),
    lambda: Camera((0, 0, 0), (1, 0, 0), vfov=math.pi), lambda: Camera((0, 0, 0), (1, 0, 0), width=0),
    lambda: PointLight((0, 0, 0), (-1, 0, 0)), lambda: DirectionalLight((0, 0, 0), (1, 1, 1)),
    lambda: SpotLight((0, 0, 0), (0, -1, 0), 0.0, 0.0, (1, 1, 1)),
    lambda: SpotLight((0, 0, 0), (0, -1, 0), 0.1, math.nextafter(math.pi / 2, 2), (1, 1, 1)),
    lambda: SpotLight((0, 0, 0), (0, -1, 0), 0.0, 1e-8, (1, 1, 1)),
    lambda: SpotLight((0, 0, 0), (0, -1, 0), 0.0, "1", (1, 1, 1)),  # type: ignore[arg-type]
    lambda: SpotLight((0, 0, 0), (0, -1, 0), 0.5, 0.4, (1, 1, 1)),
    lambda: PointLight(3, (1, 1, 1)),  # type: ignore[arg-type]
    lambda: Material(exponent=1e300), lambda: Material(emission=(1e300, 0, 0)), lambda: Material(ior=1e300),
    lambda: Material(exponent="7"),  # type: ignore[arg-type]
    lambda: Camera((0, 0, 0), (1, 0, 0), vfov="40"),  # type: ignore[arg-type]
    lambda: Camera((0, 0, 0), (1, 0, 0), width=1.5),  # type: ignore[arg-type]
])
def test_values_that_make_no_scene(make: Any) -> None:
    with pytest.raises(InputError, match="expected"):
        make()


@pytest.mark.parametrize(("change", "said"), [
    ({"vertices": VERTICES * np.nan}, "geometry: vertex 0: expected finite"),
    ({"faces": FACES + 9}, "geometry: face 0"), ({"material_of_face": np.zeros(2, np.int32)}, "one index a face"),
])
def test_geometry_that_kernels_cannot_read(change: dict[str, Any], said: str) -> None:
    """An index without a vertex would read memory that is not the mesh's."""
    geometry, _ = merge([Mesh(VERTICES, FACES)])
    with pytest.raises(InputError, match=said):
        dataclasses.replace(geometry, **change)


@pytest.mark.parametrize("change", [
    {"materials": ()}, {"lights": ("lamp",)}, {"exposure": "1"}, {"exposure": math.nan},
    {"geometry": Geometry(VERTICES, FACES, np.array([-1], np.int32))},
])
def test_scenes_whose_parts_do_not_fit(change: dict[str, Any]) -> None:
    geometry, materials = merge([Mesh(VERTICES, FACES)])
    scene = Scene("one", geometry, materials, Camera((0, 0, 0), (1, 0, 0)), (PointLight((0, 0, 0), (1, 1, 1)),))
    with pytest.raises(InputError, match="expected"):
        dataclasses.replace(scene, **change)


def test_vectors_given_as_arrays_compare_and_hash_like_tuples() -> None:
    x, one = np.array([1.0, 0, 0]), np.ones(3)
    assert Camera(np.zeros(3), x) == Camera((0, 0, 0), (1, 0, 0))  # type: ignore[arg-type]
    assert Camera((0, 0, 0), (1, 0, 0), width=np.int64(5)).width == 5  # type: ignore[arg-type]
    assert len({Material(diffuse=one), Material(diffuse=(1, 1, 1))}) == 1  # type: ignore[arg-type]
    assert len({PointLight(x, one), PointLight((1, 0, 0), (1, 1, 1))}) == 1  # type: ignore[arg-type]
    assert len({DirectionalLight(x, one), DirectionalLight((1, 0, 0), (1, 1, 1))}) == 1  # type: ignore[arg-type]
    assert SpotLight(x, x, 0.1, 0.2, one) == SpotLight((1, 0, 0), (1, 0, 0), 0.1, 0.2, (1, 1, 1))  # type: ignore[arg-type]


@pytest.mark.parametrize("size", [1e-8, 1.0, 1e8])
def test_a_mesh_of_any_size_is_framed_and_lit(size: float) -> None:
    geometry, _ = merge([Mesh(VERTICES * size, FACES)])
    middle = np.mean(geometry.bounds, axis=0)
    for place in (default_camera(geometry).eye, default_light(geometry).position):
        assert 1 < np.linalg.norm(middle - place) / geometry.diagonal < 5


def test_tables() -> None:
    spot = SpotLight((1, 2, 3), (0, -3, 0), 0.2, 0.4, (4, 5, 6))
    table = light_table([spot, PointLight((7, 8, 9), (1, 1, 1)), DirectionalLight((2, 0, 0), (3, 2, 1))])
    assert table.kind.tolist() == [0, 1, 2]
    assert table.direction.tolist() == [[0, -1, 0], [0, 0, 0], [1, 0, 0]]
    assert table.position.tolist() == [[1, 2, 3], [7, 8, 9], [0, 0, 0]]
    assert table.intensity.tolist() == [[4, 5, 6], [1, 1, 1], [3, 2, 1]]
    np.testing.assert_allclose(table.cone[0, ::2], [math.sin(0.4), math.cos(0.4), math.cos(0.2) - math.cos(0.4),
                                                   1])
    assert not table.cone[1:].any()
    materials = material_table([Material(), Material("b", (0, 0, 0), (1, 1, 1), 7.0, 1.5)])
    assert materials.exponent.tolist() == [0, 7]
    assert materials.ior.tolist() == [0, 1.5]
    assert material_table([]).diffuse.shape == (0, 3)


def test_lights_without_power() -> None:
    dark, bright = PointLight((0, 0, 0), (0, 0, 0)), DirectionalLight((0, 1, 0), (0, 0, 1))
    with pytest.warns(RefgiWarning, match="2 lights of zero power"):
        assert lights_with_power([dark, bright, dark], "lights") == (bright,)
    with pytest.raises(InputError, match="got 'none'"):
        lights_with_power([], "lights")


@settings(deadline=None)
@given(st.lists(st.floats(-100, 100), min_size=12, max_size=12))
def test_placing_moves_points_normals_and_orientation_alike(numbers: list[float]) -> None:
    rows = [*numbers, 0.0, 0.0, 0.0, 1.0]
    try:
        matrix = affine(rows, "transform")
    except InputError:
        return
    if np.linalg.cond(matrix[:3, :3]) > 1e4:
        return
    moved, = transformed_all([Mesh(VERTICES, FACES, np.array([[0.0, 0, 1]] * 3))], matrix[None])
    assert np.allclose(sorted(map(tuple, moved.vertices)), sorted(tuple(matrix[:3, :3] @ v + matrix[:3, 3])
                                                                  for v in VERTICES), atol=1e-9)
    a, b, c = moved.vertices[moved.faces[0]]
    normal = np.cross(b - a, c - a)
    assert np.allclose(normal / np.linalg.norm(normal), np.asarray(moved.normals)[0], atol=1e-6)


@pytest.mark.parametrize("numbers", [
    [1.0] * 16, [0.0] * 15 + [1.0], [math.nan] + [1.0] * 15, [1.0] * 15,
    [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 1, 1],
    [1, 2, 3, 0, 4, 5, 6, 0, 7, 8, 9, 0, 0, 0, 0, 1], [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1e-14, 0, 0, 0, 0, 1],
])
def test_matrices_that_place_nothing(numbers: list[float]) -> None:
    with pytest.raises(InputError, match="transform: expected"):
        affine(numbers, "transform")


@settings(deadline=None)
@given(scale=st.floats(1e-8, 1e8), slim=st.floats(1e-12, 1.0))
def test_a_thin_face_is_kept_at_any_scale(scale: float, slim: float) -> None:
    vertices = VERTICES * (1.0, slim, 1.0) * scale
    assert not zero_area(vertices, FACES).any()
    assert zero_area(np.array([[0.0, 0, 0], [1, 1, 1], [3, 3, 3]]) * scale, FACES).all()


def test_missing_normals_are_filled_in() -> None:
    normals = np.array([[0.0, 0, 2], [0, 0, 0], [math.nan, 0, 0]])
    mesh, dropped = repaired(Mesh(VERTICES, FACES, normals), "mesh")
    assert dropped == 0
    assert np.asarray(mesh.normals).tolist() == [[0, 0, 1]] * 3


def test_a_signalling_nan_is_a_missing_normal_without_a_warning() -> None:
    """Python warnings are errors here: a file can hold any bits."""
    normals = np.tile(np.float32([0, 0, 2]), (3, 1))
    normals[1, 0] = np.array(0x7FA00000, np.uint32).view(np.float32)
    turned = transformed_all([Mesh(VERTICES, FACES, normals)], np.diag([2.0, 1, 1, 1])[None])[0]
    for mesh in (Mesh(VERTICES, FACES, normals), turned):
        assert np.asarray(repaired(mesh, "mesh")[0].normals).tolist() == [[0, 0, 1]] * 3
