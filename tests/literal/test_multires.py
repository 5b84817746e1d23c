"""Refinement as literal text: cells and lists by hand, closed forms of planes and spheres."""

import math

import numpy as np
import pytest

from refgi.literal import multires

ROUNDING = 1e-12
HOLE = -1
LEVELS = 3


def ids(shown):
    return np.where(shown, 0, HOLE)


def test_ranges_of_a_picture_by_hand():
    depth = np.array([[1.0, 2, 9], [4, 5, 6], [7, 0.5, 3]])
    triangle_id = np.array([[0, 3, 1], [0, 0, 0], [0, HOLE, 0]])
    least, whole, largest, all_of_it = multires.depth_ranges(depth, triangle_id, 2, 0)
    assert least.tolist() == [[1, 6], [7, 3]]
    assert largest.tolist() == [[5, 9], [7, 3]]
    assert (whole.item(), all_of_it.item()) == (1, 9)
    least, largest = multires.depth_ranges(depth, triangle_id, 1, 1)
    assert least.tolist() == [[1, 2], [3, 3]]
    assert largest.tolist() == [[9, 9], [7, 6]]
    low, high = multires.normal_ranges(np.stack([depth, -depth, 2 * depth]), triangle_id, 1, 0, 2)
    assert low.tolist() == [[[1, 6], [7, 3]], [[-5, -9], [-7, -3]]]
    assert high.tolist() == [[[5, 9], [7, 3]], [[-1, -6], [-7, -3]]]
    assert multires.depth_ranges(depth[2:, 1:2], ids(False)[None, None], 1, 0) == [np.inf, -np.inf]


def test_the_slope_of_a_plane_is_its_gradient_but_not_across_holes():
    y, x = np.mgrid[:5, :6]
    depth, shown = 2 + 0.3 * x + 0.4 * y, np.ones((5, 6), bool)
    for slope in multires.slopes(depth, ids(shown), LEVELS, False):
        assert slope == pytest.approx(0.5)
    relative = multires.slopes(depth, ids(shown), 1, True)[0]
    assert relative == pytest.approx(0.5 / depth[::2, ::2])  # the nearest pixel of a cell is the steepest
    shown[:, 1::2] = False
    assert multires.slopes(depth, ids(shown), 1, False)[0] == pytest.approx(0.4)  # no neighbour left or right


@pytest.mark.parametrize("radius", [0.5, 3.0])
def test_curvature_over_distance_is_that_of_a_sphere(radius):
    y, x = (np.mgrid[:9, :7] - 4) / 8
    normal = np.stack([x, -y, np.sqrt(1 - x**2 - y**2)])
    shown = np.ones(x.shape, bool)
    for curvature in multires.curvatures(normal, radius * normal, ids(shown), LEVELS, True):
        assert curvature == pytest.approx(1 / radius)


@pytest.mark.parametrize("angle", [0.0, 10.0, 90.0, 180.0])
def test_curvature_is_the_printed_one(angle):
    """Eq. 1: 2 sin(arccos(N1 . N2) / 2)."""
    turned = math.radians(angle)
    normal = np.array([[0.0, 0, 1], [math.sin(turned), 0, math.cos(turned)]]).T[:, None]
    (chord,) = multires.curvatures(normal, 0 * normal, np.zeros((1, 2), int), 1, False)
    assert chord.item() == pytest.approx(2 * math.sin(turned / 2), abs=ROUNDING)


@pytest.mark.parametrize(("measure", "threshold", "split"), [
    ("absolute", 0.4, [True, True]), ("absolute", 0.6, [False, False]), ("relative", 0.2, [True, True]),
    ("relative", 0.3, [False, False]), ("demo", 0.1, [False, True]), ("demo", 0.05, [True, True])])
def test_ranges_of_depth_against_thresholds_by_hand(measure, threshold, split):
    """Depths 2 to 2.5 m in cells of levels 1 and 3: 0.5 m, a quarter of the least; demo: 3 t / level of it."""
    least, largest = [np.full((1, 1), 2.0)] * LEVELS, [np.full((1, 1), 2.5)] * LEVELS
    found = multires.discontinuities(LEVELS, 0, least, largest, depth_threshold=threshold, depth_measure=measure)
    assert [bool(found[level - 1].item()) for level in (1, 3)] == split


def test_any_test_marks_a_cell_and_the_finest_level_is_never_refined():
    one, other = np.array([[1.0, 0, 0]]), np.array([[0.0, 1, 0]])
    normals = np.stack([np.zeros((1, 3)), [[0.0, 0, 0.3]]])
    found = multires.discontinuities(
        2, 1, slope=[one, one], curvature=[other, other], normal_least=[0 * normals] * 2, normal_largest=[normals] * 2,
        slope_threshold=0.5, curvature_threshold=0.5, normal_threshold=0.25)
    assert not found[0].any()
    assert found[1].all()
    empty = np.full((2, 1, 3), np.inf)
    found = multires.discontinuities(1, 0, normal_least=[empty], normal_largest=[-empty], normal_threshold=0.25)
    assert not found[0].any()


@pytest.mark.parametrize(("rule", "cells"), [
    ("off", [(0, 0), (0, 1)]), ("corner", [(0, 0), (0, 1), (1, 2)]),
    ("literal", [(0, 0), (0, 1), (1, 0), (1, 1), (1, 2)]),
    ("full8", [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2)])])
def test_what_two_discontinuous_cells_refine_by_hand(rule, cells):
    marked, shown = np.zeros((3, 4), bool), np.ones((6, 8), bool)
    marked[0, :2] = True
    (states,) = multires.states([marked], ids(shown), rule)
    assert list(map(tuple, np.argwhere(states == multires.REFINED).tolist())) == cells
    shown[2:4, 4:6] = False
    (states,) = multires.states([marked], ids(shown), rule)
    assert states[1, 2] == multires.EMPTY


def test_subsplats_by_hand():
    """A picture of 3 x 5 pixels: one cell of level 1 refined in the first of level 2, nothing shown at the right."""
    shown = np.ones((3, 5), bool)
    shown[:, 4] = shown[0, 0] = False
    states = [np.array([[2, 1, 0], [1, 1, 0]]), np.array([[2, 0]])]
    level, row, column, pixel = multires.subsplats(ids(shown), states, 0)
    assert list(zip(level, row, column, strict=True)) == [(0, 0, 1), (0, 1, 0), (0, 1, 1), (1, 0, 1), (1, 1, 0),
                                                          (1, 1, 1)]
    assert pixel.tolist() == [1, 5, 6, 8, 11, 13]
    assert multires.subsplats(ids(shown), states, 1)[0].tolist() == [1, 1, 1, 1]


@pytest.mark.parametrize("rule", ["off", "corner", "literal", "full8"])
def test_subsplats_tile_the_surfaces(rule):
    rng = np.random.default_rng(1)
    shown, times = rng.random((19, 14)) < 0.6, np.zeros((19, 14), int)
    marks = [rng.random(multires.grid(shown.shape, level)) < 0.4 for level in range(1, LEVELS + 1)]
    cells = zip(*multires.subsplats(ids(shown), multires.states(marks, ids(shown), rule), 0), strict=True)
    for level, i, j, pixel in cells:
        inside = np.s_[i << level : i + 1 << level, j << level : j + 1 << level]
        times[inside] += 1
        assert shown.flat[pixel]
        assert pixel in np.arange(shown.size).reshape(shown.shape)[inside]
    assert times.max() == 1
    assert (times[shown] == 1).all()


def test_representative_pixels_by_hand():
    shown = np.ones((4, 6), bool)
    assert multires.representative(shown, 2, 0, 0) == 2 * 6 + 2
    assert multires.representative(shown, 2, 0, 1) == 2 * 6 + 5  # the centre lies beyond the border
    shown[2, 2] = False
    assert multires.representative(shown, 2, 0, 0) == 1 * 6 + 2  # of four equally near ones the upper
    shown[1, 2] = False
    assert multires.representative(shown, 2, 0, 0) == 2 * 6 + 1  # then the left
    shown[:, :4] = False
    assert multires.representatives(ids(shown), 2)[2].tolist() == [[-1, 2 * 6 + 5]]
