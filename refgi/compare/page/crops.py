"""The worst places of a picture: squares that hold the most squared error."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

PLACES = 3
SHARE_OF_SIDE = 8  # a square is an eighth of the shorter side
LEAST_SIDE = 8  # pixels
NEGLIGIBLE = 1e-9  # of the whole: what rounding leaves in sums over windows without error


class Crop(NamedTuple):
    """A square of a picture, in pixels from the upper left corner."""

    x: int
    y: int
    side: int
    share: float  # of the squared error of the whole picture


def worst_crops(error: Array, covered: Array) -> tuple[Crop, ...]:
    """Return up to `PLACES` squares with the most squared error, (h, w), worst first, none over another.

    An error that is not finite counts as the largest that is; no square where there is no error on covered pixels.
    """
    squares = _squares(error, covered)
    side = min(*error.shape, max(LEAST_SIDE, min(error.shape) // SHARE_OF_SIDE))
    sums, whole = _window_sums(squares, side), float(squares.sum())
    found: list[Crop] = []
    while len(found) < PLACES and sums.max() > NEGLIGIBLE * whole:
        y, x = (int(i) for i in np.unravel_index(np.argmax(sums), sums.shape))
        found.append(Crop(x, y, side, float(sums[y, x]) / whole))
        sums[max(0, y - side + 1):y + side, max(0, x - side + 1):x + side] = 0  # windows over this one
    return tuple(found)


def _squares(error: Array, covered: Array) -> Array:
    finite = np.isfinite(error) & covered
    squares = np.where(finite, np.where(finite, error, 0.0).astype(np.float64) ** 2, 0.0)
    squares[covered & ~finite] = squares.max(initial=0.0) or 1.0
    return squares


def _window_sums(values: Array, side: int) -> Array:
    sums = np.pad(values, ((1, 0), (1, 0))).cumsum(0).cumsum(1)
    windows: Array = sums[side:, side:] - sums[:-side, side:] - sums[side:, :-side] + sums[:-side, :-side]
    return windows
