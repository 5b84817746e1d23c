"""Eq. 3 of SII, the sum over all pairs of glossy pixel light and receiver, against what the machine can do.

The yardsticks sum the same lobes straight, with every licence: fastmath, contraction to fused multiply-add, free order
of the lights, one receiver per iteration and the lights as lanes. One takes the power from the compiler, which calls
libm; the other from refgi's polynomials, which run in lanes, and is the faster. No light can be passed over here:
receivers of a tile lie and face anywhere. On a wall that sharp lobes light, most can.
"""

from collections.abc import Iterator
from functools import partial

import numba
import numpy as np
from numba import njit, prange

from benchmarks.eq2 import on_threads, room
from benchmarks.harness import Row, ratio, seconds
from refgi.elementary import exp2, log2p1
from refgi.pairs.lobe_sum import add_lobes
from refgi.pairs.pair_sum import Clamp

EXPONENTS = (20.0, 1000.0)


@njit(fastmath=True)
def power_of_libm(h, exponent):
    return (type(h)(1.0) - h) ** exponent


@njit(fastmath=True)
def power_in_lanes(h, exponent):
    return exp2(exponent * log2p1(-h))


def yardstick(power):
    @njit(parallel=True, fastmath=True, error_model="numpy")
    def add_lobes_freely(position, normal, lights, irradiance):
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

    return add_lobes_freely


def rows(quick: bool) -> Iterator[Row]:
    pixels, lights, repeats = (1 << 14, 256, 7) if quick else (1 << 16, 512, 15)
    in_lanes, of_libm = yardstick(power_in_lanes), yardstick(power_of_libm)
    for exponent in EXPONENTS:
        position, normal, packed = room(pixels, lights, np.float32)
        lobes = np.concatenate([packed[:6], packed[3:6], np.full((1, lights), exponent, np.float32), packed[6:]])
        clamp = Clamp(np.float32(0), np.zeros(lights, np.float32), np.float32(np.inf))
        out = np.zeros_like(position)
        strict = partial(add_lobes, position, normal, lobes, clamp, None, None, None, out)
        for free, how in ((in_lanes, "polynomials"), (of_libm, "libm")):
            freely = partial(free, position, normal, lobes, out)
            for threads in sorted({numba.get_num_threads(), 1}, reverse=True):
                against = ratio(partial(on_threads, threads, freely), partial(on_threads, threads, strict), repeats)
                rate = pixels * lights / against.seconds_b / 1e9
                yield Row(f"Eq. 3, P = {exponent:g}, speed over fastmath with {how}, threads: {threads}",
                          against.median, "ratio", ">= 0.6",
                          f"{against.low:.2f} to {against.high:.2f}; {rate:.2f} G pairs/s")
    yield from wall(quick)


def wall(quick: bool) -> Iterator[Row]:
    """Time 4096 sharp lobes over a picture of a wall: almost all terms are 0."""
    side, lights = (256, 1024) if quick else (512, 4096)
    across = (np.arange(side, dtype=np.float32) + 0.5) / side
    blocks = np.arange(side * side).reshape(side // 16, 16, side // 16, 16).transpose(0, 2, 1, 3).reshape(-1)
    position = np.stack([*(part.reshape(-1)[blocks] for part in np.meshgrid(across, across)), np.zeros(side * side)])
    position = np.ascontiguousarray(position, np.float32)
    normal = np.zeros_like(position)
    normal[2] = 1
    rng = np.random.default_rng(1)
    axis = np.concatenate([rng.normal(0, 0.3, (2, lights)), np.full((1, lights), -1.0)])
    axis /= np.linalg.norm(axis, axis=0)
    place = np.concatenate([rng.random((2, lights)), np.full((1, lights), 0.5)])
    for exponent in EXPONENTS:
        lobes = np.concatenate([place, -axis, -axis, np.full((1, lights), exponent), np.ones((3, lights))])
        clamp = Clamp(np.float32(0), np.zeros(lights, np.float32), np.float32(np.inf))
        took = seconds(partial(add_lobes, position, normal, lobes.astype(np.float32), clamp, None, None, None,
                               np.zeros_like(position)), 3)
        yield Row(f"{lights} lobes of exponent {exponent:g} over a wall of {side}^2", took * 1e3, "ms", "",
                  f"{side * side * lights / took / 1e9:.2f} G pairs/s, zeros included")
