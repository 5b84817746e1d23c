"""Receivers that no texel around them can hide: the least depth of each block of a map's texels says so.

Depth tests of an open scene look at texels that mostly hold nothing. A few blocks answer for all texels of a region:
exactly, as a texel hides a receiver only by a depth that is finite, and for `pcf` below the receiver's distance.
"""

import math
from typing import Any

import numpy as np

from refgi.jit import kernel
from refgi.skips import left_out
from refgi.types import Array

SIDE = 8  # texels of a block


def casters_of(depth: Array) -> Array:
    """Return the least depth, m, of each block of a map (n, n), inf where it holds nothing; without the skip -inf."""
    blocks = -(-len(depth) // SIDE)
    least = np.full((blocks, blocks), np.inf, depth.dtype)
    _fill_least(depth, least)
    if left_out("cluster.casters", lambda: (np.isinf(least).sum(), least.size)):
        return least
    return np.full_like(least, -np.inf)


@kernel
def _fill_least(depth: Array, least: Array) -> None:
    for i in range(len(depth)):
        for j in range(len(depth)):
            least[i // SIDE, j // SIDE] = min(least[i // SIDE, j // SIDE], depth[i, j])


@kernel
def least_depth(least: Array, first: int, last: int, top: int, bottom: int) -> Any:
    """Return a lower bound, m, of the depths of the texels of some columns and rows, of which some may lie outside."""
    found = least.dtype.type(math.inf)
    blocks = len(least)
    for i in range(max(top, 0) // SIDE, min(max(bottom, 0) // SIDE, blocks - 1) + 1):
        for j in range(max(first, 0) // SIDE, min(max(last, 0) // SIDE, blocks - 1) + 1):
            found = min(found, least[i, j])
    return found
