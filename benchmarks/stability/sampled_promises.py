"""Promises of sampled maps: sums of importance, points warped after it, discs of texels near a map's border.

References are literal: sums in extended precision by the borders floor(i H / 2^l) of docs, the identity that weight
times the mean of a point's cell is the mean of all maps, and a sum over texels found by floor.
"""

import math

import numpy as np

from benchmarks.stability.promise import Case, Promise
from refgi.errors import InputError
from refgi.lights.importance import importance_pyramid
from refgi.lights.warp import Warp, texel_of, warp_stacked
from refgi.splat.gather.gather_sum import GatherMap, disc_pattern, gather_discs
from refgi.types import Array

U = 2.0**-53
MOST_SIDE = 257  # texels of a drawn map
ROUNDINGS = 8  # of a weight, each level: sum, quotient and two products, down and across
TERM = 14 + 8  # of a term: those of Eq. 2, and 4 of 1 for each of both cosines
RECEIVERS = 64


def _cells(finest: Array, level: int) -> Array:
    """Return the sums of a level's cells in longdouble, from the texels."""
    sums = finest.astype(np.longdouble)
    for axis in (0, 1):
        ends = (np.arange((1 << level) + 1) * finest.shape[axis]) >> level
        running = np.concatenate([np.zeros_like(sums[:1]), np.cumsum(sums, axis=0)])
        sums = (running[ends[1:]] - running[ends[:-1]]).T  # of both axes in turn
    return sums


def _of_cells(finest: Array, level: int) -> Array:
    """Return, for each texel, the mean of the cell of a level that holds it."""
    count = _cells(np.ones_like(finest), level)
    mean = np.divide(_cells(finest, level), count, out=np.zeros_like(count), where=count > 0).astype(np.float64)
    for axis, size in enumerate(finest.shape):
        mean = np.repeat(mean, np.diff((np.arange((1 << level) + 1) * size) >> level), axis=axis)
    return mean


def sums(rng: np.random.Generator) -> Case:
    """Return how far the sums of a map's cells are from their texels, over the roundings that they take."""
    height, width = (int(2 ** rng.uniform(0, math.log2(MOST_SIDE))) for _ in range(2))
    real = rng.choice([np.float32, np.float64])
    texels = np.exp(rng.uniform(-3, 3, (height, width)))
    texels = np.where(rng.random(texels.shape) < 0.01, 1e12 * texels, texels).astype(real)
    texels[rng.random(texels.shape) < 0.2] = 0
    worst, at = 0.0, 0
    levels = importance_pyramid(texels)
    for level, found in enumerate(levels[:-1]):
        exact = _cells(texels, level)
        # running sums of the reference are off by 2^-64 of the whole map's
        lost = exact.sum() * np.longdouble(2.0**-64) * (height + width)
        off = np.maximum(np.abs(found - exact) - lost, 0)
        share = float((off / np.where(exact > lost, exact, np.inf)).max()) / (U * (height + width))
        worst, at = (share, level) if share > worst or math.isnan(share) else (worst, at)
    return Case(worst, f"{height} x {width} texels, {np.dtype(real).name}, level {at} of {len(levels) - 1}")


def warped(rng: np.random.Generator) -> Case:
    """Return how far weight times a cell's mean is from the whole mean, over its roundings; some maps are dark.

    Some points lie upon borders between maps, texels or at 0.
    """
    maps, height, width = int(rng.integers(1, 7)), *(int(n) for n in rng.integers(1, 40, 2))
    texels = np.floor(np.exp(rng.uniform(0, 10, (maps * height, width))))
    texels[rng.random(texels.shape) < 0.3] = 0
    dark = rng.random(maps) < 0.4
    dark[rng.integers(maps)] = False
    whole = texels.reshape(maps, height, width)
    whole[dark] = 0
    whole[np.flatnonzero(~dark)[0], 0, 0] += 1
    points = rng.random((200, 2))
    of_map = whole.sum(axis=(1, 2))
    ends = np.cumsum(of_map) / of_map.sum()
    points[:maps, 1] = np.minimum(np.concatenate([[0.0], ends[:-1]]), 1 - U)
    points[maps : 2 * maps, 1] = np.nextafter(points[:maps, 1], 0)
    points[:20] = np.where(rng.random((20, 2)) < 0.3, 0.0, points[:20])
    depth = int(rng.integers(0, max(height, width).bit_length() + 2))
    mean = np.concatenate([_of_cells(one, min(depth, (max(height, width) - 1).bit_length())) for one in whole])
    try:
        with np.errstate(all="ignore"):
            place, weight = warp_stacked(points, texels, maps, Warp("A", depth))
    except InputError as error:  # a place that is no number
        return Case(math.inf, f"{maps} maps of {height} x {width} texels, {int(dark.sum())} of them dark: {error}")
    here = mean[texel_of(place[:, 1], maps * height), texel_of(place[:, 0], width)]
    with np.errstate(all="ignore"):
        share = of_map.sum() / of_map[texel_of(place[:, 1], maps * height) // height]
        off = np.abs(weight * here / texels.mean() - 1) / (U * (ROUNDINGS * depth + 8 + 4 * share))
    worst = int(np.argmax(np.where(np.isnan(off), np.inf, off)))
    return Case(float(off[worst]), f"{maps} maps of {height} x {width} texels, {int(dark.sum())} of them dark, {depth} "
                f"levels: point {points[worst].tolist()}"
                f" of weight {weight[worst]:.6g} where importance is {here[worst]:g}, "
                f"mean {texels.mean():g}")


def discs(rng: np.random.Generator) -> Case:
    """Return how far sums over discs near a map's border are from literal ones, over the roundings they take."""
    real = rng.choice([np.float32, np.float64])
    height, width = (int(n) for n in rng.integers(1, 33, 2))
    shape = (3, height, width)
    normal = rng.normal(size=shape)
    source = GatherMap(*(np.ascontiguousarray(one, real) for one in (
        rng.uniform(-1, 1, shape), normal / np.linalg.norm(normal, axis=0), rng.random(shape))))
    place = np.ascontiguousarray(2 * rng.uniform(-1, 1, (3, RECEIVERS)), real)
    up = rng.normal(size=(3, RECEIVERS))
    up = np.ascontiguousarray(up / np.linalg.norm(up, axis=0), real)
    centre = np.where(rng.random((2, RECEIVERS)) < 0.5, rng.uniform(-1.5, 1.5, (2, RECEIVERS)),
                      np.array([[height], [width]]) + rng.uniform(-1.5, 1.5, (2, RECEIVERS)))
    pattern = disc_pattern(int(rng.integers(1, 40)), 0) * np.array([rng.uniform(0.1, 4), rng.uniform(0.1, 4), 1])
    scale, got = real(1 / (math.pi * len(pattern))), np.zeros((3, RECEIVERS), real)
    gather_discs(place, up, centre, source, pattern, scale, got)
    at, out, flux = (np.asarray(one, np.longdouble) for one in source)
    exact, bound = np.zeros((2, 3, RECEIVERS), np.longdouble)
    for i in range(RECEIVERS):
        for down, right, weight in pattern:
            t, u = math.floor(centre[0, i] + down), math.floor(centre[1, i] + right)
            if not (0 <= t < height and 0 <= u < width):
                continue
            d = at[:, t, u] - place[:, i]
            square = d @ d
            peak = flux[:, t, u] * np.longdouble(weight) * np.longdouble(scale) / square
            cosines = max(0, -(d @ out[:, t, u])) * max(0, d @ up[:, i]) / square
            exact[:, i] += peak * cosines
            bound[:, i] += peak
    rounding = float(np.finfo(real).eps) / 2 * (TERM + len(pattern))
    off = np.abs(got - exact) / np.where(bound > 0, bound, 1) / rounding
    return Case(float(np.where(np.isnan(off), np.inf, off).max()),
                f"{height} x {width} texels, {len(pattern)} samples, {np.dtype(real).name}")


PROMISES = (
    Promise("importance.sums", "sums of cells beside those of their texels", "importance_pyramid",
            f"maps of 1 .. {MOST_SIDE - 1} texels a side, a hundredth of them 1e12 times as bright", sums,
            "of the bound", 1.0, "derived", "a sum over n rows and columns rounds n times, in float64", 4000, 60),
    Promise("importance.warp", "weight times a cell's mean is the whole mean", "warp_stacked",
            "1 .. 6 maps of 1 .. 39 texels a side, dark ones among them; points upon borders", warped, "of the bound",
            1.0, "derived", "8 roundings a level, and 4 of the whole for a map's share of it", 5000, 60),
    Promise("gather.discs", "discs beside a map's border and a literal sum", "gather_discs",
            "1 .. 32 texels a side, centres within 1.5 texels of a border, radii 0.1 .. 4 texels", discs,
            "of the bound", 1.0, "derived", "22 roundings of a term of Eq. 2 and one for each sum", 500, 8),
)
