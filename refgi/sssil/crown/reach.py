"""How far the crowns of all levels reach together, and the smallest radius with which they cover the picture.

The crown of level k ends at 2 r texels of that level: r 2^K texels of the first of K levels. A receiver in a corner
needs the diagonal of the picture.

How often each offset from a receiver is sampled: once, by the crowns of all levels together (Sec. 3.2, Fig. 2).
"""

import math
import warnings
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.errors import RefgiWarning
from refgi.sssil.crown.pattern import offsets_at, row_offsets, sample_weight
from refgi.sssil.settings import HssilSettings

Array = npt.NDArray[Any]

RECEIVERS = 256  # rows of receivers, or receivers, whose samples are counted


def chosen_radius(shape: tuple[int, int], settings: HssilSettings) -> float:
    """Return the inner radius of the crowns: that of the settings, else the smallest that covers the picture.

    Parameters
    ----------
    shape : tuple of int
        Rows and columns of the first level.
    settings : HssilSettings
        May name a radius.

    Returns
    -------
    float
        Texels, 1 or more.
    """
    return covering_radius(shape, settings.levels) if settings.radius is None else float(settings.radius)


def covering_radius(shape: tuple[int, int], levels: int) -> float:
    """Return the smallest inner radius with which the crowns cover the picture: its diagonal / 2^K.

    Parameters
    ----------
    shape : tuple of int
        Rows and columns of the first level.
    levels : int
        K.

    Returns
    -------
    float
        Texels, 1 or more.

    Examples
    --------
    >>> covering_radius((300, 400), 4)
    31.25
    """
    return max(1.0, math.hypot(*shape) / float(1 << levels))


def reach(settings: HssilSettings, radius: float) -> float:
    """Return how far the last crown ends from a receiver: r 2^K.

    Parameters
    ----------
    settings : HssilSettings
        Says how many levels there are.
    radius : float
        r, texels.

    Returns
    -------
    float
        Texels of the first level.
    """
    return radius * float(1 << settings.levels)


def expect_reach(shape: tuple[int, int], settings: HssilSettings) -> None:
    """Warn when light from one corner of the picture does not reach the other.

    Parameters
    ----------
    shape : tuple of int
        Rows and columns of the first level.
    settings : HssilSettings
        Say how far it reaches.

    Warns
    -----
    RefgiWarning
        With the reach, the diagonal, and the radius that would do.
    """
    diagonal = math.hypot(*shape)
    far = reach(settings, chosen_radius(shape, settings))
    if far < diagonal:
        warnings.warn(RefgiWarning(
            f"radius: samples reach {far:g} of the first level's diagonal of {diagonal:.0f} texels; "
            f"{math.ceil(covering_radius(shape, settings.levels))} texels cover it, as does none"), stacklevel=2)


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
