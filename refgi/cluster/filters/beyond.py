"""What the square beyond the unit disc holds, for filters that cannot leave it out.

The disc is the hemisphere before the light, and a square map has a fifth of its texels beyond it. Holding nothing
they are lit, so that light leaks in over the rim. `mirrored` texels hold what lies in the direction mirrored at the
light's plane, (s, t) / (s^2 + t^2): the filter then sees nothing but the hemisphere, as the sum over the texels of
the disc does.
"""

import functools
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel

Array = npt.NDArray[Any]

INSIDE = 1.5  # texels from the rim, within which the centre of a texel lies in the disc


@functools.lru_cache(maxsize=8)
def beyond_disc(size: int, mirrored: bool) -> Array:
    """Pair the texels beyond the unit disc with those they mirror.

    Parameters
    ----------
    size : int
        Texels along a side of the map, n.
    mirrored : bool
        Whether they mirror any; no pairs otherwise.

    Returns
    -------
    (count, 2) ndarray
        Int32: a texel beyond and the one it copies, row by row.
    """
    if not mirrored:
        return np.zeros((0, 2), np.int32)
    centres = (np.arange(size) + 0.5) * 2 / size - 1
    s, t = np.meshgrid(centres, centres)
    rho = np.hypot(s, t)
    beyond = np.flatnonzero(rho.ravel() > 1)
    scale = np.minimum(1 / rho.ravel()[beyond], 1 - INSIDE / size) / rho.ravel()[beyond]
    column, row = (((x.ravel()[beyond] * scale + 1) * size / 2).astype(np.int64) for x in (s, t))
    return np.stack([beyond, row * size + column], axis=1).astype(np.int32)


@kernel
def fill_beyond(pairs: Array, depth: Array) -> None:
    """Copy depths to the texels beyond the unit disc.

    Parameters
    ----------
    pairs : (count, 2) ndarray
        As from `beyond_disc`.
    depth : (n, n) ndarray
        Changed in place.
    """
    n = len(depth)
    for k in range(len(pairs)):
        target, source = pairs[k, 0], pairs[k, 1]
        depth[target // n, target % n] = depth[source // n, source % n]
