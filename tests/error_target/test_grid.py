"""Cells of levels, and the pixel that stands for each, against the literal text."""

import numpy as np
import pytest

from refgi.error_target.grid import level_shape, representatives, top_level
from refgi.literal import multires as literal

SIZES = [(1, 1), (1, 9), (13, 1), (8, 8), (21, 34)]


@pytest.mark.feature("AMS-10")
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("share", [0.0, 0.1, 0.6, 1.0])
def test_the_pixel_nearest_to_the_centre_stands_for_a_cell(size, share):
    covered = np.random.default_rng(1).random(size) < share
    expected = literal.representatives(np.where(covered, 0, -1), 5)
    for found, level in zip(representatives(covered, 5), expected, strict=True):
        np.testing.assert_array_equal(found, level)


@pytest.mark.feature("AMS-06", "AMS-07")
def test_the_papers_levels():
    assert [level_shape(1024, 1024, level) for level in (0, 1, 6)] == [(1024, 1024), (512, 512), (16, 16)]
    assert [top_level(1024, 1024, n) for n in (16, 8, 1024, 1)] == [6, 7, 0, 10]
    assert top_level(1, 1, 16) == 0
    assert top_level(1, 17, 16) == 1
    assert level_shape(17, 1, 4) == (2, 1)
