"""Maps and discs that the tests of the filters read, and summed areas of the basis.

The table holds the sum over all texels above and to the left of each corner, read bilinearly between: the exact mean
over the box of `brute`. Its sums are float64 whatever the map is: differences of 256^2 texels cost float32 5 digits.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.cluster.filters.basis import DepthScale, beyond_disc, fill_basis, fill_beyond, normalise
from refgi.cluster.filters.mip import mip_means
from refgi.cluster.filters.mip_build import build_mip
from refgi.cluster.filters.prefilter import brute_means, brutes, build_brute
from refgi.cluster.filters.pyramid import mip_of, mips
from refgi.jit import kernel
from refgi.literal.val_maps import basis, series_depth

Array = npt.NDArray[Any]


class Sat(NamedTuple):
    """Summed areas of all channels of a map."""

    depth: Array  # (n, n): t
    sums: Array  # (n + 1, n + 1, 4 M + 1) float64
    quantised: bool  # 8 bits for the basis, 16 for basis-z
    beyond: Array  # (count, 2) int32: texels beyond the unit disc and what they copy


def sats(size: int, terms: int, dtype: npt.DTypeLike, *, quantised: bool = False, mirrored: bool = False) -> Sat:
    """Make scratch for one map of n x n texels and M terms, not yet filled; as `mips`."""
    return Sat(np.zeros((size, size), dtype), np.zeros((size + 1, size + 1, 4 * terms + 1)), quantised,
               beyond_disc(size, mirrored))


@kernel
def build_sat(depth: Array, scale: DepthScale, sat: Sat) -> None:
    """Fill the table of one map of radial distances (n, n), m."""
    normalise(depth, scale, sat.depth)
    fill_beyond(sat.beyond, sat.depth)
    n, terms = len(depth), sat.sums.shape[2] // 4
    basis, basis_z = np.empty((1, n, 2 * terms), depth.dtype), np.empty((1, n, 2 * terms + 1), depth.dtype)
    along = np.empty(4 * terms + 1)
    for i in range(n):
        fill_basis(sat.depth[i : i + 1], terms, sat.quantised, basis, basis_z)
        along[:] = 0.0
        for j in range(n):
            for c in range(2 * terms):
                along[c] += basis[0, j, c]
            for c in range(2 * terms + 1):
                along[2 * terms + c] += basis_z[0, j, c]
            for c in range(4 * terms + 1):
                sat.sums[i + 1, j + 1, c] = sat.sums[i, j + 1, c] + along[c]


@kernel
def sat_means(
    sat: Sat, s: Array, t: Array, radius: Array, active: Array, count: int, with_z: bool, out: Array
) -> None:
    """Read the means over the box around a disc for each lane of a tile, as `mip.mip_means`."""
    n, terms = len(sat.depth), sat.sums.shape[2] // 4
    real = s.dtype.type
    channels = 4 * terms + 1 if with_z else 2 * terms
    for i in range(count):
        if not active[i]:
            continue
        half = max(0.5, 0.5 * radius[i] * n)
        x, y = min(max(0.0, 0.5 * n * (s[i] + 1.0)), 1.0 * n), min(max(0.0, 0.5 * n * (t[i] + 1.0)), 1.0 * n)
        left, right = max(x - half, 0.0), min(x + half, 1.0 * n)
        top, bottom = max(y - half, 0.0), min(y + half, 1.0 * n)
        area = (right - left) * (bottom - top)
        for c in range(channels):
            above = _read(sat.sums, top, right, c) - _read(sat.sums, top, left, c)
            below = _read(sat.sums, bottom, right, c) - _read(sat.sums, bottom, left, c)
            out[c, i] = real((below - above) / area)


@kernel
def _read(sums: Array, y: float, x: float, c: int) -> Any:
    """Return the sum above and to the left of a point, in texels."""
    last = sums.shape[0] - 2
    i, j = min(int(y), last), min(int(x), last)
    fy, fx = y - i, x - j
    above = sums[i, j, c] + fx * (sums[i, j + 1, c] - sums[i, j, c])
    below = sums[i + 1, j, c] + fx * (sums[i + 1, j + 1, c] - sums[i + 1, j, c])
    return above + fy * (below - above)


MOST = 0.85  # far end of the range of depths


def linear(per_metre):
    """A scale of depths that starts at 0 m."""
    return DepthScale(False, 0.0, per_metre, MOST)


def texels(depth, terms, per_metre=MOST / 4, in_bytes=False):
    """Return the literal basis (1, C, n, n) of one map."""
    return basis(depths(depth, per_metre)[None], terms, in_bytes)


def depths(depth, per_metre=MOST / 4):
    """Return the literal depths (n, n) of one map."""
    t = series_depth(np.asarray(depth, float)[None], np.zeros(1), np.array([per_metre]), np.array([MOST]), False)
    return t[0]


def random_map(n, dtype, seed=1):
    """Distances of 0.2 to 5 m, the corners and one texel more empty."""
    rng = np.random.default_rng(seed)
    depth = rng.uniform(0.2, 5, (n, n)).astype(dtype)
    depth[np.add.outer(np.square(np.arange(n) * 2 - n + 1), np.square(np.arange(n) * 2 - n + 1)) > n * n] = np.inf
    depth[0, n // 2] = np.inf
    return depth


def random_discs(count, dtype, seed=2):
    """Discs smaller than a texel to larger than the map, some of them beyond it; s, t, radius."""
    rng = np.random.default_rng(seed)
    return (*rng.uniform(-1.3, 1.3, (2, count)).astype(dtype), (10 ** rng.uniform(-2.5, 0.3, count)).astype(dtype))


def mip(depth, terms, per_metre=MOST / 4, **options):
    """Build the pyramid of one map."""
    filled = mip_of.py_func(mips(1, len(depth), terms, depth.dtype, **options), 0)
    build_mip(depth, linear(per_metre), filled)
    return filled


def sat(depth, terms, per_metre=MOST / 4, **options):
    """Build the summed areas of one map."""
    filled = sats(len(depth), terms, depth.dtype, **options)
    build_sat(depth, linear(per_metre), filled)
    return filled


def brute(depth, terms, per_metre=MOST / 4, **options):
    """Build the basis of one map."""
    filled = brutes(len(depth), terms, depth.dtype, **options)
    build_brute(depth, linear(per_metre), filled)
    return filled


MEANS = {"Mip": mip_means, "Sat": sat_means, "Brute": brute_means}


def means(filters, discs, terms, *, with_z=True, wanted=None, count=None):
    """Read discs into an array of NaN with three lanes to spare."""
    s, t, radius = discs
    out = np.full((4 * terms + 1 if with_z else 2 * terms, len(s)), np.nan, s.dtype)
    wanted = np.ones(len(s), bool) if wanted is None else wanted
    MEANS[type(filters).__name__](filters, s, t, radius, wanted, len(s) if count is None else count, with_z, out)
    return out
