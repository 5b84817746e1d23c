"""Attribute resolve, the second pass of rasterization: depth, position, normal, material, vertex colour of each texel.

Every texel of every projection has a ray: an origin o and a direction d, where d reaches depth 1 (planar maps) or has
unit length (paraboloid). With v_i relative to o and N = (v1 - v0) x (v2 - v0) the hit is o + t d,
t = v0 . N / (d . N), and t is the depth itself. Positions therefore lie on the ray and on the plane to float64
rounding, before the cast to the buffer's type. `surfaces` has how normals are interpolated.
"""

from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel, prange
from refgi.rsm.buffers.lines import (
    LINE,
    LINES,
    SIDE,
    TABLE,
    Runs,
    find_runs,
    mix_normals,
    spread_normals,
    store,
    store_depth,
    store_distance,
    store_points,
    store_units,
    write_hits,
    write_ray,
    write_rays,
)
from refgi.rsm.buffers.surfaces import (
    BATCH,
    COLUMNS,
    INPUTS,
    Records,
    Surface,
    cross,
    describe,
    image_ray,
    row_view,
)
from refgi.rsm.pool import plane
from refgi.rsm.raster.projection import Projection
from refgi.scene.model import Geometry
from refgi.scene.texture.lookup import Colour, colour_at
from refgi.types import Array

ROWS = 16  # of a tile: its records stay in cache, and most of a triangle's runs lie in one tile


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
    line: Array  # (workers, LINES LINE) float64: see `lines`


def allocate(workers: int, rows: int = ROWS) -> Scratch:
    """Allocate scratch arrays for workers that resolve tiles of `rows` rows."""
    most = rows * SIDE + 2
    runs = Runs(np.empty((workers, rows, SIDE + 1), np.int32), np.empty((workers, rows, SIDE), np.int32),
                np.empty((workers, rows), np.int32), np.zeros((workers, TABLE), np.int32))  # fmt: skip
    records = Records(np.empty((workers, most), np.int32), plane((workers, most, COLUMNS), np.float64),
                      np.zeros((workers, (INPUTS + COLUMNS) * BATCH)))
    records.fixed[:, 0] = 0.0  # of texels that see nothing
    return Scratch(runs, records, np.ones((workers, LINES * LINE)))


@kernel(parallel=True)
def resolve(
    surface: Surface, projection: Projection, triangle_id: Array, texel: Array, seen: Array, channels: ChannelMask,
    planes: Planes, scratch: Scratch,
) -> None:
    """Fill the planes of the chosen channels: of all texels, or of listed ones, to the same bits.

    `projection`: the maps that `triangle_id` (H, W) was drawn on: triangle at each texel, -1 for none. `texel` (n,):
    those listed, of the flattened maps, n > 0; the planes then have one row of them, and one worker fills it. `seen`:
    `triangle_id` there, (1, n), or everywhere. `scratch`: of each worker; strips of rows, and rows of materials, are
    assigned to them round-robin.
    """
    workers, height, width = len(scratch.line), projection.height, projection.width
    strips = (height + ROWS - 1) // ROWS  # of a map
    listed, painted = len(texel) > 0, channels.albedo | channels.material_id
    shaped = channels.depth | channels.distance | channels.position | channels.normal
    for worker in prange(workers):
        for row in range(worker, len(seen) if painted else 0, workers):
            _fill_materials(surface, seen[row], row, planes)
        runs, records, line = _runs_of(scratch, worker), _records_of(scratch, worker), scratch.line[worker]
        strip = worker
        left: Any = np.int64(0)  # no literal, for which callees would be compiled again
        while shaped and (left < len(texel) if listed else strip < strips * len(projection.origin)):
            if listed:
                m, columns = _list_runs(projection, triangle_id, texel, left, runs, records, line)
                tile, count = Tile(m * height, left, 1, columns), columns + 1
            else:
                m = strip // strips
                first = (strip - m * strips) * ROWS
                tile = Tile(m * height + first, left, min(ROWS, height - first), min(SIDE, width - left))
                count = find_runs(triangle_id, tile.top, tile.top + tile.rows, left, left + tile.columns, runs, records)
            describe(surface, surface.normals, projection, m, count, records)
            _fill(projection, tile, listed, surface.normals, runs, records, line, channels, planes)
            left += tile.columns
            if not listed and left >= width:
                strip, left = strip + workers, np.int64(0)


@kernel
def _runs_of(scratch: Scratch, worker: int) -> Runs:
    runs = scratch.runs
    return Runs(runs.first[worker], runs.record[worker], runs.number[worker], runs.table[worker])


@kernel
def _records_of(scratch: Scratch, worker: int) -> Records:
    records = scratch.records
    return Records(records.face[worker], records.fixed[worker], records.batch[worker])


@kernel
def _list_runs(
    projection: Projection, triangle_id: Array, texel: Array, done: int, runs: Runs, records: Records, line: Array
) -> tuple[int, int]:
    """Make runs of one texel each and write their rays: of as many listed ones as follow one another on a map.

    Result: the map, and how many.
    """
    width, height = projection.width, projection.height
    m, count = texel[done] // width // height, 0
    while count < BATCH and done + count < len(texel) and texel[done + count] // width // height == m:
        row, column = texel[done + count] // width, texel[done + count] % width
        face = triangle_id[row, column]
        records.face[count + 1] = max(face, 0)
        runs.first[0, count], runs.record[0, count] = count, count + 1 if face >= 0 else 0
        write_ray(projection, row, column, count, line)
        count += 1
    runs.first[0, count], runs.number[0] = count, count
    return m, count


@kernel
def _fill(
    projection: Projection, tile: Tile, listed: bool, normals: Array | None, runs: Runs, records: Records, line: Array,
    channels: ChannelMask, planes: Planes,
) -> None:
    """Fill a tile of the planes row by row: what depends on the triangle run by run, the rest along the whole row.

    `listed`: `line` holds rays of texels from anywhere on the tile's map, which belong in row 0 of the planes.
    """
    fixed, first, record = records.fixed, runs.first, runs.record
    kind, left, columns = projection.kind, tile.left, tile.columns
    for y in range(tile.rows):
        row, count = 0 if listed else tile.top + y, runs.number[y]
        view, v = row_view(projection, tile.top + y)
        if not listed:
            write_rays(projection, view, v, left, columns, line)
        if channels.depth or channels.distance or channels.position:
            write_hits(kind, view, y, count, first, record, fixed, line)
        if channels.depth:
            store_depth(row, left, columns, line, planes.depth)
        if channels.distance:
            store_distance(kind, view, row, left, columns, line, planes.distance)
        if channels.position:
            store_points(kind, view, row, left, columns, line, planes.position)
        if channels.normal:
            if normals is None:
                spread_normals(y, count, first, record, fixed, line)
                store(row, left, columns, line, planes.normal)
            else:
                mix_normals(kind, y, count, first, record, fixed, line)
                store_units(row, left, columns, line, planes.normal)


@kernel
def _fill_materials(surface: Surface, face: Array, row: int, planes: Planes) -> None:
    """Fill a row of the planes of material and albedo, if not empty, of visible triangles (w,), -1: none."""
    material = np.empty(len(face), np.int32)
    for x in range(len(face)):
        material[x] = surface.material_of_face[max(face[x], 0)] if face[x] >= 0 else -1
    for x in range(len(face) if planes.material_id.size else 0):
        planes.material_id[row, x] = material[x]
    for channel in range(3 if planes.albedo.size else 0):
        for x in range(len(face)):
            planes.albedo[channel, row, x] = surface.diffuse[channel, material[x]]


class Coloured(NamedTuple):
    """Triangles and the colours of their corners."""

    vertices: Array  # (n, 3) float64, m
    faces: Array  # (m, 3) int32
    colours: Array  # (m, 3, 3) float64


def tint(
    geometry: Geometry, projection: Projection, triangle_id: Array, albedo: Array, texel: Array | None = None
) -> None:
    """Multiply albedo by the vertex colours, in place; scenes without any are left alone.

    `projection`: the maps that `triangle_id` (H, W) was drawn on. `albedo` (3, H, W), or of `texel` (n,) alone; empty
    where it is not wanted.
    """
    if geometry.colours is None or not albedo.size:
        return
    surface = Coloured(geometry.vertices, geometry.faces, geometry.colours)
    if texel is None:
        _tint_rows(surface, projection, triangle_id, albedo)
    else:
        _tint_texels(surface, projection, triangle_id, texel, albedo.reshape(3, -1))


@kernel(parallel=True)
def _tint_rows(surface: Coloured, projection: Projection, triangle_id: Array, albedo: Array) -> None:
    for row in prange(triangle_id.shape[0]):
        for column in range(triangle_id.shape[1]):
            face = triangle_id[row, column]
            if face >= 0:
                r, g, b = _colour(surface, projection, face, row, column)
                albedo[0, row, column] *= r
                albedo[1, row, column] *= g
                albedo[2, row, column] *= b


@kernel
def _tint_texels(surface: Coloured, projection: Projection, triangle_id: Array, texel: Array, albedo: Array) -> None:
    width = triangle_id.shape[1]
    for k in range(len(texel)):
        row, column = texel[k] // width, texel[k] % width
        face = triangle_id[row, column]
        if face >= 0:
            r, g, b = _colour(surface, projection, face, row, column)
            albedo[0, k] *= r
            albedo[1, k] *= g
            albedo[2, k] *= b


@kernel
def _colour(surface: Coloured, projection: Projection, face: int, row: int, column: int) -> Colour:
    """Return the colour where the ray o + t d of a texel meets its triangle: t = N . (v_0 - o) / (N . d)."""
    view, y = row_view(projection, row)
    x = ((column + 0.5) * (2.0 / projection.width) - 1.0) * projection.half[0]
    ox, oy, oz, dx, dy, dz = image_ray(projection.kind, view, x, y)
    vertices, (i, j, k) = surface.vertices, (surface.faces[face, 0], surface.faces[face, 1], surface.faces[face, 2])
    px, py, pz = vertices[i, 0], vertices[i, 1], vertices[i, 2]
    nx, ny, nz = cross(vertices[j, 0] - px, vertices[j, 1] - py, vertices[j, 2] - pz,
                       vertices[k, 0] - px, vertices[k, 1] - py, vertices[k, 2] - pz)
    t = (nx * (px - ox) + ny * (py - oy) + nz * (pz - oz)) / (nx * dx + ny * dy + nz * dz)
    return colour_at(vertices, surface.faces, surface.colours, face, ox + t * dx, oy + t * dy, oz + t * dz)
