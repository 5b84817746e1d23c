"""Clamping of earlier light to the new light around a pixel: light that lags is bounded, at the price of noise.

Variance clipping of temporal anti-aliasing (Salvi 2016; Karis 2014 clamps to the extremes): the bounds are the mean of
the new light in a square of pixels, plus and minus some standard deviations, in each channel.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange

Array = npt.NDArray[Any]


def clamp_to_neighbourhood(new: Array, covered: Array, deviations: float, radius: int, earlier: Array) -> None:
    """Clamp earlier light to so many standard deviations about the mean of the new light around each pixel.

    Light is in W/m^2; the first three planes of `earlier` (3 or 4, h, w) are clamped. A neighbourhood is a square of 2
    radius + 1 pixels, less what is outside the picture and pixels that are not covered.
    """
    _clamp(new, covered, new.dtype.type(deviations), radius, earlier)


@kernel(parallel=True)
def _clamp(new: Array, covered: Array, deviations: Any, radius: int, earlier: Array) -> None:
    height, width = covered.shape
    for row in prange(height):
        first, end = max(0, int(row) - radius), min(height, int(row) + radius + 1)
        count, total, square = np.zeros(width), np.zeros(width), np.zeros(width)
        for channel in range(3):
            _sum_columns(new[channel], covered, first, end, count, total, square)
            _clamp_row(count, total, square, deviations, radius, covered[row], earlier[channel, row])


@kernel
def _sum_columns(
    new: Array, covered: Array, first: int, end: int, count: Array, total: Array, square: Array
) -> None:
    """Sum number, light and its square over rows `first` to `end` - 1 of each column, in float64."""
    count[:], total[:], square[:] = 0.0, 0.0, 0.0
    for row in range(first, end):
        for column in range(len(count)):
            light = np.float64(new[row, column]) if covered[row, column] else 0.0
            count[column] += 1.0 if covered[row, column] else 0.0
            total[column] += light
            square[column] += light * light


@kernel
def _clamp_row(
    count: Array, total: Array, square: Array, deviations: Any, radius: int, covered: Array, earlier: Array
) -> None:
    real = earlier.dtype.type
    for column in range(len(count)):
        if not covered[column]:
            continue
        n, one, two = 0.0, 0.0, 0.0
        for beside in range(max(0, column - radius), min(len(count), column + radius + 1)):
            n, one, two = n + count[beside], one + total[beside], two + square[beside]
        mean = one / n
        spread = deviations * math.sqrt(max(0.0, two / n - mean * mean))
        earlier[column] = min(max(earlier[column], real(mean - spread)), real(mean + spread))
