"""Transform meshes to world space by a 4x4 matrix that acts on column vectors, p' = M p."""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from refgi.errors import expect
from refgi.scene.mesh import Mesh, as_float64, at_corners, missing_normals
from refgi.scene.values import Array

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
    return [mesh if rest[k] else _moved(mesh, matrices[k], inverse[k], bool(mirrors[k]))
            for k, mesh in enumerate(meshes)]


def _moved(mesh: Mesh, matrix: Array, inverse: Array, mirrors: bool) -> Mesh:
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
