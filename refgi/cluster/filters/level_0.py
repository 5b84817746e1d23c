"""Level 0 of a mip map, computed from the depths where it is read, by receivers whose discs are a few texels wide."""

from typing import Any

import numpy.typing as npt

from refgi.cluster.filters.basis import sine_cosine, turned
from refgi.cluster.filters.eight import room_of
from refgi.cluster.filters.pyramid import Mip
from refgi.cluster.filters.quantise import eight_bits, half_precision
from refgi.jit import kernel

Array = npt.NDArray[Any]

CHUNK = 128  # receivers whose texels and weights are kept at once
LEVEL, DIRECT = 4, 5  # rows of whole numbers: the finer level, and the first texel of the map where that is 0
MAP = 8  # first of 4 rows of weights of texels of the map
DEPTHS, SINES, COSINES, BY_SINES, BY_COSINES = (room_of(1, CHUNK) for _ in range(5))


@kernel
def add_level_0(mip: Mip, with_z: bool, lanes: int, whole: Array, weights: Array, out: Array, start: int) -> None:
    """Add what lanes read of the map itself; those that read none of it have weights of 0.

    Parameters
    ----------
    mip : Mip
        One map's pyramid.
    with_z : bool
        All 4 M + 1 channels instead of the first 2 M.
    lanes : int
        Lanes of the chunk.
    whole : (6, CHUNK) ndarray
        Int32; rows LEVEL and DIRECT count.
    weights : (15, CHUNK) ndarray
        Rows MAP to MAP + 3: of texels left and right, above and below.
    out : (channels, tile) ndarray
        Added to.
    start : int
        Lane of the tile that the chunk begins with.
    """
    if mip.quantised:
        _add_rounded(mip.depth, mip.terms, with_z, lanes, whole, weights, out, start)
    else:
        _add_exact(mip.depth, mip.terms, with_z, lanes, whole, weights, out, start)


@kernel
def _add_exact(
    depth: Array, terms: int, with_z: bool, lanes: int, whole: Array, weights: Array, out: Array, start: int
) -> None:
    depths, sines, cosines = DEPTHS(depth)[0], SINES(depth)[0], COSINES(depth)[0]
    by_sines, by_cosines = BY_SINES(depth)[0], BY_COSINES(depth)[0]
    for tap in range(4):
        _fetch(depth, tap, lanes, whole, depths)
        for lane in range(lanes):
            sine, cosine = sine_cosine(depths[lane])
            by_sines[lane], by_cosines[lane] = turned(sine, cosine, sine, cosine)
            sines[lane], cosines[lane] = weights[MAP + tap, lane] * sine, weights[MAP + tap, lane] * cosine
        for k in range(terms):
            _accumulate(sines, lanes, out[k], start)
            _accumulate(cosines, lanes, out[terms + k], start)
            if with_z:
                _accumulate_z(sines, depths, lanes, out[2 * terms + k], start)
                _accumulate_z(cosines, depths, lanes, out[3 * terms + k], start)
            for lane in range(lanes):
                sines[lane], cosines[lane] = turned(sines[lane], cosines[lane], by_sines[lane], by_cosines[lane])
        if with_z:
            _accumulate_z(weights[MAP + tap], depths, lanes, out[4 * terms], start)


@kernel
def _fetch(depth: Array, tap: int, lanes: int, whole: Array, depths: Array) -> None:
    n = len(depth)
    flat = depth.reshape(-1)
    step = tap // 2 * n + tap % 2
    for lane in range(lanes):
        depths[lane] = flat[min(whole[DIRECT, lane] + step, n * n - 1)]


@kernel
def _accumulate(values: Array, lanes: int, row: Array, start: int) -> None:
    for lane in range(lanes):
        row[start + lane] += values[lane]


@kernel
def _accumulate_z(values: Array, depths: Array, lanes: int, row: Array, start: int) -> None:
    for lane in range(lanes):
        row[start + lane] += values[lane] * depths[lane]


@kernel
def _add_rounded(
    depth: Array, terms: int, with_z: bool, lanes: int, whole: Array, weights: Array, out: Array, start: int
) -> None:
    flat, n = depth.reshape(-1), len(depth)
    for lane in range(lanes):
        if whole[LEVEL, lane] > 0:
            continue
        for tap in range(4):
            weight = weights[MAP + tap, lane]
            z = flat[min(whole[DIRECT, lane] + tap // 2 * n + tap % 2, n * n - 1)]
            sine, cosine = sine_cosine(z)
            by_sine, by_cosine = turned(sine, cosine, sine, cosine)
            for k in range(terms):
                out[k, start + lane] += weight * eight_bits(sine)
                out[terms + k, start + lane] += weight * eight_bits(cosine)
                if with_z:
                    out[2 * terms + k, start + lane] += weight * half_precision(z * sine)
                    out[3 * terms + k, start + lane] += weight * half_precision(z * cosine)
                sine, cosine = turned(sine, cosine, by_sine, by_cosine)
            if with_z:
                out[4 * terms, start + lane] += weight * half_precision(z)
