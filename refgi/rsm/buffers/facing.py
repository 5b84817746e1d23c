"""Face normals of the G-buffer's triangles, where shading normals are interpolated, and backs that are seen."""

import math
from typing import Any

import numpy as np

from refgi.jit import kernel, prange
from refgi.rsm.pool import plane
from refgi.scene.model import Geometry
from refgi.stages import stage
from refgi.types import Array


@stage("rsm.facing")
def facing_normals(geometry: Geometry, triangle_id: Array, normal: Array) -> Array:
    """Return the normal of each pixel's triangle on the side of its shading normal (docs/conventions).

    normal (3, h, w): Shading normals; their dtype is that of the result.
    -> (3, h, w): Unit vectors; 0 where there is no surface. The very array `normal` where nothing is interpolated.
    """
    if geometry.vertex_normals is None:
        return normal
    facing = plane(normal.shape, normal.dtype)
    _fill_facing(geometry.vertices, geometry.faces, triangle_id, normal, facing)
    return facing


@stage("rsm.backs")
def share_of_backs(geometry: Geometry, one_sided: Array, eye: tuple[float, float, float], triangle_id: Array) -> float:
    """Return the share of pixels with a surface that show the back of one that its file leaves out.

    geometry: The triangles; fronts are counter-clockwise.
    one_sided (k,) bool: Which materials have no back.
    eye: Where the camera is, m.
    -> float: From 0 to 1.
    """
    pixels = np.bincount(triangle_id[triangle_id >= 0], minlength=1)
    seen = np.flatnonzero(pixels)
    a, b, c = (geometry.vertices[geometry.faces[seen, k]] for k in range(3))
    turned = np.einsum("ij,ij->i", np.cross(b - a, c - a), np.asarray(eye) - a) < 0
    backs = seen[turned & one_sided[geometry.material_of_face[seen]]]
    return float(pixels[backs].sum() / max(1, pixels.sum()))


@kernel(parallel=True)
def _fill_facing(vertices: Array, faces: Array, triangle_id: Array, normal: Array, facing: Array) -> None:
    for row in prange(triangle_id.shape[0]):
        last, nx, ny, nz = -1, 0.0, 0.0, 0.0
        for column in range(triangle_id.shape[1]):
            face = triangle_id[row, column]
            if face != last:  # neighbours mostly share their triangle
                nx, ny, nz = _unit_normal(vertices, faces, face)
                last = face
            along = nx * normal[0, row, column] + ny * normal[1, row, column] + nz * normal[2, row, column]
            sign = -1.0 if along < 0.0 else 1.0
            facing[0, row, column] = sign * nx
            facing[1, row, column] = sign * ny
            facing[2, row, column] = sign * nz


@kernel
def _unit_normal(vertices: Array, faces: Array, face: int) -> Any:
    if face < 0:
        return 0.0, 0.0, 0.0
    i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
    ax, ay, az = vertices[j, 0] - vertices[i, 0], vertices[j, 1] - vertices[i, 1], vertices[j, 2] - vertices[i, 2]
    bx, by, bz = vertices[k, 0] - vertices[i, 0], vertices[k, 1] - vertices[i, 1], vertices[k, 2] - vertices[i, 2]
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if length == 0.0:
        return 0.0, 0.0, 0.0
    return nx / length, ny / length, nz / length
