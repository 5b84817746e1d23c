"""exp2, log2, log2p1 and pow without branches or tables, so that loops over them run in SIMD lanes.

Libraries of vectorised functions are not to be had from Numba any more, and the platform's libm differs from machine
to machine in the last bit. These differ nowhere: additions, multiplications, one division and bit patterns. Each
picks its polynomial by the type of its argument, when it is compiled; their coefficients minimise the largest
relative error.

log2(1 + f) = s (C + z q(z)) with s = f / (2 + f), z = s^2, C = 2 / ln 2, and 2^r = 1 + r q(r). `log2` and `pow` carry
some 11 (float64: 26) bits more than their type in a second number; a number whose lower half of bits is 0 has exact
products with its like, which takes the place of a fused multiply-add.
"""

import math
from typing import Any

import numpy as np
from numba import types

from refgi.elementary import double, single
from refgi.jit import by_type


def exp2(x: Any) -> Any:
    """Return 2^x; 0 below the smallest normal number, inf where that is what is left.

    Within 1.3 ULP, exact for whole x; NaN for NaN.
    """
    return np.exp2(x)


def log2(x: Any) -> Any:
    """Return the logarithm to base 2 of x >= 0, subnormal numbers among them.

    Within 0.6 ULP, exact for powers of 2; -inf at 0, NaN below 0 and for NaN.
    """
    return np.log2(x)


def log2p1(x: Any) -> Any:
    """Return log2(1 + x) for finite x > -1, with full relative accuracy near 0.

    Within 3 ULP, in a third of the time of `log2`, which cannot know what a rounded 1 + x has lost.
    """
    return np.log1p(x) / math.log(2.0)


def pow(x: Any, y: Any) -> Any:
    """Return x^y for x >= 0, subnormal numbers among them, y of the same type; 0 below the smallest normal number.

    Within 2.5 ULP (float64: 15), however large y is; inf where that is what is left. 1 for y = 0 and every number x;
    NaN for x < 0 and for NaN.
    """
    return np.power(x, y)


def _choose(name: str) -> Any:
    def by_type(x: Any) -> Any:
        return (single if x == types.float32 else double).FUNCTIONS[name]

    return by_type


def _choose_pow(x: Any, y: Any) -> Any:  # noqa: ARG001
    return (single if x == types.float32 else double).FUNCTIONS["pow"]


by_type(exp2)(_choose("exp2"))
by_type(log2)(_choose("log2"))
by_type(log2p1)(_choose("log2p1"))
by_type(pow)(_choose_pow)
