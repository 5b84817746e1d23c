"""Reach of the crowns of all levels together, and the smallest radius with which they cover the picture (Sec. 3.2).

The crown of level k ends at 2 r texels of that level: r 2^K texels of the first of K levels. A receiver in a corner
needs the diagonal of the picture. Together the crowns sample each offset from a receiver once (Fig. 2).
"""

import math
import warnings

import numpy as np

from refgi.errors import RefgiWarning
from refgi.sssil.crown.pattern import samples_at, shared_offsets
from refgi.sssil.settings import SamplingSettings
from refgi.types import Array

RECEIVERS = 256  # rows of receivers, or receivers, whose samples are counted


def chosen_radius(shape: tuple[int, int], sampling: SamplingSettings) -> float:
    """Return the inner radius of the crowns: that of the settings, else the smallest that covers the picture.

    Texels of the first level, whose rows and columns are `shape`; 1 or more.
    """
    return covering_radius(shape, sampling.levels) if sampling.radius is None else float(sampling.radius)


def covering_radius(shape: tuple[int, int], levels: int) -> float:
    """Return the smallest inner radius with which K crowns cover the picture: its diagonal / 2^K, 1 texel or more.

    >>> covering_radius((300, 400), 4)
    31.25
    """
    return max(1.0, math.hypot(*shape) / float(1 << levels))


def reach(sampling: SamplingSettings, radius: float) -> float:
    """Return the outer radius of the last crown: r 2^K, texels of the first level."""
    return radius * float(1 << sampling.levels)


def warn_short_reach(shape: tuple[int, int], sampling: SamplingSettings) -> None:
    """Warn, with the radius that covers it, when light from one corner of the picture does not reach the other."""
    diagonal = math.hypot(*shape)
    far = reach(sampling, chosen_radius(shape, sampling))
    if far < diagonal:
        warnings.warn(RefgiWarning(
            f"radius: samples reach {far:g} of the first level's diagonal of {diagonal:.0f} texels; "
            f"{math.ceil(covering_radius(shape, sampling.levels))} texels cover it, as does none"), stacklevel=2)


def coverage(sampling: SamplingSettings, shape: tuple[int, int], receivers: int = RECEIVERS) -> Array:
    """Count how many texels' worth of samples fall on each texel around a receiver, over all levels.

    (2 h - 1, 2 w - 1) float64: mean weight of offset (row - h + 1, column - w + 1), texels of the first level, of
    `shape`; 1 where an offset is covered once. `receivers` says how many rows of them are averaged, or receivers with
    samples of their own. A receiver is equally likely to lie anywhere in its texel of level k, so that a crown's rims
    are blurred by 2^k.
    """
    radius = chosen_radius(shape, sampling)
    rows, columns = (np.arange(1 - size, size) for size in shape)
    total = np.zeros((len(rows), len(columns)))
    for index in range(sampling.levels):
        weight = texel_weights(sampling, index, sampling.first_level + index, receivers, radius)
        across = _spread(weight.T, columns, index).T
        total += _spread(across, rows, index)
    return total


def texel_weights(
    sampling: SamplingSettings, index: int, number: int, receivers: int = RECEIVERS, radius: float | None = None
) -> Array:
    """Count how many texels' worth of samples fall on each texel of one level around a receiver.

    (2 n + 1, 2 n + 1) float64: mean weight of offset (row - n, column - n), texels of the level; samples on the
    receiver itself count. `receivers` as in `coverage`, the others as in `pattern.shared_offsets`.
    """
    if sampling.pattern == "pixel":
        found = [samples_at(sampling, index, number, 0, column, radius) for column in range(receivers)]
        offsets, weight = (np.stack(parts) for parts in zip(*found, strict=True))
    else:
        offsets, weight = shared_offsets(sampling, index, number, receivers, radius)
    reach = int(np.abs(offsets).max(initial=0))
    counted = np.zeros((2 * reach + 1, 2 * reach + 1))
    sets = offsets.size // (2 * max(weight.shape[-1], 1))
    np.add.at(counted, (offsets[..., 1] + reach, offsets[..., 0] + reach), weight / max(sets, 1))
    return counted


def _spread(weight: Array, at: Array, index: int) -> Array:
    """Return the weight of each fine offset along the first axis, mean over where in its texel a receiver lies."""
    reach, parts = len(weight) // 2, 1 << index
    padded = np.concatenate([weight, np.zeros((1, weight.shape[1]))])
    texel = (at[:, None] + np.arange(parts)) // parts + reach
    inside = (texel >= 0) & (texel < len(weight))
    spread: Array = padded[np.where(inside, texel, len(weight))].mean(axis=1)
    return spread
