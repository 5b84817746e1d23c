"""Spatial weights of three texels in a row.

The tent about a place t texels (up to 1/2) from the middle one has a half width of (4 + |t|) / 3; brought to a sum of 1
its weights are (1 - 2 |t|) / 6, (2 - |t|) / 3 and (1 + 4 |t|) / 6 for the far, the own and the near texel. Of all tents
it is the one that leaves linear functions linear, as the bilinear weights of two texels do, which it goes over to at
|t| = 1/2 and which stand in beyond.
"""

from typing import Any

import numpy.typing as npt

from refgi.jit import kernel
from refgi.sssil.upsampling.lines import SPAN, WIDE

Array = npt.NDArray[Any]

BEFORE, AFTER, TENTS = SPAN, 4 * SPAN, 7 * SPAN
SIXTH, THIRD = 1 / 6, 1 / 3


@kernel
def tent_at(t: Any) -> Any:
    """Return the weights of three texels in a row.

    Parameters
    ----------
    t : float
        Where the receiver lies from the point that the middle texel stands for, texels, -1 to 1.

    Returns
    -------
    before, own, after : float
        Weights; their sum is 1.
    """
    real = type(t)
    zero, one, two, four = real(0.0), real(1.0), real(2.0), real(4.0)
    away = abs(t)
    inner = away < real(0.5)
    far = (one - two * away) * real(SIXTH) if inner else zero
    own = (two - away) * real(THIRD) if inner else one - away
    near = (one + four * away) * real(SIXTH) if inner else away
    return near if t < zero else far, own, far if t < zero else near


@kernel
def write_tents(factor: int, lean: Any, tents: Array) -> None:
    """Write where the centres of a row's pixels lie from those of their texels, and what the texels beside weigh.

    Parameters
    ----------
    factor : int
        Pixels along a texel's side.
    lean : float
        How far the point that a texel stands for is from its middle, texels.
    tents : (TENTS,) ndarray
        Filled: offsets, texels, -1/2 to 1/2; weights of the texel before and of the one after as shares of the
        own texel's, three lines each: for points after the middle by `lean`, in it, and before it by `lean`.
    """
    for i in range(WIDE):
        t = offset(i % factor, factor, tents)
        tents[i] = t
        for lie in range(3):
            before, own, after = tent_at(t + tents.dtype.type(lie - 1) * lean)
            tents[BEFORE + lie * SPAN + i] = before / own
            tents[AFTER + lie * SPAN + i] = after / own


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
