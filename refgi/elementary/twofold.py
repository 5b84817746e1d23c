"""Sums and products in float64 with what rounding takes from them: a pair (high, low) holds some 106 bits.

Where a difference cancels, such as the cosine at the edge of a spot's cone, its operands must be known to more bits
than the result keeps. The pairs are those of Dekker 1971, which strict IEEE arithmetic makes exact.
"""

import decimal
import math

from refgi.jit import kernel

Pair = tuple[float, float]
Vector = tuple[float, float, float]

SPLITTER = 134217729.0  # 2^27 + 1: splits 53 bits into two halves whose products are exact
DIGITS = 60  # of decimal arithmetic, for what is computed once


def sine_cosine_digits(angle: float) -> tuple[decimal.Decimal, decimal.Decimal]:
    """Return sine and cosine, off by less than 1e-58; `angle`: 0 to pi/2, rad; taken as the exact number it is."""
    with decimal.localcontext(prec=DIGITS):
        x = decimal.Decimal(angle)
        sums, term, n = [decimal.Decimal(0), decimal.Decimal(0)], decimal.Decimal(1), 0
        while abs(term) > decimal.Decimal(10) ** (-DIGITS - 20):  # sines of narrow cones keep their digits, too
            sums[n % 2] += term * (-1) ** (n // 2)
            n += 1
            term *= x / n
        return sums[1], sums[0]


def twofold(value: decimal.Decimal) -> Pair:
    """Return a number as a pair: `high, low`, the nearest float64, and the float64 nearest to the rest."""
    with decimal.localcontext(prec=DIGITS):
        high = float(value)
        return high, float(value - decimal.Decimal(high))


@kernel
def two_sum(a: float, b: float) -> Pair:
    """Return a + b as a pair: `high, low`, the rounded sum, and what rounding took; exact."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


@kernel
def two_product(a: float, b: float) -> Pair:
    """Return a b as a pair.

    Returns `high, low`: the rounded product, and what rounding took; exact where it does not underflow.
    """
    s, t = SPLITTER * a, SPLITTER * b
    a_head, b_head = s - (s - a), t - (t - b)
    a_tail, b_tail = a - a_head, b - b_head
    product = a * b
    return product, ((a_head * b_head - product) + a_head * b_tail + a_tail * b_head) + a_tail * b_tail


@kernel
def add(x: Pair, y: Pair) -> Pair:
    """Return the sum of two pairs: `high, low`, their sum, to some 2^-100 of the larger."""
    high, low = two_sum(x[0], y[0])
    return two_sum(high, low + (x[1] + y[1]))


@kernel
def multiply(x: Pair, y: Pair) -> Pair:
    """Return the product of two pairs: `high, low`, their product, to some 2^-100 of it."""
    high, low = two_product(x[0], y[0])
    return two_sum(high, low + (x[0] * y[1] + x[1] * y[0]))


@kernel
def root(x: Pair) -> Pair:
    """Return the square root of a pair.

    `x`: the pair, 0 or more. Returns `high, low`: its root, to some 2^-100 of it.
    """
    high = math.sqrt(x[0])
    if high == 0.0:
        return 0.0, 0.0
    square, rest = two_product(high, high)
    return high, (((x[0] - square) - rest) + x[1]) / (2.0 * high)


@kernel
def length_along(d: Vector, axis: Vector) -> Pair:
    """Return the dot product of two vectors as a pair.

    Returns `high, low`: to some 2^-100 of the product of both lengths.
    """
    return add(add(two_product(d[0], axis[0]), two_product(d[1], axis[1])), two_product(d[2], axis[2]))


@kernel
def length_across(d: Vector, axis: Vector) -> Pair:
    """Return the length of the cross product of two vectors as a pair.

    Returns `high, low`: to some 2^-100 of the product of both lengths.
    """
    x = add(two_product(d[1], axis[2]), two_product(-d[2], axis[1]))
    y = add(two_product(d[2], axis[0]), two_product(-d[0], axis[2]))
    z = add(two_product(d[0], axis[1]), two_product(-d[1], axis[0]))
    return root(add(add(multiply(x, x), multiply(y, y)), multiply(z, z)))
