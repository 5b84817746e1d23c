"""The geometry-aware blur against its literal text, and what it must not do."""

import numpy as np
import pytest

from refgi.cluster.geometry_blur import blur
from refgi.cluster.settings import BoxBlur, GeometryBlur
from refgi.jit import threads
from refgi.literal import val_filters as literal
from refgi.pairs.irradiance import Receivers
from refgi.rsm.buffers.extent import Extent

ROUNDING = 1e-12  # of means of some dozen float64 values, relative to the largest
ROUNDING_SINGLE = 2e-6  # the same of float32: 64 differences, half a unit of rounding each
DIAGONAL = 10.0  # m: an extent of 1 m as published
BOX = Extent(np.zeros(3), np.array([DIAGONAL, 0, 0]))
BETWEEN = 0.103  # of the diagonal: no two pixels of `rough` are this far apart, so that rounding does not decide


def blurred(light, position, normal, covered, side, extent, cosine, every_subset=False):
    """Return the literal mean; `extent`, m."""
    box = np.array([[0.0, 0, 0], [1, 0, 0]])
    return literal.blur(light, position, normal, np.where(covered, 0, -1), box, side, extent, cosine, every_subset)


def plane(height, width, real=np.float64):
    """Return a plane that faces the camera, a pixel every tenth of a metre."""
    y, x = np.mgrid[:height, :width].astype(real)
    position = np.stack([x / 10, -y / 10, np.zeros_like(x)])
    normal = np.zeros_like(position)
    normal[2] = 1
    return Receivers(position, normal, np.ones((height, width), bool))


def rough(rng, height, width, real=np.float64):
    """Return pixels on two depths, turned at random, some of them without surface."""
    flat = plane(height, width, real)
    position = flat.position + np.array([0, 0, 1]).reshape(3, 1, 1) * rng.choice([0.0, 0.9, 2.0], (height, width))
    normal = flat.normal + rng.normal(size=flat.normal.shape) * 0.4
    normal /= np.linalg.norm(normal, axis=0)
    covered = rng.random((height, width)) > 0.1
    return Receivers(position.astype(real), (normal * covered).astype(real), covered)


@pytest.mark.feature("VAL-24")
@pytest.mark.parametrize(("height", "width", "side"), [(19, 77, 8), (7, 5, 8), (1, 1, 3), (21, 67, 5), (18, 130, 1)])
def test_equals_the_literal_text(height, width, side, evidence):
    rng = np.random.default_rng(height)
    to, light = rough(rng, height, width), rng.random((3, height, width))
    plain, full = (blurred(light, *to, side, BETWEEN * DIAGONAL, 0.8, every) for every in (False, True))
    error, farther = (np.abs(blur(light, to, side, GeometryBlur(BETWEEN, 0.8, every), BOX) - expected).max()
                      for every, expected in ((False, plain), (True, full)))
    evidence(f"{width} x {height}, n = {side}: {error:.1e} off the literal text, {farther:.1e} with every subset")
    assert max(error, farther) < ROUNDING
    assert (np.abs(full - plain).max() > 0.05) == (side > 1 and height > side)
    # any normal: what has no surface has none, and is to be left out for that
    around = blurred(light, *to, side, BETWEEN * DIAGONAL, -np.inf, every_subset=True)
    assert np.abs(blur(light, to, side, GeometryBlur(BETWEEN, -1.0), BOX) - around).max() < ROUNDING
    box = blur(light, to, side, BoxBlur(), BOX)
    assert np.abs(box - blurred(light, *to, side, np.inf, -2.0)).max() < ROUNDING


@pytest.mark.feature("VAL-24")
@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("across", [False, True])
def test_a_step_along_one_axis_parts_two_surfaces(axis, sign, across, evidence):
    """Pixels of one normal and two places, one axis and one way apart; none of the tile's first row lies beyond."""
    rng = np.random.default_rng(8)
    y, x = np.mgrid[:16, :24]
    position = np.zeros((3, 16, 24))
    position[axis] = 3.0 * sign * (x >= 14 if across else y >= 11)
    normal = np.zeros_like(position)
    normal[axis - 1] = 1
    to, light = Receivers(position, normal, np.ones((16, 24), bool)), rng.random((3, 16, 24))
    expected, every = blurred(light, *to, 8, 1.0, 0.8), blurred(light, *to, 8, 1.0, 0.8, every_subset=True)
    error = max(np.abs(blur(light, to, 8, GeometryBlur(every_subset=some), BOX) - picture).max()
                for some, picture in ((False, expected), (True, every)))
    mixed = np.abs(blur(light, to, 8, BoxBlur(), BOX) - expected).max()
    evidence(f"axis {axis}, {sign:+d}: {error:.0e} off the literal text, where a mean of all is {mixed:.2f} off")
    assert error < ROUNDING
    assert mixed > 0.05


@pytest.mark.feature("VAL-24")
@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_a_constant_stays_to_the_bit(real, evidence):
    rng = np.random.default_rng(3)
    for to in (plane(33, 70, real), rough(rng, 33, 70, real)):
        light = np.broadcast_to(np.array([0.1, 1 / 3, 7e5], real).reshape(3, 1, 1), to.position.shape)
        result = blur(light, to, 8, GeometryBlur(), BOX)
        assert np.array_equal(result, np.where(to.covered, light, 0))
    evidence("constant field: 0 bits of difference")


@pytest.mark.feature("VAL-24")
def test_nothing_leaks_across_an_edge(evidence):
    flat = plane(40, 90, np.float32)
    right = np.arange(90) >= 45
    light = np.where(right, np.float32(1e6), np.float32(0.1)) * np.ones((3, 40, 90), np.float32)
    deep = flat._replace(position=flat.position - 1.5 * np.array([0, 0, 1], np.float32).reshape(3, 1, 1) * right)
    turned = flat._replace(normal=np.where(right, np.array([1, 0, 0], np.float32).reshape(3, 1, 1), flat.normal))
    for to in (deep, turned):
        assert np.array_equal(blur(light, to, 8, GeometryBlur(), BOX), light)
    assert not np.array_equal(blur(light, flat, 8, GeometryBlur(), BOX), light)
    evidence("a step of 1e7 across an edge in depth, in normal: 0 bits leak")


@pytest.mark.feature("VAL-24")
@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_without_comparisons_where_bounds_decide(real):
    """A tile whose pixels all count has the bits of one that compares them: an edge far below changes none above."""
    rng = np.random.default_rng(4)
    to, light = plane(64, 128, real), rng.random((3, 64, 128)).astype(real)
    below = to._replace(normal=to.normal.copy())
    below.normal[:, 60:] = np.array([1, 0, 0]).reshape(3, 1, 1)
    for side in (8, 5):
        large = BOX._replace(high=10 * BOX.high)
        alike, compared = (blur(light, some, side, GeometryBlur(), large) for some in (to, below))
        assert np.array_equal(alike[:, :56], compared[:, :56])
        assert not np.array_equal(alike[:, 57:], compared[:, 57:])


@pytest.mark.slow
def test_single_precision_and_threads():
    rng = np.random.default_rng(5)
    to, light = rough(rng, 50, 150), rng.random((3, 50, 150)).astype(np.float32)
    near = Receivers(to.position.astype(np.float32), to.normal.astype(np.float32), to.covered)
    with threads(1):
        one = blur(light, near, 8, GeometryBlur(BETWEEN), BOX)
    assert np.array_equal(one, blur(light, near, 8, GeometryBlur(BETWEEN), BOX))
    position, extent = near.position.astype(np.float64), BETWEEN * DIAGONAL
    exact = blurred(light, position, near.normal, near.covered, 8, extent, 0.8, every_subset=True)
    off = np.abs(one - exact).max(axis=0)
    # where a comparison is decided by rounding, another set of pixels counts
    assert (off > ROUNDING_SINGLE).mean() < 1e-3


@pytest.mark.feature("VAL-24")
@pytest.mark.parametrize("edge", ["left", "top", "corner", "slanted"])
def test_beside_an_edge_every_subset_counts_once(edge, evidence):
    """A surface whose light is one number for each subset: its mean everywhere, however the edge cuts the windows."""
    y, x = np.mgrid[:48, :64]
    ahead = {"left": x >= 21, "top": y < 19, "corner": (x >= 21) & (y < 35), "slanted": 2 * x > y + 30}[edge]
    to = plane(48, 64)
    to = to._replace(position=to.position + np.array([0, 0, 3.0]).reshape(3, 1, 1) * ahead)
    subset = y % 8 * 8 + x % 8
    light = np.where(ahead, subset, 100.0 + subset) * np.ones((3, 1, 1))
    mean = np.where(ahead, 31.5, 131.5)
    settings = GeometryBlur(extent=0.25)  # 2.5 m: farther along the surface, not across the step
    left_out = np.abs(blur(light, to, 8, GeometryBlur(0.25, every_subset=False), BOX) - mean).max()
    error = np.abs(blur(light, to, 8, settings, BOX) - mean).max()
    evidence(f"{edge} edge: off by {error:.0e} of subsets 0 to 63, by {left_out:.1f} without those that windows miss")
    assert error < ROUNDING * 200
    assert left_out > 1
