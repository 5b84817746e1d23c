"""Motion of surfaces since the frame before, and pixels that the camera's motion brings in (Sec. 3.3, 4).

A point was the same mean of its triangle's corners as they were: exact for rigid motion and skinned meshes alike. "New
pixels revealed by camera panning and rotations ... also have an a depending on the camera speed"; the light they blend
with, which the paper does not name, is that of the nearest texel at the edge of the earlier picture.
"""

import dataclasses
import math
from typing import Any, NamedTuple

import numpy as np

from refgi.elementary import exp2
from refgi.jit import kernel, prange
from refgi.rsm.buffers.gbuffer import GBuffer
from refgi.rsm.buffers.surfaces import cross
from refgi.rsm.pool import plane
from refgi.rsm.raster.projection import Projection
from refgi.scene.model import Geometry
from refgi.scene.values import Vector
from refgi.sssil.reprojection import PixelTransform, SourceView, pixel_transform
from refgi.stages import stage
from refgi.types import Array


def as_solids(geometry: Geometry, before: Geometry, solids: Array) -> Geometry:
    """Return earlier triangles with those of each solid, (m,) from 1 by face, as a rigid body (Kabsch 1976)."""
    vertices, normals = np.array(before.vertices, np.float64), before.vertex_normals
    normals = None if normals is None else np.array(normals, np.float64)
    for solid in np.unique(solids[solids > 0]):
        used = np.unique(geometry.faces[solids == solid])
        now, then = geometry.vertices[used], before.vertices[used]
        if np.array_equal(now, then):
            continue  # at rest, to the bit
        middle, place = now.mean(axis=0), then.mean(axis=0)
        left, _, right = np.linalg.svd((now - middle).T @ (then - place))
        left[:, 2] *= np.sign(np.linalg.det(left @ right))  # no mirror
        vertices[used] = (now - middle) @ (left @ right) + place
        if normals is not None and geometry.vertex_normals is not None:
            normals[used] = geometry.vertex_normals[used] @ (left @ right)
    return dataclasses.replace(before, vertices=vertices, vertex_normals=normals)


class PreviousPoints(NamedTuple):
    """The surface points of a picture one frame earlier."""

    position: Array  # (3, h, w) where it was, m
    normal: Array  # (3, h, w) its unit normal then
    speed: Array  # (h, w) how far it moved as this frame's camera sees it, pixels


def previous_points(buffer: GBuffer, geometry: Geometry, before: Geometry) -> PreviousPoints:
    """Move the surface points of a G-buffer back to where their triangles, `before` the same, were a frame earlier."""
    position, normal = buffer.resolve("position", "normal")
    return motion(position, normal, buffer.triangle_id, geometry.faces, geometry.vertices, before.vertices,
                  buffer.projection, geometry.vertex_normals, before.vertex_normals)


@stage("sssil.motion", kept=False)
def motion(
    position: Array, normal: Array, triangle_id: Array, faces: Array, vertices: Array, before: Array,
    projection: Projection, vertex_normals: Array | None = None, normals_before: Array | None = None,
) -> PreviousPoints:
    """Move surface points back to where they were a frame earlier: the same mean of their corners (HSS Sec. 4).

    position (3, h, w): Surface points of the picture, m.
    vertices (vertex, 3): Where the corners are, m.
    before (vertex, 3): Where the corners were a frame earlier, m.
    vertex_normals (vertex, 3): Normals of smooth triangles.
    normals_before (vertex, 3): The same a frame earlier.
    -> PreviousPoints: Points of triangles that did not move have the same position and normal to the bit.

    Notes
    -----
    Barycentric coordinates are found from the position in float64; what is added to the position is the same mean of
    the corners' displacements. The speed is inf where this frame's camera would have had the point behind it.
    """
    result = PreviousPoints(plane(position.shape, position.dtype), plane(normal.shape, normal.dtype),
                            plane(normal.shape[1:], normal.dtype))
    moving = np.empty(len(faces), np.bool_)
    corners = Corners(faces, *(np.zeros((0, 3)) if one is None else np.ascontiguousarray(one, np.float64)
                               for one in (vertices, before, vertex_normals, normals_before)))
    _find_moving(corners, moving)
    seen = pixel_transform(projection, np.float64)
    _move_back(triangle_id, moving, corners, seen, position, normal, result)
    return result


class Corners(NamedTuple):
    """The corners of triangles now and a frame earlier, in float64."""

    faces: Array  # (triangle, 3) vertices
    vertices: Array  # (vertex, 3) m
    before: Array  # (vertex, 3) m
    vertex_normals: Array  # (vertex, 3); (0, 3) of flat triangles
    normals_before: Array  # the same


@kernel(parallel=True)
def _find_moving(corners: Corners, moving: Array) -> None:
    faces, vertices, before, vertex_normals, normals_before = corners
    for face in prange(faces.shape[0]):
        same = True
        for corner in range(3):
            vertex = faces[face, corner]
            for axis in range(3):
                same &= vertices[vertex, axis] == before[vertex, axis]
                if vertex_normals.shape[0] > 0:
                    same &= vertex_normals[vertex, axis] == normals_before[vertex, axis]
        moving[face] = not same


@kernel(parallel=True)
def _move_back(
    triangle_id: Array, moving: Array, corners: Corners, seen: PixelTransform, position: Array, normal: Array,
    result: PreviousPoints,
) -> None:
    for row in prange(triangle_id.shape[0]):
        for axis in range(3):
            for column in range(triangle_id.shape[1]):
                result.position[axis, row, column] = position[axis, row, column]
                result.normal[axis, row, column] = normal[axis, row, column]
        _move_row(row, triangle_id, moving, corners, seen, result)


@kernel
def _move_row(
    row: int, triangle_id: Array, moving: Array, corners: Corners, seen: PixelTransform, result: PreviousPoints
) -> None:
    """Move a row's points on moving triangles and turn their normals, in place."""
    faces, vertices, before, vertex_normals, normals_before = corners
    position, normal, speed = result
    eye = seen.eye
    for column in range(triangle_id.shape[1]):
        speed[row, column] = 0
        face = triangle_id[row, column]
        if face < 0 or not moving[face]:
            continue
        i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
        x, y, z = float(position[0, row, column]), float(position[1, row, column]), float(position[2, row, column])
        nx, ny, nz = _scaled_normal(vertices, i, j, k)
        mx, my, mz = _scaled_normal(before, i, j, k)
        a, b, c = _barycentric(vertices, i, j, k, x, y, z)
        if vertex_normals.shape[0] > 0:
            nx, ny, nz = _mean(vertex_normals, i, j, k, a, b, c)
            mx, my, mz = _mean(normals_before, i, j, k, a, b, c)
        ox, oy, oz = _mean(vertices, i, j, k, a, b, c)
        px, py, pz = _mean(before, i, j, k, a, b, c)
        dx, dy, dz = px - ox, py - oy, pz - oz
        speed[row, column] = _pixels_between(x - eye[0], y - eye[1], z - eye[2], dx, dy, dz, seen)
        position[0, row, column], position[1, row, column], position[2, row, column] = x + dx, y + dy, z + dz
        side = nx * normal[0, row, column] + ny * normal[1, row, column] + nz * normal[2, row, column]
        length = math.sqrt(mx * mx + my * my + mz * mz)
        if length > 0.0:
            unit = math.copysign(1.0 / length, side)  # on the side that is visible in this frame
            normal[0, row, column], normal[1, row, column] = mx * unit, my * unit
            normal[2, row, column] = mz * unit


@kernel
def _scaled_normal(vertices: Array, i: int, j: int, k: int) -> tuple[float, float, float]:
    """Return the normal of a triangle, twice its area long."""
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
    """Return the weighted mean of an attribute of three vertices."""
    return (a * of_vertex[i, 0] + b * of_vertex[j, 0] + c * of_vertex[k, 0],
            a * of_vertex[i, 1] + b * of_vertex[j, 1] + c * of_vertex[k, 1],
            a * of_vertex[i, 2] + b * of_vertex[j, 2] + c * of_vertex[k, 2])


@kernel
def _pixels_between(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, seen: PixelTransform
) -> float:
    """Return the distance in pixels between the images of a point, relative to the eye, and of the point moved by d."""
    axes, scale = seen.axes, seen.scale
    right = axes[0, 0] * x + axes[0, 1] * y + axes[0, 2] * z
    down = axes[1, 0] * x + axes[1, 1] * y + axes[1, 2] * z
    depth = axes[2, 0] * x + axes[2, 1] * y + axes[2, 2] * z
    more_right = axes[0, 0] * dx + axes[0, 1] * dy + axes[0, 2] * dz
    more_down = axes[1, 0] * dx + axes[1, 1] * dy + axes[1, 2] * dz
    deeper = axes[2, 0] * dx + axes[2, 1] * dy + axes[2, 2] * dz
    if not (depth > 0.0 and depth + deeper > 0.0):
        return np.inf
    # (a + da) / (z + dz) - a / z without the difference of nearly equal numbers
    u = (more_right - right / depth * deeper) / (depth + deeper) * scale[0]
    v = (more_down - down / depth * deeper) / (depth + deeper) * scale[1]
    return math.sqrt(u * u + v * v)


def fetch_entering(
    values: Array, source: SourceView, position: Array, covered: Array, weight: Array, origin: Vector, speed: float,
    reprojected: Array,
) -> Array:
    """Fetch the light at the edge of the earlier picture for pixels whose points lay outside it, into `reprojected`.

    `position` (3, h', w'): where each point was then, m from `origin`; `weight` (h', w'): 0 where reprojection found no
    light. Returns exp(-v / speed), (h', w'), of pixels that entered, moved by v pixels across the picture; 0 of others.
    """
    share = plane(covered.shape, reprojected.dtype)
    to = pixel_transform(source.projection, reprojected.dtype, np.subtract(source.origin, origin))
    falloff = reprojected.dtype.type(-math.log2(math.e) / speed)
    _fetch_entering(values, source.depth, to, position, covered, weight, falloff, reprojected, share)
    return share


@kernel(parallel=True)
def _fetch_entering(
    values: Array, depth: Array, to: PixelTransform, position: Array, covered: Array, weight: Array, falloff: Any,
    reprojected: Array, share: Array,
) -> None:
    for row in prange(covered.shape[0]):
        _fetch_row(row, values, depth, to, position, covered, weight, falloff, reprojected, share)


@kernel
def _fetch_row(
    row: Any, values: Array, depth: Array, to: PixelTransform, position: Array, covered: Array, weight: Array,
    falloff: Any, reprojected: Array, share: Array,
) -> None:
    real, eye, axes, scale = share.dtype.type, to.eye, to.axes, to.scale
    height, width, half = depth.shape[0], depth.shape[1], real(0.5)
    for column in range(share.shape[1]):
        share[row, column] = real(0)
        if weight[row, column] > real(0) or not covered[row, column]:
            continue
        dx = position[0, row, column] - eye[0]
        dy = position[1, row, column] - eye[1]
        dz = position[2, row, column] - eye[2]
        ahead = axes[2, 0] * dx + axes[2, 1] * dy + axes[2, 2] * dz
        if not ahead > real(0):
            continue
        x = (axes[0, 0] * dx + axes[0, 1] * dy + axes[0, 2] * dz) / ahead * scale[0] + scale[2]
        y = (axes[1, 0] * dx + axes[1, 1] * dy + axes[1, 2] * dz) / ahead * scale[1] + scale[3]
        if -half <= x <= real(width) - half and -half <= y <= real(height) - half:
            continue  # it was hidden, not outside
        j = int(np.rint(min(max(x, real(0)), real(width - 1))))
        i = int(np.rint(min(max(y, real(0)), real(height - 1))))
        if not depth[i, j] < np.inf:
            continue
        across, down = x - real(column), y - real(row)
        share[row, column] = exp2(math.sqrt(across * across + down * down) * falloff)
        for channel in range(3):
            reprojected[channel, row, column] = values[channel, i, j]
