"""Planes of numbers as text inside a page: half floats, predicted, deflated, base64.

A plane is divided by a power of two that brings its largest number just below 2^15, so that no number overflows and all
above 2^-29 of the largest keep 11 bits; the page multiplies it back. Half floats are compared as the integers of their
bits, which grow with the logarithm of the number: what is stored is the difference to the second channel (channels
differ by a nearly constant factor, noise included), then to the pixel on the left; high bytes stand before low bytes.
"""

import base64
import math
import zlib
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]
Bits = npt.NDArray[np.uint16]

LARGEST_EXPONENT = 15  # numbers are scaled below 2^15; half floats end at 65504
LEVEL = 6  # of deflate: 9 takes three times as long for 1 % less
BASE = 1  # the channel that others are predicted from: green


def halves(planes: Array) -> tuple[Bits, int]:
    """Return numbers, (c, h, w), over 2^exponent as the bits of half floats, uint16, and the exponent.

    NaN and infinity may be among them.

    >>> bits, exponent = halves(np.array([[[1.0, 0.5]]]))
    >>> (bits.view(np.float16) * 2.0**exponent).tolist()
    [[[1.0, 0.5]]]
    """
    finite = np.abs(planes[np.isfinite(planes)])
    largest = float(finite.max()) if finite.size else 0.0
    exponent = math.frexp(largest)[1] - LARGEST_EXPONENT if largest > 0 else 0
    scaled = np.ldexp(np.asarray(planes, np.float64), -exponent).astype(np.float16)
    return np.ascontiguousarray(scaled).view(np.uint16), exponent


def packed(bits: Bits) -> str:
    """Return planes of 16 bits, (c, h, w), as the text that the page's script unpacks: Base64 of a zlib stream."""
    if len(bits) > BASE:
        base = bits[BASE].copy()
        bits = bits - base  # modulo 2^16, as all sums here and in the script
        bits[BASE] = base
    steps = np.diff(bits, axis=2, prepend=np.uint16(0)).astype(np.uint16)
    content = np.concatenate([(steps >> 8).astype(np.uint8).ravel(), (steps & 0xFF).astype(np.uint8).ravel()])
    return base64.b64encode(zlib.compress(content.tobytes(), LEVEL)).decode("ascii")


def block_means(values: Array, covered: Array, level: int) -> Array:
    """Return the mean of covered pixels in each block of 2^level x 2^level.

    (c, h, w) to (c, h / 2^level, w / 2^level), rounded up at the far edges; 0 where nothing is covered.
    """
    if level == 0:
        return values
    counts = _block_sums(covered.astype(np.float64), level)
    sums = _block_sums(np.where(covered, values, 0), level)
    means: Array = sums / np.maximum(counts, 1)
    return means


def every(values: Array, level: int) -> Array:
    """Return the upper left pixel of each block of 2^level x 2^level, for planes that have no mean, such as ids.

    (..., h, w) to (..., h / 2^level, w / 2^level), rounded up.
    """
    step = 1 << level
    return values[..., ::step, ::step]


def _block_sums(values: Array, level: int) -> Array:
    step = 1 << level
    height, width = values.shape[-2:]
    rows = np.add.reduceat(values, np.arange(0, height, step), axis=-2)
    sums: Array = np.add.reduceat(rows, np.arange(0, width, step), axis=-1)
    return sums
