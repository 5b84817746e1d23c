"""Maps and discs that the tests of the filters read, and summed areas of the basis."""

import numpy as np

from refgi.cluster.filters.basis import DepthScale
from refgi.cluster.filters.mip import mip_means
from refgi.cluster.filters.mip_build import build_mip
from refgi.cluster.filters.prefilter import brute_means, brutes, build_brute
from refgi.cluster.filters.pyramid import mip_of, mips
from refgi.literal.val_maps import basis, map_depths

MOST = 0.85  # far end of the range of depths


def linear(per_metre):
    """A scale of depths that starts at 0 m."""
    return DepthScale(False, 0.0, per_metre, MOST)


def texels(depth, terms, per_metre=MOST / 4, in_bytes=False, mirrored=False):
    """Return the literal basis (1, C, n, n) of one map."""
    scale = np.zeros(1), np.array([per_metre]), np.array([MOST]), False
    return basis(map_depths(np.asarray(depth, float)[None], *scale, mirrored), terms, in_bytes)


def sat_means(discs, channels):
    """Return means of a map's channels (C, n, n) over boxes around discs, (C, count), by sums above and to the left."""
    n = channels.shape[-1]
    sums = np.pad(channels, ((0, 0), (1, 0), (1, 0))).cumsum(axis=1).cumsum(axis=2)
    s, t, half = np.asarray(discs[0], float), np.asarray(discs[1], float), np.maximum(0.5, discs[2] * n / 2)

    def up_to(y, x):
        i, j = (np.minimum(place.astype(int), n - 1) for place in (y, x))
        rows = [sums[:, i + k, j] + (x - j) * (sums[:, i + k, j + 1] - sums[:, i + k, j]) for k in (0, 1)]
        return rows[0] + (y - i) * (rows[1] - rows[0])

    (left, right), (top, bottom) = ([np.clip(np.clip(n * (c + 1) / 2, 0, n) + side * half, 0, n) for side in (-1, 1)]
                                    for c in (s, t))
    total = up_to(bottom, right) - up_to(bottom, left) - up_to(top, right) + up_to(top, left)
    return total / ((right - left) * (bottom - top))


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


def brute(depth, terms, per_metre=MOST / 4, **options):
    """Build the basis of one map."""
    filled = brutes(len(depth), terms, depth.dtype, **options)
    build_brute(depth, linear(per_metre), filled)
    return filled


def means(filters, discs, terms, *, with_z=True, wanted=None, count=None):
    """Read discs into an array of NaN with three lanes to spare."""
    s, t, radius = discs
    out = np.full((4 * terms + 1 if with_z else 2 * terms, len(s)), np.nan, s.dtype)
    wanted = np.ones(len(s), bool) if wanted is None else wanted
    read = mip_means if type(filters).__name__ == "Mip" else brute_means
    read(filters, s, t, radius, wanted, len(s) if count is None else count, with_z, out)
    return out
