"""What is computed along a row of a tile: run by run what depends on the triangle, along all texels the rest.

A line is one array, so that the compiler sees that its parts do not overlap; parts lie apart by constants, and runs are
filled in whole lanes, so that loops over lanes are SIMD code without a rest. What lanes write past the end of a run the
next run overwrites. All numbers are float64 until they are stored in the buffer's type.

In kernels below `first` (rows, SIDE + 1) and `record` (rows, SIDE) are runs' first texels and records in row `y` of a
tile, `count` of them; `fixed` (n, COLUMNS) are the records. `row` and `left` say where a line belongs in the planes.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel
from refgi.rsm.buffers.surfaces import CONSTANT, CORNER, MIXED, NORMAL, PLANE, RANGE, Records, image_ray, texel_ray
from refgi.rsm.raster.projection import ORTHOGRAPHIC, Projection
from refgi.types import Array

TABLE = 4096  # places where a triangle's record is looked for; a power of two


class Runs(NamedTuple):
    """Runs of the rows of a strip."""

    first: Array  # (rows, texels + 1) int32: first texel of each run, then one past the last texel
    record: Array  # (rows, texels) int32: record of each run; 0: it sees nothing
    number: Array  # (rows,) int32: how many runs a row has
    table: Array  # (TABLE,) int32: a record where one may be that of a triangle


@kernel
def find_runs(triangle_id: Array, top: int, bottom: int, left: int, right: int, runs: Runs, records: Records) -> int:
    """Find the runs of some rows, and the triangles that they see.

    `triangle_id` (H, W): triangle at each texel, -1 for none. `top`, `bottom`: first row and one past the last. `runs`:
    receives where they lie. `records`: `face` receives each triangle, mostly once. Result: one past the last record.
    """
    first, record, table, face_of = runs.first, runs.record, runs.table, records.face
    known, width = 1, np.uint64(right - left)
    face_of[0] = -1
    for row in range(top, bottom):
        y, line, count, before = np.uint64(row - top), np.uint64(row), np.uint64(0), np.int32(-2)
        for x in range(width):  # free of branches: what does not begin a run is overwritten
            face = triangle_id[line, np.uint64(left) + x]
            first[y, count] = x
            count += np.uint64(face != before)
            before = face
        first[y, count] = width
        runs.number[y] = count
        for run in range(count):
            face = triangle_id[line, np.uint64(left) + np.uint64(first[y, run])]
            place = np.uint64(face) & np.uint64(TABLE - 1)
            there = table[place]
            new = (there >= known) | (face_of[there] != face)  # the table may still hold records of other tiles
            slot = known if new else there
            face_of[known] = face
            known += new & (face >= 0)
            table[place] = slot
            record[y, run] = slot if face >= 0 else 0
    return known


SIDE = 256  # texels of a line
LANES = 4  # texels computed at once: runs are short
LINE = SIDE + LANES
# where a line holds what varies along it, direction or origin of rays: x, then y, z; then t; then three numbers
Y, Z, HIT, VALUE, LINES = np.uint64(LINE), np.uint64(2 * LINE), np.uint64(3 * LINE), np.uint64(4 * LINE), 7


@kernel
def write_ray(projection: Projection, row: int, column: int, i: int, line: Array) -> None:
    """Write a ray's direction, of a parallel one its origin, at place `i` of a line."""
    ox, oy, oz, dx, dy, dz = texel_ray(projection, row, column)
    parallel, at = projection.kind == ORTHOGRAPHIC, np.uint64(i)
    line[at], line[at + Y], line[at + Z] = ox if parallel else dx, oy if parallel else dy, oz if parallel else dz


@kernel
def write_rays(projection: Projection, view: Any, v: float, left: int, columns: int, line: Array) -> None:
    """Write what varies along a row: directions of rays from one centre, origins of parallel ones."""
    kind, across, half, middle = projection.kind, 2.0 / projection.width, projection.half[0], left + 0.5
    for i in range(columns):
        ox, oy, oz, dx, dy, dz = image_ray(kind, view, ((np.int32(i) + middle) * across - 1.0) * half, v)
        parallel, at = kind == ORTHOGRAPHIC, np.uint64(i)
        line[at] = ox if parallel else dx
        line[at + Y] = oy if parallel else dy
        line[at + Z] = oz if parallel else dz


@kernel
def write_hits(
    kind: int, view: Any, y: int, count: int, first: Array, record: Array, fixed: Array, line: Array
) -> None:
    """Write t of each texel of a row: inf without surface."""
    ox, oy, oz, _, _, _, _, _, _, dx, dy, dz = view
    for run in range(count):
        start, stop, r = first[y, run], first[y, run + 1], record[y, run]
        gx, gy, gz = fixed[r, PLANE], fixed[r, PLANE + 1], fixed[r, PLANE + 2]
        vx, vy, vz = fixed[r, CORNER], fixed[r, CORNER + 1], fixed[r, CORNER + 2]
        least, greatest = fixed[r, RANGE], fixed[r, RANGE + 1]
        texels = (stop - start + LANES - 1) & -LANES
        if r == 0:
            for lane in range(texels):
                line[np.uint64(start) + np.uint64(lane) + HIT] = np.inf
        elif kind == ORTHOGRAPHIC:
            facing = dx * gx + dy * gy + dz * gz
            for lane in range(texels):
                at = np.uint64(start) + np.uint64(lane)
                above = (vx - line[at]) * gx + (vy - line[at + Y]) * gy + (vz - line[at + Z]) * gz
                t = above / facing
                t = t if t > least else least  # not a number where 0 is divided by 0
                line[at + HIT] = t if t < greatest else greatest
        else:
            above = (vx - ox) * gx + (vy - oy) * gy + (vz - oz) * gz
            for lane in range(texels):
                at = np.uint64(start) + np.uint64(lane)
                t = above / (line[at] * gx + line[at + Y] * gy + line[at + Z] * gz)
                t = t if t > least else least
                line[at + HIT] = t if t < greatest else greatest


@kernel
def store_depth(row: int, left: int, columns: int, line: Array, depth: Array) -> None:
    """Round depths of a row to the buffer's type."""
    to = np.uint64(left)
    for i in range(columns):
        at = np.uint64(i)
        depth[row, to + at] = line[at + HIT]


@kernel
def store_distance(kind: int, view: Any, row: int, left: int, columns: int, line: Array, distance: Array) -> None:
    """Round the lengths of t d of a row to the buffer's type."""
    _, _, _, _, _, _, _, _, _, dx, dy, dz = view
    parallel, to = kind == ORTHOGRAPHIC, np.uint64(left)
    for i in range(columns):
        at = np.uint64(i)
        x, y, z = dx if parallel else line[at], dy if parallel else line[at + Y], dz if parallel else line[at + Z]
        distance[row, to + at] = line[at + HIT] * math.sqrt(x * x + y * y + z * z)


@kernel
def store_points(kind: int, view: Any, row: int, left: int, columns: int, line: Array, position: Array) -> None:
    """Round the points o + t d of a row to the buffer's type: 0 without surface."""
    ox, oy, oz, _, _, _, _, _, _, dx, dy, dz = view
    parallel, to = kind == ORTHOGRAPHIC, np.uint64(left)
    for i in range(columns):
        at = np.uint64(i)
        t, x, y, z = line[at + HIT], line[at], line[at + Y], line[at + Z]
        x = x + t * dx if parallel else ox + t * x
        y = y + t * dy if parallel else oy + t * y
        z = z + t * dz if parallel else oz + t * z
        seen = t < np.inf
        position[0, row, to + at] = x if seen else 0.0
        position[1, row, to + at] = y if seen else 0.0
        position[2, row, to + at] = z if seen else 0.0


@kernel
def mix_normals(kind: int, y: int, count: int, first: Array, record: Array, fixed: Array, line: Array) -> None:
    """Write interpolated normals of a row, of any length, on the side of the face's: 0 without surface."""
    parallel = kind == ORTHOGRAPHIC
    for run in range(count):
        start, stop, r = first[y, run], first[y, run + 1], record[y, run]
        vx, vy, vz = fixed[r, CORNER], fixed[r, CORNER + 1], fixed[r, CORNER + 2]
        vx, vy, vz = vx if parallel else 0.0, vy if parallel else 0.0, vz if parallel else 0.0
        nx, ny, nz = fixed[r, NORMAL], fixed[r, NORMAL + 1], fixed[r, NORMAL + 2]
        mxx, mxy, mxz, kx = fixed[r, MIXED], fixed[r, MIXED + 1], fixed[r, MIXED + 2], fixed[r, CONSTANT]
        myx, myy, myz, ky = fixed[r, MIXED + 3], fixed[r, MIXED + 4], fixed[r, MIXED + 5], fixed[r, CONSTANT + 1]
        mzx, mzy, mzz, kz = fixed[r, MIXED + 6], fixed[r, MIXED + 7], fixed[r, MIXED + 8], fixed[r, CONSTANT + 2]
        for lane in range((stop - start + LANES - 1) & -LANES):
            at = np.uint64(start) + np.uint64(lane)
            qx, qy, qz = line[at] - vx, line[at + Y] - vy, line[at + Z] - vz
            sx = kx + (qx * mxx + qy * mxy + qz * mxz)
            sy = ky + (qx * myx + qy * myy + qz * myz)
            sz = kz + (qx * mzx + qy * mzy + qz * mzz)
            long = sx * sx + sy * sy + sz * sz > 0.0
            side = math.copysign(1.0, sx * nx + sy * ny + sz * nz)
            sx, sy, sz = side * sx, side * sy, side * sz
            line[at + VALUE] = sx if long else nx
            line[at + VALUE + Y] = sy if long else ny
            line[at + VALUE + Z] = sz if long else nz


@kernel
def store_units(row: int, left: int, columns: int, line: Array, normal: Array) -> None:
    """Round normals of a row, brought to unit length, to the buffer's type."""
    to = np.uint64(left)
    for i in range(columns):
        at = np.uint64(i)
        x, y, z = line[at + VALUE], line[at + VALUE + Y], line[at + VALUE + Z]
        square = x * x + y * y + z * z
        scale = 1.0 / math.sqrt(square) if square > 0.0 else 0.0
        normal[0, row, to + at], normal[1, row, to + at], normal[2, row, to + at] = x * scale, y * scale, z * scale


@kernel
def spread_normals(y: int, count: int, first: Array, record: Array, fixed: Array, line: Array) -> None:
    """Write the faces' normals of a row along its runs."""
    for run in range(count):
        start, stop, r = first[y, run], first[y, run + 1], record[y, run]
        a, b, c = fixed[r, NORMAL], fixed[r, NORMAL + 1], fixed[r, NORMAL + 2]
        for lane in range((stop - start + LANES - 1) & -LANES):
            at = np.uint64(start) + np.uint64(lane)
            line[at + VALUE], line[at + VALUE + Y], line[at + VALUE + Z] = a, b, c


@kernel
def store(row: int, left: int, columns: int, line: Array, channel: Array) -> None:
    """Round three numbers of each texel of a row to the buffer's type."""
    to = np.uint64(left)
    for i in range(columns):
        at = np.uint64(i)
        channel[0, row, to + at], channel[1, row, to + at] = line[at + VALUE], line[at + VALUE + Y]
        channel[2, row, to + at] = line[at + VALUE + Z]
