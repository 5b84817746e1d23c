"""Slow literal twin of direct light at one point: a lamp's irradiance, and the look-up in its shadow map."""

import math

import numpy as np

from tests.naive.radiometry import spot_intensity


def irradiance(kind, lamp, point, normal, falloff="smoothstep"):
    """Return E of a "spot", "point" or "directional" lamp, unblocked; `lamp` holds its arrays by name."""
    if kind == "directional":
        toward = -lamp["direction"] / np.linalg.norm(lamp["direction"])
        return lamp["irradiance"] * max(0.0, normal @ toward)
    away = point - lamp["position"]
    far = math.sqrt(away @ away)
    intensity = lamp["intensity"]
    if kind == "spot":
        axis = lamp["direction"] / np.linalg.norm(lamp["direction"])
        inner, outer = (math.cos(angle) for angle in lamp["half_angles"])
        intensity = spot_intensity(intensity, axis @ away / far, inner, outer, falloff)
    return intensity * max(0.0, -(normal @ away) / far) / far**2


def texel(kind, origin, frame, half, rows, columns, point):
    """Return row, column and depth of a point on stacked "perspective" or "orthographic" maps; None if none has it."""
    for index in range(len(origin)):
        x, y, z = frame[index] @ (point - origin[index])
        if kind == "perspective":
            if z <= 0:
                continue
            x, y = x / z, y / z
        if abs(x) <= half[0] and abs(y) <= half[1]:
            row, column = (y / half[1] + 1) / 2 * rows, (x / half[0] + 1) / 2 * columns
            return index * rows + min(int(row), rows - 1), min(int(column), columns - 1), z
    return None


def reached(kind, origin, frame, half, shape, depth, position, point, normal):
    """Tell whether a map's light reaches a point, by the receiver-plane rule; `shape`: rows and columns of one map."""
    found = texel(kind, origin, frame, half, *shape, point)
    if found is None:
        return False
    row, column, far = found
    if not np.isfinite(depth[row, column]) or far <= depth[row, column]:
        return True
    above = normal @ (position[:, row, column] - point) - 1e-6 * far
    index, width = row // shape[0], 2 * max(half[0] / shape[1], half[1] / shape[0])
    along = frame[index, 2]
    if kind == "perspective":
        along = point - origin[index]
        width *= np.linalg.norm(along)
        along = along / np.linalg.norm(along)
    cosine = min(1.0, abs(along @ normal))
    return above <= 0.1 * width * (1 + min(math.sqrt(1 - cosine**2) / max(cosine, 1e-6), 10))
