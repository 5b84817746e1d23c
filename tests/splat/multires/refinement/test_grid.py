"""Cells of levels, and the pixel that stands for each, against loops over pixels."""

import math

import numpy as np
import pytest

from refgi.splat.multires.refinement.grid import level_shape, representatives, top_level

SIZES = [(1, 1), (1, 9), (13, 1), (8, 8), (21, 34)]


def literal(covered, level, i, j):
    """The covered pixel of the cell nearest to the one right and below of its centre, the first in row order."""
    side = 2**level
    row, column = (min(side * place + side // 2, size - 1) for place, size in zip((i, j), covered.shape, strict=True))
    inside = [(y, x) for y in range(side * i, min(side * (i + 1), covered.shape[0]))
              for x in range(side * j, min(side * (j + 1), covered.shape[1])) if covered[y, x]]
    nearest = min(inside, key=lambda place: (math.dist(place, (row, column)), place), default=None)
    return -1 if nearest is None else nearest[0] * covered.shape[1] + nearest[1]


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("share", [0.0, 0.1, 0.6, 1.0])
def test_the_pixel_nearest_to_the_centre_stands_for_a_cell(size, share):
    covered = np.random.default_rng(1).random(size) < share
    for level, places in enumerate(representatives(covered, 5)):
        assert places.shape == (math.ceil(size[0] / 2**level), math.ceil(size[1] / 2**level))
        assert places.tolist() == [[literal(covered, level, i, j) for j in range(places.shape[1])]
                                   for i in range(places.shape[0])]


def test_the_papers_levels():
    assert [level_shape(1024, 1024, level) for level in (0, 1, 6)] == [(1024, 1024), (512, 512), (16, 16)]
    assert [top_level(1024, 1024, n) for n in (16, 8, 1024, 1)] == [6, 7, 0, 10]
    assert top_level(1, 1, 16) == 0
    assert top_level(1, 17, 16) == 1
    assert level_shape(17, 1, 4) == (2, 1)
