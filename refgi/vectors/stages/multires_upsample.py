"""Stages of upsampling from subsplats to pixels, coarsest level first (Nichols and Wyman 2009, Sec. 3.5).

A level is the irradiance of its cells and a mask of those that hold any, evaluated there or at a coarser level.
"""

from functools import partial
from typing import Any

import numpy as np

from refgi.splat.multires.settings import Upsampling
from refgi.splat.multires.subsplats.upsample import (
    black_level,
    demo_level,
    filled_cells,
    sorted_by_row,
    tent_level,
    upsample,
)
from refgi.vectors.bugs.upsample import nearest_bugs, tent, tent_bugs
from refgi.vectors.recipe import Recipe
from refgi.vectors.spec import Array, Arrays, Bug, Run, Spec
from refgi.vectors.stages.multires_list import SUBSPLATS, subsplats_of
from refgi.vectors.stages.multires_ranges import IDS, covered_of

LIGHT = "multires.irradiance"


def add_upsampling(recipe: Recipe, mode: Upsampling, top: int, filter_all: bool, corner_rule: bool) -> None:
    """Add what leads from subsplats to pixels: by levels, coarsest first, or at once where the mode has no levels."""
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
    bugs = [Bug("cells evaluated at this level are copied" if filter_all else "cells evaluated at this level are "
                "filtered as well", lambda a, r: run(a, r, every=not filter_all), "E-AMS-09"),
            Bug("rows and columns of subsplats are exchanged", _with_list(run, turned, 0), "row, column"),
            Bug("subsplats one level finer are taken", _with_list(run, (0, 1), -1), "level of the layer")]
    if mode == "tent":
        bugs += [Bug("cells across a corner count only beside a cell that counts" if not corner_rule else
                     "cells across a corner always count", lambda a, r: run(a, r, corner=not corner_rule),
                     "E-AMS-09"), *tent_bugs(literal, corner_rule, not above)]
    if above and mode == "tent":
        bugs.append(Bug("the filter of the authors' demo", lambda a, r: run(a, r, how="demo"), "E-AMS-09"))
    if above and mode == "demo":
        bugs += [Bug("the coarser light is doubled but not filtered", literal(weights=(0, 1, 0)), "E-AMS-09"),
                 Bug("light does not come down from the coarser level (level above): own cells alone are known",
                     literal(coarse_light=False), "E-AMS-09"),
                 Bug("a tent at this level", lambda a, r: run(a, r, how="tent"), "E-AMS-09"),
                 Bug("a tent that counts cells without light as black",
                     literal(masked=False), "E-AMS-09")]
    rule = {"tent": "weights (1, 2, 1) x (1, 2, 1)", "demo": "weights (1 - f, 1, f) / 2 on the coarser level"}[mode]
    recipe.add(f"multires.upsample.{level}", f"light of level {level} from that of the level above and subsplats, "
               + rule if above else f"light of level {level}, the coarsest", run,
               (IDS, *SUBSPLATS[:3], LIGHT, *above), {
                   light: Spec("rgb, row, column", "W/m^2", "indirect irradiance; 0 where the mask is false",
                               "linear RGB"),
                   mask: Spec("row, column", "1", "cells with light: evaluated here or coarser, with surface",
                              tier="T0")},
               paper="AMS Sec. 3.5; E-AMS-09", bugs=tuple(bugs))


def _with_list(run: Run, order: tuple[int, int], up: int) -> Run:
    """Return a stage that takes row and column in another order or the subsplats of another level, where they fit."""
    def altered(arrays: Arrays, real: Any) -> Arrays:
        level = np.asarray(arrays[SUBSPLATS[0]])
        other = np.maximum(level + up, 0)
        places = [np.asarray(arrays[SUBSPLATS[1 + axis]]) for axis in order]
        height, width = covered_of(arrays).shape
        row, column = (np.minimum(place, (size - 1) >> other)
                       for place, size in zip(places, (height, width), strict=True))
        return run({**arrays, SUBSPLATS[0]: other, SUBSPLATS[1]: row, SUBSPLATS[2]: column}, real)

    return altered


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
               paper="AMS Sec. 3.5, Fig. 7", bugs=(
                   *(Bug(cause, partial(run, how=how), "AMS Fig. 7") for how, cause in others.items()
                     if how != mode),
                   *(nearest_bugs(run) if mode == "nearest" else ()),
                   Bug("rows and columns of subsplats are exchanged", _with_list(run, (1, 0), 0), "row, column"),
                   Bug("subsplats one level finer are taken", _with_list(run, (0, 1), -1), "level of the layer")))
