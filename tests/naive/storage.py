"""The formats of the paper's storage (SII Sec. 4, 6), number by number: IEEE half floats, and codes of 0 to 255."""

import math
import struct

import numpy as np


def half(x):
    return struct.unpack("e", struct.pack("e", float(x)))[0]


def halves(plane):
    return np.vectorize(half, otypes=[float])(plane)


def direction(v):
    """Each component c as the code nearest to (c + 1) 255 / 2, decoded and made a unit vector."""
    if not any(v):
        return np.zeros(3)
    decoded = [math.floor((float(c) + 1) * 127.5 + 0.5) / 127.5 - 1 for c in v]
    return np.array(decoded) / math.hypot(*decoded)


def directions(plane):
    return np.apply_along_axis(direction, 0, plane)
