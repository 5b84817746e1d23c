"""exp2, log2, log2p1 and pow in float64; see the package."""

import math
from typing import Any

import numpy as np
from numba.extending import register_jitable

SQRT_HALF_BITS = np.int64(0x3FE6A09E667F3BCD)
HEAD = np.int64(-0x8000000)  # keeps 26 of 53 significant bits
ROUNDER = np.float64(6755399441055744.0)  # 1.5 * 2^52: adding it rounds to a whole number, found in the lowest bits
C = 2.0 / math.log(2.0)
C_HEAD, C_TAIL = 2.885390043258667, 3.8519259822532349e-8  # C in two parts, the first of 26 bits


@register_jitable
def _head(x: Any) -> Any:
    """Return x with the lower half of its significant bits 0."""
    return np.int64(np.float64(x).view(np.int64) & HEAD).view(np.float64)


@register_jitable
def _power_of_sum(high: Any, low: Any) -> Any:
    """Return 2^(high + low); high may be far larger than low."""
    x = high + low
    inside = -1022.0 if x < -1022.0 else x
    shifted = (1024.0 if inside > 1024.0 else inside) + ROUNDER
    r = (high - (shifted - ROUNDER)) + low
    p = 4.4347711729226272264e-10
    p = p * r + 7.0737832508856737232e-9
    p = p * r + 1.0178199572640586318e-7
    p = p * r + 1.3215435282291825728e-6
    p = p * r + 1.5252733493125674108e-5
    p = p * r + 1.5403530457112131061e-4
    p = p * r + 1.3333558146774622297e-3
    p = p * r + 9.6181291075940051171e-3
    p = p * r + 5.5504108664820083220e-2
    p = p * r + 2.4022650695910131260e-1
    p = p * r + 6.9314718055994532581e-1
    p = p * r + 1.0
    bits = np.float64(p).view(np.int64) + np.int64(np.float64(shifted).view(np.int64) << np.int64(52))
    power: Any = np.int64(bits).view(np.float64)
    power = power if x >= -1022.0 else 0.0
    power = power if x < 1024.0 else np.inf
    return power if x == x else x


@register_jitable
def _split(x: Any) -> Any:
    """Return k and f of x = 2^k (1 + f), 1 + f between the roots of 1/2 and 2."""
    small = x < 2.2250738585072014e-308
    bits = np.float64(x * 4503599627370496.0 if small else x).view(np.int64)
    k = np.int64((bits - SQRT_HALF_BITS) >> np.int64(52))
    f = np.int64(bits - np.int64(k << np.int64(52))).view(np.float64) - 1.0
    return np.float64(k) - (52.0 if small else 0.0), f


@register_jitable
def _log2_parts(x: Any) -> Any:
    """Return log2 x in two parts, the first with the lower half of its bits 0; x > 0, finite."""
    k, f = _split(x)
    t = 2.0 + f
    t_head = _head(t)
    t_tail = f - (t_head - 2.0)
    inverse = 1.0 / t
    s = f * inverse
    s_head = _head(s)
    s_tail = inverse * ((f - s_head * t_head) - s_head * t_tail)
    z = s_head * s_head + s_tail * (s + s_head)
    q = 0.19117382364957698782
    q = q * z + 0.19115906332462512192
    q = q * z + 0.22198878362528881316
    q = q * z + 0.26230757613543030233
    q = q * z + 0.32059890409739576863
    q = q * z + 0.41219858307735571039
    q = q * z + 0.57707801635567542218
    q = q * z + 0.96179669392597552286
    w = z * q
    factor = _head(C + w)
    factor_tail = ((C_HEAD - factor) + w) + C_TAIL
    main = s_head * factor
    rest = s_head * factor_tail + s_tail * (factor + factor_tail)
    total = k + main
    rest = (main - (total - k)) + rest
    head = _head(total + rest)
    return head, rest - (head - total)


def _exp2(x: Any) -> Any:
    """Return 2^x."""
    return _power_of_sum(x, 0.0)


def _log2(x: Any) -> Any:
    """Return the logarithm to base 2."""
    high, low = _log2_parts(x)
    # the sum before what chooses it: within a choice it would become a branch
    value, other = high + low, -np.inf if x == 0.0 else np.nan
    value = value if x > 0.0 else other
    return value if x < np.inf else x


def _log2p1(x: Any) -> Any:
    """Return log2(1 + x)."""
    bits = np.float64(1.0 + x).view(np.int64)
    k = np.int64((bits - SQRT_HALF_BITS) >> np.int64(52))
    reduced = np.int64(bits - np.int64(k << np.int64(52))).view(np.float64) - 1.0
    f = x if k == 0 else reduced  # x itself where the sum with 1 would round it
    s = f / (2.0 + f)
    z = s * s
    q = 0.21346043128575741777
    q = q * z + 0.22093504802068456353
    q = q * z + 0.26233338078326172486
    q = q * z + 0.32059855679197671491
    q = q * z + 0.41219858557754847402
    q = q * z + 0.57707801634714096595
    q = q * z + 0.96179669392598537851
    return np.float64(k) + (s * C + s * (z * q))


def _pow(x: Any, y: Any) -> Any:
    """Return x^y for x >= 0."""
    most = 1.8446744073709552e19  # beyond it every power but that of 1 is 0 or infinite
    high, low = _log2_parts(x)
    exponent = most if y > most else (-most if y < -most else y)
    head = _head(exponent)
    power = _power_of_sum(head * high, (exponent - head) * high + exponent * low)
    up, down = (np.inf, 0.0) if y > 0.0 else (0.0, np.inf)
    power = power if x > 0.0 else (down if x == 0.0 else np.nan)
    power = power if x < np.inf else (up if x == x else x)
    return 1.0 if y == 0.0 and x >= 0.0 else (power if y == y else y)


FUNCTIONS = {"exp2": _exp2, "log2": _log2, "log2p1": _log2p1, "pow": _pow}
