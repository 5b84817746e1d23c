"""Stages of upsampling from subsplats to pixels, coarsest level first (Nichols and Wyman 2009, Sec. 3.5).

A level is the irradiance of its cells and a mask of those that hold any, evaluated there or at a coarser level.
"""

from typing import Any, get_args

import numpy as np

from refgi.literal import multires_upsample as literal
from refgi.splat.multires.settings import Upsampling
from refgi.splat.multires.subsplats.upsample import (
    black_level,
    demo_level,
    filled_cells,
    sorted_by_row,
    tent_level,
    upsample,
)
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Array, Arrays, Spec
from refgi.vectors.stages.multires_list import SUBSPLATS, subsplats_of
from refgi.vectors.stages.multires_ranges import IDS, covered_of

LIGHT = "multires.irradiance"
LIST = {"triangle_id": IDS, "level": SUBSPLATS[0], "row": SUBSPLATS[1], "column": SUBSPLATS[2], "irradiance": LIGHT}


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

    def run(arrays: Arrays, real: Any) -> Arrays:
        subsplats, values = subsplats_of(arrays, top), np.ascontiguousarray(arrays[LIGHT], real)
        filled = filled_cells(covered_of(arrays), top)[level]
        if mode == "demo":
            made = demo_level(values, subsplats, level, coarse(arrays, real, filled), filled, filter_all)
        else:
            made = tent_level(values, subsplats.column, sorted_by_row(subsplats), level, coarse(arrays, real, filled),
                              filled, filter_all, corner_rule)
        return dict(zip((light, mask), made, strict=True))

    form = Form(literal.upsample_level, {**LIST, **dict(zip(("coarse", "coarse_known"), above, strict=False))},
                (light, mask), {"at": level, "mode": mode, "filter_all": filter_all, "corner_rule": corner_rule})
    lists = ["filter all" if filter_all else "copy"]
    if mode == "tent":
        lists += ["tent", *(("corner rule", "tent corner rule") if corner_rule else ("all corners",))]
    lists += [f"{mode} below"] if above else []
    rule = {"tent": "weights (1, 2, 1) x (1, 2, 1)", "demo": "weights (1 - f, 1, f) / 2 on the coarser level"}[mode]
    recipe.add(f"multires.upsample.{level}", f"light of level {level} from that of the level above and subsplats, "
               + rule if above else f"light of level {level}, the coarsest", run,
               (IDS, *SUBSPLATS[:3], LIGHT, *above), {
                   light: Spec("rgb, row, column", "W/m^2", "indirect irradiance; 0 where the mask is false",
                               "linear RGB"),
                   mask: Spec("row, column", "1", "cells with light: evaluated here or coarser, with surface",
                              tier="T0")},
               paper="AMS Sec. 3.5; E-AMS-09", variants=(form,),
               bugs=form.bugs("upsample_level", *(f"upsample_level/{one}" for one in lists)))


def _add_at_once(recipe: Recipe, mode: Upsampling, top: int) -> None:
    def run(arrays: Arrays, real: Any) -> Arrays:
        values = np.ascontiguousarray(arrays[LIGHT], real)
        return {"multires.upsampled.0": upsample(values, subsplats_of(arrays, top), covered_of(arrays), mode)}

    form = Form(literal.upsample, LIST, ("multires.upsampled.0",), {"top": top, "mode": mode})
    recipe.add("multires.upsample", {"nearest": "each pixel has the light of its subsplat", "naive_bilinear":
               "sum of all levels, each interpolated as if it were black where it holds nothing"}[mode], run,
               (IDS, *SUBSPLATS[:3], LIGHT), {"multires.upsampled.0": Spec(
                   "rgb, row, column", "W/m^2", "indirect irradiance; 0 without surface", "linear RGB")},
               paper="AMS Sec. 3.5, Fig. 7", variants=(form,),
               bugs=form.bugs("upsample", f"upsample/{mode}", *(f"upsample/not {one}" for one in get_args(Upsampling)
                                                                if one != mode)))
