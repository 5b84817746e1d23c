"""exp2, log2, log2p1 and pow in float32; see the package."""

import math
from typing import Any

import numpy as np
from numba.extending import register_jitable

SQRT_HALF_BITS = np.int32(0x3F3504F3)
HEAD = np.int32(-0x1000)  # keeps 12 of 24 significant bits
ROUNDER = np.float32(12582912.0)  # 1.5 * 2^23: adding it rounds to a whole number, found in the lowest bits
C = 2.0 / math.log(2.0)
C_HEAD, C_TAIL = 2.884765625, 6.24456777927e-4  # C in two parts, the first of 12 bits


@register_jitable
def _head(x: Any) -> Any:
    """Return x with the lower half of its significant bits 0."""
    return np.int32(np.float32(x).view(np.int32) & HEAD).view(np.float32)


@register_jitable
def _power_of_sum(high: Any, low: Any) -> Any:
    """Return 2^(high + low); high may be far larger than low."""
    x = high + low
    inside = np.float32(-126.0) if x < np.float32(-126.0) else x
    shifted = (np.float32(128.0) if inside > np.float32(128.0) else inside) + ROUNDER
    r = (high - (shifted - ROUNDER)) + low
    p = np.float32(1.5353361944104770e-4)
    p = p * r + np.float32(1.3398874403644236e-3)
    p = p * r + np.float32(9.6184373574484709e-3)
    p = p * r + np.float32(5.5503324711590184e-2)
    p = p * r + np.float32(2.4022647913632002e-1)
    p = p * r + np.float32(6.9314720285504529e-1)
    p = p * r + np.float32(1.0)
    bits = np.float32(p).view(np.int32) + np.int32(np.float32(shifted).view(np.int32) << np.int32(23))
    power = np.int32(bits).view(np.float32)
    power = power if x >= np.float32(-126.0) else np.float32(0.0)
    power = power if x < np.float32(128.0) else np.float32(np.inf)
    return power if x == x else x


@register_jitable
def _split(x: Any) -> Any:
    """Return k and f of x = 2^k (1 + f), 1 + f between the roots of 1/2 and 2."""
    small = x < np.float32(1.1754944e-38)
    bits = np.float32(x * np.float32(8388608.0) if small else x).view(np.int32)
    k = np.int32((bits - SQRT_HALF_BITS) >> np.int32(23))
    f = np.int32(bits - np.int32(k << np.int32(23))).view(np.float32) - np.float32(1.0)
    return np.float32(k) - (np.float32(23.0) if small else np.float32(0.0)), f


@register_jitable
def _log2_parts(x: Any) -> Any:
    """Return log2 x in two parts, the first with the lower half of its bits 0; x > 0, finite."""
    k, f = _split(x)
    t = np.float32(2.0) + f
    t_head = _head(t)
    t_tail = f - (t_head - np.float32(2.0))
    inverse = np.float32(1.0) / t
    s = f * inverse
    s_head = _head(s)
    s_tail = inverse * ((f - s_head * t_head) - s_head * t_tail)
    z = s_head * s_head + s_tail * (s + s_head)
    q = np.float32(0.34021853)
    q = q * z + np.float32(0.41170634)
    q = q * z + np.float32(0.57708285)
    q = q * z + np.float32(0.96179668)
    w = z * q
    factor = _head(np.float32(C) + w)
    factor_tail = ((np.float32(C_HEAD) - factor) + w) + np.float32(C_TAIL)
    main = s_head * factor
    rest = s_head * factor_tail + s_tail * (factor + factor_tail)
    total = k + main
    rest = (main - (total - k)) + rest
    head = _head(total + rest)
    return head, rest - (head - total)


def _exp2(x: Any) -> Any:
    """Return 2^x."""
    return _power_of_sum(x, np.float32(0.0))


def _log2(x: Any) -> Any:
    """Return the logarithm to base 2."""
    high, low = _log2_parts(x)
    # the sum before what chooses it: within a choice it would become a branch
    value, other = high + low, np.float32(-np.inf) if x == np.float32(0.0) else np.float32(np.nan)
    value = value if x > np.float32(0.0) else other
    return value if x < np.float32(np.inf) else x


def _log2p1(x: Any) -> Any:
    """Return log2(1 + x)."""
    one = np.float32(1.0)
    bits = np.float32(one + x).view(np.int32)
    k = np.int32((bits - SQRT_HALF_BITS) >> np.int32(23))
    reduced = np.int32(bits - np.int32(k << np.int32(23))).view(np.float32) - one
    f = x if k == 0 else reduced  # x itself where the sum with 1 would round it
    s = f / (np.float32(2.0) + f)
    z = s * s
    q = np.float32(0.43095793)
    q = q * z + np.float32(0.57675401)
    q = q * z + np.float32(0.96179828)
    return np.float32(k) + (s * np.float32(C) + s * (z * q))


def _pow(x: Any, y: Any) -> Any:
    """Return x^y for x >= 0."""
    most = np.float32(8589934592.0)  # beyond it every power but that of 1 is 0 or infinite
    high, low = _log2_parts(x)
    exponent = most if y > most else (-most if y < -most else y)
    head = _head(exponent)
    power = _power_of_sum(head * high, (exponent - head) * high + exponent * low)
    up, down = (np.float32(np.inf), np.float32(0.0)) if y > np.float32(0.0) else (np.float32(0.0), np.float32(np.inf))
    power = power if x > np.float32(0.0) else (down if x == np.float32(0.0) else np.float32(np.nan))
    power = power if x < np.float32(np.inf) else (up if x == x else x)
    return np.float32(1.0) if y == np.float32(0.0) and x >= np.float32(0.0) else (power if y == y else y)


FUNCTIONS = {"exp2": _exp2, "log2": _log2, "log2p1": _log2p1, "pow": _pow}
