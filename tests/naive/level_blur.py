"""Slow literal twin of the blur of a level: the mean over a box of texels of one surface, by rows, then by columns."""

import numpy as np


def blurred(light, texels, size, plane_tolerance, cosine):
    """Return the mean light, (3, h, w); `texels` are those of `tests.naive.hssil`, `size` is the side of the box."""
    for down, right in ((0, 1), (1, 0)):
        light = along(light, texels, size, down, right, plane_tolerance, cosine)
    return light


def along(light, texels, size, down, right, plane_tolerance, cosine):
    """Return the mean over the texels at most half a box away in one direction, those that its rim halves by half."""
    height, width = len(texels), len(texels[0])
    mean = np.zeros(light.shape)
    for row in range(height):
        for column in range(width):
            here, total, weight = texels[row][column], np.zeros(3), 0.0
            for step in range(-size, size + 1):
                inside = min(1.0, max(0.0, (size + 1) / 2 - abs(step)))  # of the texel, by the box
                i, j = row + step * down, column + step * right
                if here is None or not inside or not (0 <= i < height and 0 <= j < width) or texels[i][j] is None:
                    continue
                there = texels[i][j]
                height_above = here["normal"] @ (there["place"] - here["place"])
                on_plane = abs(height_above) <= plane_tolerance * here["depth"]
                if step == 0 or (on_plane and here["normal"] @ there["normal"] >= cosine):
                    total += inside * light[:, i, j]
                    weight += inside
            mean[:, row, column] = total / weight if weight else 0.0
    return mean
