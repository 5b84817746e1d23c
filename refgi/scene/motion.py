"""Objects of a scene moved rigidly: the same triangles, some of their vertices elsewhere."""

import dataclasses
import math

import numpy as np

from refgi.errors import InputError, expect
from refgi.scene.files import did_you_mean
from refgi.scene.model import Array, Geometry, Scene
from refgi.scene.values import Vector, is_direction


def faces_of(scene: Scene, material: str) -> Array:
    """Return which faces of a scene show a material.

    Parameters
    ----------
    scene : Scene
        The scene.
    material : str
        The material's name.

    Returns
    -------
    (m,) ndarray of bool
        For every face of its geometry.

    Raises
    ------
    InputError
        If there is no material of that name, or no face shows it.
    """
    names = [given.name for given in scene.materials]
    if material not in names:
        raise InputError(f"material: expected one of {', '.join(names)}, got {material!r}"
                         f"{did_you_mean(material, names)}")
    wanted = [index for index, name in enumerate(names) if name == material]
    selected: Array = np.isin(scene.geometry.material_of_face, wanted)
    expect(bool(selected.any()), "material", "one that a face shows", material)
    return selected


def with_own_vertices(geometry: Geometry, selected: Array) -> Geometry:
    """Give some faces vertices of their own, so that they can move without pulling at others.

    Parameters
    ----------
    geometry : Geometry
        The triangles.
    selected : (m,) ndarray of bool
        Which faces.

    Returns
    -------
    Geometry
        The same object where no vertex is shared; else shared vertices stand once more at the end.
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
    """Turn some faces about a point, then move them: x' = center + R (x - center) + translation.

    Parameters
    ----------
    geometry : Geometry
        The triangles.
    selected : (m,) ndarray of bool
        Which faces move.
    rotation : (3, 3) ndarray
        R, a proper rotation.
    center : tuple of 3 floats
        The point that it leaves where it is, m.
    translation : tuple of 3 floats
        Displacement afterwards, m.

    Returns
    -------
    Geometry
        With the same array of faces; other vertices keep their coordinates to the bit.

    Raises
    ------
    InputError
        If a face that rests shares a vertex with one that moves.
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
    """Return the rotation about an axis (Rodrigues).

    Parameters
    ----------
    axis : tuple of 3 floats
        Direction, of any length.
    angle : float
        Counter-clockwise for who looks against the axis, rad.

    Returns
    -------
    (3, 3) ndarray
        The matrix; exactly the identity where the angle is 0.

    Raises
    ------
    InputError
        If the axis is no direction.

    Examples
    --------
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
