"""The basis in 8 bits and in half floats, as published textures hold it, and how ports get it wrong (VAL Sec. 6)."""

from collections.abc import Callable, Mapping

import numpy as np

from refgi.cluster.filters.basis import HALF_STEP, STEPS
from refgi.vectors.recipe import writing
from refgi.vectors.spec import Array, Bug, Run

BYTES = "VAL Sec. 6: 8 bits for sines and cosines, 16 for those times the depth"
Change = Callable[[Array], Array]


def eight(x: Array) -> Array:
    """Return the nearest of 256 evenly spaced numbers from -1 to 1, halves up."""
    return np.floor((x + 1) * (0.5 * STEPS) + HALF_STEP) * (2 / STEPS) - 1


def half(x: Array) -> Array:
    """Return the nearest half floats."""
    return x.astype(np.float16).astype(x.dtype)


def in_bytes(basis: Array, terms: int, first: Change = eight, second: Change = half) -> Array:
    """Return (area light, channel, row, column) with sines and cosines in 8 bits, the rest in 16; 0 on empty maps."""
    made = np.concatenate([first(basis[:, : 2 * terms]), second(basis[:, 2 * terms :])], axis=1)
    return np.asarray(np.where(basis.any(axis=(1, 2, 3), keepdims=True), made, 0), basis.dtype)


def rounding_bugs(run: Run, name: str, terms: int) -> tuple[Bug, ...]:
    """Return likely bugs of the rounding; `run` is the basis before it."""
    def same(x: Array) -> Array:
        return x

    ways: Mapping[str, tuple[Change, Change]] = {
        "nothing is rounded: floats of 32 bits": (same, same),
        "sines and cosines are not rounded to 8 bits": (same, half),
        "sines and cosines are in half floats, as those times the depth": (half, half),
        "those times the depth are in 8 bits as well": (eight, eight),
        "those times the depth are not rounded to half floats": (eight, same),
        "8 bits are cut off, not rounded": (lambda x: np.floor((x + 1) * 127.5) / 127.5 - 1, half),
        "8 bits hold 127 steps to either side: signed bytes": (lambda x: np.floor(x * 127 + 0.5) / 127, half),
        "8 bits hold 256 steps, not 255": (lambda x: np.floor((x + 1) * 128 + 0.5).clip(0, 255) / 128 - 1, half),
        "8 bits hold [0, 1]: negative sines and cosines are 0": (
            lambda x: np.floor(x.clip(0, 1) * 255 + 0.5) / 255, half),
        "8 bits are not turned back to [-1, 1]: (x + 1) / 2 is stored": (lambda x: (eight(x) + 1) / 2, half),
        "half floats are cut off, not rounded": (eight, _cut),
        "half floats have 8 bits of mantissa: bfloat16": (eight, _short),
    }
    return tuple(Bug(cause, writing(run, **{name.replace(".", "__"): _kept(terms, *pair)}), BYTES)
                 for cause, pair in ways.items())


def _kept(terms: int, first: Change, second: Change) -> Change:
    return lambda basis: in_bytes(basis, terms, first, second)


def _cut(x: Array) -> Array:
    near = half(x)
    return np.where(np.abs(near) > np.abs(x), np.nextafter(near.astype(np.float16), np.float16(0)), near)


def _short(x: Array) -> Array:
    bits = x.astype(np.float32).view(np.uint32)
    return ((bits + 0x7FFF + (bits >> 16 & 1)) & 0xFFFF0000).astype(np.uint32).view(np.float32)
