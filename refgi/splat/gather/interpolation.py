"""Screen-space interpolation of indirect light from a coarse grid of pixels (RSM 2005, in SII Fig. 12)."""

from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel, prange
from refgi.pairs.irradiance import Receivers
from refgi.types import Array

LEAST_SIMILAR = 3  # of the four coarse neighbours that must be similar to a pixel


class SimilarityLimits(NamedTuple):
    """How far a coarse pixel's surface may differ from a pixel's."""

    least_cosine: float  # between their normals
    reach: float  # distance between their surfaces, m


def coarse_pixels(height: int, width: int, grid: int) -> tuple[Array, Array]:
    """Return rows and columns, rising, of the coarse pixels: the middles of grid x grid cells, at most one a pixel.

    >>> coarse_pixels(8, 4, 2)[0].tolist()
    [2, 6]
    """
    rows, columns = (((np.arange(min(grid, size)) + 0.5) * size / min(grid, size)).astype(np.int64)
                     for size in (height, width))
    return rows, columns


def interpolate(
    receivers: Receivers, coarse_light: Array, coarse: tuple[Array, Array], limits: SimilarityLimits
) -> tuple[Array, Array]:
    """Interpolate irradiance (3, h, w) between coarse pixels (rows, columns) where surfaces are similar.

    Returns it, 0 where it could not be, and where it could be, (h, w) bool: three of four neighbours are similar, or
    the pixel is a coarse one itself. Weights are bilinear and made to sum to 1 over the similar neighbours.
    """
    covered = np.asarray(receivers.covered)
    result = np.zeros_like(coarse_light)
    interpolated = np.zeros_like(covered)
    lines = (*_neighbours(coarse[0], covered.shape[0]), *_neighbours(coarse[1], covered.shape[1]))
    _interpolate(receivers.position, receivers.normal, coarse_light, covered, lines, limits, (result, interpolated))
    at_coarse = np.ix_(*coarse)
    interpolated[at_coarse] = covered[at_coarse]
    channels = np.ix_(np.arange(3), *coarse)
    result[channels] = coarse_light[channels]
    return result, interpolated


def _neighbours(coarse: Array, size: int) -> tuple[Array, Array, Array]:
    """Return for each pixel of an axis the coarse pixels around it and the weight of the second, 0 to 1."""
    pixel = np.arange(size)
    first = np.clip(np.searchsorted(coarse, pixel, side="right") - 1, 0, max(0, len(coarse) - 2))
    low, high = coarse[first], coarse[np.minimum(first + 1, len(coarse) - 1)]
    return low, high, np.clip((pixel - low) / np.maximum(high - low, 1), 0, 1)


@kernel(parallel=True)
def _interpolate(
    position: Array, normal: Array, coarse_light: Array, covered: Array, lines: Any, limits: SimilarityLimits, out: Any
) -> None:
    top, bottom, down, left, right, across = lines
    result, interpolated = out
    real = position.dtype.type
    for i in prange(covered.shape[0]):
        for j in range(covered.shape[1]):
            if not covered[i, j]:
                continue
            total, similar = 0.0, 0
            for corner in range(4):
                r, c = bottom[i] if corner & 2 else top[i], right[j] if corner & 1 else left[j]
                if covered[r, c] and _similar(position, normal, i, j, r, c, limits):
                    weight = (down[i] if corner & 2 else 1.0 - down[i]) * (across[j] if corner & 1 else 1.0 - across[j])
                    similar += 1
                    total += weight
                    for channel in range(3):
                        result[channel, i, j] += real(weight) * coarse_light[channel, r, c]
            interpolated[i, j] = total > 0.0 and similar >= LEAST_SIMILAR
            for channel in range(3):
                result[channel, i, j] = result[channel, i, j] / real(total) if interpolated[i, j] else real(0.0)


@kernel
def _similar(position: Array, normal: Array, i: int, j: int, r: int, c: int, limits: SimilarityLimits) -> Any:
    cosine, square = 0.0, 0.0
    for axis in range(3):
        cosine += normal[axis, i, j] * normal[axis, r, c]
        square += (position[axis, i, j] - position[axis, r, c]) ** 2
    return cosine >= limits.least_cosine and square <= limits.reach * limits.reach
