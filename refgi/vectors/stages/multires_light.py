"""Stages of light at subsplats: points, Eq. 2, upsampling level by level, Eq. 3 (Nichols and Wyman 2009, Sec. 3.4, 3.5).

A level is the irradiance of its cells and a mask of those that hold any, evaluated there or at a coarser level.
"""

from functools import partial
from typing import Any

import numpy as np

from refgi.pairs.settings import PairSettings
from refgi.settings import replaced
from refgi.splat.multires.settings import Representative, Upsampling
from refgi.splat.multires.subsplats.detail import surface_detail
from refgi.splat.multires.subsplats.evaluate import evaluate, points_of
from refgi.splat.multires.subsplats.upsample import (
    black_level,
    demo_level,
    filled_cells,
    sorted_by_row,
    tent_level,
    upsample,
)
from refgi.vectors.recipe import Recipe, reading
from refgi.vectors.spec import Array, Arrays, Decoy, Run, Spec
from refgi.vectors.stages.buffers import VECTOR
from refgi.vectors.stages.lights import light_names, pixel_lights_of
from refgi.vectors.stages.multires_list import SUBSPLATS, subsplats_of
from refgi.vectors.stages.multires_ranges import IDS, covered_of, everywhere
from refgi.vectors.stages.pairs import RECEIVERS, pair_decoys

POINTS = ("multires.point", "multires.normal")
LIGHT = "multires.irradiance"
EQ2 = "AMS Eq. 2, E only; E-AMS-02"


def add_points(recipe: Recipe, representative: Representative, top: int) -> None:
    """Add the point and normal that each subsplat is evaluated at."""
    def run(arrays: Arrays, real: Any, how: Representative = representative) -> Arrays:
        position, normal = (np.ascontiguousarray(arrays[name], real) for name in RECEIVERS[:2])
        return dict(zip(POINTS, points_of(position, normal, covered_of(arrays), subsplats_of(arrays, top), how),
                        strict=True))

    def exchanged(arrays: Arrays, real: Any) -> Arrays:
        (height, width), pixel = covered_of(arrays).shape, np.asarray(arrays[SUBSPLATS[3]])
        turned = np.minimum(pixel % width, height - 1) * width + np.minimum(pixel // width, width - 1)
        return run({**arrays, SUBSPLATS[3]: turned}, real)

    other: Representative = "pixel" if representative == "mean" else "mean"
    decoys = [Decoy("the mean of the cell's surface" if other == "mean" else "the representative pixel alone",
                    lambda a, r: run(a, r, other), "E-AMS-11"),
              Decoy("rows and columns of pixels are exchanged", exchanged, "row * width + column")]
    if representative == "mean":
        decoys += [Decoy("pixels without surface count as points at 0", reading(
            run, gbuffer__triangle_id=everywhere), "mean of the surface"),
            Decoy("mean normals are not made unit vectors", _shortened(run, top), "unit vectors")]
    else:
        decoys += [Decoy("the pixel to the right", reading(run, multires__pixel=lambda a: np.minimum(
            a + 1, a.max(initial=0))), "E-AMS-11"),
            Decoy("the pixel at the cell's corner", partial(_corner, run), "E-AMS-11")]
    recipe.add("multires.points", "where each subsplat is evaluated: its " + (
        "representative pixel" if representative == "pixel" else "mean surface"), run, (*RECEIVERS, *SUBSPLATS), {
            POINTS[0]: Spec("xyz, subsplat", "m", "surface point", "world"),
            POINTS[1]: Spec("xyz, subsplat", VECTOR, "its normal", "world")},
        paper="AMS Sec. 3.4; E-AMS-11", exact=RECEIVERS[:2] if representative == "pixel" else (), decoys=tuple(decoys))


def _corner(run: Run, arrays: Arrays, real: Any) -> Arrays:
    level, row, column = (np.asarray(arrays[name]) for name in SUBSPLATS[:3])
    return run({**arrays, SUBSPLATS[3]: (row << level) * covered_of(arrays).shape[1] + (column << level)}, real)


def _shortened(run: Run, top: int) -> Run:
    """Return the stage with means of normals as they are, on the side and at the place of the unit ones."""
    def altered(arrays: Arrays, real: Any) -> Arrays:
        made, here = dict(run(arrays, real)), covered_of(arrays)
        subsplats, means = subsplats_of(arrays, top), np.array(made[POINTS[1]])
        for k, (level, row, column) in enumerate(zip(*subsplats[:3], strict=True)):
            cell = np.s_[int(row) << level : int(row + 1) << level, int(column) << level : int(column + 1) << level]
            means[:, k] = np.asarray(arrays[RECEIVERS[1]])[:, *cell][:, here[cell]].mean(axis=1)
        return {**made, POINTS[1]: means}

    return altered


def add_irradiance(recipe: Recipe, pairs: PairSettings) -> None:
    """Add Eq. 2 at every subsplat."""
    names, area = light_names(recipe), ("lights.area",) if pairs.needs_footprints else ()

    def sums(arrays: Arrays, real: Any, how: PairSettings = pairs) -> Arrays:
        points, normals = (np.ascontiguousarray(arrays[name][:, 0], real) for name in RECEIVERS[:2])
        footprint = np.ascontiguousarray(arrays["lights.area"], np.float64) if area else None
        return {"sum.irradiance": evaluate(points, normals, pixel_lights_of(arrays, real), how, footprint)[:, None]}

    def at_points(inner: Run) -> Run:
        """Return the stage at subsplats of what reads pixels and writes their sum."""
        def run(arrays: Arrays, real: Any) -> Arrays:
            pixels = {RECEIVERS[0]: arrays[POINTS[0]][:, None], RECEIVERS[1]: arrays[POINTS[1]][:, None],
                      RECEIVERS[2]: np.zeros((1, arrays[POINTS[0]].shape[1]), np.int32)}
            return {LIGHT: inner({**arrays, **pixels}, real)["sum.irradiance"][:, 0]}

        return run

    decoys = [Decoy(one.cause, at_points(one.run), EQ2) for one in pair_decoys(sums, bool(area), _glossy(recipe))
              if one.cause != "the distance is clamped at 0.1 m"]
    decoys += [Decoy("1/pi is left out", at_points(reading(sums, lights__flux=lambda a: a * np.pi)), "E-AMS-02"),
               Decoy("pairs count as at least sqrt(0.2) m apart, as in the authors' demo", at_points(
                   lambda a, r: sums(a, r, replaced(pairs, {"clamp": "distance", "clamp.value": 0.2**0.5}))), "E-AMS-05")]
    if area:
        decoys.append(Decoy("nothing is clamped", at_points(lambda a, r: sums(a, r, replaced(pairs, {"clamp": "none"}))),
                            "r^2 + A / pi"))
    recipe.facts["multires.clamp"] = "none" if pairs.clamp is None else pairs.clamp.name()
    recipe.add("multires.irradiance", "irradiance of every pixel light at every subsplat, without albedo/pi",
               at_points(sums), (*POINTS, *names, *area),
               {LIGHT: Spec("rgb, subsplat", "W/m^2", "indirect irradiance", "linear RGB", EQ2)}, paper=EQ2,
               exact=(POINTS[0], "lights.position"), decoys=tuple(decoys))


def _glossy(recipe: Recipe) -> bool:
    return "lights.lobe_flux" in recipe.specs


def add_upsampling(recipe: Recipe, mode: Upsampling, top: int, filter_all: bool, corner_rule: bool) -> None:
    """Add what leads from subsplats to pixels: level by level, coarsest first, or at once where the mode has no levels."""
    recipe.facts["multires.upsampling"] = {"mode": mode, "filter_all": filter_all, "corner_rule": corner_rule}
    if mode in ("tent", "demo"):
        for level in range(top, -1, -1):
            _add_level(recipe, mode, level, top, filter_all, corner_rule)
    else:
        _add_at_once(recipe, mode, top)


def _add_level(recipe: Recipe, mode: Upsampling, level: int, top: int, filter_all: bool, corner_rule: bool) -> None:
    light, mask = f"multires.upsampled.{level}", f"multires.known.{level}"
    above = (f"multires.upsampled.{level + 1}", f"multires.known.{level + 1}") if level < top else ()

    def coarse(arrays: Arrays, real: Any, filled: Array) -> tuple[Array, Array]:
        if not above:
            return black_level(filled, np.dtype(real))
        return np.ascontiguousarray(arrays[above[0]], real), np.ascontiguousarray(arrays[above[1]], np.bool_)

    def run(arrays: Arrays, real: Any, how: str = mode, every: bool = filter_all, corner: bool = corner_rule) -> Arrays:
        subsplats, values = subsplats_of(arrays, top), np.ascontiguousarray(arrays[LIGHT], real)
        filled = filled_cells(covered_of(arrays), top)[level]
        if how == "demo":
            made = demo_level(values, subsplats, level, coarse(arrays, real, filled), filled, every)
        else:
            made = tent_level(values, subsplats.column, sorted_by_row(subsplats), level, coarse(arrays, real, filled),
                              filled, every, corner)
        return dict(zip((light, mask), made, strict=True))

    def literal(**bugs: Any) -> Run:
        def altered(arrays: Arrays, real: Any) -> Arrays:
            subsplats, filled = subsplats_of(arrays, top), filled_cells(covered_of(arrays), top)[level]
            layer, here = np.zeros((3, *filled.shape)), subsplats.level == level
            layer[:, subsplats.row[here], subsplats.column[here]] = np.asarray(arrays[LIGHT])[:, here]
            options = {"every": filter_all, "corner": corner_rule} | bugs
            return dict(zip((light, mask), tent(layer, subsplats.leaf[level], coarse(arrays, real, filled), filled,
                                                **options), strict=True))

        return altered

    turned = (1, 0)
    decoys = [Decoy("cells evaluated at this level are copied" if filter_all else "cells evaluated at this level are "
                    "filtered as well", lambda a, r: run(a, r, every=not filter_all), "E-AMS-09"),
              Decoy("rows and columns of subsplats are exchanged", _with_list(run, turned, 0), "row, column"),
              Decoy("subsplats one level finer are taken", _with_list(run, (0, 1), -1), "level of the layer")]
    if above:
        decoys.append(Decoy("the coarser light is doubled but not filtered", literal(weights=(0, 1, 0)), "E-AMS-09"))
    if mode == "tent":
        decoys += [Decoy("cells across a corner count only beside a cell that counts" if not corner_rule else
                         "cells across a corner always count", lambda a, r: run(a, r, corner=not corner_rule), "E-AMS-09"),
                   Decoy("nine equal weights", literal(weights=(1, 1, 1)), "E-AMS-09: (1, 2, 1) x (1, 2, 1)"),
                   Decoy("cells without light count as black", literal(masked=False), "m = 1 where there is light"),
                   Decoy("beyond the border it is black", literal(border="constant"), "the border repeats its cells")]
    if above and mode == "tent":
        decoys += [Decoy("the coarser light is shifted by one cell", literal(shift=1), "cell i lies in cell i / 2"),
                   Decoy("light spreads into cells without surface", literal(spread=True), "m = 1 where a surface is"),
                   Decoy("the filter of the authors' demo", lambda a, r: run(a, r, how="demo"), "E-AMS-09")]
    if above and mode == "demo":
        decoys += [Decoy("a tent at this level", lambda a, r: run(a, r, how="tent"), "E-AMS-09"),
                   Decoy("a bilinear filter of the coarser level that counts cells without light as black",
                         literal(masked=False), "E-AMS-09")]
    rule = {"tent": "weights (1, 2, 1) x (1, 2, 1)", "demo": "weights (1 - f, 1, f) / 2 on the coarser level"}[mode]
    recipe.add(f"multires.upsample.{level}", f"light of level {level} from that of level {level + 1} and its subsplats, "
               + rule if above else f"light of level {level}, the coarsest", run, (IDS, *SUBSPLATS[:3], LIGHT, *above), {
                   light: Spec("rgb, row, column", "W/m^2", "indirect irradiance; 0 where the mask is false", "linear RGB"),
                   mask: Spec("row, column", "1", "cells with light: evaluated here or coarser, with surface", tier="T0")},
               paper="AMS Sec. 3.5; E-AMS-09", decoys=tuple(decoys))


def _with_list(run: Run, order: tuple[int, int], up: int) -> Run:
    """Return a stage that takes row and column in another order or the subsplats of another level, where they fit."""
    def altered(arrays: Arrays, real: Any) -> Arrays:
        level = np.asarray(arrays[SUBSPLATS[0]])
        other = np.maximum(level + up, 0)
        places = [np.asarray(arrays[SUBSPLATS[1 + axis]]) for axis in order]
        height, width = covered_of(arrays).shape
        row, column = (np.minimum(place, (size - 1) >> other) for place, size in zip(places, (height, width), strict=True))
        return run({**arrays, SUBSPLATS[0]: other, SUBSPLATS[1]: row, SUBSPLATS[2]: column}, real)

    return altered


def tent(
    layer: Array, leaf: Array, coarse: tuple[Array, Array], filled: Array, *, every: bool, corner: bool,
    weights: tuple[int, int, int] = (1, 2, 1), masked: bool = True, border: Any = "edge", shift: int = 0,
    spread: bool = False,
) -> tuple[Array, Array]:
    """Return a level of the masked tent filter and its mask, with bugs, in float64."""
    rows, columns = (np.minimum((np.arange(size) + shift) // 2, (size - 1) // 2) for size in filled.shape)
    mask = coarse[1][rows][:, columns] & (filled | spread) | leaf
    texels = np.where(leaf, layer, coarse[0][:, rows][:, :, columns].astype(np.float64)) * mask
    around, known = np.pad(texels, ((0, 0), (1, 1), (1, 1)), mode=border), np.pad(mask, 1, mode="edge")
    total, weight = np.zeros_like(texels), np.zeros(filled.shape)
    for i, j in np.ndindex(3, 3):
        part = np.s_[i : i + filled.shape[0], j : j + filled.shape[1]]
        counts = known[part]
        if corner and i != 1 and j != 1:
            counts = counts & (known[1:-1, part[1]] | known[part[0], 1:-1])
        share = weights[i] * weights[j] * (counts if masked else np.ones_like(counts))
        total, weight = total + share * around[:, *part], weight + share
    mean = np.divide(total, weight, out=np.zeros_like(total), where=weight > 0)
    return np.where(mask, np.where(leaf & (not every), texels, mean), 0.0), mask


def _add_at_once(recipe: Recipe, mode: Upsampling, top: int) -> None:
    def run(arrays: Arrays, real: Any, how: Upsampling = mode) -> Arrays:
        values = np.ascontiguousarray(arrays[LIGHT], real)
        return {"multires.upsampled.0": upsample(values, subsplats_of(arrays, top), covered_of(arrays), how)}

    others: dict[Upsampling, str] = {"nearest": "each pixel takes the light of its subsplat", "tent": "a masked tent",
                                     "naive_bilinear": "the levels are interpolated with black where they hold nothing"}
    recipe.add("multires.upsample", {"nearest": "each pixel has the light of its subsplat", "naive_bilinear":
               "sum of all levels, each interpolated as if it were black where it holds nothing"}[mode], run,
               (IDS, *SUBSPLATS[:3], LIGHT), {"multires.upsampled.0": Spec(
                   "rgb, row, column", "W/m^2", "indirect irradiance; 0 without surface", "linear RGB")},
               paper="AMS Sec. 3.5, Fig. 7", decoys=(
                   *(Decoy(cause, lambda a, r, how=how: run(a, r, how), "AMS Fig. 7") for how, cause in others.items()
                     if how != mode),
                   Decoy("light spreads to pixels without surface", reading(run, gbuffer__triangle_id=everywhere),
                         "0 without surface"),
                   Decoy("rows and columns of subsplats are exchanged", _with_list(run, (1, 0), 0), "row, column"),
                   Decoy("subsplats one level finer are taken", _with_list(run, (0, 1), -1), "level of the layer")))


def add_detail(recipe: Recipe, a: float) -> None:
    """Add Eq. 3, which darkens what turns away from the camera."""
    def run(arrays: Arrays, real: Any, share: float = a) -> Arrays:
        light, position, normal = (np.ascontiguousarray(arrays[name], real) for name in (
            "multires.upsampled.0", *RECEIVERS[:2]))
        eye = np.asarray(arrays["camera.origin"], real)[0]
        return {"multires.detailed": surface_detail(light, position, normal, covered_of(arrays), eye, share)}

    def unclamped(arrays: Arrays, real: Any) -> Arrays:
        light, x, n = (np.asarray(arrays[name], np.float64) for name in ("multires.upsampled.0", *RECEIVERS[:2]))
        v = np.asarray(arrays["camera.origin"], np.float64)[0][:, None, None] - x
        return {"multires.detailed": np.where(covered_of(arrays), light * (a * (v * n).sum(axis=0) + 1 - a), 0)}

    recipe.facts["multires.detail"] = a
    recipe.add("multires.detail", "E (a <V, N> + 1 - a)", run, ("multires.upsampled.0", *RECEIVERS, "camera.origin"), {
        "multires.detailed": Spec("rgb, row, column", "W/m^2", "indirect irradiance", "linear RGB", "AMS Eq. 3")},
        paper="AMS Eq. 3", exact=(RECEIVERS[0], "camera.origin"), decoys=(
            Decoy("a and 1 - a are exchanged", lambda a_, r: run(a_, r, 1 - a), "AMS Eq. 3"),
            Decoy("V points from the camera to the surface", reading(run, gbuffer__normal=lambda n: -n), "AMS Eq. 3"),
            Decoy("V is not made a unit vector", unclamped, "AMS Eq. 3"),
            Decoy("a = 1: light is multiplied by the cosine", lambda a_, r: run(a_, r, 1.0), "AMS Eq. 3")))
