"""The pixels of a picture in an order that keeps neighbours together, which is the order kernels see them in.

Blocks of 16 x 16 pixels go row by row; within a block 8 x 8 after 8 x 8, within these 4 x 4 after 4 x 4. Pixels
without surface are left out, so the tiles of the kernels are filled and still compact: fewer lights reach into them
than into a piece of a row. One thread does it: copying a picture takes less than it may take another to start.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel

Array = npt.NDArray[Any]

BLOCK = 16  # BLOCK^2 pixels fill one tile of the kernels


def block_by_block(covered: Array) -> Array:
    """Return the flat indices of covered pixels, block by block.

    Parameters
    ----------
    covered : (h, w) ndarray of bool
        Whether there is a surface.

    Returns
    -------
    (n,) ndarray of int64
        Indices.
    """
    places = np.empty(covered.size, np.int64)
    count = _fill(covered, _path(), places)
    return places[:count]


def taken(plane: Array, places: Array) -> Array:
    """Return the values of three channels at some pixels.

    Parameters
    ----------
    plane : (3, h, w) ndarray
        Values.
    places : (n,) ndarray of int64
        Flat indices.

    Returns
    -------
    (3, n) ndarray
        The values there.
    """
    values = np.empty((3, len(places)), plane.dtype)
    _take(np.ascontiguousarray(plane).reshape(3, -1), places, values)
    return values


def put(plane: Array, places: Array, values: Array) -> None:
    """Store the values of three channels at some pixels.

    Parameters
    ----------
    plane : (3, h, w) ndarray
        Changed; contiguous.
    places : (n,) ndarray of int64
        Flat indices, each once.
    values : (3, n) ndarray
        What to store.
    """
    _put(values, places, plane.reshape(3, -1))


def _path() -> Array:
    """Return row and column within a block in the order of its pixels, (2, BLOCK^2)."""
    index = np.arange(BLOCK * BLOCK).reshape(2, 2, 4, 2, 2, 4).transpose(0, 3, 1, 4, 2, 5).reshape(-1)
    return np.stack([index // BLOCK, index % BLOCK])


@kernel
def _fill(covered: Array, path: Array, places: Array) -> int:
    height, width = covered.shape
    count = 0
    for top in range(0, height, BLOCK):
        for left in range(0, width, BLOCK):
            for i in range(BLOCK * BLOCK):
                row, column = top + path[0, i], left + path[1, i]
                if row < height and column < width and covered[row, column]:
                    places[count] = row * width + column
                    count += 1
    return count


@kernel
def _take(plane: Array, places: Array, values: Array) -> None:
    for c in range(3):
        for i in range(len(places)):
            values[c, i] = plane[c, places[i]]


@kernel
def _put(values: Array, places: Array, plane: Array) -> None:
    for c in range(3):
        for i in range(len(places)):
            plane[c, places[i]] = values[c, i]
