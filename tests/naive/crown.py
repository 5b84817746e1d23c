"""Sums over the samples of a crown as Soler et al. 2009 write them down (Sec. 3): loops, float64, one pair at a time.

With the pi that Eq. 4 lacks in print: what stands for cos' ds / r^2 is pi R^2 / (r^2 + R^2), R^2 = cos' ds / pi.
"""

import math

import numpy as np


def pair(p, n, p_j, n_j, ds, form, covered=1.0):
    """What radiance of one sample is multiplied by (Eq. 3 and 4); the disc covers a part of its surface ds."""
    d = [b - a for a, b in zip(p, p_j, strict=True)]
    r = math.sqrt(sum(x * x for x in d))
    if r == 0.0:
        return 0.0
    cos_i = max(0.0, sum(a * b for a, b in zip(n, d, strict=True)) / r)
    cos_j = max(0.0, -sum(a * b for a, b in zip(n_j, d, strict=True)) / r)
    if form == "point":
        return cos_i * cos_j * ds / r**2
    square = cos_j * covered * ds / math.pi
    return math.pi * cos_i * square / (r**2 + square) / covered if square > 0 else 0.0


def gathered(level, samples_at, form, share=1.0):
    """Irradiance (3, h, w) of every texel; samples_at(row, column) gives (ox, oy) of samples and the texels of each.

    A disc covers a share of them, but at least one where there is one.
    """
    position, normal, radiance, area = (np.asarray(a, np.float64) for a in level)
    rows, columns = area.shape
    result = np.zeros((3, rows, columns))
    for row in range(rows):
        for column in range(columns):
            for (ox, oy), weight in zip(*samples_at(row, column), strict=True):
                a, b = row + int(oy), column + int(ox)
                if 0 <= a < rows and 0 <= b < columns and (a, b) != (row, column):
                    worth = pair(position[:, row, column], normal[:, row, column], position[:, a, b], normal[:, a, b],
                                 area[a, b] * weight, form, max(share, min(1.0, 1.0 / weight)))
                    result[:, row, column] += worth * radiance[:, a, b]
    return result


def share_inside(ox, oy, low, high, n=64):
    """Share of texel (ox, oy) whose points lie at a distance of [low, high) from the middle of texel (0, 0)."""
    at = (np.arange(n) + 0.5) / n - 0.5
    length = np.hypot(ox + at[None, :], oy + at[:, None])
    return ((length >= low) & (length < high)).mean()
