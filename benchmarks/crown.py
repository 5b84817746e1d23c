"""Samples of a crown: the strict kernel against one with every licence, threads, and the paper's shape of costs.

The yardstick is the kernel's own source compiled with fastmath and contraction to fused multiply-add; the strict kernel
has neither and must give the same bits for every thread count.
"""

import math
import types
from collections.abc import Iterator
from functools import partial

import numba
import numpy as np
from numba import njit, prange

from benchmarks.harness import Row, ratio, seconds
from refgi.jit import threads
from refgi.settings import of
from refgi.sssil import HssilSettings
from refgi.sssil.crown.form_factor import ROWS, WIDE, add_two, term
from refgi.sssil.crown.gather import gather
from refgi.sssil.pyramid.view import Level
from refgi.sssil.settings import PRESETS

SAMPLES = 64


def freely(function, **others):
    """Compile a kernel's source once more, with every licence."""
    plain = function.py_func
    plain = types.FunctionType(plain.__code__, {**plain.__globals__, **others}, plain.__name__)
    return njit(fastmath=True, error_model="numpy")(plain)


def driver(add):
    """Return a kernel that runs tiles of receivers past random samples of a band of lines, by one of two kernels."""
    @njit(parallel=True, error_model="numpy")
    def run(packed, step, starts, result):
        for row in prange(starts.shape[0]):
            tile = np.zeros(ROWS * WIDE, packed.dtype)
            one = packed.dtype.type(1.0)
            for i in range(6 * WIDE):
                tile[i] = packed[i % WIDE + i // WIDE * step]
            for j in range(0, starts.shape[1], 2):
                add(tile, 0, WIDE, packed, step, starts[row, j], one, starts[row, j + 1], one, True)
            for i in range(3 * WIDE):
                result[row, i] = tile[6 * WIDE + i]
    return run


def room(height: int, width: int, dtype: type) -> Level:
    """Return a level that looks into a half pipe, lit all over."""
    y, x = (np.mgrid[:height, :width] + 0.5) / width - np.array([height / width, 1.0])[:, None, None] / 2
    angle = math.pi * x
    position = np.stack([np.sin(angle), y, -2.0 - np.cos(angle)])
    normal = np.stack([-np.sin(angle), 0 * y, np.cos(angle)])
    planes = position, -position[2], normal, np.ones((3, height, width)), np.full((height, width), 4.0 / width**2)
    pixel = np.arange(height * width, dtype=np.int32).reshape(height, width)
    return Level(1, *(np.ascontiguousarray(plane, dtype) for plane in planes), pixel)


def rows(quick: bool) -> Iterator[Row]:
    height, width, repeats = (180, 320, 9) if quick else (360, 640, 25)
    for dtype in (np.float32, np.float64):
        yield _against_fastmath(dtype, repeats)
    level, settings = room(height, width, np.float32), HssilSettings()
    whole = partial(gather, level, 0, settings)
    taken = seconds(whole, repeats)
    pairs = height * width * sum(settings.sampling.counts(0))
    yield Row(f"first level, {width} x {height}, {SAMPLES} samples", taken * 1e3, "ms",
              note=f"{pairs / taken / 1e9:.2f} G pairs/s")
    scaling = ratio(partial(_on_threads, 1, whole), whole, repeats)
    yield Row(f"one thread over {numba.get_num_threads()}", scaling.median, "ratio",
              ">= 1.8" if numba.get_num_threads() > 1 and not quick else "", f"{scaling.low:.2f} to {scaling.high:.2f}")
    yield from _cost_shape(height, width, repeats)
    own = of(HssilSettings, samples=SAMPLES, pattern="pixel")
    yield Row("samples of each pixel's own, time over shared", ratio(partial(gather, level, 0, own), whole, 3).median,
              "ratio")


def _against_fastmath(dtype: type, repeats: int) -> Row:
    rng = np.random.default_rng(1)
    step = 3000
    packed = rng.normal(size=60 * 9 * step).astype(dtype)
    starts = (rng.integers(0, 60, (128, 86)) * 9 * step + rng.integers(0, step - WIDE, (128, 86))).astype(np.int64)
    out = np.zeros((128, 3 * WIDE), dtype)
    strict, free = driver(add_two), driver(freely(add_two, term=freely(term)))
    against = ratio(partial(free, packed, step, starts, out), partial(strict, packed, step, starts, out), repeats)
    rate = starts.size * WIDE / against.seconds_b / 1e9
    return Row(f"sum over samples, strict {np.dtype(dtype).name}, speed over fastmath", against.median, "ratio",
               ">= 0.75", f"{against.low:.2f} to {against.high:.2f}; {rate:.2f} G pairs/s")


def _cost_shape(height: int, width: int, repeats: int) -> Iterator[Row]:
    """Time by level, as in Fig. 7: each a quarter of the one before, the first with its disc."""
    settings = PRESETS["paper"]
    taken = [seconds(partial(gather, room(height >> k, width >> k, np.float32), k, settings), repeats)
             for k in range(5)]
    four = sum(taken[:4])
    yield Row("first of four levels, share of their time", taken[0] / four, "ratio", ">= 0.7",
              "paper: 0.753; " + ", ".join(f"{t * 1e3:.2f}" for t in taken) + " ms")
    yield Row("a fifth level, share of four", taken[4] / four, "ratio", "" if quick_size(height) else "<= 0.01")


def quick_size(height: int) -> bool:
    """Whether a picture is so small that starting a kernel outweighs its last levels."""
    return height < 360


def _on_threads(count: int, function: partial) -> None:
    with threads(count):
        function()
