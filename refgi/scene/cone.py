"""A spot's cone as kernels read it: numbers that keep their digits however narrow or wide it is."""

import decimal

import numpy as np

from refgi.elementary.twofold import DIGITS, sine_cosine_digits, twofold
from refgi.scene.values import Array

# places in a row of `cone_row`; sine and cosine of the outer half-angle come in two parts, the second the rest
SINE, SINE_REST, COSINE, COSINE_REST, SPAN, CAP = range(6)


def cone_row(inner: float, outer: float) -> Array:
    """Return what kernels need of a spot's half-angles.

    Parameters
    ----------
    inner, outer : float
        Half-angles, rad, 0 <= inner <= outer < pi/2.

    Returns
    -------
    (6,) ndarray of float64
        sin outer and cos outer, each a float64 and the rest; cos inner - cos outer; 1 - cos outer.
    """
    sine, cosine = sine_cosine_digits(outer)
    _, cosine_inner = sine_cosine_digits(inner)
    with decimal.localcontext(prec=DIGITS):
        return np.array([*twofold(sine), *twofold(cosine), float(cosine_inner - cosine), float(1 - cosine)])
