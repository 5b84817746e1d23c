"""The surfaces that stand for the cells of each level, side by side as in a picture of that level's size."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange, threads
from refgi.rsm.memory import plane
from refgi.splat.refinement.grid import level_shape, representative

Array = npt.NDArray[Any]

FEW_CELLS = 1 << 16  # of a level, that one thread has seen to before others are awake


class Level(NamedTuple):
    """One surface for each cell."""

    position: Array  # (3, h_l, w_l), world space, m
    normal: Array  # (3, h_l, w_l), unit vectors; both 0 where a cell is empty
    covered: Array  # (h_l, w_l) bool
    place: Array  # (h_l, w_l) int32, the pixel that stands for it, -1 where empty; (0, 0) at level 0: each its own

    @property
    def crew(self) -> int | None:
        """Threads that are worth waking for the level; None: all."""
        return 1 if self.covered.size <= FEW_CELLS else None


def levels_of(position: Array, normal: Array, covered: Array, top: int) -> tuple[Level, ...]:
    """Return the surfaces of levels 0, the picture itself, to `top`.

    Parameters
    ----------
    position, normal : (3, h, w) ndarray
        World space, m, and unit vectors.
    covered : (h, w) ndarray of bool
        Whether there is a surface.
    top : int
        Coarsest level.

    Returns
    -------
    tuple of Level
        Each cell is where the pixel is that stands for it, of `representative`.
    """
    position, normal, covered = (np.ascontiguousarray(part) for part in (position, normal, covered))
    levels = [Level(position, normal, covered, np.empty((0, 0), np.int32))]
    for level in range(1, top + 1):
        shape = level_shape(covered.shape[0], covered.shape[1], level)
        one = Level(plane((3, *shape), position.dtype), plane((3, *shape), position.dtype), plane(shape, np.bool_),
                    plane(shape, np.int32))
        with threads(one.crew):
            _gather(position, normal, covered, level, *one)
        levels.append(one)
    return tuple(levels)


@kernel(parallel=True)
def _gather(
    position: Array, normal: Array, covered: Array, level: int, at: Array, facing: Array, there: Array, place: Array
) -> None:
    width, zero = covered.shape[1], position.dtype.type(0.0)
    for i in prange(place.shape[0]):
        for j in range(place.shape[1]):
            p = representative(covered, level, i, j)
            place[i, j], there[i, j] = p, p >= 0
            y, x = max(p, 0) // width, max(p, 0) % width
            for c in range(3):
                at[c, i, j] = position[c, y, x] if p >= 0 else zero
                facing[c, i, j] = normal[c, y, x] if p >= 0 else zero
