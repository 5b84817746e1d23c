"""Attribute resolve, the second pass of rasterization: position, normal and albedo of each texel, in float64.

Every texel of every projection has a ray: an origin o and a direction d, where d reaches depth 1 (planar maps) or has
unit length (paraboloid). With v_i relative to o and N = (v1 - v0) x (v2 - v0) the hit is o + t d,
t = v0 . N / (d . N), and t is the depth itself. Positions therefore lie on the ray and on the plane to float64
rounding, before the cast to the buffer's type. `surfaces` has how normals are interpolated.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.rsm.buffers.runs import TABLE, Runs, find_runs
from refgi.rsm.buffers.surfaces import (
    ALBEDO,
    BATCH,
    COLUMNS,
    CONSTANT,
    CORNER,
    INPUTS,
    MIXED,
    NORMAL,
    PLANE,
    Records,
    Surface,
    describe,
)
from refgi.rsm.buffers.texel_rays import image_ray, row_view, texel_ray
from refgi.rsm.pool import plane
from refgi.rsm.raster.projection import ORTHOGRAPHIC, Projection

Array = npt.NDArray[Any]

ROWS, SIDE = 16, 256  # rows and columns of a tile: its records stay in cache, most of a triangle's runs lie in one
LANES = 4  # texels computed at once: runs are short
LINE = SIDE + LANES
# where a line holds what varies along it, direction or origin of rays: x, then y, z; then t; then three numbers
Y, Z, HIT, VALUE, LINES = np.uint64(LINE), np.uint64(2 * LINE), np.uint64(3 * LINE), np.uint64(4 * LINE), 7


class ChannelMask(NamedTuple):
    """Which channels a pass fills; the others' planes are empty."""

    depth: bool
    distance: bool
    position: bool
    normal: bool
    albedo: bool
    material_id: bool


class Planes(NamedTuple):
    """Where a pass writes, in the buffer's type."""

    depth: Array  # (H, W) m: axial in perspective and orthographic maps, else distance
    distance: Array  # (H, W) m: from the centre of projection; orthographic: the depth
    position: Array  # (3, H, W) m, world space
    normal: Array  # (3, H, W) unit vector on the visible side
    albedo: Array  # (3, H, W) diffuse reflectance
    material_id: Array  # (H, W) int32


class Tile(NamedTuple):
    """Texels resolved at once: `rows` rows from `top` on, `columns` columns from `left` on, all of one map."""

    top: int
    left: int
    rows: int
    columns: int


class Scratch(NamedTuple):
    """Scratch arrays of each worker."""

    runs: Runs
    records: Records
    line: Array  # (workers, LINES LINE) float64


def allocate(workers: int, rows: int = ROWS) -> Scratch:
    """Allocate scratch arrays for workers that resolve tiles of `rows` rows."""
    most = rows * SIDE + 2
    runs = Runs(np.empty((workers, rows, SIDE + 1), np.int32), np.empty((workers, rows, SIDE), np.int32),
                np.empty((workers, rows), np.int32), np.zeros((workers, TABLE), np.int32))  # fmt: skip
    records = Records(np.empty((workers, most), np.int32), np.empty((workers, most), np.int32),
                      plane((workers, most, COLUMNS), np.float64), np.zeros((workers, (INPUTS + COLUMNS) * BATCH)))
    records.fixed[:, 0] = 0.0  # of texels that see nothing
    records.material[:, 0] = -1
    return Scratch(runs, records, np.ones((workers, LINES * LINE)))


@kernel(parallel=True)
def resolve(
    surface: Surface, projection: Projection, triangle_id: Array, channels: ChannelMask, planes: Planes,
    scratch: Scratch,
) -> None:
    """Fill the planes of the chosen channels.

    `projection`: the maps that `triangle_id` was drawn on. `triangle_id` (H, W): triangle at each texel, -1 for none.
    `channels`: which planes to fill. `scratch`: of each worker; strips of rows are assigned to them round-robin.
    """
    workers, height, width = len(scratch.line), projection.height, projection.width
    strips = (height + ROWS - 1) // ROWS  # of a map
    for worker in prange(workers):
        runs, records, line = _runs_of(scratch, worker), _records_of(scratch, worker), scratch.line[worker]
        for strip in range(worker, strips * len(projection.origin), workers):
            m = strip // strips
            first = (strip - m * strips) * ROWS
            for left in range(0, width, SIDE):
                tile = Tile(m * height + first, left, min(ROWS, height - first), min(SIDE, width - left))
                count = find_runs(triangle_id, tile.top, tile.top + tile.rows, left, left + tile.columns, runs, records)
                describe(surface, projection, m, count, records)
                _fill(projection, tile, False, len(surface.normals) > 0, runs, records, line, channels, planes)


@kernel
def _runs_of(scratch: Scratch, worker: int) -> Runs:
    runs = scratch.runs
    return Runs(runs.first[worker], runs.record[worker], runs.count[worker], runs.table[worker])


@kernel
def _records_of(scratch: Scratch, worker: int) -> Records:
    records = scratch.records
    return Records(records.face[worker], records.material[worker], records.fixed[worker], records.batch[worker])


@kernel
def resolve_at(
    surface: Surface, projection: Projection, triangle_id: Array, texel: Array, channels: ChannelMask, planes: Planes,
    scratch: Scratch,
) -> None:
    """Fill the planes of the chosen channels at some texels, with the bits that `resolve` gives there.

    `projection`: the maps that `triangle_id` was drawn on. `triangle_id` (H, W): triangle at each texel, -1 for none.
    `texel` (n,): texels of the flattened maps. `channels`: which planes to fill. `planes`: the result, one row of n
    texels. `scratch`: of one worker.
    """
    runs, records, line = _runs_of(scratch, 0), _records_of(scratch, 0), scratch.line[0]
    width, height, done = projection.width, projection.height, 0
    while done < len(texel):  # as many as follow one another on the same map
        m, count = texel[done] // width // height, 0
        while count < BATCH and done + count < len(texel) and texel[done + count] // width // height == m:
            row, column = texel[done + count] // width, texel[done + count] % width
            face = triangle_id[row, column]
            records.face[count + 1] = max(face, 0)
            runs.first[0, count], runs.record[0, count] = count, count + 1 if face >= 0 else 0
            _write_ray(projection, row, column, count, line)
            count += 1
        runs.first[0, count], runs.count[0] = count, count
        describe(surface, projection, m, count + 1, records)
        tile = Tile(m * height, done, 1, count)
        _fill(projection, tile, True, len(surface.normals) > 0, runs, records, line, channels, planes)
        done += count


@kernel
def _fill(
    projection: Projection, tile: Tile, listed: bool, smooth: bool, runs: Runs, records: Records, line: Array,
    channels: ChannelMask, planes: Planes,
) -> None:
    """Fill a tile of the planes row by row: what depends on the triangle run by run, the rest along the whole row.

    `listed`: `line` holds rays of texels from anywhere on the tile's map, which belong in row 0 of the planes.
    """
    fixed, first, record, material = records.fixed, runs.first, runs.record, records.material
    kind, left, columns = projection.kind, tile.left, tile.columns
    for y in range(tile.rows):
        row, count = 0 if listed else tile.top + y, runs.count[y]
        view, v = row_view(projection, tile.top + y)
        if not listed:
            _write_rays(projection, view, v, left, columns, line)
        if channels.depth or channels.distance or channels.position:
            _write_hits(kind, view, y, count, first, record, fixed, line)
        if channels.depth:
            _store_depth(row, left, columns, line, planes.depth)
        if channels.distance:
            _store_distance(kind, view, row, left, columns, line, planes.distance)
        if channels.position:
            _store_points(kind, view, row, left, columns, line, planes.position)
        if smooth and channels.normal:
            _mix_normals(kind, y, count, first, record, fixed, line)
            _store_units(row, left, columns, line, planes.normal)
        elif channels.normal:
            _spread(NORMAL, y, count, first, record, fixed, line)
            _store(row, left, columns, line, planes.normal)
        if channels.albedo:
            _spread(ALBEDO, y, count, first, record, fixed, line)
            _store(row, left, columns, line, planes.albedo)
        if channels.material_id:
            _store_material(row, left, y, count, first, record, material, planes.material_id)


@kernel
def _write_ray(projection: Projection, row: int, column: int, i: int, line: Array) -> None:
    """Write at place `i` what varies over texels: the direction of a ray from one centre, the origin of a parallel one."""
    ox, oy, oz, dx, dy, dz = texel_ray(projection, row, column)
    parallel, at = projection.kind == ORTHOGRAPHIC, np.uint64(i)
    line[at], line[at + Y], line[at + Z] = ox if parallel else dx, oy if parallel else dy, oz if parallel else dz


@kernel
def _write_rays(projection: Projection, view: Any, v: float, left: int, columns: int, line: Array) -> None:
    """Write what varies along a row: directions of rays from one centre, origins of parallel ones."""
    kind, across, half, middle = projection.kind, 2.0 / projection.width, projection.half[0], left + 0.5
    for i in range(columns):
        ox, oy, oz, dx, dy, dz = image_ray(kind, view, ((np.int32(i) + middle) * across - 1.0) * half, v)
        parallel, at = kind == ORTHOGRAPHIC, np.uint64(i)
        line[at] = ox if parallel else dx
        line[at + Y] = oy if parallel else dy
        line[at + Z] = oz if parallel else dz


@kernel
def _write_hits(
    kind: int, view: Any, y: int, count: int, first: Array, record: Array, fixed: Array, line: Array
) -> None:
    """Write t of each texel of a row: inf without surface."""
    ox, oy, oz, _, _, _, _, _, _, dx, dy, dz = view
    for run in range(count):
        start, stop, r = first[y, run], first[y, run + 1], record[y, run]
        gx, gy, gz = fixed[r, PLANE], fixed[r, PLANE + 1], fixed[r, PLANE + 2]
        vx, vy, vz = fixed[r, CORNER], fixed[r, CORNER + 1], fixed[r, CORNER + 2]
        texels = (stop - start + LANES - 1) & -LANES
        if r == 0:
            for lane in range(texels):
                line[np.uint64(start) + np.uint64(lane) + HIT] = np.inf
        elif kind == ORTHOGRAPHIC:
            facing = dx * gx + dy * gy + dz * gz
            for lane in range(texels):
                at = np.uint64(start) + np.uint64(lane)
                above = (vx - line[at]) * gx + (vy - line[at + Y]) * gy + (vz - line[at + Z]) * gz
                line[at + HIT] = above / facing
        else:
            above = (vx - ox) * gx + (vy - oy) * gy + (vz - oz) * gz
            for lane in range(texels):
                at = np.uint64(start) + np.uint64(lane)
                line[at + HIT] = above / (line[at] * gx + line[at + Y] * gy + line[at + Z] * gz)


@kernel
def _store_depth(row: int, left: int, columns: int, line: Array, depth: Array) -> None:
    """Round depths of a row to the buffer's type."""
    to = np.uint64(left)
    for i in range(columns):
        at = np.uint64(i)
        depth[row, to + at] = line[at + HIT]


@kernel
def _store_distance(kind: int, view: Any, row: int, left: int, columns: int, line: Array, distance: Array) -> None:
    """Round the lengths of t d of a row to the buffer's type."""
    _, _, _, _, _, _, _, _, _, dx, dy, dz = view
    parallel, to = kind == ORTHOGRAPHIC, np.uint64(left)
    for i in range(columns):
        at = np.uint64(i)
        x, y, z = dx if parallel else line[at], dy if parallel else line[at + Y], dz if parallel else line[at + Z]
        distance[row, to + at] = line[at + HIT] * math.sqrt(x * x + y * y + z * z)


@kernel
def _store_points(kind: int, view: Any, row: int, left: int, columns: int, line: Array, position: Array) -> None:
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
def _mix_normals(kind: int, y: int, count: int, first: Array, record: Array, fixed: Array, line: Array) -> None:
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
def _store_units(row: int, left: int, columns: int, line: Array, normal: Array) -> None:
    """Round normals of a row, brought to unit length, to the buffer's type."""
    to = np.uint64(left)
    for i in range(columns):
        at = np.uint64(i)
        x, y, z = line[at + VALUE], line[at + VALUE + Y], line[at + VALUE + Z]
        square = x * x + y * y + z * z
        scale = 1.0 / math.sqrt(square) if square > 0.0 else 0.0
        normal[0, row, to + at], normal[1, row, to + at], normal[2, row, to + at] = x * scale, y * scale, z * scale


@kernel
def _spread(column: int, y: int, count: int, first: Array, record: Array, fixed: Array, line: Array) -> None:
    """Write three numbers of a record, from `column` on, along each of its runs in a row."""
    for run in range(count):
        start, stop, r = first[y, run], first[y, run + 1], record[y, run]
        a, b, c = fixed[r, column], fixed[r, column + 1], fixed[r, column + 2]
        for lane in range((stop - start + LANES - 1) & -LANES):
            at = np.uint64(start) + np.uint64(lane)
            line[at + VALUE], line[at + VALUE + Y], line[at + VALUE + Z] = a, b, c


@kernel
def _store(row: int, left: int, columns: int, line: Array, channel: Array) -> None:
    """Round three numbers of each texel of a row to the buffer's type."""
    to = np.uint64(left)
    for i in range(columns):
        at = np.uint64(i)
        channel[0, row, to + at], channel[1, row, to + at] = line[at + VALUE], line[at + VALUE + Y]
        channel[2, row, to + at] = line[at + VALUE + Z]


@kernel
def _store_material(
    row: int, left: int, y: int, count: int, first: Array, record: Array, material: Array, channel: Array
) -> None:
    for run in range(count):
        value = material[record[y, run]]
        for i in range(first[y, run], first[y, run + 1]):
            channel[row, np.uint64(left) + np.uint64(i)] = value
