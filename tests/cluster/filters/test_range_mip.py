"""Bounds of the depths that a box can meet: never beyond them, and exact where the box is one texel or the map."""

import numpy as np
import pytest

from refgi.cluster.filters.range_mip import nearest_in_discs, range_in_box, range_mip_of, range_mips
from tests.cluster.filters import reads
from tests.naive import filters as naive


@pytest.mark.feature("VAL-16")
@pytest.mark.parametrize("n", [1, 2, 7, 16, 33])
def test_no_texel_of_a_disc_is_nearer(n, evidence):
    depth = np.stack([reads.random_map(n, np.float32, seed) for seed in range(2)])
    mip = range_mip_of.py_func(range_mips(depth), 1)
    s, t, radius = reads.random_discs(200, np.float32)
    s, t = np.clip(s, -1, 1), np.clip(t, -1, 1)
    found = np.full(200, np.nan, np.float32)
    nearest_in_discs(mip, s, t, radius, np.arange(200) != 3, 200, found)
    exact = np.array([naive.nearest_in_disc(depth[1], *map(float, disc)) for disc in zip(s, t, radius, strict=True)])
    assert np.isnan(found[3])
    found[3] = exact[3]
    assert (found <= exact).all()
    assert (found == exact).mean() > 0.3
    if n == 33:
        evidence(f"nearest depth of 200 discs: never beyond it, equal to it for {(found == exact).mean():.0%}")


@pytest.mark.parametrize("n", [1, 7, 16])
def test_bounds_of_boxes(n):
    depth = reads.random_map(n, np.float64)
    mip = range_mip_of.py_func(range_mips(depth[None]), 0)
    assert range_in_box(mip, -1.0, 1.0, -1.0, 1.0) == (depth.min(), depth.max())
    for i in range(n):
        for j in range(n):
            s, t = naive.centre(j, n), naive.centre(i, n)
            assert range_in_box(mip, s, s, t, t) == (depth[i, j], depth[i, j])
    rng = np.random.default_rng(5)
    for low, high in zip(rng.uniform(-1.2, 0.5, (50, 2)), rng.uniform(0, 1.2, (50, 2)), strict=True):
        high = low + high
        near, far = range_in_box(mip, low[0], high[0], low[1], high[1])
        centres = np.array([naive.centre(i, n) for i in range(n)])
        columns = (centres + 1 / n >= low[0]) & (centres - 1 / n <= high[0])
        rows = (centres + 1 / n >= low[1]) & (centres - 1 / n <= high[1])
        inside = depth[np.ix_(rows, columns)]
        assert inside.size == 0 or (near <= inside.min() and far >= inside.max())


def test_beyond_the_map_its_edge_is_met():
    depth = np.arange(16.0).reshape(4, 4)
    mip = range_mip_of.py_func(range_mips(depth[None]), 0)
    assert range_in_box(mip, 1.5, 2.0, -3.0, -2.0) == (3.0, 3.0)
    assert range_in_box(mip, np.nan, np.nan, -0.9, -0.9) == (0.0, 0.0)
