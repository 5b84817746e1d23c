"""Mip levels in linear light that keep the energy: each texel is the mean of the area below it.

So the mean of every level is the image's. A level has half the texels of the one below along each axis, rounded down,
at least 1. Where that does not divide, a texel covers parts of texels, which count with their area.
"""

import numpy as np

from refgi.scene.values import Array


def level_sizes(width: int, height: int) -> list[tuple[int, int]]:
    """Return (width, height) of each level, the image itself first, down to 1 x 1."""
    sizes = [(width, height)]
    while sizes[-1] != (1, 1):
        width, height = max(1, width // 2), max(1, height // 2)
        sizes.append((width, height))
    return sizes


def next_level(level: Array) -> Array:
    """Return the level above (h', w', 3) of one (h, w, 3), in its dtype; summed in float64."""
    halved = _halved(level.astype(np.float64), 0)
    return _halved(halved, 1).astype(level.dtype)


def _halved(level: Array, axis: int) -> Array:
    """Return area-weighted means along an axis."""
    count = level.shape[axis]
    if count == 1:
        return level
    level = np.moveaxis(level, axis, 0)
    fewer = count // 2
    if count == 2 * fewer:
        return np.moveaxis((level[0::2] + level[1::2]) / 2, 0, axis)
    # texel k of n covers from k (2 n + 1) / n on: the rest of texel 2 k, all of 2 k + 1, and what 2 k + 2 still has
    k = np.arange(fewer).reshape(-1, *(1,) * (level.ndim - 1))
    parts = (fewer - k) * level[0:-1:2] + fewer * level[1::2] + (k + 1) * level[2::2]
    return np.moveaxis(parts / count, 0, axis)
