"""Means over passes: running mean and sum of squared deviations, in float64 (Welford's update).

Passes are independent, so the spread of their values gives the variance of the mean, whatever correlation there is
between the samples inside a pass or between pixels. Pixels share lit points, so the errors of means over several pixels
do not follow from theirs: means over blocks of 8 x 8 pixels and over the picture are followed as values of their own.
A value that is not a finite number is left out of all of them and counted.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange

Array = npt.NDArray[Any]

BLOCK_SIDE = 8  # pixels


class Moments(NamedTuple):
    """What all passes so far add up to; updated in place."""

    passes: Array  # () int64
    mean: Array  # (3, n) float64
    squares: Array  # (3, n) float64, sums of squared deviations from the mean
    lost: Array  # (n,) int64: passes whose value was not a finite number

    @property
    def variance_of_mean(self) -> Array:
        """Estimated variance of each mean, (3, n); inf before the second pass."""
        n = np.float64(self.passes) - self.lost
        return np.where(n > 1, self.squares / np.maximum(n * (n - 1), 1), np.inf)


def no_passes(values: int) -> Moments:
    """Return the moments of no passes.

    Parameters
    ----------
    values : int
        How many values a pass has.

    Returns
    -------
    Moments
        All zero.
    """
    return Moments(np.zeros((), np.int64), np.zeros((3, values)), np.zeros((3, values)), np.zeros(values, np.int64))


def add_pass(moments: Moments, values: Array) -> None:
    """Take one pass into the moments.

    Parameters
    ----------
    moments : Moments
        Updated.
    values : (3, n) float64 ndarray
        What the pass found, W/m^2.
    """
    moments.passes[...] += 1
    finite = np.asarray(np.isfinite(values).all(axis=0))
    moments.lost[~finite] += 1
    _add(moments.mean, moments.squares, values, finite, int(moments.passes) - moments.lost)


def blocks_of(pixel: Array, shape: tuple[int, ...]) -> tuple[Array, tuple[int, int]]:
    """Return which block of 8 x 8 pixels each pixel lies in.

    Parameters
    ----------
    pixel : (r,) ndarray
        Flat indices into the picture.
    shape : tuple of 2 ints
        Rows and columns of the picture.

    Returns
    -------
    (r,) ndarray, tuple of 2 ints
        Flat index of each pixel's block, and rows and columns of blocks.
    """
    rows, columns = (-(-size // BLOCK_SIDE) for size in shape)
    return pixel // shape[1] // BLOCK_SIDE * columns + pixel % shape[1] // BLOCK_SIDE, (rows, columns)


def with_means(values: Array, block: Array, blocks: int) -> Array:
    """Append the means over blocks and over all receivers.

    Parameters
    ----------
    values : (3, r) float64 ndarray
        Irradiance of a pass, W/m^2.
    block : (r,) int ndarray
        Which block each receiver counts for.
    blocks : int
        How many there are.

    Returns
    -------
    (3, r + blocks + 1) ndarray
        The values, the means of the finite ones over each block and over all: 0 without
        receivers, NaN where none is finite.
    """
    finite = np.isfinite(values).all(axis=0)
    block, kept = np.append(block, np.full(len(block), blocks)), np.tile(values, 2)  # the picture is one block more
    counts = [np.bincount(block[some], minlength=blocks + 1) for some in (np.tile(finite, 2), slice(None))]
    sums = np.stack([np.bincount(block, channel, blocks + 1) for channel in np.where(np.tile(finite, 2), kept, 0)])
    means = sums / np.maximum(counts[0], 1)
    means[:, (counts[0] == 0) & (counts[1] > 0)] = np.nan
    return np.concatenate([values, means], axis=1)


@kernel(parallel=True)
def _add(mean: Array, squares: Array, values: Array, finite: Array, count: Array) -> None:
    for i in prange(values.shape[1]):
        if finite[i]:
            for c in range(3):
                delta = values[c, i] - mean[c, i]
                mean[c, i] += delta / count[i]
                squares[c, i] += delta * (values[c, i] - mean[c, i])
