"""Strict sums against what the machine can do: Eq. 2 and 3 of SII over all pairs, and a crown's samples.

A yardstick sums the same with every licence: fastmath, contraction to fused multiply-add, free order. Those of Eq. 2
and 3 have one receiver per iteration and the lights as lanes; lobes take the power from refgi's polynomials, which run
in lanes and are the faster, or from libm. That of the crown is the kernel's own source. Strict kernels have no licence
and must give the same bits for every thread count. No light of Eq. 3 can be passed over here: receivers of a tile lie
and face anywhere.
"""

import types as python
from collections.abc import Callable, Iterator
from functools import cache, partial
from typing import Any

import numba
import numpy as np
from numba import njit, prange, types

from benchmarks.harness import Row, ratio
from refgi.elementary import exp2, log2p1
from refgi.jit import threads
from refgi.pairs.lobe_sum import add_lobes
from refgi.pairs.pair_sum import Clamp, sum_pairs
from refgi.sssil.form_factor import ROWS, WIDE, add_two, term

EXPONENTS = (20.0, 1000.0)
LINE = 3000  # texels of the crown's band


@njit(parallel=True, fastmath=True, error_model="numpy")
def sum_pairs_freely(position, normal, lights, irradiance):
    real = position.dtype.type
    zero, least = real(0.0), real(1e-30)
    for i in prange(position.shape[1]):
        x, y, z = position[0, i], position[1, i], position[2, i]
        nx, ny, nz = normal[0, i], normal[1, i], normal[2, i]
        red, green, blue = zero, zero, zero
        for k in range(lights.shape[1]):
            dx, dy, dz = lights[0, k] - x, lights[1, k] - y, lights[2, k] - z
            inverse = real(1.0) / max(dx * dx + dy * dy + dz * dz, least)
            cl = max(dx * lights[3, k] + dy * lights[4, k] + dz * lights[5, k], zero)
            cx = max(dx * nx + dy * ny + dz * nz, zero)
            g = cl * cx * inverse * inverse
            red += g * lights[6, k]
            green += g * lights[7, k]
            blue += g * lights[8, k]
        irradiance[0, i], irradiance[1, i], irradiance[2, i] = red, green, blue


@njit(fastmath=True)
def power_of_libm(h, exponent):
    return (type(h)(1.0) - h) ** exponent


@cache
def power_in_lanes():
    # Compiled before any caller: Numba hands a caller's licence on to the overloads that it calls, and with it the
    # polynomials' rounding to whole numbers is taken apart: sums would be off by a fifth.
    @njit(types.float32(types.float32, types.float32))
    def power(h, exponent):
        return exp2(exponent * log2p1(-h))
    return power


def lobes_freely(power):
    @njit(parallel=True, fastmath=True, error_model="numpy")
    def add(position, normal, lights, irradiance):
        real = position.dtype.type
        zero, half, one, least = real(0.0), real(0.5), real(1.0), real(1e-30)
        for i in prange(position.shape[1]):
            x, y, z = position[0, i], position[1, i], position[2, i]
            nx, ny, nz = normal[0, i], normal[1, i], normal[2, i]
            red, green, blue = zero, zero, zero
            for k in range(lights.shape[1]):
                dx, dy, dz = lights[0, k] - x, lights[1, k] - y, lights[2, k] - z
                inverse_square = one / max(dx * dx + dy * dy + dz * dz, least)
                inverse = np.sqrt(inverse_square)
                ox, oy, oz = lights[6, k] - dx * inverse, lights[7, k] - dy * inverse, lights[8, k] - dz * inverse
                h = half * (ox * ox + oy * oy + oz * oz)
                cx = max(dx * nx + dy * ny + dz * nz, zero) * inverse
                dark = (dx * lights[3, k] + dy * lights[4, k] + dz * lights[5, k] <= zero) | (h >= one)
                g = power(zero if dark else h, lights[9, k]) * cx * inverse_square
                g = zero if dark else g
                red += g * lights[10, k]
                green += g * lights[11, k]
                blue += g * lights[12, k]
            irradiance[0, i], irradiance[1, i], irradiance[2, i] = red, green, blue

    return add


def freely(function, **others):
    """Compile a kernel's source once more, with every licence."""
    plain = function.py_func
    plain = python.FunctionType(plain.__code__, {**plain.__globals__, **others}, plain.__name__)
    return njit(fastmath=True, error_model="numpy")(plain)


def over_band(add):
    """Return a kernel that runs tiles of receivers past random samples of a band of lines, by one of two kernels."""
    @njit(parallel=True, error_model="numpy")
    def run(packed, step, starts, result):
        for row in prange(starts.shape[0]):
            tile = np.zeros(ROWS * WIDE, packed.dtype)
            one = packed.dtype.type(1.0)
            for i in range(6 * WIDE):
                tile[i] = packed[i % WIDE + i // WIDE * step]
            for j in range(0, starts.shape[1], 2):
                add(tile, 0, WIDE, packed, step, starts[row, j], one, one, starts[row, j + 1], one, one)
            for i in range(3 * WIDE):
                result[row, i] = tile[6 * WIDE + i]
    return run


def room(pixels: int, lights: int, dtype: Any) -> tuple[np.ndarray, ...]:
    """Return position and normal (3, pixels) of receivers and packed lights (9, lights), anywhere in a cube."""
    rng = np.random.default_rng(1)
    normal = rng.normal(size=(3, pixels + lights))
    normal /= np.linalg.norm(normal, axis=0)
    position = rng.uniform(-1, 1, (3, pixels + lights))
    packed = np.concatenate([position, -normal, rng.random((3, pixels + lights))])[:, pixels:]
    return tuple(np.ascontiguousarray(a, dtype) for a in (position[:, :pixels], normal[:, :pixels], packed))


def rows(quick: bool) -> Iterator[Row]:
    for dtype in (np.float32, np.float64):
        yield from _pairs(quick, dtype)
    yield from _lobes(quick)
    for dtype in (np.float32, np.float64):
        yield _crown(quick, dtype)


def _against(name: str, aim: str, free: Callable, strict: Callable, pairs: int, repeats: int) -> Row:
    found = ratio(free, strict, repeats)
    return Row(f"{name}, speed over fastmath", found.median, "ratio", aim,
               f"{found.low:.2f} to {found.high:.2f}; {pairs / found.seconds_b / 1e9:.2f} G pairs/s")


def _pairs(quick: bool, dtype: Any) -> Iterator[Row]:
    pixels, lights, repeats = (1 << 14, 512, 7) if quick else (1 << 16, 1024, 15)
    name, position, normal, packed = np.dtype(dtype).name, *room(pixels, lights, dtype)
    out = np.zeros_like(position)
    strict = partial(sum_pairs, position, normal, packed, None, True, out)
    yield _against(f"Eq. 2 strict {name}", ">= 0.85" if dtype is np.float32 else "",
                   partial(sum_pairs_freely, position, normal, packed, out), strict, pixels * lights, repeats)
    scaling = ratio(partial(on_threads, 1, strict), strict, repeats)
    yield Row(f"Eq. 2 strict {name}, {numba.get_num_threads()} threads over one", scaling.median, "ratio",
              ">= 1.8" if dtype is np.float32 and numba.get_num_threads() > 1 else "",
              f"{scaling.low:.2f} to {scaling.high:.2f}")
    clamp = Clamp(dtype(1e-4), np.zeros(lights, dtype), dtype(np.inf))
    clamped = partial(sum_pairs, position, normal, packed, clamp, True, out)
    yield Row(f"Eq. 2 {name} with a clamp, time over without", ratio(clamped, strict, repeats).median, "ratio")


def _lobes(quick: bool) -> Iterator[Row]:
    pixels, lights, repeats = (1 << 14, 256, 7) if quick else (1 << 16, 512, 15)
    yardsticks = {"polynomials": lobes_freely(power_in_lanes()), "libm": lobes_freely(power_of_libm)}
    position, normal, packed = room(pixels, lights, np.float32)
    clamp, out = Clamp(np.float32(0), np.zeros(lights, np.float32), np.float32(np.inf)), np.zeros_like(position)
    for exponent in EXPONENTS:
        lobes = np.concatenate([packed[:6], packed[3:6], np.full((1, lights), exponent, np.float32), packed[6:]])
        strict = partial(add_lobes, position, normal, lobes, clamp, None, None, None, out)
        for how, free in yardsticks.items():
            for count in sorted({numba.get_num_threads(), 1}, reverse=True):
                yield _against(f"Eq. 3, P = {exponent:g}, {how}, threads: {count}", ">= 0.6",
                               partial(on_threads, count, partial(free, position, normal, lobes, out)),
                               partial(on_threads, count, strict), pixels * lights, repeats)


def _crown(quick: bool, dtype: Any) -> Row:
    rng = np.random.default_rng(1)
    packed = rng.normal(size=60 * 9 * LINE).astype(dtype)
    starts = (rng.integers(0, 60, (128, 86)) * 9 * LINE + rng.integers(0, LINE - WIDE, (128, 86))).astype(np.int64)
    given = packed, LINE, starts, np.zeros((128, 3 * WIDE), dtype)
    strict, free = over_band(add_two), over_band(freely(add_two, term=freely(term)))
    return _against(f"crown's samples, strict {np.dtype(dtype).name}", ">= 0.75", partial(free, *given),
                    partial(strict, *given), starts.size * WIDE, 9 if quick else 25)


def on_threads(count: int, function: Callable) -> None:
    with threads(count):
        function()
