"""Screen-space interpolation of indirect light from a coarse grid of pixels (RSM 2005, used in SII Fig. 12)."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.pairs.irradiance import Receivers
from refgi.stages import stage

Array = npt.NDArray[Any]

NEEDED = 3  # of the four coarse neighbours that must agree with a pixel


class Agreement(NamedTuple):
    """When a coarse pixel may stand for another."""

    least_cosine: float  # between their normals
    reach: float  # distance between their surfaces, m


def coarse_pixels(height: int, width: int, grid: int) -> tuple[Array, Array]:
    """Return rows and columns of the coarse pixels: the middles of grid x grid cells.

    Parameters
    ----------
    height, width : int
        Size of the picture, pixels.
    grid : int
        Cells along a side; at most one a pixel.

    Returns
    -------
    tuple of two 1-D ndarrays of int64
        Rows and columns, rising.

    Examples
    --------
    >>> coarse_pixels(8, 4, 2)[0].tolist()
    [2, 6]
    """
    rows, columns = (((np.arange(min(grid, size)) + 0.5) * size / min(grid, size)).astype(np.int64)
                     for size in (height, width))
    return rows, columns


@stage("gather.interpolate")
def interpolate(
    receivers: Receivers, known: Array, coarse: tuple[Array, Array], agreement: Agreement
) -> tuple[Array, Array]:
    """Interpolate light between coarse pixels where their surfaces agree.

    Parameters
    ----------
    receivers : Receivers
        All pixels.
    known : (3, h, w) ndarray
        Irradiance, right at the coarse pixels.
    coarse : tuple of two 1-D ndarrays
        Rows and columns of the coarse pixels.
    agreement : Agreement
        When a coarse pixel may stand for another.

    Returns
    -------
    irradiance : (3, h, w) ndarray
        Interpolated irradiance, W/m^2; 0 where it could not be.
    done : (h, w) ndarray of bool
        Where it could be: three of four neighbours agree, or the pixel is a coarse one itself.

    Notes
    -----
    Weights are bilinear and made to sum to 1 over the neighbours that agree.
    """
    covered = np.asarray(receivers.covered)
    result = np.zeros_like(known)
    done = np.zeros_like(covered)
    lines = (*_between(coarse[0], covered.shape[0]), *_between(coarse[1], covered.shape[1]))
    _interpolate(receivers.position, receivers.normal, known, covered, lines, agreement, (result, done))
    at_coarse = np.ix_(*coarse)
    done[at_coarse] = covered[at_coarse]
    channels = np.ix_(np.arange(3), *coarse)
    result[channels] = known[channels]
    return result, done


def _between(coarse: Array, size: int) -> tuple[Array, Array, Array]:
    """Return for each pixel of an axis the coarse pixels around it and the weight of the second, 0 to 1."""
    pixel = np.arange(size)
    first = np.clip(np.searchsorted(coarse, pixel, side="right") - 1, 0, max(0, len(coarse) - 2))
    low, high = coarse[first], coarse[np.minimum(first + 1, len(coarse) - 1)]
    return low, high, np.clip((pixel - low) / np.maximum(high - low, 1), 0, 1)


@kernel(parallel=True)
def _interpolate(
    position: Array, normal: Array, known: Array, covered: Array, lines: Any, agreement: Agreement, out: Any
) -> None:
    top, bottom, down, left, right, across = lines
    result, done = out
    real = position.dtype.type
    for i in prange(covered.shape[0]):
        for j in range(covered.shape[1]):
            if not covered[i, j]:
                continue
            total, agreeing = 0.0, 0
            for corner in range(4):
                r, c = bottom[i] if corner & 2 else top[i], right[j] if corner & 1 else left[j]
                if covered[r, c] and _agree(position, normal, i, j, r, c, agreement):
                    weight = (down[i] if corner & 2 else 1.0 - down[i]) * (across[j] if corner & 1 else 1.0 - across[j])
                    agreeing += 1
                    total += weight
                    for channel in range(3):
                        result[channel, i, j] += real(weight) * known[channel, r, c]
            done[i, j] = total > 0.0 and agreeing >= NEEDED
            for channel in range(3):
                result[channel, i, j] = result[channel, i, j] / real(total) if done[i, j] else real(0.0)


@kernel
def _agree(position: Array, normal: Array, i: int, j: int, r: int, c: int, agreement: Agreement) -> Any:
    cosine, square = 0.0, 0.0
    for axis in range(3):
        cosine += normal[axis, i, j] * normal[axis, r, c]
        square += (position[axis, i, j] - position[axis, r, c]) ** 2
    return cosine >= agreement.least_cosine and square <= agreement.reach * agreement.reach
