"""What is left of the basis in the published textures: 8 bits for sines and cosines, 16 for those times z (Sec. 6).

8 bits store [-1, 1] as 0 .. 255; the paper does not say how, this is the mapping of normalised textures. Each number
is off by 1/255 at most, so V is off by sum_k 2 sqrt(2) / (255 c_k) at most: 0.0059 with 4 terms. 16 bits are the
IEEE format of 11 significant ones, rounded to nearest, ties to even.
"""

import math
from typing import Any

import numpy as np

from refgi.jit import kernel

STEPS = 255.0
HALF_STEP = 0.5001  # what lies half way, as means of four often do, is rounded up however it was rounded before
LEAST_EXPONENT = -14  # of a half with all its 11 bits; below it the spacing stays 2^-24


@kernel
def eight_bits(value: Any) -> Any:
    """Return what a texture of 8 bits keeps of a number.

    Parameters
    ----------
    value : float
        Number of [-1, 1].

    Returns
    -------
    float
        The nearest of 256 evenly spaced numbers from -1 to 1.
    """
    real = type(value)
    step = math.floor((value + real(1.0)) * real(0.5 * STEPS) + real(HALF_STEP))
    return real(step) * real(2.0 / STEPS) - real(1.0)


@kernel
def half_precision(value: Any) -> Any:
    """Return what a float of 16 bits keeps of a number.

    Parameters
    ----------
    value : float
        Number within 65504 in size.

    Returns
    -------
    float
        The nearest half, of two equally near ones the even.
    """
    real = type(value)
    _, exponent = math.frexp(value)
    spacing = math.ldexp(1.0, max(exponent - 1, LEAST_EXPONENT) - 10)
    return real(np.rint(value / spacing) * spacing)
