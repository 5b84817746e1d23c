"""The visibility buffer: nearest triangle and its inverse depth at every texel.

Work is split by rows. One map is cut into bands; each band keeps the list of triangles that reach it, in mesh order,
and draws them alone, so that the result does not depend on the height of a band or the number of threads. Several maps
are drawn one map per task without lists. Whoever draws has keys of nearness and id of its own and writes the planes at
the end. Depth is kept as nearness in float32, ties go to the lowest id.
"""

from typing import Any, NamedTuple

import numba
import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.rsm.pool import plane
from refgi.rsm.raster.batch import EMPTY, Part, draw, unpack
from refgi.rsm.raster.cluster_batch import Placed, draw_clusters, local_scratch, place_clusters
from refgi.rsm.raster.paraboloid import cut_chunks, draw_paraboloids
from refgi.rsm.raster.projection import PARABOLOID, Projection
from refgi.rsm.raster.triangle import LANES, bound_triangles, project_vertices
from refgi.scene.clusters import Clusters
from refgi.scene.cutouts import CutFaces
from refgi.scene.model import Geometry
from refgi.skips import left_out
from refgi.stages import stage

Array = npt.NDArray[Any]

BATCH = 1024  # triangles whose boxes are found before they are drawn on one of several maps
MOST_ROWS = 64  # of a band: its keys stay in cache
CHUNKS = 32  # pieces of the list of triangles that are counted and listed on their own


class Visibility(NamedTuple):
    """Nearest triangle at each texel of the stacked maps."""

    triangle_id: Array  # (H, W) int32, -1: nothing
    inverse_depth: Array  # (H, W) float32: 1/depth, 1/m; orthographic 1 - depth/reach; 0: nothing


class Bands(NamedTuple):
    """Triangles by band of rows."""

    boxes: Array  # (m, 4) uint16: first and last column, first and last row; first > last: covers nothing
    starts: Array  # (bands + 1,) where each band's triangles start in `members`
    members: Array  # (...) int32: triangles of band 0, of band 1, ..., each in mesh order; then CHUNKS of no meaning
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

    Parameters
    ----------
    geometry : Geometry
        The triangles; those without area are passed over.
    projection : Projection
        The maps.
    band_rows : int, optional
        Height of a band of one map, in rows; the result does not depend on it.

    Returns
    -------
    Visibility
        Triangle and nearness at each texel of the stacked maps.

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
    workers = numba.get_num_threads()
    if projection.kind == PARABOLOID:
        draw_paraboloids(projection, vertices, faces, workers, visibility.inverse_depth, visibility.triangle_id,
                         cut_chunks(geometry))
    elif projection.maps > 1:
        _draw_maps(projection, vertices, faces, cut, scratch(workers, len(vertices), projection), visibility)
    else:
        rows = min(band_rows or min(max(height // (8 * workers), 4), MOST_ROWS), height)
        if cut is not None:
            corners, cells = plane((len(vertices), 4), np.float64), plane((len(vertices), 4), np.int32)
            _project(projection, vertices, corners, cells)
            cut = cut._replace(lists=bands(corners, cells, cut.faces, width, height, rows))
            cut = cut._replace(corners=corners)
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
def _project(projection: Projection, vertices: Array, corners: Array, cells: Array) -> None:
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


def _draw_clusters(
    projection: Projection, geometry: Geometry, rows: int, cut: Cut | None, visibility: Visibility
) -> None:
    """Draw one map in bands of rows, each from the clusters that reach it, the nearest first."""
    clusters, (height, width), workers = geometry.clusters, projection.shape, numba.get_num_threads()
    count, band_count = len(clusters.box), -(-height // rows)
    placed = Placed(np.empty((count, 4), np.int32), np.empty(count), np.empty(count, np.int64), np.empty(count),
                    np.empty((count, 4)), np.empty(count))
    place_clusters(projection, 0, clusters, placed)
    order = np.argsort(-placed.nearest)
    starts = np.zeros(band_count + 1, np.int64)
    members = list_clusters(placed.rect, order, rows, starts)
    keys = plane((workers, rows * (width + LANES)), np.int64)
    passing = left_out("rsm.clusters", lambda: (0, 1))
    _draw_bands(projection, clusters, placed, starts, members, rows, passing, cut, keys, visibility)


@kernel
def list_clusters(rect: Array, order: Array, rows: int, starts: Array) -> Array:
    """Return the clusters of band 0, of band 1, ..., each in an order; `starts` (bands + 1,) receives where each starts.

    `rect` (c, 4): texels that each cluster may cover. `order` (c,): all clusters. `rows`: height of a band.
    """
    for c in range(len(rect)):
        if rect[c, 0] <= rect[c, 1] and rect[c, 2] <= rect[c, 3]:
            for band in range(rect[c, 2] // rows, rect[c, 3] // rows + 1):
                starts[band + 1] += 1
    for band in range(1, len(starts)):
        starts[band] += starts[band - 1]
    cursors, members = starts[:-1].copy(), np.empty(starts[-1], np.int32)
    for c in order:
        if rect[c, 0] <= rect[c, 1] and rect[c, 2] <= rect[c, 3]:
            for band in range(rect[c, 2] // rows, rect[c, 3] // rows + 1):
                members[cursors[band]] = c
                cursors[band] += 1
    return members


@kernel(parallel=True)
def _draw_bands(
    projection: Projection, clusters: Clusters, placed: Placed, starts: Array, members: Array, rows: int,
    passing: bool, cut: Cut | None, keys: Array, visibility: Visibility,
) -> None:
    workers, (height, width) = len(keys), visibility.triangle_id.shape
    for worker in prange(workers):
        band_keys, local = keys[worker], local_scratch()
        for band in range(worker, len(starts) - 1, workers):  # interleaved: neighbours cost alike
            top, bottom = band * rows, min((band + 1) * rows, height) - 1
            band_keys[:] = EMPTY
            draw_clusters(projection, 0, clusters, placed, members[starts[band] : starts[band + 1]], (top, bottom),
                          passing, local, band_keys)
            if cut is not None:
                draw(cut.corners, cut.faces, _part_of(cut.lists, band, top, bottom), width, cut.holes, band_keys)
            unpack(band_keys, width, top, bottom, visibility.inverse_depth, visibility.triangle_id)


@kernel
def _part_of(lists: Bands, band: int, top: int, bottom: int) -> Part:
    return Part(lists.members, lists.starts[band], lists.starts[band + 1], lists.boxes, 0, top, bottom)


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
