"""Reading the mip map of convolution shadow maps by explicit 8-lane vectors, against plain loops.

Discs are those of penumbrae, from less than a texel to a quarter of the map.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from benchmarks.harness import Row, ratio
from refgi.cluster.filters import mip as reading
from refgi.cluster.filters.basis import DepthScale
from refgi.cluster.filters.mip import Mip, build_mip, mip_means, mip_of, mips
from refgi.jit import kernel

Array = Any
SIDE, LANES, READS, CHUNK = 256, 256, 400, 128
SCALE = DepthScale(False, 0.0, 0.2, 0.847)
AIM = ">= 1.3"  # what keeps the vectors


def rows(quick: bool) -> Iterator[Row]:
    rng = np.random.default_rng(1)
    depth = rng.uniform(0.2, 4.0, (SIDE, SIDE)).astype(np.float32)
    discs = (*rng.uniform(-0.7, 0.7, (2, LANES)).astype(np.float32),
             (10 ** rng.uniform(-2.5, -0.6, LANES)).astype(np.float32))
    for terms, aim in ((4, AIM), (16, "")):
        mip = mip_of.py_func(mips(1, SIDE, terms, np.float32, shift=-1.0, mirrored=True), 0)
        build_mip(depth, SCALE, mip)
        yield _row(mip, discs, aim, 5 if quick else 15)


def _row(mip: Mip, discs: Any, aim: str, repeats: int) -> Row:
    active, shape = np.ones(LANES, np.bool_), (4 * mip.terms + 1, LANES)
    by_vectors, by_loops = np.empty(shape, np.float32), np.empty(shape, np.float32)

    def read(means: Any, out: Array) -> None:
        for _ in range(READS):
            means(mip, *discs, active, LANES, True, out)

    found = ratio(lambda: read(plain_means, by_loops), lambda: read(mip_means, by_vectors), repeats)
    np.testing.assert_array_equal(by_vectors, by_loops)
    return Row(f"plain loops / 8-lane vectors, {mip.terms} terms", found.median, "", aim,
               f"{LANES} reads: {1e6 * found.seconds_a / READS:.0f} against {1e6 * found.seconds_b / READS:.0f} us")


@kernel
def plain_means(
    mip: Mip, s: Array, t: Array, radius: Array, active: Array, count: int, with_z: bool, out: Array
) -> None:
    whole, weights = np.empty((6, CHUNK), np.int32), np.empty((15, CHUNK), s.dtype)
    n, top, channels = len(mip.depth), len(mip.first) - 1, 2 * mip.terms
    for start in range(0, count, CHUNK):
        lanes = min(CHUNK, count - start)
        place = slice(start, start + lanes)
        reading._find_levels(mip.shift, n, top, s[place], t[place], radius[place], active[place], whole, weights)
        for which in range(2):
            reading._find_texels(n, top, lanes, which, whole, weights)
        some, direct = reading._find_starts(mip.first, active[place], whole)
        if not some:
            continue
        if direct:
            reading._part_map(lanes, whole, weights)
        _plain(mip.basis, channels, lanes, whole, weights, out, 0, start)
        if with_z:
            _plain(mip.basis_z, channels, lanes, whole, weights, out, channels, start)
            reading._sum_depths(mip.mean_depth, lanes, whole, weights, out, 2 * channels, start)
        if direct:
            reading.add_level_0(mip, with_z, lanes, whole, weights, out, start)


@kernel
def _plain(levels: Array, channels: int, lanes: int, whole: Array, weights: Array, out: Array, row: int,
           start: int) -> None:
    for lane in range(lanes):
        a, c = np.int64(whole[0, lane]), np.int64(whole[1, lane])
        b, d = a + np.int64(whole[2, lane]), c + np.int64(whole[3, lane])
        w0, w1, w2, w3 = weights[0, lane], weights[1, lane], weights[2, lane], weights[3, lane]
        w4, w5, w6, w7 = weights[4, lane], weights[5, lane], weights[6, lane], weights[7, lane]
        for k in range(channels):
            fine = (levels[a, k] * w0 + levels[a + 1, k] * w1) + (levels[b, k] * w2 + levels[b + 1, k] * w3)
            coarse = (levels[c, k] * w4 + levels[c + 1, k] * w5) + (levels[d, k] * w6 + levels[d + 1, k] * w7)
            out[row + k, start + lane] = fine + coarse
