"""Slow literal twin of imperfect shadow maps: points one by one, texels one by one."""

import math

import numpy as np

from tests.naive.draws import draw

STREAM = 7  # of a light's points: this + 256 times its number
NEAR = 0.1
HORIZON = 1e-3
GRAZING = 0.05
GROWTH = 1.32471795724474602596  # g^3 = g + 1


def basis(n):
    """Return tangent and bitangent of a unit normal (Duff et al. 2017)."""
    sign = math.copysign(1.0, n[2])
    a = -1 / (sign + n[2])
    b = n[0] * n[1] * a
    return (1 + sign * n[0] ** 2 * a, sign * b, -sign * n[0]), (b, sign + n[1] ** 2 * a, -n[1])


def point_of(corners, area, share, a, b):
    """Return the point at a share of the area and at two numbers of its face, and the face's normal."""
    f, left = 0, share * sum(area)
    while left >= area[f] and f < len(area) - 1:
        left, f = left - area[f], f + 1
    a = math.sqrt(a)
    across = np.cross(corners[f][1] - corners[f][0], corners[f][2] - corners[f][0])
    point = (1 - a) * corners[f][0] + a * (1 - b) * corners[f][1] + a * b * corners[f][2]
    return point, across / np.linalg.norm(across)


def depth_map(corners, position, normal, number, points, side, levels, seed, splat=1.0):
    """Return the map of one light (side, side), m, and the radius of a point, m."""
    area = [np.linalg.norm(np.cross(b - a, c - a)) / 2 for a, b, c in corners]
    radius = math.sqrt(sum(area) / points / math.pi)
    depth = np.full((side, side), np.inf)
    tangent, bitangent = basis(normal)
    xi = [draw(seed, STREAM + 256 * number, i) for i in range(3)]
    for k in range(points):
        point, across = point_of(corners, area, (k + xi[0]) / points, (xi[1] + k / GROWTH) % 1,
                                 (xi[2] + k / GROWTH**2) % 1)
        d = point - position
        distance, z = np.linalg.norm(d), d @ normal
        if z <= HORIZON * distance or distance <= radius:
            continue
        s, t = d @ tangent / (distance + z), d @ bitangent / (distance + z)
        # of a disc that looks as large; d(tan(theta / 2)) = (1 + tan^2(theta / 2)) / 2 d(theta)
        half = splat * radius * math.sqrt(abs(d @ across) / distance) / distance * (1 + s * s + t * t) / 2
        centres = (np.arange(side) + 0.5) / side * 2 - 1
        columns, rows = np.abs(centres - s) <= half, np.abs(centres - t) <= half
        if not columns.any():
            columns[min(side - 1, int((s + 1) / 2 * side))] = True
        if not rows.any():
            rows[min(side - 1, int((t + 1) / 2 * side))] = True
        box = np.outer(rows, columns)
        depth[box] = np.minimum(depth[box], distance)
    return filled(depth, levels), radius


def filled(depth, levels):
    """Return a map with its holes of up to 2^levels texels filled."""
    if levels == 0:
        return depth
    side = len(depth)
    coarse = np.full((side // 2, side // 2), np.inf)
    for i, j in np.ndindex(coarse.shape):
        coarse[i, j] = mean_of_nearest(depth[2 * i : 2 * i + 2, 2 * j : 2 * j + 2].ravel(), (1, 1, 1, 1))
    coarse, result = filled(coarse, levels - 1), depth.copy()
    for i, j in np.argwhere(np.isinf(depth)):
        # bilinear: the texel's centre lies at (i + 1/2) / 2 of the coarse one's
        tall, wide = taps(i, len(coarse)), taps(j, len(coarse))
        pairs = [(coarse[y, x], w * v) for y, w in tall for x, v in wide]
        result[i, j] = mean_of_nearest(*map(np.array, zip(*pairs, strict=True)))
    return result


def taps(i, side):
    """Return the two texels around a place, at the border the same one twice, and their weights."""
    at = (i + 0.5) / 2 - 0.5
    first = math.floor(at)
    return [(min(max(first, 0), side - 1), 1 - (at - first)), (min(max(first + 1, 0), side - 1), at - first)]


def mean_of_nearest(values, weights):
    """Return the weighted mean of those that are near the least; inf where all are."""
    values, weights = np.asarray(values, float), np.asarray(weights, float)
    if np.isinf(values).all():
        return np.inf
    near = values <= (1 + NEAR) * values.min()
    return (weights[near] * values[near]).sum() / weights[near].sum()


def is_hidden(depth, radius, bias, point, facing, position, normal):
    """Return whether a point before the light is farther than what its texel holds."""
    d = point - position
    distance, z = np.linalg.norm(d), d @ normal
    tangent, bitangent = basis(normal)
    s, t = d @ tangent / (distance + z), d @ bitangent / (distance + z)
    side = len(depth)
    texel = 2 / side * distance * 2 / (1 + s * s + t * t)
    column, row = (min(side - 1, int((u + 1) / 2 * side)) for u in (s, t))
    cosine = max(GRAZING, -(d @ facing) / distance)
    within = max(radius * math.sqrt(cosine), texel) * max(1, math.tan(math.acos(min(1, cosine))))
    return depth[row, column] < distance - bias * within
