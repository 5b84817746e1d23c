"""Cut-outs: the alpha of images as arrays for kernels, and the one test that says where a surface is (glTF's MASK).

A surface is there where factor x alpha >= cutoff. Alpha is blended between the four texels around (u, v) of the image
itself, whatever the distance; of textures that show the nearest texel it is that one's. Every map and every ray asks
`is_opaque`, so that all of them see the same holes.
"""

from typing import NamedTuple

import numpy as np

from refgi.jit import kernel
from refgi.jit.borrowed import borrowed
from refgi.scene.texture.lookup import inside, near, neighbours_of
from refgi.scene.values import Array

START, WIDTH, HEIGHT, WRAP_U, WRAP_V, NEAREST = range(6)  # columns of `AlphaTable.mask`
FACTOR, CUTOFF = range(2)  # columns of `AlphaTable.limit`


class AlphaTable(NamedTuple):
    """Masks as arrays for kernels."""

    alpha: Array  # (n,) float32, 0 to 1: row by row, image by image
    mask: Array  # (k, 6) int64: first texel, width, height, wrap of u and v, whether the nearest texel counts
    limit: Array  # (k, 2) float64: factor, cutoff


NO_MASKS = AlphaTable(np.zeros(0, np.float32), np.zeros((0, 6), np.int64), np.zeros((0, 2)))


@kernel
def lent(table: AlphaTable) -> AlphaTable:
    """Return a table for calls of `is_opaque` in an inner loop; the one it is made of must be kept."""
    return AlphaTable(borrowed(table.alpha), borrowed(table.mask), borrowed(table.limit))


@kernel
def is_opaque(table: AlphaTable, mask: int, u: float, v: float) -> bool:
    """Return whether a surface is there at (u, v), by one of the masks; a mask without texels is a hole as a whole."""
    masks, alpha = table.mask, table.alpha
    width, height = masks[mask, WIDTH], masks[mask, HEIGHT]
    if width == 0:
        return False
    start, wrap_u, wrap_v = masks[mask, START], masks[mask, WRAP_U], masks[mask, WRAP_V]
    x, y = u * width, v * height
    if masks[mask, NEAREST]:
        i, j = inside(int(np.floor(near(x))), width, wrap_u), inside(int(np.floor(near(y))), height, wrap_v)
        value = np.float64(alpha[start + j * width + i])
    else:
        left, right, p = neighbours_of(x, width, wrap_u)
        upper, lower, q = neighbours_of(y, height, wrap_v)
        upper, lower = start + upper * width, start + lower * width
        # steps from one to the other: between equal texels the blend is exactly these
        above = alpha[upper + left] + p * (np.float64(alpha[upper + right]) - alpha[upper + left])
        below = alpha[lower + left] + p * (np.float64(alpha[lower + right]) - alpha[lower + left])
        value = above + q * (below - above)
    return bool(table.limit[mask, FACTOR] * value >= table.limit[mask, CUTOFF])
