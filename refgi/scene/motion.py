"""Meshes by a 4x4 matrix, rigid motion of objects, and translation to where float32 resolves them.

At 1e5 m two float32 numbers are 8 mm apart: positions, shadows and rays of a room there would be wrong, though the
scene itself, in float64, knows its places to 1e-11 m. All that is computed depends on differences of places alone, so
the whole scene is moved once, before anything is rounded.
"""

import dataclasses
import math
import warnings
from collections.abc import Callable, Sequence

import numpy as np

from refgi.errors import InputError, RefgiWarning, expect
from refgi.scene.files import did_you_mean
from refgi.scene.light import DirectionalLight, Light
from refgi.scene.mesh import Mesh, as_float64, at_corners, missing_normals
from refgi.scene.model import Geometry, Scene
from refgi.scene.values import Vector, is_direction
from refgi.stages import stage
from refgi.types import Array

IDENTITY = np.eye(4)
# Rank is judged on the matrix scaled to its largest entry; below this a direction has collapsed to rounding noise.
COLLAPSED = 1e-12


def affine(numbers: Sequence[float], where: str) -> Array:
    """Return 16 row-major numbers as an invertible affine matrix.

    `numbers`: sixteen, row by row. `where`: file and key, for the error's text. Returns (4, 4) float64: world from
    object. Raises `InputError` if a number is not finite, the last row is not 0 0 0 1, or the matrix is singular.
    """
    expect(len(numbers) == 16, where, "16 numbers, row by row", list(numbers))
    matrix = np.asarray(numbers, np.float64).reshape(4, 4)
    expect_affine(matrix[None], lambda _: where)
    return matrix


def expect_affine(matrices: Array, where: Callable[[int], str]) -> None:
    """Raise `InputError` for the first of many matrices that is not finite, affine and invertible.

    `matrices` (k, 4, 4) float64: world from object. `where`: returns file and key of the matrix of some number, for the
    error's text. Raises `InputError` if a number is not finite, the last row is not 0 0 0 1, or the matrix is singular.
    """
    finite = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    straight = (matrices[:, 3] == IDENTITY[3]).all(axis=1)
    for number in np.flatnonzero(~(finite & straight))[:1].tolist():
        expect(bool(finite[number]), where(number), "16 finite numbers", matrices[number].ravel().tolist())
        expect(False, where(number), "a last row of 0 0 0 1", matrices[number, 3].tolist())
    linear = matrices[:, :3, :3]
    largest = np.abs(linear).max(axis=(1, 2))
    scaled = linear / np.where(largest > 0, largest, 1)[:, None, None]
    singular = np.linalg.svd(scaled, compute_uv=False)[:, -1] < COLLAPSED
    for number in np.flatnonzero(singular)[:1].tolist():
        expect(False, where(number), "an invertible matrix", matrices[number].ravel().tolist())


def invertible(matrices: Array) -> Array:
    """Return which matrices are finite and have an inverse.

    `matrices` (k, 4, 4) float64. Returns (k,) bool: products of good matrices may have overflowed or vanished.
    """
    finite = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    linear = _near_one(np.where(finite[:, None, None], matrices[:, :3, :3], 0))
    return np.asarray(np.linalg.det(linear) != 0)


def _near_one(linear: Array) -> Array:
    """Return matrices scaled by powers of 2, to the bit otherwise, so that determinants and inverses stay finite."""
    _, exponent = np.frexp(np.abs(linear).max(axis=(1, 2)))
    return np.asarray(np.ldexp(linear, -exponent[:, None, None]))


def transformed_all(meshes: Sequence[Mesh], matrices: Array) -> list[Mesh]:
    """Return each mesh in world space; a mirroring matrix also turns the winding of its faces.

    `matrices` (k, 4, 4): world from object, affine and invertible. Result: the same object where a matrix is the
    identity; else normals are unit vectors, or zero where they are missing.
    """
    linear = _near_one(matrices[:, :3, :3])
    rest = (matrices == IDENTITY).all(axis=(1, 2))
    mirrors = np.linalg.det(linear) < 0
    inverse = np.linalg.inv(linear)  # its scale is lost again where normals are made unit vectors
    return [mesh if rest[k] else _moved_mesh(mesh, matrices[k], inverse[k], bool(mirrors[k]))
            for k, mesh in enumerate(meshes)]


def _moved_mesh(mesh: Mesh, matrix: Array, inverse: Array, mirrors: bool) -> Mesh:
    with np.errstate(over="ignore", invalid="ignore"):  # final coordinates are checked by `repair`
        vertices = np.asarray(mesh.vertices, np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
        normals = None if mesh.normals is None else as_float64(mesh.normals)
    if normals is not None:
        normals = np.where(missing_normals(normals)[:, None], 0.0, normals) @ inverse
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        normals = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
    mesh = dataclasses.replace(mesh, vertices=vertices, normals=normals)
    if mirrors:
        return dataclasses.replace(mesh, faces=mesh.faces[:, ::-1], **at_corners(mesh, lambda values: values[:, ::-1]))
    return mesh


FAR = 16.0  # diagonals off the origin: float32 still has 2^19 steps a diagonal
COARSEST_STEP = 1 / 4096  # of the diagonal between neighbouring coordinates: the light is then off by 1e-3


def faces_of(scene: Scene, material: str) -> Array:
    """Return, (m,) bool, which faces of a scene show a material.

    Raises InputError if there is no material of that name, or no face shows it.
    """
    names = [one.name for one in scene.materials]
    if material not in names:
        raise InputError(f"material: expected one of {', '.join(names)}, got {material!r}"
                         f"{did_you_mean(material, names)}")
    selected_materials = [index for index, name in enumerate(names) if name == material]
    selected: Array = np.isin(scene.geometry.material_of_face, selected_materials)
    expect(bool(selected.any()), "material", "one that a face shows", material)
    return selected


def with_own_vertices(geometry: Geometry, selected: Array) -> Geometry:
    """Give the selected faces, (m,) bool, vertices of their own, so that they can move without pulling at others.

    Shared vertices stand once more at the end; the same object where none is shared.
    """
    shared = np.flatnonzero(_used(geometry, selected) & _used(geometry, ~selected))
    if not len(shared):
        return geometry
    copy = np.arange(len(geometry.vertices), dtype=geometry.faces.dtype)
    copy[shared] = len(geometry.vertices) + np.arange(len(shared))
    faces = np.where(selected[:, None], copy[geometry.faces], geometry.faces)
    normals = geometry.vertex_normals
    return dataclasses.replace(
        geometry, faces=faces, vertices=np.concatenate([geometry.vertices, geometry.vertices[shared]]),
        vertex_normals=None if normals is None else np.concatenate([normals, normals[shared]]))


def moved(geometry: Geometry, selected: Array, rotation: Array, center: Vector, translation: Vector) -> Geometry:
    """Turn the selected faces, (m,) bool, about a point, then move them: x' = center + R (x - center) + translation.

    `rotation`: R, (3, 3), proper; `center, translation`: m. Other vertices keep their coordinates to the bit, and faces
    their array. Raises InputError if a face that rests shares a vertex with one that moves.
    """
    moving = _used(geometry, selected)
    torn = int(np.count_nonzero(moving & _used(geometry, ~selected)))
    expect(torn == 0, "geometry", "no vertex that faces which move share with faces which rest (with_own_vertices)",
           f"{torn:,}")
    vertices = np.array(geometry.vertices, np.float64)
    if not np.array_equal(rotation, np.eye(3)):  # what only moves is not rounded twice
        vertices[moving] = (vertices[moving] - center) @ np.transpose(rotation) + center
    vertices[moving] += translation
    normals = geometry.vertex_normals
    if normals is not None:
        normals = np.array(normals, np.float64)
        normals[moving] = normals[moving] @ np.transpose(rotation)
    return dataclasses.replace(geometry, vertices=vertices, vertex_normals=normals)


def rotation_about(axis: Vector, angle: float) -> Array:
    """Return the (3, 3) rotation about an axis of any length (Rodrigues); InputError if it is no direction.

    `angle`: counter-clockwise when viewed against the axis, rad; exactly the identity for 0.

    >>> np.round(rotation_about((0, 0, 2), math.pi / 2) @ (1, 0, 0), 12).tolist()
    [0.0, 1.0, 0.0]
    """
    expect(is_direction(axis), "axis", "a finite vector, not zero, up to 1e+100 long", axis)
    x, y, z = np.asarray(axis, np.float64) / math.hypot(*axis)
    across = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    # 1 - cos without its rounding
    rotation: Array = np.eye(3) + math.sin(angle) * across + 2 * math.sin(angle / 2) ** 2 * (across @ across)
    return rotation


def _used(geometry: Geometry, selected: Array) -> Array:
    """Return which vertices some faces use."""
    used = np.zeros(len(geometry.vertices), np.bool_)
    used[geometry.faces[selected]] = True
    return used


def near_origin(scene: Scene) -> tuple[Scene, Vector]:
    """Return a scene near the origin, and what was subtracted from every place, m.

    The same object where its box lies within FAR diagonals of the origin; else moved as a whole, camera and lights with
    it, by whole multiples of a power of 2 not below the diagonal, so that the subtraction is exact and scenes moved by
    such a multiple become equal. Warns if float64 has too few steps for a scene so small and so far off.
    """
    low, high = scene.geometry.bounds
    diagonal, center = scene.geometry.diagonal, (low + high) / 2
    if diagonal == 0 or np.abs(center).max() <= FAR * diagonal:
        return scene, (0.0, 0.0, 0.0)
    step = float(np.spacing(np.abs(center).max()))
    if step > COARSEST_STEP * diagonal:
        text = (f"scene {scene.name!r}: {diagonal:.3g} m across, but so far from the origin that neighbouring "
                f"coordinates are {step:.3g} m apart: its shape is lost; build it nearer to the origin")
        warnings.warn(RefgiWarning(text), stacklevel=4)
    grid = 2.0 ** math.ceil(math.log2(diagonal))
    x, y, z = (float(value) for value in np.round(center / grid) * grid)
    origin = (x, y, z)
    camera = dataclasses.replace(scene.camera, eye=_moved(scene.camera.eye, origin),
                                 target=_moved(scene.camera.target, origin))
    lights = tuple(_moved_light(light, origin) for light in scene.lights)
    return dataclasses.replace(scene, geometry=_moved_geometry(scene.geometry, origin), camera=camera,
                               lights=lights), origin


@stage("scene.move")
def _moved_geometry(geometry: Geometry, origin: Vector) -> Geometry:
    """Move triangles so that `origin` becomes the origin.

    origin: World space, m.
    -> Geometry: The moved triangles.

    Notes
    -----
    A stage, so that frames of an animation go on sharing one geometry.
    """
    return dataclasses.replace(geometry, vertices=np.asarray(geometry.vertices, np.float64) - origin)


def _moved_light(light: Light, origin: Vector) -> Light:
    if isinstance(light, DirectionalLight):
        return light
    return dataclasses.replace(light, position=_moved(light.position, origin))


def _moved(place: Vector, origin: Vector) -> Vector:
    return place[0] - origin[0], place[1] - origin[1], place[2] - origin[2]
