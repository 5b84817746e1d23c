"""How often each offset from a receiver is sampled: once, by the crowns of all levels together (Sec. 3.2, Fig. 2)."""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.sssil.crown.pattern import offsets_at, row_offsets, sample_weight
from refgi.sssil.crown.reach import chosen_radius
from refgi.sssil.settings import HssilSettings

Array = npt.NDArray[Any]

RECEIVERS = 256  # rows of receivers, or receivers, whose samples are counted


def coverage(settings: HssilSettings, shape: tuple[int, int], receivers: int = RECEIVERS) -> Array:
    """Count how many texels' worth of samples fall on each texel around a receiver, over all levels.

    Parameters
    ----------
    settings : HssilSettings
        Pattern, radius and levels.
    shape : tuple of int
        Rows and columns of the first level.
    receivers : int
        How many rows of receivers are averaged, or receivers with samples of their own.

    Returns
    -------
    (2 h - 1, 2 w - 1) ndarray of float64
        Mean weight of offset (row - h + 1, column - w + 1), texels of the first level: 1 where an offset is covered
        once.

    Notes
    -----
    A receiver is equally likely to lie anywhere in its texel of level k, so that a crown's rims are blurred by 2^k.
    """
    radius = chosen_radius(shape, settings)
    rows, columns = (np.arange(1 - size, size) for size in shape)
    total = np.zeros((len(rows), len(columns)))
    for index in range(settings.levels):
        weight = texel_weights(settings, index, settings.first_level + index, receivers, radius)
        across = _spread(weight.T, columns, index).T
        total += _spread(across, rows, index)
    return total


def texel_weights(
    settings: HssilSettings, index: int, number: int, receivers: int = RECEIVERS, radius: float | None = None
) -> Array:
    """Count how many texels' worth of samples fall on each texel of one level around a receiver.

    Parameters
    ----------
    settings : HssilSettings
        Pattern and radius.
    index : int
        0 for the first level, whose inner disc is sampled as well.
    number : int
        Which level of the pyramid.
    receivers : int
        How many rows of receivers are averaged, or receivers with samples of their own.
    radius : float, optional
        Inner radius of the crown, texels; that of the settings unless given.

    Returns
    -------
    (2 n + 1, 2 n + 1) ndarray of float64
        Mean weight of offset (row - n, column - n), texels of the level; samples on the receiver itself count.
    """
    if settings.pattern == "pixel":
        offsets = np.stack([offsets_at(settings, index, number, 0, column, radius) for column in range(receivers)])
        known = radius if radius is not None else chosen_radius((1, 1), settings)
        weight = sample_weight(known, settings.inner if index == 0 else 0, settings.samples)
    else:
        offsets, weight = row_offsets(settings, index, number, receivers, radius)
    reach = int(np.abs(offsets).max(initial=0))
    counted = np.zeros((2 * reach + 1, 2 * reach + 1))
    np.add.at(counted, (offsets[..., 1] + reach, offsets[..., 0] + reach), weight / len(offsets))
    return counted


def _spread(weight: Array, at: Array, index: int) -> Array:
    """Return the weight of each fine offset along the first axis, mean over where in its texel a receiver lies."""
    reach, parts = len(weight) // 2, 1 << index
    padded = np.concatenate([weight, np.zeros((1, weight.shape[1]))])
    texel = (at[:, None] + np.arange(parts)) // parts + reach
    inside = (texel >= 0) & (texel < len(weight))
    spread: Array = padded[np.where(inside, texel, len(weight))].mean(axis=1)
    return spread
