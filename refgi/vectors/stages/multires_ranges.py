"""Stages of adaptive refinement: ranges of depths and normals, discontinuous cells (Nichols and Wyman 2009, Sec. 3.2).

Level l has cells of 2^l x 2^l pixels, cut at the right and lower border; a pixel without surface counts nowhere.
`multires_list` goes on with the list of subsplats.
"""

from collections.abc import Callable
from typing import Any, get_args

import numpy as np

from refgi.literal import multires as literal
from refgi.splat.multires.refinement.criteria import (
    depth_ranges,
    mark_curvatures,
    mark_depth_ranges,
    mark_depth_slopes,
    mark_normal_ranges,
    normal_ranges,
)
from refgi.splat.multires.refinement.derivatives import curvatures, depth_slopes
from refgi.splat.multires.refinement.mipmap import START, Mipmap, element_count, layout, level_views
from refgi.splat.multires.settings import Criteria, Measure
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Array, Arrays, Spec

IDS = "gbuffer.triangle_id"


def covered_of(arrays: Arrays) -> Array:
    """Return which pixels show a surface."""
    return np.asarray(arrays[IDS]) >= 0


def of_levels(name: str, top: int, first: int = 1) -> tuple[str, ...]:
    """Return the names of an array's levels."""
    return tuple(f"multires.{name}.{level}" for level in range(first, top + 1))


def add_ranges(recipe: Recipe, what: str, top: int, rim: int, components: int) -> None:
    """Add least and largest depths or normals (`what`) of levels 1 to `top`."""
    source = f"gbuffer.{what}"
    lows, highs = of_levels(f"{what}_least", top), of_levels(f"{what}_largest", top)
    components_of = {} if what == "depth" else {"components": components}
    form = Form(literal.depth_ranges if what == "depth" else literal.normal_ranges,
                     {what: source, "triangle_id": IDS}, (*lows, *highs), {"top": top, "rim": rim, **components_of})

    def run(arrays: Arrays, real: Any) -> Arrays:
        plane = np.ascontiguousarray(arrays[source], real)
        make: Callable[..., Mipmap] = depth_ranges if what == "depth" else normal_ranges
        mip = make(plane if what == "depth" else plane[:components], covered_of(arrays), top, rim)
        return dict(zip((*lows, *highs), (*mip.low[1:], *mip.high[1:]), strict=True))

    axes, unit = ("row, column", "m") if what == "depth" else (f"{'xyz'[:components]}, row, column", "1")
    text = "{} " + ("depth" if what == "depth" else "of each component of normals") + " in each cell; {} where empty"
    recipe.add(f"multires.{what}_ranges", f"least and largest {what} within each cell of each level", run,
               (source, IDS), {
        **{name: Spec(axes, unit, text.format("least", "inf")) for name in lows},
        **{name: Spec(axes, unit, text.format("largest", "-inf")) for name in highs},
    }, paper="AMS Sec. 3.2.1" if what == "depth" else "AMS Sec. 3.2.2", exact=(source,),
        variants=(form,), bugs=form.bugs("ranges", f"ranges/{'' if rim else 'no '}rim", f"{what}_ranges",
                                               *(("ranges/three levels",) if top > 2 else ())))


def add_slopes(recipe: Recipe, top: int, relative: bool) -> None:
    """Add the steepest change of depth of levels 1 to `top`."""
    names = of_levels("slope", top)
    form = Form(literal.slopes, {"depth": "gbuffer.depth", "triangle_id": IDS}, names,
                     {"top": top, "relative": relative})

    def run(arrays: Arrays, real: Any) -> Arrays:
        mip = depth_slopes(np.ascontiguousarray(arrays["gbuffer.depth"], real), covered_of(arrays), top, relative)
        return dict(zip(names, mip.high[1:], strict=True))

    recipe.add("multires.slopes", "steepest change of depth from pixel to pixel within each cell", run,
               ("gbuffer.depth", IDS), {
                   name: Spec("row, column", "1/pixel" if relative else "m/pixel", "sqrt(dx^2 + dy^2), the larger of "
                              "both differences along each axis" + ", over the depth" * relative) for name in names},
               paper="AMS Sec. 3.2.1", exact=("gbuffer.depth",), variants=(form,),
               bugs=form.bugs("slopes", f"slopes/{'relative' if relative else 'absolute'}"))


def add_curvatures(recipe: Recipe, top: int, rate: bool) -> None:
    """Add the largest chord between neighbouring normals of levels 1 to `top`."""
    names = of_levels("curvature", top)
    form = Form(literal.curvatures, {
        "normal": "gbuffer.normal", "position": "gbuffer.position", "triangle_id": IDS}, names,
        {"top": top, "rate": rate})

    def run(arrays: Arrays, real: Any) -> Arrays:
        normal, position = (np.ascontiguousarray(arrays[f"gbuffer.{key}"], real) for key in ("normal", "position"))
        return dict(zip(names, curvatures(normal, position, covered_of(arrays), top, rate).high[1:], strict=True))

    recipe.add("multires.curvatures", "largest Eq. 1 between neighbouring pixels within each cell", run,
               ("gbuffer.normal", "gbuffer.position", IDS), {
                   name: Spec("row, column", "1/m" if rate else "1", "largest |N1 - N2|" + " / |x1 - x2|" * rate,
                              paper="AMS Eq. 1; E-AMS-01") for name in names},
               paper="AMS Eq. 1; E-AMS-01", exact=("gbuffer.normal", "gbuffer.position"), variants=(form,),
               bugs=form.bugs("curvatures", f"curvatures/{'rate' if rate else 'chord'}"))


def add_discontinuities(
    recipe: Recipe, criteria: Criteria, top: int, finest: int, shape: tuple[int, int]
) -> None:
    """Add which cells of levels 1 to `top` exceed a threshold."""
    names, sizes = of_levels("discontinuous", top), layout(*shape, top, first=1)
    count = element_count(sizes) if top else 0
    parts = [key for kind, keys in (("depth", ("depth_least", "depth_largest")), ("derivative", ("slope",)),
                                    ("normal", ("normal_least", "normal_largest")), ("curvature", ("curvature",)))
             if getattr(criteria, kind) is not None for key in keys]

    form = Form(literal.discontinuities, {key: of_levels(key, top) for key in parts}, names,
                {"top": top, "finest": finest, **_numbers(criteria)})

    def marks(arrays: Arrays, real: Any) -> Array:
        found = np.zeros(count, np.bool_)
        begin = int(sizes[finest + 1, START]) if finest < top else count
        known = {key: np.concatenate([np.asarray(arrays[name], real).reshape(-1, arrays[name].shape[-2] * arrays[
            name].shape[-1]) for name in of_levels(key, top)], axis=1) for key in parts if top}
        if begin < count and criteria.depth is not None:
            mark_depth_ranges(known["depth_least"], known["depth_largest"], criteria.depth, sizes, found, begin)
        if begin < count and criteria.derivative is not None:
            mark_depth_slopes(known["slope"], criteria.derivative, sizes, found, begin)
        if begin < count and criteria.normal is not None:
            mark_normal_ranges(known["normal_least"], known["normal_largest"], criteria.normal, found, begin)
        if begin < count and criteria.curvature is not None:
            mark_curvatures(known["curvature"], criteria.curvature, found, begin)
        return found

    def run(arrays: Arrays, real: Any) -> Arrays:
        return dict(zip(names, level_views(marks(arrays, real), sizes, first=1), strict=True))

    recipe.add("multires.discontinuities", "cells that a test of their own finds discontinuous", run,
               tuple(name for key in parts for name in of_levels(key, top)),
               {name: Spec("row, column", "1", "true where a test exceeds its threshold", tier="T0") for name in names},
               paper="AMS Sec. 3.2, 3.3; E-AMS-07", variants=(form,),
               bugs=form.bugs("discontinuities", *(f"discontinuities/{one}" for one in _tests(criteria, finest))))


def _numbers(criteria: Criteria) -> dict[str, Any]:
    """Return thresholds and measures of the tests that there are."""
    depth, slope, normal, curvature = (criteria.depth, criteria.derivative, criteria.normal, criteria.curvature)
    numbers: dict[str, Any] = {f"{name}_threshold": one.threshold for name, one in (
        ("depth", depth), ("slope", slope), ("normal", normal), ("curvature", curvature)) if one is not None}
    return numbers | {f"{name}_measure": one.measure for name, one in (("depth", depth), ("slope", slope))
                      if one is not None}


def _tests(criteria: Criteria, finest: int) -> list[str]:
    """Return which tests and measures there are, and which not, as lists of rows are named."""
    depth, slope, normal, curvature = (criteria.depth, criteria.derivative, criteria.normal, criteria.curvature)
    tests = {"depth": depth, "slope": slope, "normal": normal, "curvature": curvature,
             "depth and normal": depth and normal, "slope and curvature": slope and curvature}
    lists = [name for name, one in tests.items() if one is not None]
    if depth is not None:
        lists += [depth.measure, *(f"not {one}" for one in get_args(Measure) if one != depth.measure)]
    return lists + ["xyz"] * (normal is not None and normal.components == "xyz") + ["finest"] * (finest > 0)
