"""Slow literal twin of upsampling between levels, pixel by pixel in float64.

Weights of three by three texels: tent * (1 - u/16)^16 * max(0, <n . n'>)^power, u = delta^2 / (2 sigma^2), where
(1 - u/16)^16, 0 from u = 16 on, stands for exp(-u). delta = z (1/z' - 1/z_plane): 1/z is linear in the picture along
planes. Light is an array (3, rows, columns), depth (rows, columns) with inf for no surface.
"""

import math

import numpy as np


def tent(step, t):
    """Weight of the texel before (-1), of the own (0) or the one after (1), t texels (-1 to 1) from the own's point."""
    half_width = (4 + abs(t)) / 3 if abs(t) < 0.5 else 1
    weights = [max(0.0, 1 - abs(t - place) / half_width) for place in (-1, 0, 1)]
    return weights[step + 1] / sum(weights)


def gauss(u):
    """What stands for exp(-u)."""
    return max(0.0, 1 - u / 16) ** 16


def offset(i, factor):
    """Where pixel i lies in its texel, -1/2 to 1/2 of it."""
    return (i % factor + 0.5) / factor - 0.5


def slope(depth, i, j, di, dj):
    """Change of 1/z from pixel to pixel along an axis: the smaller of two differences of the same sign, else 0."""
    here = 1 / depth[i, j]

    def difference(sign):
        row, column = i + sign * di, j + sign * dj
        if 0 <= row < depth.shape[0] and 0 <= column < depth.shape[1]:
            return None if math.isinf(depth[row, column]) else sign * (1 / depth[row, column] - here)
        return "edge"

    before, after = difference(-1), difference(1)
    if before == "edge" and after == "edge":
        return 0.0
    if before == "edge" or after == "edge":  # the slope goes on, unless it would pass infinity beyond the picture
        known, inward = (after, 1) if before == "edge" else (before, -1)
        return known if known is not None and here - inward * known > 0 else 0.0
    if before is None or after is None or before * after <= 0:
        return 0.0
    return before if abs(before) < abs(after) else after


def bilateral(light, below_depth, below_normal, depth, normal, factor, sigma=0.02, power=8.0, closest=True):
    """Irradiance of the pixels; closest: a texel's surface point is the nearest of its pixels, else its middle."""
    rows, columns = depth.shape
    result = np.zeros((3, rows, columns))
    for i in range(rows):
        for j in range(columns):
            if not math.isinf(depth[i, j]):
                result[:, i, j] = _pixel(light, below_depth, below_normal, depth, normal, factor, sigma, power, closest,
                                         i, j)
    return result


def _pixel(light, below_depth, below_normal, depth, normal, factor, sigma, power, closest, i, j):
    gx, gy = slope(depth, i, j, 0, 1), slope(depth, i, j, 1, 0)
    ty, tx = offset(i, factor), offset(j, factor)
    if closest:  # the nearest of the texel's pixels, at its corner, lies there
        tx, ty = (t - (factor - 1) / (2 * factor) * np.sign(g) for t, g in ((tx, gx), (ty, gy)))
    total, weights, nearest, least = np.zeros(3), 0.0, np.zeros(3), math.inf
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            row, column = i // factor + dy, j // factor + dx
            if not (0 <= row < below_depth.shape[0] and 0 <= column < below_depth.shape[1]):
                continue
            if math.isinf(below_depth[row, column]):
                continue
            plane = 1 / depth[i, j] + factor * ((dx - tx) * gx + (dy - ty) * gy)
            delta = depth[i, j] * (1 / below_depth[row, column] - plane)
            cosine = max(0.0, float(np.dot(normal[:, i, j], below_normal[:, row, column])))
            spatial = tent(dx, tx) * tent(dy, ty)
            weight = spatial * gauss(delta**2 / (2 * sigma**2)) * cosine**power
            total, weights = total + weight * light[:, row, column], weights + weight
            if abs(delta) < least:
                least, nearest = abs(delta), light[:, row, column]
    return total / weights if weights > 1e-20 else nearest


def bilinear(light, below_depth, depth, factor):
    """Bilinear mean of the four texels around a pixel, of those that see a surface."""
    rows, columns = depth.shape
    result = np.zeros((3, rows, columns))
    for i in range(rows):
        for j in range(columns):
            if math.isinf(depth[i, j]):
                continue
            total, weights = np.zeros(3), 0.0
            for row in range(below_depth.shape[0]):
                for column in range(below_depth.shape[1]):
                    y, x = abs((i + 0.5) / factor - row - 0.5), abs((j + 0.5) / factor - column - 0.5)
                    weight = max(0.0, 1 - y) * max(0.0, 1 - x) * (not math.isinf(below_depth[row, column]))
                    total, weights = total + weight * light[:, row, column], weights + weight
            result[:, i, j] = total / weights if weights > 0 else 0.0
    return result
