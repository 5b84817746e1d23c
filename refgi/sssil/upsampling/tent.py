"""Spatial weights of three by three texels.

The tent about a pixel's centre has a half width of (4 + t) / 3 texels, t the distance of the pixel's centre from that
of its texel, along each axis; brought to a sum of 1 its weights are (1 - 2 t) / 6, (2 - t) / 3 and (1 + 4 t) / 6 for
the far, the own and the near texel. Of all tents it is the one that leaves linear functions linear, as the bilinear
weights of two by two texels do; it goes over to (0, 1/2, 1/2) where the next texel begins.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel
from refgi.sssil.upsampling.lines import SPAN, WIDE

Array = npt.NDArray[Any]

OFFSET, LINES = 9 * SPAN, 10 * SPAN  # after the weights of above left, above, above right, left, ..


@kernel
def write_tents(tents: Array) -> None:
    """Write what texels weigh for rows of pixels.

    Parameters
    ----------
    tents : (F, LINES) ndarray
        Filled, for each of the rows of pixels that a texel of F x F pixels has, and for blocks that begin with a texel:
        nine lines of weights and one of offsets.
    """
    factor = len(tents)
    for y in range(factor):
        for x in range(WIDE):
            tents[y, np.uint64(OFFSET + x)] = offset(x % factor, factor, tents)
            for dy in range(-1, 2):
                for dx in range(-1, 2):
                    weight = weight_of(y, dy, factor, tents) * weight_of(x % factor, dx, factor, tents)
                    tents[y, np.uint64((3 * dy + dx + 4) * SPAN + x)] = weight


@kernel
def weight_of(place: int, step: int, factor: int, like: Array) -> Any:
    """Return the weight of one of three texels along an axis.

    Parameters
    ----------
    place : int
        Of the pixel in its texel, 0 to factor - 1.
    step : int
        -1: the texel before, 0: the own, 1: the one after.
    factor : int
        Pixels along a texel's side.
    like : ndarray
        Of the type of the result.

    Returns
    -------
    float
        The sum over the three is 1.
    """
    real = like.dtype.type
    along = offset(place, factor, like)
    t = abs(along)
    if step == 0:
        return (real(2.0) - t) / real(3.0)
    if (step < 0) == (along < real(0.0)):
        return (real(1.0) + real(4.0) * t) / real(6.0)
    return (real(1.0) - real(2.0) * t) / real(6.0)


@kernel
def offset(place: int, factor: int, like: Array) -> Any:
    """Return where a pixel's centre lies from that of its texel.

    Parameters
    ----------
    place : int
        Of the pixel in its texel, 0 to factor - 1.
    factor : int
        Pixels along a texel's side.
    like : ndarray
        Of the type of the result.

    Returns
    -------
    float
        Texels, -1/2 to 1/2.
    """
    real = like.dtype.type
    return real(2 * place + 1 - factor) / real(2 * factor)
