"""Triangles in chunks of consecutive ones, their corners laid out for SIMD lanes, each chunk with its box."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.rsm.memory import plane

Array = npt.NDArray[Any]

CHUNK = 64  # triangles


class Chunks(NamedTuple):
    """Triangles of c chunks, in mesh order; the last is filled up with triangles without area."""

    corners: Array  # (c, 9, CHUNK) float64, m: x, y, z of the first corner, of the second, of the third
    box: Array  # (c, 6) float64, m: least x, y, z, then greatest


def chunks(vertices: Array, faces: Array) -> Chunks:
    """Lay out triangles in chunks.

    Parameters
    ----------
    vertices : (n, 3) float64 ndarray
        World space, m.
    faces : (m, 3) ndarray
        Vertices of each triangle.

    Returns
    -------
    Chunks
        A copy of their corners.
    """
    number = (len(faces) + CHUNK - 1) // CHUNK
    laid = Chunks(plane((number, 9, CHUNK), np.float64), np.empty((number, 6)))
    _lay_out(vertices, faces, laid.corners, laid.box)
    return laid


@kernel(parallel=True)
def _lay_out(vertices: Array, faces: Array, corners: Array, box: Array) -> None:
    for chunk in prange(len(box)):
        first = np.int64(chunk) * CHUNK
        for axis in range(3):
            box[chunk, axis], box[chunk, 3 + axis] = np.inf, -np.inf
        for b in range(CHUNK):
            face, here = first + b, first + b < len(faces)
            for corner in range(3):
                vertex = faces[face if here else len(faces) - 1, corner if here else 0]
                for axis in range(3):
                    value = vertices[vertex, axis]
                    corners[chunk, 3 * corner + axis, b] = value
                    box[chunk, axis] = min(box[chunk, axis], value)
                    box[chunk, 3 + axis] = max(box[chunk, 3 + axis], value)
