"""Stages of adaptive refinement: ranges of depths and normals, discontinuous cells (Nichols and Wyman 2009, Sec. 3.2).

Level l has cells of 2^l x 2^l pixels, cut at the right and lower border; a pixel without surface counts nowhere.
`multires_list` goes on with the list of subsplats.
"""

import dataclasses
from collections.abc import Callable
from typing import Any, get_args

import numpy as np

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
from refgi.vectors.bugs.marks import marks_bugs
from refgi.vectors.bugs.ranges import ranges_bugs
from refgi.vectors.bugs.slopes import curvatures_bugs, slopes_bugs
from refgi.vectors.recipe import Recipe, reading
from refgi.vectors.spec import Array, Arrays, Bug, Run, Spec

IDS = "gbuffer.triangle_id"
Join = Callable[[list[Array]], Array]


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

    def named(low: Any, high: Any) -> Arrays:
        return dict(zip((*lows, *highs), (*low, *high), strict=True))

    def run(arrays: Arrays, real: Any, around: int = rim) -> Arrays:
        plane = np.ascontiguousarray(arrays[source], real)
        make: Callable[..., Mipmap] = depth_ranges if what == "depth" else normal_ranges
        mip = make(plane if what == "depth" else plane[:components], covered_of(arrays), top, around)
        return named(mip.low[1:], mip.high[1:])

    def joined(low: Join, high: Join) -> Run:
        def altered(arrays: Arrays, real: Any) -> Arrays:
            plane, here = np.asarray(arrays[source], real), covered_of(arrays)
            plane = plane if what == "depth" else plane[:components]
            return named(_pyramid(np.where(here, plane, np.inf), top, low),
                         _pyramid(np.where(here, plane, -np.inf), top, high))

        return altered

    empty = {source.replace(".", "__"): lambda a: np.where(np.isfinite(a), a, 0.0), "gbuffer__triangle_id": everywhere}
    axes, unit = ("row, column", "m") if what == "depth" else (f"{'xyz'[:components]}, row, column", "1")
    text = "{} " + ("depth" if what == "depth" else "of each component of normals") + " in each cell; {} where empty"
    recipe.add(f"multires.{what}_ranges", f"least and largest {what} within each cell of each level", run,
               (source, IDS), {
        **{name: Spec(axes, unit, text.format("least", "inf")) for name in lows},
        **{name: Spec(axes, unit, text.format("largest", "-inf")) for name in highs},
    }, paper="AMS Sec. 3.2.1" if what == "depth" else "AMS Sec. 3.2.2", exact=(source,), bugs=(
        Bug("pixels without surface count as 0", reading(run, **empty), "only surfaces count"),
        Bug("the last row and column of odd sizes are left out", reading(run, gbuffer__triangle_id=_even_part),
            "cells are cut by the border"),
        Bug("a cell takes one of its four finer cells", joined(lambda four: four[0], lambda four: four[0]),
            "min-max"),
        Bug("the fourth quadrant is left out", joined(lambda four: np.min(four[:3], axis=0),
                                                      lambda four: np.max(four[:3], axis=0)), "E-AMS-06"),
        Bug("least and largest are exchanged", lambda a, r: named(*(
            [run(a, r)[name] for name in names] for names in (highs, lows))), "least, largest"),
        Bug("the pixels around a cell are left out" if rim else "the pixels around a cell count as well",
            lambda a, r: run(a, r, 1 - rim), "rim of the settings (AMS Fig. 15)"),
        *ranges_bugs(what, top, rim, components)))


def _pyramid(plane: Array, top: int, join: Join) -> list[Array]:
    levels: list[Array] = []
    for _ in range(top):
        rows, columns = plane.shape[-2:]
        even = np.pad(plane, [(0, 0)] * (plane.ndim - 2) + [(0, rows % 2), (0, columns % 2)], mode="edge")
        plane = join([even[..., a::2, b::2] for a in (0, 1) for b in (0, 1)])
        levels.append(plane)
    return levels


def everywhere(ids: Array) -> Array:
    """Return ids of a picture that shows a surface everywhere."""
    return np.zeros_like(ids)


def _even_part(ids: Array) -> Array:
    cut = np.array(ids)
    rows, columns = ids.shape
    cut[rows - rows % 2 :], cut[:, columns - columns % 2 :] = -1, -1
    return cut


def add_slopes(recipe: Recipe, top: int, relative: bool) -> None:
    """Add the steepest change of depth of levels 1 to `top`."""
    names = of_levels("slope", top)

    def run(arrays: Arrays, real: Any, share: bool = relative) -> Arrays:
        mip = depth_slopes(np.ascontiguousarray(arrays["gbuffer.depth"], real), covered_of(arrays), top, share)
        return dict(zip(names, mip.high[1:], strict=True))

    recipe.add("multires.slopes", "steepest change of depth from pixel to pixel within each cell", run,
               ("gbuffer.depth", IDS), {
                   name: Spec("row, column", "1/pixel" if relative else "m/pixel", "sqrt(dx^2 + dy^2), the larger of "
                              "both differences along each axis" + ", over the depth" * relative) for name in names},
               paper="AMS Sec. 3.2.1", exact=("gbuffer.depth",), bugs=(
                   Bug("slopes are not divided by the depth" if relative else "slopes are divided by the depth",
                       lambda a, r: run(a, r, not relative), "measure of the settings"),
                   *slopes_bugs(names, relative),
                   Bug("pixels without surface count as 0", reading(
                       run, gbuffer__depth=lambda a: np.where(np.isfinite(a), a, 0.0), gbuffer__triangle_id=everywhere),
                       "only surfaces count")))


def add_curvatures(recipe: Recipe, top: int, rate: bool) -> None:
    """Add the largest chord between neighbouring normals of levels 1 to `top`."""
    names = of_levels("curvature", top)

    def run(arrays: Arrays, real: Any, over: bool = rate) -> Arrays:
        normal, position = (np.ascontiguousarray(arrays[f"gbuffer.{key}"], real) for key in ("normal", "position"))
        return dict(zip(names, curvatures(normal, position, covered_of(arrays), top, over).high[1:], strict=True))

    def angles(arrays: Arrays, real: Any) -> Arrays:
        return {name: 2 * np.arcsin(np.minimum(chord / 2, 1)) for name, chord in run(arrays, real, False).items()}

    recipe.add("multires.curvatures", "largest Eq. 1 between neighbouring pixels within each cell", run,
               ("gbuffer.normal", "gbuffer.position", IDS), {
                   name: Spec("row, column", "1/m" if rate else "1", "largest |N1 - N2|" + " / |x1 - x2|" * rate,
                              paper="AMS Eq. 1; E-AMS-01") for name in names},
               paper="AMS Eq. 1; E-AMS-01", exact=("gbuffer.normal", "gbuffer.position"), bugs=(
                   *curvatures_bugs(names, rate),
                   Bug("angles in place of chords", angles, "E-AMS-01: |N1 - N2|"),
                   Bug("the distance of the points is left out" if rate else "divided by the distance of the points",
                       lambda a, r: run(a, r, not rate), "E-AMS-01"),
                   Bug("pixels without surface count", reading(run, gbuffer__triangle_id=everywhere),
                       "only surfaces count")))


def add_discontinuities(
    recipe: Recipe, criteria: Criteria, top: int, finest: int, shape: tuple[int, int]
) -> None:
    """Add which cells of levels 1 to `top` exceed a threshold."""
    names, sizes = of_levels("discontinuous", top), layout(*shape, top, first=1)
    count = element_count(sizes) if top else 0
    parts = [key for kind, keys in (("depth", ("depth_least", "depth_largest")), ("derivative", ("slope",)),
                                    ("normal", ("normal_least", "normal_largest")), ("curvature", ("curvature",)))
             if getattr(criteria, kind) is not None for key in keys]

    def marks(arrays: Arrays, real: Any, how: Criteria, stop: int = finest) -> Array:
        found = np.zeros(count, np.bool_)
        begin = int(sizes[stop + 1, START]) if stop < top else count
        known = {key: np.concatenate([np.asarray(arrays[name], real).reshape(-1, arrays[name].shape[-2] * arrays[
            name].shape[-1]) for name in of_levels(key, top)], axis=1) for key in parts if top}
        if begin < count and how.depth is not None:
            mark_depth_ranges(known["depth_least"], known["depth_largest"], how.depth, sizes, found, begin)
        if begin < count and how.derivative is not None:
            mark_depth_slopes(known["slope"], how.derivative, sizes, found, begin)
        if begin < count and how.normal is not None:
            axes = len(how.normal.components)
            mark_normal_ranges(known["normal_least"][:axes], known["normal_largest"][:axes], how.normal, found, begin)
        if begin < count and how.curvature is not None:
            mark_curvatures(known["curvature"], how.curvature, found, begin)
        return found

    def run(arrays: Arrays, real: Any, how: Criteria = criteria, stop: int = finest) -> Arrays:
        return dict(zip(names, level_views(marks(arrays, real, how, stop), sizes, first=1), strict=True))

    def another(**parts_of: Any) -> Run:
        return lambda a, r: run(a, r, dataclasses.replace(criteria, **parts_of))

    bugs = [Bug(f"the test of {kind} is left out", another(**{kind: None}), "any test counts")
            for kind in ("depth", "derivative", "normal", "curvature") if getattr(criteria, kind) is not None]
    if criteria.depth is not None:
        bugs += [Bug(cause, another(depth=dataclasses.replace(criteria.depth, measure=measure)), "E-AMS-07")
                 for measure, cause in zip(get_args(Measure), (
                       "depths are compared with a share of the depth (relative, not absolute)",
                       "depths are compared with a length in metres (absolute, not relative)",
                       "the threshold of depths falls as 3 / level"), strict=True) if measure != criteria.depth.measure]
    if criteria.normal is not None and criteria.normal.components == "xyz":
        bugs.append(Bug("z of the normals is left out", another(normal=dataclasses.replace(
            criteria.normal, components="xy")), "E-AMS-07: three components, x and y in the authors' demo"))
    if criteria.depth is not None or criteria.derivative is not None:
        bugs += marks_bugs(names, criteria, finest)
    if finest:
        bugs.append(Bug("cells of the finest level are refined", lambda a, r: run(a, r, stop=finest - 1),
                        "the finest level is never refined"))
    recipe.add("multires.discontinuities", "cells that a test of their own finds discontinuous", run,
               tuple(name for key in parts for name in of_levels(key, top)),
               {name: Spec("row, column", "1", "true where a test exceeds its threshold", tier="T0") for name in names},
               paper="AMS Sec. 3.2, 3.3; E-AMS-07", bugs=tuple(bugs))
