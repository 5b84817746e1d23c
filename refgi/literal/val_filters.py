"""Means over regions of a map by mip levels or texel by texel, and the blur that joins interleaved pixels (VAL Sec. 6).

Symbols: K maps of n x n texels with channels S, C, SZ, CZ, Z; region (K, 3, h, w) discs s, t, radius in units of half a
map, -1 to 1 to the right and down; texel centres lie at + 1/2.
"""

from typing import Any

import numpy as np

from refgi.literal.val_maps import rounded_level, texel_centers
from refgi.literal.val_visibility import in_region


def mip_levels(basis: Any, in_bytes: bool = False) -> Any:
    """Return levels 1 and on of a basis (K, C, n, n), each half as wide as the one before, down to one texel."""
    levels, level = [], basis
    while level.shape[2] > 1:
        level = halved(level)
        level = rounded_level(level) if in_bytes else level
        levels.append(level)
    return levels


def halved(level: Any) -> Any:
    """Return means of 2 x 2 texels; of an odd side the last counts twice."""
    side = level.shape[2]
    first = 2 * np.arange((side + 1) // 2)
    second = np.minimum(first + 1, side - 1)
    upper, lower = level[:, :, first], level[:, :, second]
    a, b = upper[..., first], upper[..., second]
    c, d = lower[..., first], lower[..., second]
    return (a + b + c + d) / 4


def mip_means(pending: Any, region: Any, terms: int, weighed: bool, levels: Any) -> Any:
    """Return means (K, C, h, w) over discs, where pending: 8 texels of two levels, C = 4 M + 1 or, not `weighed`, 2 M.

    `levels`: the basis itself, then those of `mip_levels`. `weighed`: with the terms times depth, for z_avg.
    A read between texels is a tent twice as wide as a texel: one level finer than log2 of the disc's diameter.
    """
    n, top = levels[0].shape[2], len(levels) - 1
    s, t, radius = region.swapaxes(0, 1)
    x = (s + 1) / 2 * n
    y = (t + 1) / 2 * n
    diameter = np.maximum(radius * n, 1e-9)
    level = np.log2(diameter) - 1
    level = np.clip(level, 0, top)
    fine = np.floor(level)
    part = (level - fine)[:, None]
    near = read_level(levels, fine, x, y)
    far = read_level(levels, np.minimum(fine + 1, top), x, y)
    means = near + part * (far - near)
    means = means if weighed else means[:, : 2 * terms]
    return np.where(pending[:, None], means, 0)


def read_level(levels: Any, of: Any, x: Any, y: Any) -> Any:
    """Return (K, C, h, w) at places x, y of level 0, in texels, each read of the level `of` (K, h, w)."""
    made = np.zeros((*of.shape, levels[0].shape[1]), levels[0].dtype)
    for number, texels in enumerate(levels):
        here = of == number
        k = np.nonzero(here)[0]
        shrink = 0.5**number
        made[here] = bilinear(texels, k, x[here] * shrink, y[here] * shrink)
    return np.moveaxis(made, 3, 1)


def bilinear(texels: Any, k: Any, x: Any, y: Any) -> Any:
    """Return (N, C) between the 2 x 2 nearest texels of maps k (N,); beyond the last centres the edge goes on."""
    side = texels.shape[2]
    u = np.clip(x - 0.5, 0, side - 1)
    v = np.clip(y - 0.5, 0, side - 1)
    a = (u - np.floor(u))[:, None]
    b = (v - np.floor(v))[:, None]
    column, row = np.floor(u).astype(int), np.floor(v).astype(int)
    right, below = np.minimum(column + 1, side - 1), np.minimum(row + 1, side - 1)
    upper = (1 - a) * texels[k, :, row, column] + a * texels[k, :, row, right]
    lower = (1 - a) * texels[k, :, below, column] + a * texels[k, :, below, right]
    return (1 - b) * upper + b * lower


def box_means(pending: Any, region: Any, terms: int, weighed: bool, basis: Any) -> Any:
    """Return means (K, C, h, w) over the squares around discs, at least a texel wide, by the area that each texel has.

    A square with its middle beyond the map is moved to its edge; what lies beyond the map is cut off.
    """
    n = basis.shape[2]
    s, t, radius = region.swapaxes(0, 1)
    half = np.maximum(radius * n / 2, 0.5)
    wide = overlap((s + 1) / 2 * n, half, n)
    high = overlap((t + 1) / 2 * n, half, n)
    total = np.einsum("kijr,kijc,kmrc->kmij", high, wide, basis, optimize=True)
    means = total / (high.sum(axis=3) * wide.sum(axis=3))[:, None]
    means = means if weighed else means[:, : 2 * terms]
    return np.where(pending[:, None], means, 0)


def overlap(middle: Any, half: Any, n: int) -> Any:
    """Return how much of each of n texels (..., n) an interval holds, in texels."""
    middle, half = np.clip(middle, 0, n)[..., None], half[..., None]
    texel = np.arange(n, dtype=middle.dtype)
    return np.maximum(np.minimum(texel + 1, middle + half) - np.maximum(texel, middle - half), 0)


def disc_means(pending: Any, region: Any, terms: int, weighed: bool, basis: Any) -> Any:
    """Return means (K, C, h, w) of the texels with their centre in a disc and in the hemisphere, or its middle's."""
    s, t = texel_centers(basis)
    inside = in_region(region, s, t).astype(basis.dtype)
    total = np.einsum("kijrc,kmrc->kmij", inside, basis)
    means = total / np.maximum(inside.sum(axis=(3, 4)), 1)[:, None]
    means = means if weighed else means[:, : 2 * terms]
    return np.where(pending[:, None], means, 0)


def blur(
    irradiance: Any, position: Any, normal: Any, triangle_id: Any, box: Any, size: int, extent: float = 0.1,
    cosine: float = 0.8, every_subset: bool = True,
) -> Any:
    """Return the mean (3, h, w), W/m^2, over size x size pixels of the same surface (Sec. 6; E-VAL-13).

    Each place of the window stands for one subset of the lights; beyond the picture its like `size` further in counts.
    `every_subset`: where that lies on another surface, the nearest of its subset does, up to `size` away.
    """
    covered = triangle_id >= 0
    diagonal = np.sqrt(((box[1] - box[0]) ** 2).sum())  # of what is visible
    window = range(-(size // 2), size - size // 2)
    total, count = np.zeros_like(irradiance), np.zeros_like(irradiance[0])
    for dy in window:
        for dx in window:
            missing = covered
            for v, u in places_of_subset(dy, dx, size) if every_subset else [(dy, dx)]:
                row, column, held = beside(covered.shape, v, u, size if (v, u) == (dy, dx) else 0)
                away = position[:, row, column] - position
                near = (away**2).sum(axis=0) <= (extent * diagonal) ** 2
                alike = (normal[:, row, column] * normal).sum(axis=0) >= cosine
                counts = missing & held & covered[row, column] & near & alike
                total += np.where(counts, irradiance[:, row, column] - irradiance, 0)
                count += counts
                missing = missing & ~counts
    return np.where(covered, irradiance + total / np.maximum(count, 1), 0)


def beside(shape: Any, dy: int, dx: int, move: int) -> Any:
    """Return row (h, 1), column (1, w) and whether both lie within (h, w), of pixels dy down and dx to the right.

    What lies beyond the picture is moved by `move` into it.
    """
    places = []
    for count, step in zip(shape, (dy, dx), strict=True):
        place = np.arange(count) + step
        place = place + move * (place < 0)
        place = place - move * (place >= count)
        places.append(place)
    row, column = places[0][:, None], places[1][None]
    held = (row >= 0) & (row < shape[0]) & (column >= 0) & (column < shape[1])
    return np.clip(row, 0, shape[0] - 1), np.clip(column, 0, shape[1] - 1), held


def places_of_subset(dy: int, dx: int, size: int) -> Any:
    """Return a place of the window and, from near to far, the eight pixels about it that sum the same lights."""
    others = [(dy + v * size, dx + u * size) for v in (-1, 0, 1) for u in (-1, 0, 1) if (v, u) != (0, 0)]
    return [(dy, dx), *sorted(others, key=lambda place: (place[0] ** 2 + place[1] ** 2, place))]
