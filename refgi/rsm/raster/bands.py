"""Lists of the triangles that reach each band of rows of one map, in mesh order."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.rsm.pool import plane
from refgi.rsm.raster.batch import Part
from refgi.rsm.raster.projection import Projection
from refgi.rsm.raster.triangle import bound_triangles, project_vertices

Array = npt.NDArray[Any]

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
