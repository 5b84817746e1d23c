"""Joint bilateral upsampling written out, each of its parts a keyword, to put bugs into (docs/methods/hssil).

A texel of the 3 x 3 around a pixel weighs tent * (1 - delta^2 / (32 sigma^2))^16 * cosine^p, delta = z (1/z' - d) with
d the nearness of the pixel's plane at the point that the texel stands for.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from refgi.sssil.settings import Bilateral
from refgi.vectors.spec import Array, Arrays

Pair = tuple[float, float]  # along rows, that is downwards, and along columns
LEAST = 1e-20  # sum of weights that is too small to divide by


def tent(step: int, t: Array) -> Array:
    """Return the weight of the texel `step` places on about a place `t` texels from the middle one."""
    half = np.where(np.abs(t) < 0.5, (4 + np.abs(t)) / 3, 1.0)
    parts = [np.clip(1 - np.abs(t - place) / half, 0, None) for place in (-1, 0, 1)]
    return np.asarray(parts[step + 1] / sum(parts))


def distance_of(z: Array, there: Array, plane: Array) -> Array:
    """Return delta: z (1/z' - d)."""
    return np.asarray(z * (1 / there - plane))


def closeness(delta: Array, sigma: float) -> Array:
    """Return the gaussian of delta as a power of 16."""
    return np.asarray(np.clip(1 - delta**2 / (32 * sigma**2), 0, None) ** 16)


def likeness(cosine: Array, power: float) -> Array:
    """Return the weight of normals."""
    return np.asarray(np.clip(cosine, 0, None) ** power)


def bilateral(
    arrays: Arrays, coarse: str, below: tuple[str, ...], here: tuple[str, ...], weights: Bilateral, *,
    per_texel: bool = True, sloped: Pair = (1.0, 1.0), corner: Pair = (1.0, 1.0), begin: Pair = (0.5, 0.5),
    whole: Pair = (1.0, 1.0), kinds: tuple[str, str] = ("smaller", "smaller"), swapped: bool = False,
    crossed: bool = False, tents: Callable[[int, Array], Array] = tent, delta_of: Callable[..., Array] = distance_of,
    close: Callable[[Array, float], Array] = closeness, like: Callable[[Array, float], Array] = likeness,
    divided: str = "weights", fallback: str = "nearest", steps: tuple[int, ...] = (-1, 0, 1), corners: bool = True,
    edge: bool = False, rounded: bool = False, of_own: str = "", pixel: str = "",
) -> Array:
    """Return upsampled light, in float64, with a bug; pairs are of the axes downwards and to the right."""
    light, far, up = (np.asarray(arrays[name], np.float64) for name in (coarse, *below))
    depth, normal = (np.asarray(arrays[name], np.float64) for name in here)
    factor = next(n for n in (2, 4, 8, 16, 32) if far.shape == tuple(-(-size // n) for size in depth.shape))
    seen, z = np.isfinite(depth), np.where(np.isfinite(depth), depth, 1.0)
    places, slopes = [], []
    for axis in (0, 1):
        slope = slope_of(np.where(seen, 1 / z, 0), axis, kinds[axis])
        offset = whole[axis] * ((np.arange(depth.shape[axis]) % factor + begin[axis]) / factor - 0.5)
        shift = corner[axis] * (factor - 1) / (2 * factor) * np.sign(slope)
        places.append((offset[:, None] if axis == 0 else offset) - shift)
        slopes.append(sloped[axis] * (factor if per_texel else 1) * slope)
    total, mass, shape = np.zeros((3, *depth.shape)), np.zeros(depth.shape), np.zeros(depth.shape)
    nearest, least, count = np.zeros_like(total), np.full(depth.shape, np.inf), np.zeros(depth.shape)
    row, column = (np.indices(depth.shape) + (factor // 2 if rounded else 0)) // factor
    own = np.clip(row, 0, far.shape[0] - 1), np.clip(column, 0, far.shape[1] - 1)
    normal = up[:, *own] if pixel == "normal" else normal
    for dy, dx in ((dy, dx) for dy in steps for dx in steps if corners or not dy or not dx):
        i, j = np.clip(row + dy, 0, far.shape[0] - 1), np.clip(column + dx, 0, far.shape[1] - 1)
        there = ((i == row + dy) & (j == column + dx) | edge) & np.isfinite(far[i, j]) & seen
        ways = (dx, dy) if crossed else (dy, dx)
        plane = 1 / z + (ways[0] - places[0]) * slopes[0] + (ways[1] - places[1]) * slopes[1]
        behind = far[own] if of_own == "depth" else far[i, j]
        delta = delta_of(z, np.where(there & np.isfinite(behind), behind, 1.0), plane)
        closer = there & (np.abs(delta) < least)
        nearest, least = np.where(closer, light[:, i, j], nearest), np.where(closer, np.abs(delta), least)
        cosine = (normal * (up[:, *own] if of_own == "normal" else up[:, i, j])).sum(axis=0)
        ty, tx = places[::-1] if swapped else places
        spread = tents(dy, ty) * tents(dx, tx) * there
        weight = spread * close(delta, weights.depth_sigma) * like(cosine, weights.normal_power)
        total, mass = total + weight * light[:, i, j], mass + weight
        shape, count = shape + spread, count + there
    found = mass > LEAST
    by = {"weights": mass, "tents": shape, "count": count, "": np.ones_like(mass)}[divided]
    if fallback == "own":
        nearest = light[:, *own]
    nearest = np.zeros_like(nearest) if fallback == "none" else nearest
    mean = np.where(found, total / np.where(found, by, 1.0), nearest)
    return np.asarray(np.where(seen, mean, 0))


def slope_of(nearness: Array, axis: int, kind: str = "smaller") -> Array:
    """Return the smaller of two differences along an axis, 0 where they disagree or a neighbour sees nothing.

    `kind` names a bug: another choice of the two.
    """
    padded = np.pad(nearness, [(1, 1) if k == axis else (0, 0) for k in (0, 1)], mode="reflect", reflect_type="odd") \
        if nearness.shape[axis] > 1 else np.repeat(nearness, 3, axis)
    before, after = np.take(padded, range(nearness.shape[axis]), axis), np.take(
        padded, range(2, nearness.shape[axis] + 2), axis)
    first, second = nearness - before, after - nearness
    known = (before > 0) & (after > 0) & (nearness > 0)
    agree = first * second > 0
    if kind == "rim":
        inside = np.arange(nearness.shape[axis])
        known &= np.expand_dims((inside > 0) & (inside < nearness.shape[axis] - 1), 1 - axis)
    smaller = np.abs(first) < np.abs(second)
    ways: dict[str, Any] = {
        "smaller": np.where(smaller, first, second) * agree, "rim": np.where(smaller, first, second) * agree,
        "larger": np.where(smaller, second, first) * agree, "mean": (first + second) / 2, "before": first,
        "after": second, "unsigned": np.where(smaller, first, second), "both": (first + second) * agree}
    return np.asarray(np.where(known, ways[kind], 0))
