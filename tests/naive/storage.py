"""Slow twin of the paper's storage (SII Sec. 4, 6), number by number: IEEE half floats, and codes of 0 to 255."""

import copy
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


def stored(frame, lights):
    """Return a frame with the G-buffer that is stored, and the lights that are."""
    buffer, seen = frame.gbuffer, copy.copy(frame)
    vars(seen)["gbuffer"] = buffer.with_channels(
        {**buffer.recorded(), "position": halves(buffer.position), "normal": directions(buffer.normal)}, np.float64)
    parts = {name: getattr(lights, name) for name in ("flux", "lobe_flux") if getattr(lights, name) is not None}
    largest = max(part.max() for part in parts.values())
    kept = {name: np.vectorize(lambda watts: math.floor(watts / largest * 255 + 0.5) * largest / 255, otypes=[float])(
        part) for name, part in parts.items()}
    if lights.lobe_axis is not None:
        kept["lobe_axis"] = directions(lights.lobe_axis)
    return seen, lights._replace(position=halves(lights.position), normal=directions(lights.normal), **kept)
