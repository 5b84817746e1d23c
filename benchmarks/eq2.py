"""Eq. 2 of SII, the sum over all pairs of pixel light and receiver, against what the machine can do.

The yardstick sums the same pairs with every licence: fastmath, contraction to fused multiply-add, free order of the
lights, one receiver per iteration and the lights as lanes. The strict kernel has none of these and must give the same
bits for every thread count.
"""

from collections.abc import Iterator
from functools import partial

import numba
import numpy as np
from numba import njit, prange

from benchmarks.harness import Row, ratio
from refgi.jit import threads
from refgi.pairs.pair_sum import Clamp, sum_pairs


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


def room(pixels: int, lights: int, dtype: type) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(1)
    normal = rng.normal(size=(3, pixels + lights))
    normal /= np.linalg.norm(normal, axis=0)
    position = rng.uniform(-1, 1, (3, pixels + lights))
    packed = np.concatenate([position, -normal, rng.random((3, pixels + lights))])[:, pixels:]
    return tuple(np.ascontiguousarray(a, dtype) for a in (position[:, :pixels], normal[:, :pixels], packed))


def rows(quick: bool) -> Iterator[Row]:
    pixels, lights, repeats = (1 << 14, 512, 7) if quick else (1 << 16, 1024, 15)
    for dtype in (np.float32, np.float64):
        name = np.dtype(dtype).name
        position, normal, packed = room(pixels, lights, dtype)
        out = np.zeros_like(position)
        strict = partial(sum_pairs, position, normal, packed, None, True, out)
        freely = partial(sum_pairs_freely, position, normal, packed, out)
        against = ratio(freely, strict, repeats)
        rate = pixels * lights / against.seconds_b / 1e9
        yield Row(f"Eq. 2 strict {name}, speed over fastmath", against.median, "ratio",
                  ">= 0.85" if dtype is np.float32 else "",
                  f"{against.low:.2f} to {against.high:.2f}; {rate:.2f} G pairs/s")
        one = partial(on_threads, 1, strict)
        scaling = ratio(one, strict, repeats)
        yield Row(f"Eq. 2 strict {name}, {numba.get_num_threads()} threads over one", scaling.median, "ratio",
                  ">= 1.8" if dtype is np.float32 and numba.get_num_threads() > 1 else "",
                  f"{scaling.low:.2f} to {scaling.high:.2f}")
        clamp = Clamp(dtype(1e-4), np.zeros(lights, dtype), dtype(np.inf))
        clamped = partial(sum_pairs, position, normal, packed, clamp, True, out)
        yield Row(f"Eq. 2 {name} with a clamp, time over without", ratio(clamped, strict, repeats).median, "ratio")


def on_threads(count: int, function: partial) -> None:
    with threads(count):
        function()
