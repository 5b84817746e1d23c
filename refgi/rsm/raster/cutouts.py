"""Cut-outs on maps: triangles with holes, drawn after all others into the same keys.

The others are drawn as on any scene. Of the triangles that may have holes a texel asks the mask only where it would see
the triangle: inside, and nearer than what it has so far. Texture coordinates are u = sum(e_i u_i) / sum(e_i) with the
edge functions e_i of `batch` and `paraboloid`, which is right in perspective. The greatest key does not depend on the
order, so a texel shows the nearest triangle that is there.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.rsm.raster.batch import (
    BATCH,
    EMPTY,
    LIMIT,
    ROWS,
    Part,
    draw,
    gather,
    integer,
    key_of,
    set_up,
    shorten,
    unpack,
)
from refgi.rsm.raster.projection import Projection
from refgi.rsm.raster.triangle import LANES, SPAN_CUT, bound_triangles, project_vertices
from refgi.scene.cutouts import CutFaces
from refgi.scene.texture.alpha import is_opaque, lent

if TYPE_CHECKING:
    from refgi.rsm.raster.visibility_buffer import Bands, Scratch, Visibility

Array = npt.NDArray[Any]


@kernel
def draw_cut(corners: Array, faces: Array, part: Part, width: int, holes: CutFaces, keys: Array) -> None:
    """Keep the greatest key at each texel, of the triangles that are there.

    As `refgi.rsm.raster.batch.draw`, but for `faces` (c, 3): the triangles that may have holes alone, which `part`
    counts; `holes` has their ids, coordinates and masks.
    """
    members, boxes, stride = part.members, part.boxes, width + LANES
    uv, table, setup = holes.uv, lent(holes.table), np.zeros(ROWS * BATCH)
    for base in range(part.start, part.stop, BATCH):
        count = min(BATCH, part.stop - base)
        gather(corners, faces, members, base, count, setup)
        set_up(setup, width)
        for b in range(count):
            k = members[base + b]
            earliness, nearest, mask = EMPTY - np.int64(holes.face[k]), key_of(setup[LIMIT + b], EMPTY), holes.mask[k]
            a0, b0, c0, t0 = setup[b], setup[BATCH + b], setup[2 * BATCH + b], setup[3 * BATCH + b]
            a1, b1, c1, t1 = setup[4 * BATCH + b], setup[5 * BATCH + b], setup[6 * BATCH + b], setup[7 * BATCH + b]
            a2, b2, c2, t2 = setup[8 * BATCH + b], setup[9 * BATCH + b], setup[10 * BATCH + b], setup[11 * BATCH + b]
            an, bn, cn = setup[12 * BATCH + b], setup[13 * BATCH + b], setup[14 * BATCH + b]
            place_of_box = k - part.base
            left, right = integer(boxes[place_of_box, 0]), integer(boxes[place_of_box, 1])
            upper, lower = integer(boxes[place_of_box, 2]), integer(boxes[place_of_box, 3])
            for row in range(max(upper, part.top), min(lower, part.bottom) + 1):
                y = row + 0.5
                r0, r1, r2, rn = b0 * y + c0, b1 * y + c1, b2 * y + c2, bn * y + cn
                first, last = left, right
                if last - first > SPAN_CUT:
                    first, last = shorten(first, last, a0, r0)
                    first, last = shorten(first, last, a1, r1)
                    first, last = shorten(first, last, a2, r2)
                for column in range(first, last + 1):
                    x, at = column + 0.5, np.uint64((row - part.top) * stride + column)
                    e0, e1, e2 = a0 * x + r0, a1 * x + r1, a2 * x + r2
                    key = key_of(an * x + rn, earliness)
                    if (e0 >= t0) & (e1 >= t1) & (e2 >= t2) & (key <= nearest) & (key > keys[at]):
                        scale = 1.0 / (e0 + e1 + e2)
                        u = (e0 * uv[k, 0] + e1 * uv[k, 2] + e2 * uv[k, 4]) * scale
                        v = (e0 * uv[k, 1] + e1 * uv[k, 3] + e2 * uv[k, 5]) * scale
                        if is_opaque(table, mask, u, v):
                            keys[at] = key


@kernel(parallel=True)
def draw_bands(
    corners: Array, whole: Array, lists: "Bands", faces: Array, cut_lists: "Bands", holes: CutFaces, keys: Array,
    visibility: "Visibility",
) -> None:
    """Draw one map band by band: triangles without holes, then those that may have some.

    `corners` (n, 4): projected vertices. `whole` (m, 3): vertices of all triangles, those with holes shrunk to a point;
    `lists` by band. `faces` (c, 3): vertices of those with holes; `cut_lists` by the same bands.
    """
    workers, (height, width) = len(keys), visibility.triangle_id.shape
    for worker in prange(workers):
        band_keys = keys[worker]
        for band in range(worker, len(lists.starts) - 1, workers):
            top, bottom = band * lists.rows, min((band + 1) * lists.rows, height) - 1
            part = Part(lists.members, lists.starts[band], lists.starts[band + 1], lists.boxes, 0, top, bottom)
            cut_part = Part(cut_lists.members, cut_lists.starts[band], cut_lists.starts[band + 1], cut_lists.boxes, 0,
                            top, bottom)
            band_keys[:] = EMPTY
            draw(corners, whole, part, width, band_keys)
            draw_cut(corners, faces, cut_part, width, holes, band_keys)
            unpack(band_keys, width, top, bottom, visibility.inverse_depth, visibility.triangle_id)


@kernel(parallel=True)
def draw_maps(
    projection: Projection, vertices: Array, whole: Array, faces: Array, holes: CutFaces, scratch: "Scratch",
    visibility: "Visibility",
) -> None:
    """Draw several maps, each as `draw_bands` draws one."""
    workers, height, width = len(scratch.corners), projection.height, projection.width
    for worker in prange(workers):
        corners, cells, keys = scratch.corners[worker], scratch.cells[worker], scratch.keys[worker]
        boxes, members = scratch.boxes[worker], scratch.members[worker]
        for m in range(worker, len(projection.origin), workers):
            rows = slice(m * height, (m + 1) * height)
            project_vertices(projection, m, vertices, 0, len(vertices), corners, cells)
            keys[:] = EMPTY
            for base in range(0, len(whole), len(members)):
                count = _members(corners, cells, whole, base, (width, height), boxes, members)
                draw(corners, whole, Part(members, 0, count, boxes, base, 0, height - 1), width, keys)
            for base in range(0, len(faces), len(members)):
                count = _members(corners, cells, faces, base, (width, height), boxes, members)
                draw_cut(corners, faces, Part(members, 0, count, boxes, base, 0, height - 1), width, holes, keys)
            unpack(keys, width, 0, height - 1, visibility.inverse_depth[rows], visibility.triangle_id[rows])


@kernel
def _members(
    corners: Array, cells: Array, faces: Array, base: int, size: tuple[int, int], boxes: Array, members: Array
) -> int:
    """Bound some triangles from `base` on, list those that may cover a texel, and return how many these are."""
    count, last = 0, min(base + len(members), len(faces))
    bound_triangles(corners, cells, faces, base, last, size, boxes)
    for face in range(base, last):
        members[count] = face
        count += boxes[face - base, 0] <= boxes[face - base, 1]
    return count
