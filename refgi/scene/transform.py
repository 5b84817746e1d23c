"""Placing a mesh in the world by a 4x4 matrix that acts on column vectors, p' = M p."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from refgi.errors import expect
from refgi.scene.model import Array, Mesh

IDENTITY = np.eye(4)
# Rank is judged on the matrix scaled to its largest entry; below this a direction has collapsed to rounding noise.
COLLAPSED = 1e-12


def affine(numbers: Sequence[float], where: str) -> Array:
    """Return 16 row-major numbers as an invertible affine matrix.

    Parameters
    ----------
    numbers : sequence of float
        Sixteen, row by row.
    where : str
        File and key, for the error's text.

    Returns
    -------
    (4, 4) ndarray of float64
        World from object.

    Raises
    ------
    InputError
        If a number is not finite, the last row is not 0 0 0 1, or the matrix is singular.
    """
    expect(len(numbers) == 16, where, "16 numbers, row by row", list(numbers))
    matrix = np.asarray(numbers, np.float64).reshape(4, 4)
    expect(bool(np.isfinite(matrix).all()), where, "16 finite numbers", list(numbers))
    expect(bool((matrix[3] == IDENTITY[3]).all()), where, "a last row of 0 0 0 1", matrix[3].tolist())
    largest = np.abs(matrix[:3, :3]).max()
    singular = largest == 0 or np.linalg.svd(matrix[:3, :3] / largest, compute_uv=False)[-1] < COLLAPSED
    expect(not singular, where, "an invertible matrix", list(numbers))
    return matrix


def placed(mesh: Mesh, matrix: Array) -> Mesh:
    """Return the mesh moved into the world; a mirroring matrix also turns the faces' winding.

    Parameters
    ----------
    mesh : Mesh
        A sound mesh.
    matrix : (4, 4) ndarray
        World from object, affine and invertible.

    Returns
    -------
    Mesh
        The same object where the matrix is the identity.
    """
    if np.array_equal(matrix, IDENTITY):
        return mesh
    linear = matrix[:3, :3]
    vertices = np.asarray(mesh.vertices, np.float64) @ linear.T + matrix[:3, 3]
    normals = mesh.normals
    if normals is not None:
        normals = np.asarray(normals, np.float64) @ np.linalg.inv(linear)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    mirrors = np.linalg.det(linear / np.abs(linear).max()) < 0
    faces = mesh.faces[:, ::-1] if mirrors else mesh.faces
    return dataclasses.replace(mesh, vertices=vertices, faces=faces, normals=normals)
