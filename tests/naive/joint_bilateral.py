"""Slow literal twin of half resolution by a joint bilateral filter (SII Table 3), pixel by pixel in float64."""

import numpy as np

LEAST_WEIGHT = 0.05  # of 1; a pixel whose blocks weigh less keeps its own light


def joint_bilateral(receivers, light):
    """Return light (3, h, w) as it is made from one pixel of each 2 x 2, the first covered one.

    Weights are bilinear times max(0, n . n_k)^8 (1 - |n . (x_k - x)| / |x_k - x|)^2.
    """
    position, normal, covered = receivers.position, receivers.normal, receivers.covered
    chosen, result = block_pixels(covered), np.zeros(light.shape)
    for i, j in np.argwhere(covered):
        total, weights = np.zeros(3), 0.0
        for row, down in ((i // 2, 1 - i % 2 / 2), (i // 2 + 1, i % 2 / 2)):
            for column, across in ((j // 2, 1 - j % 2 / 2), (j // 2 + 1, j % 2 / 2)):
                place = chosen.get((row, column))
                if place is None:
                    continue
                step = position[:, *place] - position[:, i, j]
                away = np.linalg.norm(step)
                sine = min(1.0, abs(normal[:, i, j] @ step) / away) if away else 0.0
                cosine = max(0.0, normal[:, i, j] @ normal[:, *place])
                weight = down * across * cosine**8 * (1 - sine) ** 2
                weights, total = weights + weight, total + weight * light[:, *place]
        own = chosen[i // 2, j // 2] == (i, j)
        result[:, i, j] = light[:, i, j] if own or weights < LEAST_WEIGHT else total / weights
    return result


def block_pixels(covered):
    """Return the first covered pixel of each 2 x 2 block by its place, row by row; None where there is none."""
    height, width = covered.shape
    return {(top // 2, left // 2): next((place for place in ((i, j) for i in (top, top + 1) for j in (left, left + 1)
                                                             if i < height and j < width) if covered[place]), None)
            for top in range(0, height, 2) for left in range(0, width, 2)}
