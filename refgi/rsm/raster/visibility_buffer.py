"""The visibility buffer: nearest triangle and its inverse depth at every texel, drawn in bands of rows.

Work is split by rows. One map is cut into bands; each band keeps the list of clusters that reach it, the nearest first,
and draws them alone. Several maps are drawn one map per task, triangle by triangle in mesh order. Whoever draws has
keys of nearness and id of its own and writes the planes at the end. The greatest key at a texel depends on no order, so
neither the height of a band nor the number of threads changes the result. Depth is kept as nearness in float32, ties go
to the lowest id.
"""

from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel, prange, thread_count
from refgi.rsm.pool import plane
from refgi.rsm.raster.batch import EMPTY, Part, draw, unpack
from refgi.rsm.raster.cluster_batch import draw_clusters, local_scratch
from refgi.rsm.raster.paraboloid import cut_chunks, draw_paraboloids
from refgi.rsm.raster.placed_clusters import Placed, list_clusters, place
from refgi.rsm.raster.projection import PARABOLOID, Projection
from refgi.rsm.raster.triangle import LANES, bound_triangles, project_vertices
from refgi.scene.model import Geometry
from refgi.scene.triangles import Clusters, CutFaces
from refgi.skips import left_out
from refgi.stages import stage
from refgi.types import Array

CHUNKS = 32  # pieces of the list of triangles that are counted and listed on their own


class Bands(NamedTuple):
    """Triangles by band of rows."""

    boxes: Array  # (m, 4) uint16: first and last column, first and last row; first > last: covers nothing
    starts: Array  # (bands + 1,) where each band's triangles start in `members`
    members: Array  # (...) int32: triangles of band 0, of band 1, ..., each in mesh order; then CHUNKS of no meaning
    rows: int  # height of a band


def bands(corners: Array, cells: Array, faces: Array, width: int, height: int, rows: int) -> Bands:
    """List the triangles of each band of rows.

    `corners` (n, 4): projected vertices. `cells` (n, 4) int: the texels that each lies between. `faces` (m, 3):
    vertices of each triangle. `width`, `height`: size of the map. `rows`: height of a band. Result: the lists, in mesh
    order.
    """
    boxes = plane((len(faces), 4), np.uint16)
    band_of = np.arange(height, dtype=np.int32) // np.int32(rows)
    counts = np.zeros((CHUNKS, band_of[-1] + 1), np.int64)
    _count(corners, cells, faces, (width, height), band_of, boxes, counts)
    ends = np.cumsum(counts.T).reshape(counts.T.shape)  # band by band, chunk by chunk
    members = plane((int(ends[-1, -1]) + CHUNKS,), np.int32)
    _list(boxes, band_of, np.ascontiguousarray((ends - counts.T).T), members)
    return Bands(boxes, np.concatenate([[0], ends[:, -1]]), members, rows)


@kernel(parallel=True)
def project_all(projection: Projection, vertices: Array, corners: Array, cells: Array) -> None:
    """Project vertices on the first map, as `project_vertices` does."""
    step = -(-len(vertices) // CHUNKS)
    for chunk in prange(CHUNKS):
        last = min((chunk + 1) * step, len(vertices))
        project_vertices(projection, 0, vertices, chunk * step, last, corners, cells)


@kernel(parallel=True)
def _count(
    corners: Array, cells: Array, faces: Array, size: tuple[int, int], band_of: Array, boxes: Array, counts: Array
) -> None:
    step = -(-len(faces) // CHUNKS)
    for chunk in prange(CHUNKS):
        first, last = min(chunk * step, len(faces)), min((chunk + 1) * step, len(faces))
        bound_triangles(corners, cells, faces, first, last, size, boxes[first:last])
        for face in range(first, last):
            upper, lower = band_of[boxes[face, 2]], band_of[boxes[face, 3]]
            counts[chunk, upper] += boxes[face, 0] <= boxes[face, 1]
            for band in range(upper + 1, lower + 1):
                counts[chunk, band] += 1


@kernel(parallel=True)
def _list(boxes: Array, band_of: Array, cursors: Array, members: Array) -> None:
    step = -(-len(boxes) // CHUNKS)
    for chunk in prange(CHUNKS):
        spare = len(members) - 1 - chunk  # takes what covers nothing: no branch for it
        for face in range(chunk * step, min((chunk + 1) * step, len(boxes))):
            upper, lower = band_of[boxes[face, 2]], band_of[boxes[face, 3]]
            there, cursor = boxes[face, 0] <= boxes[face, 1], cursors[chunk, upper]
            members[cursor if there else spare] = face
            cursors[chunk, upper] = cursor + there
            for band in range(upper + 1, lower + 1):
                members[cursors[chunk, band]] = face
                cursors[chunk, band] += 1


@kernel
def part_of(lists: Bands, band: int, top: int, bottom: int) -> Part:
    """Return the triangles of a band and its rows, for `draw`."""
    return Part(lists.members, lists.starts[band], lists.starts[band + 1], lists.boxes, 0, top, bottom)


BATCH = 1024  # triangles whose boxes are found before they are drawn on one of several maps
MOST_ROWS = 64  # of a band: its keys stay in cache


class Visibility(NamedTuple):
    """Nearest triangle at each texel of the stacked maps."""

    triangle_id: Array  # (H, W) int32, -1: nothing
    inverse_depth: Array  # (H, W) float32: 1/depth, 1/m; orthographic 1 - depth/reach; 0: nothing


class ClusterLists(NamedTuple):
    """Clusters by band of rows."""

    starts: Array  # (bands + 1,) where each band's clusters start in `members`
    members: Array  # (...) int32: clusters of band 0, of band 1, ..., the nearest first
    rows: int  # height of a band


class Cut(NamedTuple):
    """Triangles that may have holes, drawn after all others."""

    faces: Array  # (c, 3) int32: vertices of each
    holes: CutFaces
    lists: Any  # Bands, of the same rows as those of the others; None for several maps
    corners: Any  # (n, 4) float64: projected vertices of the geometry; None for several maps


class Scratch(NamedTuple):
    """Scratch arrays of each worker that draws whole maps."""

    corners: Array  # (workers, n, 4) float64
    cells: Array  # (workers, n, 4) int32
    boxes: Array  # (workers, BATCH, 4) uint16
    members: Array  # (workers, BATCH) int32
    keys: Array  # (workers, height (width + LANES)) int64: nearness and triangle of each texel


@stage("rsm.rasterize")
def rasterize(geometry: Geometry, projection: Projection, *, band_rows: int | None = None) -> Visibility:
    """Find the nearest triangle at every texel centre.

    geometry: The triangles; those without area are passed over.
    band_rows: Height of a band of one map, in rows; the result does not depend on it.
    -> Visibility: Triangle and nearness at each texel of the stacked maps.

    Notes
    -----
    A centre on an edge belongs to one of the two triangles that share it, never to both or none. Paraboloid maps are
    drawn inside the inscribed circle of the hemisphere only. A triangle with holes is seen where its mask says that it
    is there, at the texel's centre.
    """
    vertices, faces = geometry.vertices, geometry.without_cut
    cut = None if geometry.cut is None else Cut(geometry.faces[geometry.cut.face], geometry.cut, None, None)
    height, width = projection.shape
    visibility = Visibility(plane((height, width), np.int32), plane((height, width), np.float32))
    workers = thread_count()
    if projection.kind == PARABOLOID:
        draw_paraboloids(projection, vertices, faces, workers, visibility.inverse_depth, visibility.triangle_id,
                         cut_chunks(geometry))
    elif projection.maps > 1:
        _draw_maps(projection, vertices, faces, cut, scratch(workers, len(vertices), projection), visibility)
    else:
        rows = min(band_rows or min(max(height // (8 * workers), 4), MOST_ROWS), height)
        if cut is not None:
            corners, cells = plane((len(vertices), 4), np.float64), plane((len(vertices), 4), np.int32)
            project_all(projection, vertices, corners, cells)
            cut = cut._replace(lists=bands(corners, cells, cut.faces, width, height, rows), corners=corners)
        _draw_clusters(projection, geometry, rows, cut, visibility)
    return visibility


def scratch(workers: int, vertices: int, projection: Projection) -> Scratch:
    """Allocate scratch arrays for workers that draw whole maps.

    `workers`: how many run at once. `vertices`: vertices of the geometry. `projection`: the maps.
    """
    return Scratch(
        plane((workers, vertices, 4), np.float64),
        plane((workers, vertices, 4), np.int32),
        np.empty((workers, BATCH, 4), np.uint16),
        np.empty((workers, BATCH), np.int32),
        plane((workers, projection.height * (projection.width + LANES)), np.int64),
    )


def _draw_clusters(
    projection: Projection, geometry: Geometry, rows: int, cut: Cut | None, visibility: Visibility
) -> None:
    """Draw one map in bands of rows, each from the clusters that reach it, the nearest first."""
    clusters, (height, width) = geometry.clusters, projection.shape
    placed = place(projection, clusters)
    starts, members = list_clusters(placed.rect, np.argsort(-placed.nearest, kind="stable"), rows, -(-height // rows))
    lists, passed = ClusterLists(starts, members, rows), np.zeros(len(starts) - 1, np.int64)
    keys = plane((thread_count(), rows * (width + LANES)), np.int64)

    def draw_all(passing: bool) -> tuple[int, int]:
        _draw_bands(projection, clusters, placed, lists, cut, passing, keys, passed, visibility)
        return int(passed.sum()), len(members)

    draw_all(left_out("rsm.clusters", lambda: draw_all(True)))


@kernel(parallel=True)
def _draw_bands(
    projection: Projection, clusters: Clusters, placed: Placed, lists: ClusterLists, cut: Cut | None, passing: bool,
    keys: Array, passed: Array, visibility: Visibility,
) -> None:
    workers, (height, width) = len(keys), visibility.triangle_id.shape
    starts, rows = lists.starts, lists.rows
    for worker in prange(workers):
        band_keys, local = keys[worker], local_scratch()
        for band in range(worker, len(starts) - 1, workers):  # interleaved: neighbours cost alike
            top, bottom = band * rows, min((band + 1) * rows, height) - 1
            members = lists.members[starts[band] : starts[band + 1]]
            band_keys[:] = EMPTY
            passed[band] = draw_clusters(projection, clusters, placed, members, (top, bottom), passing, local,
                                         band_keys)
            if cut is not None:
                draw(cut.corners, cut.faces, part_of(cut.lists, band, top, bottom), width, cut.holes, band_keys)
            unpack(band_keys, width, top, bottom, visibility.inverse_depth, visibility.triangle_id)


@kernel(parallel=True)
def _draw_maps(
    projection: Projection, vertices: Array, faces: Array, cut: Cut | None, scratch: Scratch, visibility: Visibility
) -> None:
    workers, height, width = len(scratch.corners), projection.height, projection.width
    for worker in prange(workers):
        corners, cells, keys = scratch.corners[worker], scratch.cells[worker], scratch.keys[worker]
        boxes, members = scratch.boxes[worker], scratch.members[worker]
        for m in range(worker, len(projection.origin), workers):
            rows = slice(m * height, (m + 1) * height)
            project_vertices(projection, m, vertices, 0, len(vertices), corners, cells)
            keys[:] = EMPTY
            for base in range(0, len(faces), BATCH):
                count = _list_some(corners, cells, faces, base, (width, height), boxes, members)
                draw(corners, faces, Part(members, 0, count, boxes, base, 0, height - 1), width, None, keys)
            if cut is not None:
                for base in range(0, len(cut.faces), BATCH):
                    count = _list_some(corners, cells, cut.faces, base, (width, height), boxes, members)
                    part = Part(members, 0, count, boxes, base, 0, height - 1)
                    draw(corners, cut.faces, part, width, cut.holes, keys)
            unpack(keys, width, 0, height - 1, visibility.inverse_depth[rows], visibility.triangle_id[rows])


@kernel
def _list_some(
    corners: Array, cells: Array, faces: Array, base: int, size: tuple[int, int], boxes: Array, members: Array
) -> int:
    """List those of BATCH triangles from `base` on that may cover a texel, and return how many these are."""
    count, last = 0, min(base + BATCH, len(faces))
    bound_triangles(corners, cells, faces, base, last, size, boxes)
    for face in range(base, last):
        members[count] = face
        count += boxes[face - base, 0] <= boxes[face - base, 1]
    return count
