"""Slow literal twins of texture look-ups: one texel after another, from the definitions on the page of scenes."""

import functools
import math

import numpy as np


def linear(code, most):
    """IEC 61966-2-1, one code."""
    share = code / most
    return share / 12.92 if share <= 0.04045 else ((share + 0.055) / 1.055) ** 2.4


def index(i, count, wrap):
    """The texel that stands for texel i: walk there one step at a time."""
    if wrap == "clamp":
        return max(0, min(count - 1, i))
    row = list(range(count)) if wrap == "repeat" else [*range(count), *reversed(range(count))]
    while i < 0:
        i += len(row)
    while i >= len(row):
        i -= len(row)
    return row[i]


def nearest(image, wrap, u, v):
    height, width = image.shape[:2]
    return image[index(math.floor(v * height), height, wrap[1]), index(math.floor(u * width), width, wrap[0])]


def bilinear(image, wrap, u, v):
    """Weights fall linearly from the centres at (i + 1/2) / n."""
    height, width = image.shape[:2]
    total = np.zeros(3)
    across, down = u * width - 0.5, v * height - 0.5
    for j in (math.floor(down), math.floor(down) + 1):
        for i in (math.floor(across), math.floor(across) + 1):
            weight = (1 - abs(across - i)) * (1 - abs(down - j))
            total += weight * image[index(j, height, wrap[1]), index(i, width, wrap[0])].astype(np.float64)
    return total


def halved(image):
    """The next level: each texel the mean of what it covers, parts of texels by their area."""
    height, width = image.shape[:2]
    rows, columns = max(1, height // 2), max(1, width // 2)
    result = np.zeros((rows, columns, 3))
    for j in range(rows):
        for i in range(columns):
            for y in range(height):
                for x in range(width):
                    high = min((j + 1) * height / rows, y + 1) - max(j * height / rows, y)
                    wide = min((i + 1) * width / columns, x + 1) - max(i * width / columns, x)
                    if high > 0 and wide > 0:
                        result[j, i] += high * wide * image[y, x] / (height / rows * width / columns)
    return result


@functools.cache
def pyramid(texels, shape):
    """The image, then each next level down to one texel."""
    levels = [np.frombuffer(texels).reshape(shape)]
    while levels[-1].shape[:2] != (1, 1):
        levels.append(halved(levels[-1]))
    return levels


def footprint(image, wrap, place, longest):
    """Mean of probes in the middle of equal parts of the parallelogram, each between the two levels around its size."""
    levels = pyramid(image.astype(np.float64).tobytes(), image.shape)
    u, v, ux, vx, uy, vy = place
    height, width = image.shape[:2]
    a, b = math.hypot(ux * width, vx * height), math.hypot(uy * width, vy * height)
    if max(a, b) <= 0.5:
        return bilinear(levels[0], wrap, u, v)
    part = max(1.2 * min(a, b), max(a, b) / longest, 0.5)
    across, down = max(1, math.ceil(a / part - 1e-6)), max(1, math.ceil(b / part - 1e-6))
    level = min(len(levels) - 1, max(0.0, math.log2(0.93 * max(a / across, b / down))))
    total = np.zeros(3)
    for j in range(down):
        for i in range(across):
            s, t = (i + 0.5) / across - 0.5, (j + 0.5) / down - 0.5
            for k, weight in ((math.floor(level), 1 - level % 1), (math.ceil(level), level % 1)):
                total += weight * bilinear(levels[k], wrap, u + s * ux + t * uy, v + s * vx + t * vy)
    return total / (across * down)


def barycentric(corners, origin, direction):
    """Where a ray meets a triangle's plane, as weights of its corners: Cramer's rule on corner weights and distance."""
    matrix = np.vstack([np.column_stack([corners.T, -np.asarray(direction)]), [1, 1, 1, 0]])
    return np.linalg.solve(matrix, [*origin, 1])[:3]
