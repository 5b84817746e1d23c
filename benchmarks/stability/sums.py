"""Promises of sums over pixel lights, of sums of importance and points warped after it, and of discs of texels.

The reference of sums is a literal sum of SII Eq. 2 and 3 in extended precision, of the numbers that the sum is given,
with its bound beside it. With U = 2^-24 (float64: 2^-53) a term is off by 14 U, and by 4 U of 1 for each cosine, a sum
that may cancel; a group of 64 rounds 63 times, its total with compensation twice, the flux twice. Sums of cells are
those in extended precision by the borders floor(i H / 2^l) of docs; weight times the mean of a point's cell is the mean
of all maps; a disc is a sum over texels found by floor.
"""

import math
from functools import partial
from typing import Any

import numpy as np

from benchmarks.stability.promise import Case, Promise
from refgi.errors import InputError
from refgi.lights.importance import importance_pyramid
from refgi.lights.warp import Warp, texel_of, warp_stacked
from refgi.pairs.irradiance import Receivers, irradiance
from refgi.pairs.pixel_lights import PixelLights
from refgi.pairs.settings import PairSettings
from refgi.splat.gather.gather_sum import GatherMap, disc_pattern, gather_discs
from refgi.types import Array

POINTS = 8  # receivers
MOST_GROUPS = 1 << 14  # of 64 lights: a million
PLAIN = PairSettings(clamp=None)
BRIGHTEST_FLUX, SHARPEST = 1e30, 1e20
TERM, GROUP = 14, 67  # roundings of a term, and of the sum
U = 2.0**-53
MOST_SIDE = 257  # texels of a drawn map
ROUNDINGS = 8  # of a weight, each level: sum, quotient and two products, down and across
DISC_TERM = 14 + 8  # of a term in a disc: those of Eq. 2, and 4 of 1 for each of both cosines
RECEIVERS = 64


def _unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=0)


def _receivers(position: Array, normal: Array, real: Any) -> Receivers:
    return Receivers(np.ascontiguousarray(position[:, None], real), np.ascontiguousarray(normal[:, None], real),
                     np.ones((1, position.shape[1]), np.bool_))


def _lights(position: Array, normal: Array, flux: Array, real: Any, lobes: Any = (None, None, None)) -> PixelLights:
    arrays = (np.ascontiguousarray(one, real) for one in (position, normal, flux))
    return PixelLights(*arrays, *(one if one is None else np.ascontiguousarray(one, real) for one in lobes),
                       position.shape[1])


def literal(receivers: Receivers, lights: PixelLights) -> tuple[Array, Array]:
    """Return E of the red channel at each receiver, and by how many U it may be off, in longdouble."""
    place, up = (np.asarray(one[:, 0], np.longdouble) for one in receivers[:2])
    at, out, flux = (np.asarray(one, np.longdouble) for one in lights[:3])
    total, bound = np.zeros((2, place.shape[1]), np.longdouble)
    for i in range(place.shape[1]):
        d = at - place[:, i : i + 1]
        square = (d * d).sum(axis=0)
        square = np.where(square > 0, square, np.inf)  # coincident: no light
        length = np.sqrt(square)
        cl, cx = -(d * out).sum(axis=0) / length, (d * up[:, i : i + 1]).sum(axis=0) / length
        peak = flux[0] / (np.longdouble(np.pi) * square)
        term = peak * np.maximum(cl, 0) * np.maximum(cx, 0)
        total[i] = term.sum()
        bound[i] = (TERM * term + 4 * peak * (np.maximum(cl, 0) + np.maximum(cx, 0))).sum() + GROUP * total[i]
    return total, bound


def many_lights(rng: np.random.Generator) -> Case:
    """Return the error of a sum over m times the same 64 lights, of m times that over them; lobes as well."""
    times = int(np.exp(rng.uniform(np.log(1000), np.log(MOST_GROUPS))))
    centre = np.array([[0.0], [0.0], [1.0]])
    at, out = centre + 0.1 * rng.uniform(-1, 1, (3, 64)), _unit(-centre + 0.3 * rng.normal(size=(3, 64)))
    flux, dark = rng.uniform(0.5, 1.5, (3, 64)), np.zeros((3, 64))
    lobes = bool(rng.integers(2))
    place = np.concatenate([rng.uniform(-0.3, 0.3, (2, POINTS)), np.zeros((1, POINTS))])
    to = _receivers(place, np.broadcast_to(centre, place.shape), np.float32)

    def total(m: int) -> Array:
        numbers = [np.tile(one, m) for one in ((dark, out, flux) if lobes else (flux,))]
        glossy = (numbers[2], numbers[1], np.full(64 * m, 3.0)) if lobes else (None, None, None)
        return irradiance(to, _lights(np.tile(at, m), np.tile(out, m), numbers[0], np.float32, glossy), PLAIN)

    one, all_of_them = total(1).astype(np.float64), total(times).astype(np.float64)
    figure = float((np.abs(all_of_them / (times * one) - 1)).max()) * 2.0**24
    return Case(figure, f"{times} times 64 {'lobes' if lobes else 'lights'}: off by {figure:.3g} U")


def near_lights(real: Any, rng: np.random.Generator) -> Case:
    """Return a sum over a few lights near the receivers, in scenes up to 16 times their size off the origin."""
    size, count = 10 ** rng.uniform(-6, 6), int(rng.integers(1, 100))
    centre = size * rng.uniform(-16, 16, (3, 1))
    at = centre + size * rng.uniform(-1, 1, (3, count))
    nearest = rng.integers(0, count, POINTS)
    place = at[:, nearest] + size * 10 ** rng.uniform(-9, 0, POINTS) * _unit(rng.normal(size=(3, POINTS)))
    lights = _lights(at, _unit(rng.normal(size=(3, count))), np.broadcast_to(rng.random(count), (3, count)), real)
    to = _receivers(place, _unit(rng.normal(size=(3, POINTS))), real)
    got = irradiance(to, lights, PLAIN)[0, 0]
    exact, bound = literal(to, lights)
    allowed = bound * np.finfo(real).eps / 2 + 4 * float(np.finfo(real).smallest_subnormal)
    off = np.abs(got - exact) / allowed
    return Case(float(off.max()), f"{count} lights, scene of {size:.3g} m: off by {float(off.max()):.3g} of the bound")


def bright_lobes(rng: np.random.Generator) -> Case:
    """Return how many numbers of a sum are no numbers: lobes that face the receivers, at least 1 mm away."""
    count = int(rng.integers(1, 65))
    axis = _unit(rng.normal(size=3))[:, None]
    strength = np.full(count, BRIGHTEST_FLUX) if rng.random() < 0.5 else 10 ** rng.uniform(-3, 30, count)
    exponent = np.full(count, SHARPEST) if rng.random() < 0.5 else 10 ** rng.uniform(-3, 20, count)
    flux, axes = np.broadcast_to(strength, (3, count)), np.broadcast_to(axis, (3, count))
    lights = _lights(np.zeros((3, count)), axes, np.zeros((3, count)), np.float32, (flux, axes, exponent))
    place = axis * 10 ** rng.uniform(-3, 2, POINTS)
    to = _receivers(place, np.broadcast_to(-axis, place.shape), np.float32)
    got = irradiance(to, lights, PLAIN)
    bad = int(np.count_nonzero(~np.isfinite(got) | (got < 0)))
    return Case(bad, f"{count} lobes, up to {strength.max():.3g} W and P {exponent.max():.3g}: {bad} of {got.size}")


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
    gather_discs(place, up, centre, source, pattern, scale, None, got)
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
    rounding = float(np.finfo(real).eps) / 2 * (DISC_TERM + len(pattern))
    off = np.abs(got - exact) / np.where(bound > 0, bound, 1) / rounding
    return Case(float(np.where(np.isnan(off), np.inf, off).max()),
                f"{height} x {width} texels, {len(pattern)} samples, {np.dtype(real).name}")


PROMISES = (
    Promise("sum.many", "float32 sum over m times the same lights", "pairs.sum",
            "64,000 to 1,000,000 pixel lights or lobes in one order", many_lights, "U of E", 4, "derived",
            "the compensated total rounds by 2 U, once more where it ends, the reference once", 60, 4),
    *(Promise(f"sum.{name}", f"{name} sum against a literal one", "pairs.sum",
              "1 to 100 lights, 1e-9 of the scene's size off a receiver and more; 1e-6 .. 1e6 m, up to 16 sizes off "
              "the origin", partial(near_lights, real), "of the bound", 1.0, "derived",
              "14 roundings of a term, 4 of each cosine, 67 of the sum", 6000, 100)
      for name, real in (("float32", np.float32), ("float64", np.float64))),
    Promise("sum.bright", "infinite or NaN", "pairs.sum", "1 to 64 lobes of up to 1e30 W and exponents to 1e20, from "
            "1e-3 m on", bright_lobes, "numbers", 0, "exact", "what no float32 holds is cut", 5000, 60, adds=True),
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
