"""Maps and discs that the tests of the filters read."""

import numpy as np

from refgi.cluster.filters.basis import DepthScale
from refgi.cluster.filters.mip import build_mip, mip_means, mip_of, mips
from refgi.cluster.filters.prefilter import brute_means, brutes, build_brute
from refgi.literal.val_maps import basis, series_depth
from tests.cluster.filters.sat import build_sat, sat_means, sats

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
