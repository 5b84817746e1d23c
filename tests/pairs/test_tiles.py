"""The order that keeps neighbouring pixels together, against its definition."""

import numpy as np
import pytest

from refgi.pairs.tiles import block_by_block


def literal(covered):
    """Blocks of 16 row by row; within one 8 x 8 after 8 x 8, within these 4 x 4 after 4 x 4, row by row."""
    height, width = covered.shape
    places = []
    for top in range(0, height, 16):
        for left in range(0, width, 16):
            for eight in range(4):
                for four in range(4):
                    for pixel in range(16):
                        y = top + 8 * (eight // 2) + 4 * (four // 2) + pixel // 4
                        x = left + 8 * (eight % 2) + 4 * (four % 2) + pixel % 4
                        if y < height and x < width and covered[y, x]:
                            places.append(y * width + x)
    return places


@pytest.mark.parametrize("shape", [(16, 16), (32, 48), (33, 47), (15, 64), (1, 1), (3, 40)])
@pytest.mark.parametrize("share", [0.0, 0.5, 0.999, 1.0])
def test_pixels_go_block_by_block(shape, share):
    covered = np.random.default_rng(3).random(shape) < share
    assert block_by_block(covered).tolist() == literal(covered)
    nth = np.flatnonzero(np.random.default_rng(4).random(int(covered.sum())) < 0.3)  # few of them, or none
    assert block_by_block(covered, nth).tolist() == [literal(covered)[i] for i in nth]
