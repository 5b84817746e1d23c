"""Where the surface point of each pixel was in the frame before (Sec. 4, dynamic objects).

A point is a mean of the corners of its triangle; it was the same mean of the corners as they were. This is exact for
rigid motion and for skinned meshes alike, so that no object has to be told by its matrix.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.rsm.buffers.gbuffer import GBuffer
from refgi.rsm.buffers.runs import cross
from refgi.rsm.memory import plane
from refgi.scene.model import Geometry
from refgi.stages import stage

Array = npt.NDArray[Any]


class Before(NamedTuple):
    """The surface points of a picture one frame earlier."""

    position: Array  # (3, h, w) m
    normal: Array  # (3, h, w) unit vectors
    speed: Array  # (h, w) how far each moved across the picture of today's camera, pixels


@stage("sssil.motion", kept=False)
def points_before(buffer: GBuffer, geometry: Geometry, before: Geometry) -> Before:
    """Move surface points back to where their triangles were.

    Parameters
    ----------
    buffer : GBuffer
        What the camera sees today.
    geometry : Geometry
        The triangles that it sees.
    before : Geometry
        The same triangles a frame earlier, in the same coordinates.

    Returns
    -------
    Before
        Points of triangles that did not move keep position and normal to the bit.

    Notes
    -----
    Barycentric coordinates are found from the position in float64; what is added to the position is the same mean of
    the corners' displacements. The speed is inf where today's camera would have had the point behind it.
    """
    position, normal = buffer.resolve("position", "normal")
    room = Before(plane(position.shape, position.dtype), plane(normal.shape, normal.dtype),
                  plane(normal.shape[1:], normal.dtype))
    none = np.zeros((0, 3))
    smooth = none if geometry.vertex_normals is None else geometry.vertex_normals
    smooth_before = none if before.vertex_normals is None else before.vertex_normals
    moving = np.empty(len(geometry.faces), np.bool_)
    _find_moving(geometry.faces, geometry.vertices, before.vertices, smooth, smooth_before, moving)
    projection = buffer.projection
    size = np.array([projection.width, projection.height])
    _move_back(buffer.triangle_id, moving, geometry.faces, geometry.vertices, before.vertices, smooth, smooth_before,
               projection.origin[0], projection.frame[0], size / (2 * projection.half), position, normal, *room)
    return room


@kernel(parallel=True)
def _find_moving(
    faces: Array, vertices: Array, before: Array, smooth: Array, smooth_before: Array, moving: Array
) -> None:
    for face in prange(faces.shape[0]):
        same = True
        for corner in range(3):
            vertex = faces[face, corner]
            for axis in range(3):
                same &= vertices[vertex, axis] == before[vertex, axis]
                if smooth.shape[0] > 0:
                    same &= smooth[vertex, axis] == smooth_before[vertex, axis]
        moving[face] = not same


@kernel(parallel=True)
def _move_back(
    triangle_id: Array, moving: Array, faces: Array, vertices: Array, before: Array, smooth: Array,
    smooth_before: Array, eye: Array, frame: Array, scale: Array, position: Array, normal: Array, moved: Array,
    turned: Array, speed: Array,
) -> None:
    for row in prange(triangle_id.shape[0]):
        for axis in range(3):
            for column in range(triangle_id.shape[1]):
                moved[axis, row, column] = position[axis, row, column]
                turned[axis, row, column] = normal[axis, row, column]
        _move_row(row, triangle_id, moving, faces, vertices, before, smooth, smooth_before, eye, frame, scale,
                  moved, turned, speed)


@kernel
def _move_row(
    row: int, triangle_id: Array, moving: Array, faces: Array, vertices: Array, before: Array, smooth: Array,
    smooth_before: Array, eye: Array, frame: Array, scale: Array, moved: Array, turned: Array, speed: Array,
) -> None:
    """Move a row's points on moving triangles and turn their normals; both come in as they are today."""
    for column in range(triangle_id.shape[1]):
        speed[row, column] = 0
        face = triangle_id[row, column]
        if face < 0 or not moving[face]:
            continue
        i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
        x, y, z = float(moved[0, row, column]), float(moved[1, row, column]), float(moved[2, row, column])
        nx, ny, nz = _across(vertices, i, j, k)
        mx, my, mz = _across(before, i, j, k)
        a, b, c = _barycentric(vertices, i, j, k, x, y, z)
        if smooth.shape[0] > 0:
            nx, ny, nz = _mean(smooth, i, j, k, a, b, c)
            mx, my, mz = _mean(smooth_before, i, j, k, a, b, c)
        ox, oy, oz = _mean(vertices, i, j, k, a, b, c)
        px, py, pz = _mean(before, i, j, k, a, b, c)
        dx, dy, dz = px - ox, py - oy, pz - oz
        speed[row, column] = _pixels_between(x - eye[0], y - eye[1], z - eye[2], dx, dy, dz, frame, scale)
        moved[0, row, column], moved[1, row, column], moved[2, row, column] = x + dx, y + dy, z + dz
        side = nx * turned[0, row, column] + ny * turned[1, row, column] + nz * turned[2, row, column]
        length = math.sqrt(mx * mx + my * my + mz * mz)
        if length > 0.0:
            unit = math.copysign(1.0 / length, side)  # on the side that is seen today
            turned[0, row, column], turned[1, row, column] = mx * unit, my * unit
            turned[2, row, column] = mz * unit


@kernel
def _across(vertices: Array, i: int, j: int, k: int) -> tuple[float, float, float]:
    """Return the vector across a triangle, twice its area long."""
    ax, ay, az = (vertices[j, 0] - vertices[i, 0], vertices[j, 1] - vertices[i, 1], vertices[j, 2] - vertices[i, 2])
    bx, by, bz = (vertices[k, 0] - vertices[i, 0], vertices[k, 1] - vertices[i, 1], vertices[k, 2] - vertices[i, 2])
    return cross(ax, ay, az, bx, by, bz)


@kernel
def _barycentric(
    vertices: Array, i: int, j: int, k: int, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Return the weights of a triangle's corners at a point of its plane."""
    ax, ay, az = vertices[j, 0] - vertices[i, 0], vertices[j, 1] - vertices[i, 1], vertices[j, 2] - vertices[i, 2]
    bx, by, bz = vertices[k, 0] - vertices[i, 0], vertices[k, 1] - vertices[i, 1], vertices[k, 2] - vertices[i, 2]
    px, py, pz = x - vertices[i, 0], y - vertices[i, 1], z - vertices[i, 2]
    nx, ny, nz = cross(ax, ay, az, bx, by, bz)
    square = nx * nx + ny * ny + nz * nz
    if not square > 0.0:
        return 1.0, 0.0, 0.0
    ux, uy, uz = cross(px, py, pz, bx, by, bz)
    vx, vy, vz = cross(ax, ay, az, px, py, pz)
    b, c = (ux * nx + uy * ny + uz * nz) / square, (vx * nx + vy * ny + vz * nz) / square
    return 1.0 - b - c, b, c


@kernel
def _mean(
    of_vertex: Array, i: int, j: int, k: int, a: float, b: float, c: float
) -> tuple[float, float, float]:
    """Return the weighted mean of what three vertices have."""
    return (a * of_vertex[i, 0] + b * of_vertex[j, 0] + c * of_vertex[k, 0],
            a * of_vertex[i, 1] + b * of_vertex[j, 1] + c * of_vertex[k, 1],
            a * of_vertex[i, 2] + b * of_vertex[j, 2] + c * of_vertex[k, 2])


@kernel
def _pixels_between(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, frame: Array, scale: Array
) -> float:
    """Return how far apart a camera sees a point, relative to its eye, and the point moved by d; pixels."""
    right = frame[0, 0] * x + frame[0, 1] * y + frame[0, 2] * z
    down = frame[1, 0] * x + frame[1, 1] * y + frame[1, 2] * z
    depth = frame[2, 0] * x + frame[2, 1] * y + frame[2, 2] * z
    more_right = frame[0, 0] * dx + frame[0, 1] * dy + frame[0, 2] * dz
    more_down = frame[1, 0] * dx + frame[1, 1] * dy + frame[1, 2] * dz
    deeper = frame[2, 0] * dx + frame[2, 1] * dy + frame[2, 2] * dz
    if not (depth > 0.0 and depth + deeper > 0.0):
        return np.inf
    # (a + da) / (z + dz) - a / z without the difference of nearly equal numbers
    u = (more_right - right / depth * deeper) / (depth + deeper) * scale[0]
    v = (more_down - down / depth * deeper) / (depth + deeper) * scale[1]
    return math.sqrt(u * u + v * v)
