"""Runs: stretches of a row's texels that see the same triangle, each with the record of what its texels share."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel
from refgi.rsm.buffers.surfaces import Records

Array = npt.NDArray[Any]

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
