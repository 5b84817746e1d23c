"""exp and log1p without branches or tables, so that loops over them run in SIMD lanes.

Libraries of vectorised functions are not to be had from Numba any more, and the platform's libm differs from machine
to machine in the last bit. These differ nowhere: additions, multiplications, one division and bit patterns. Each
picks its polynomial by the type of its argument, when it is compiled.
"""

import math
from typing import Any

import numpy as np
from numba import types
from numba.extending import overload

LOG2_E = 1.0 / math.log(2.0)
LOG_2_HIGH = 0.693359375  # ln 2 in two parts, the first with few bits, so that k * first is exact
LOG_2_LOW = -2.12194440054690583e-4
LOG_2_HIGH_DOUBLE = 6.93147180369123816490e-01
LOG_2_LOW_DOUBLE = 1.90821492927058770002e-10
SQRT_HALF_BITS = np.int32(0x3F3504F3)
SQRT_HALF_BITS_DOUBLE = np.int64(0x3FE6A09E667F3BCD)


def exp(x: Any) -> Any:
    """Return e^x; 0 below the smallest normal number.

    Parameters
    ----------
    x : float
        At most 88 (float32) or 709 (float64).

    Returns
    -------
    float
        Within 1.5 units in the last place.
    """
    return np.exp(x)


def log1p(x: Any) -> Any:
    """Return ln(1 + x), with full relative accuracy near 0.

    Parameters
    ----------
    x : float
        Above -1, finite.

    Returns
    -------
    float
        Within 3 units in the last place.
    """
    return np.log1p(x)


def _exp_single(x: Any) -> Any:
    one = np.float32(1.0)
    low = np.float32(-87.33654)
    inside = x if x > low else low
    shifted = inside * np.float32(LOG2_E) + np.float32(12582912.0)  # 1.5 * 2^23: rounds to a whole number
    k = shifted - np.float32(12582912.0)
    r = (inside - k * np.float32(LOG_2_HIGH)) - k * np.float32(LOG_2_LOW)
    p = np.float32(1 / 5040)
    p = p * r + np.float32(1 / 720)
    p = p * r + np.float32(1 / 120)
    p = p * r + np.float32(1 / 24)
    p = p * r + np.float32(1 / 6)
    p = p * r + np.float32(0.5)
    p = (p * (r * r) + r) + one
    power = np.int32((np.int32(k) + np.int32(127)) << np.int32(23)).view(np.float32)
    return p * power if x >= low else np.float32(0.0)


def _exp_double(x: Any) -> Any:
    low = -708.39
    inside = x if x > low else low
    k = (inside * LOG2_E + 6755399441055744.0) - 6755399441055744.0  # 1.5 * 2^52
    r = (inside - k * LOG_2_HIGH_DOUBLE) - k * LOG_2_LOW_DOUBLE
    p = 1 / 6227020800
    p = p * r + 1 / 479001600
    p = p * r + 1 / 39916800
    p = p * r + 1 / 3628800
    p = p * r + 1 / 362880
    p = p * r + 1 / 40320
    p = p * r + 1 / 5040
    p = p * r + 1 / 720
    p = p * r + 1 / 120
    p = p * r + 1 / 24
    p = p * r + 1 / 6
    p = p * r + 0.5
    p = (p * (r * r) + r) + 1.0
    power = np.int64((np.int64(k) + np.int64(1023)) << np.int64(52)).view(np.float64)
    return p * power if x >= low else 0.0


def _log1p_single(x: Any) -> Any:
    one = np.float32(1.0)
    u = one + x
    lost = ((one - u) + x) / u  # what rounding of u dropped
    bits = np.float32(u).view(np.int32)
    k = np.int32((bits - SQRT_HALF_BITS) >> np.int32(23))
    f = np.int32(bits - np.int32(k << np.int32(23))).view(np.float32) - one
    s = f / (np.float32(2.0) + f)
    z = s * s
    p = np.float32(2 / 11)
    p = p * z + np.float32(2 / 9)
    p = p * z + np.float32(2 / 7)
    p = p * z + np.float32(2 / 5)
    p = p * z + np.float32(2 / 3)
    # ln(1 + f) = f - s (f - z p): f itself is exact, so the rounding is that of the small rest
    e = np.float32(k)
    rest = lost + e * np.float32(LOG_2_LOW) - s * (f - z * p)
    return (rest + f) + e * np.float32(LOG_2_HIGH)


def _log1p_double(x: Any) -> Any:
    u = 1.0 + x
    lost = ((1.0 - u) + x) / u
    bits = np.float64(u).view(np.int64)
    k = np.int64((bits - SQRT_HALF_BITS_DOUBLE) >> np.int64(52))
    f = np.int64(bits - np.int64(k << np.int64(52))).view(np.float64) - 1.0
    s = f / (2.0 + f)
    z = s * s
    p = 2 / 23
    p = p * z + 2 / 21
    p = p * z + 2 / 19
    p = p * z + 2 / 17
    p = p * z + 2 / 15
    p = p * z + 2 / 13
    p = p * z + 2 / 11
    p = p * z + 2 / 9
    p = p * z + 2 / 7
    p = p * z + 2 / 5
    p = p * z + 2 / 3
    e = np.float64(k)
    rest = lost + e * LOG_2_LOW_DOUBLE - s * (f - z * p)
    return (rest + f) + e * LOG_2_HIGH_DOUBLE


def _choose(single: Any, double: Any) -> Any:
    def by_type(x: Any) -> Any:
        return single if x == types.float32 else double

    return by_type


overload(exp)(_choose(_exp_single, _exp_double))
overload(log1p)(_choose(_log1p_single, _log1p_double))
