"""Stages that join levels: blur along surfaces, joint bilateral upsampling, coarsest level first (HSS Sec. 3.2, 5)."""

import math
from typing import Any

import numpy as np

from refgi.settings import replaced
from refgi.sssil.blur import blur
from refgi.sssil.settings import Bilateral, GeometryBlur, HssilSettings
from refgi.sssil.upsampling.upsample import Guide, upsample
from refgi.vectors.recipe import Recipe, reading, writing
from refgi.vectors.spec import Array, Arrays, Bug, Run, Spec
from refgi.vectors.stages.blur_bugs import BLUR, blur_bugs
from refgi.vectors.stages.levels import level_names, level_of

GUIDE = ("depth", "normal")
BILATERAL = "HSS Sec. 3.2, 5: joint bilateral, 3 x 3; weights in docs/methods/hssil (E-HSS-12)"


def add_blur(recipe: Recipe, settings: GeometryBlur, index: int, number: int) -> None:
    """Add the mean over a window of texels of the same surface."""
    light, name = f"gather{index}.irradiance", f"blur{index}.irradiance"
    planes = level_names(index, "position", "normal", "depth")

    def run(arrays: Arrays, real: Any) -> Arrays:
        return {name: blur(np.ascontiguousarray(arrays[light], real), level_of(arrays, index, number, real), settings)}

    recipe.facts["blur"] = {"size": settings.size, "plane_tolerance": settings.plane_tolerance,
                            "cosine": settings.cosine}
    recipe.add(f"blur{index}", "mean over a window along the row, then along the column, of texels on the texel's "
               "tangent plane that face as it does", run, (light, *planes), {
                   name: Spec("rgb, row, column", "W/m^2", "irradiance by this level, averaged", "linear RGB", BLUR)},
               paper=BLUR, exact=planes, bugs=tuple(blur_bugs(light, name, planes, settings)))


def add_light(recipe: Recipe, settings: HssilSettings, index: int, added: str, coarse: str) -> str:
    """Add the light of a level and of all coarser ones; `added` is the level's own, `coarse` that of the coarser ones.

    `index` -1 is the picture, to which no light is added. Returns the name of what is written.
    """
    name = "picture.irradiance" if index < 0 else f"light{index}.irradiance"
    below = level_names(index + 1, *GUIDE)
    here = ("gbuffer.depth", "gbuffer.normal") if index < 0 else level_names(index, *GUIDE)
    adds = index >= 0

    def run(arrays: Arrays, real: Any, how: HssilSettings = settings) -> Arrays:
        guides = [np.ascontiguousarray(arrays[one], real) for one in (*below, *here)]
        return {name: upsample(np.ascontiguousarray(arrays[coarse], real), Guide(*guides[:2]), Guide(*guides[2:]), how,
                               np.ascontiguousarray(arrays[added], real) if adds else None)}

    def literal(**bugs: Any) -> Run:
        def wrong(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
            made = _bilateral(arrays, coarse, below, here, settings, **bugs)
            return {name: made + arrays[added] if adds else made}

        return wrong

    def changed(**values: Any) -> Run:
        return lambda a, r: run(a, r, replaced(settings, values))

    weights = settings.upsampling
    assert isinstance(weights, Bilateral)
    recipe.facts["upsampling"] = {"depth_sigma": weights.depth_sigma, "normal_power": weights.normal_power}
    bugs = [
        Bug("bilinear upsampling", changed(upsampling="bilinear"), BILATERAL),
        Bug("the nearest texel", changed(upsampling="nearest"), BILATERAL),
        Bug("depths are not compared", changed(**{"upsampling.depth_sigma": 1e6}), BILATERAL),
        Bug("normals are not compared", changed(**{"upsampling.normal_power": 0.0}), BILATERAL),
        Bug("exp(-delta^2 / sigma^2) without the 2", changed(**{
            "upsampling.depth_sigma": weights.depth_sigma / math.sqrt(2)}), BILATERAL),
        Bug("a texel's depth is taken for that at its centre, not at its nearest pixel",
            changed(**{"senders.downsample": "average"}), BILATERAL),
        Bug("depths are compared without the slope of the surface", literal(sloped=False), BILATERAL),
        Bug("weights are not divided by their sum", literal(divided=False), BILATERAL),
        Bug("the tent is centred on the texel of the pixel", literal(centred=True), "half-pixel (E-HSS-10)"),
        Bug("the tent is shifted to the wrong side", literal(mirrored=True), "half-pixel (E-HSS-10)"),
    ]
    if adds:
        bugs += [
            Bug("coarser levels are left out", lambda a, r: {name: np.asarray(a[added], r)}, "HSS Sec. 3.2"),
            Bug("the level's own light is left out", reading(run, **{added.replace(".", "__"): np.zeros_like}),
                "HSS Sec. 3.2"),
            Bug("levels are averaged, not added", writing(run, **{name.replace(".", "__"): lambda a: a / 2}),
                "HSS Sec. 3.2: sums of disjoint crowns"),
        ]
    recipe.add(name.split(".")[0], "light of the coarser levels at this level's texels, and this level's own" if adds
               else "light of all levels at the pixels", run, (coarse, *below, *here, *((added,) if adds else ())), {
                   name: Spec("rgb, row, column", "W/m^2", "irradiance; 0 without surface", "linear RGB", BILATERAL)},
               paper=BILATERAL, exact=(below[0], here[0]), bugs=tuple(bugs))
    return name


def _bilateral(
    arrays: Arrays, coarse: str, below: tuple[str, ...], here: tuple[str, ...], settings: HssilSettings, *,
    sloped: bool = True, divided: bool = True, centred: bool = False, mirrored: bool = False,
) -> Array:
    """Return upsampled light, in float64, with a bug."""
    light, far, up = (np.asarray(arrays[name], np.float64) for name in (coarse, *below))
    depth, normal = (np.asarray(arrays[name], np.float64) for name in here)
    weights = settings.upsampling
    assert isinstance(weights, Bilateral)
    factor = next(n for n in (2, 4, 8, 16, 32) if far.shape == tuple(-(-size // n) for size in depth.shape))
    seen, z = np.isfinite(depth), np.where(np.isfinite(depth), depth, 1.0)
    places, slopes = [], []
    for axis in (0, 1):
        slope = _slope(np.where(seen, 1 / z, 0), axis) if sloped else np.zeros_like(z)
        offset = (np.arange(depth.shape[axis]) % factor + 0.5) / factor - 0.5
        offset = np.zeros_like(offset) if centred else offset
        offset = -offset if mirrored else offset
        corner = (factor - 1) / (2 * factor) * np.sign(slope)
        places.append((offset[:, None] if axis == 0 else offset) - corner)
        slopes.append(factor * slope)
    total, mass = np.zeros((3, *depth.shape)), np.zeros(depth.shape)
    nearest, least = np.zeros_like(total), np.full(depth.shape, np.inf)
    row, column = np.indices(depth.shape) // factor
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            i, j = np.clip(row + dy, 0, far.shape[0] - 1), np.clip(column + dx, 0, far.shape[1] - 1)
            there = (i == row + dy) & (j == column + dx) & np.isfinite(far[i, j]) & seen
            plane = 1 / z + (dy - places[0]) * slopes[0] + (dx - places[1]) * slopes[1]
            delta = z * (1 / np.where(there, far[i, j], 1.0) - plane)
            closer = there & (np.abs(delta) < least)
            nearest, least = np.where(closer, light[:, i, j], nearest), np.where(closer, np.abs(delta), least)
            u = np.clip(1 - delta**2 / (32 * weights.depth_sigma**2), 0, None) ** 16
            cosine = np.clip((normal * up[:, i, j]).sum(axis=0), 0, None) ** weights.normal_power
            weight = _tent(dy, places[0]) * _tent(dx, places[1]) * u * cosine * there
            total, mass = total + weight * light[:, i, j], mass + weight
    found = mass > 1e-20
    mean = np.where(found, total / np.where(found & divided, mass, 1.0), nearest)
    return np.asarray(np.where(seen, mean, 0))


def _slope(nearness: Array, axis: int) -> Array:
    """Return the smaller of two differences along an axis, 0 where they disagree or a neighbour sees nothing."""
    padded = np.pad(nearness, [(1, 1) if k == axis else (0, 0) for k in (0, 1)], mode="reflect", reflect_type="odd") \
        if nearness.shape[axis] > 1 else np.repeat(nearness, 3, axis)
    before, after = np.take(padded, range(nearness.shape[axis]), axis), np.take(
        padded, range(2, nearness.shape[axis] + 2), axis)
    first, second = nearness - before, after - nearness
    known = (before > 0) & (after > 0) & (nearness > 0) & (first * second > 0)
    return np.asarray(np.where(known, np.where(np.abs(first) < np.abs(second), first, second), 0))


def _tent(step: int, t: Array) -> Array:
    half = np.where(np.abs(t) < 0.5, (4 + np.abs(t)) / 3, 1.0)
    parts = [np.clip(1 - np.abs(t - place) / half, 0, None) for place in (-1, 0, 1)]
    return np.asarray(parts[step + 1] / sum(parts))
