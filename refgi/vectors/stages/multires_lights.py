"""Stages of subsplats that each light refines by its own irradiance (Nichols and Wyman 2009, Sec. 3.3.1).

Every cell of every level has a representative pixel, and each light's irradiance there is an array: a port evaluates no
more than its lists come to. Lists follow each other light by light, coarsest level first, row by row.
"""

import itertools
from typing import Any

import numpy as np

from refgi.pairs.irradiance import Receivers, irradiance
from refgi.pairs.settings import PairSettings
from refgi.splat.multires.refinement.grid import level_shape, representatives, top_level
from refgi.splat.multires.settings import ByIrradiance
from refgi.splat.multires.subsplats.upsample import upsample
from refgi.vectors.bugs.pair import pair_bugs
from refgi.vectors.bugs.splits import SPLIT, split_bugs, splits
from refgi.vectors.recipe import Recipe, reading, writing
from refgi.vectors.spec import Array, Arrays, Bug, Run, Spec
from refgi.vectors.stages.lights import light_names, pixel_lights_of
from refgi.vectors.stages.multires_list import SUBSPLATS, subsplats_of
from refgi.vectors.stages.multires_ranges import IDS, covered_of
from refgi.vectors.stages.multires_upsample import LIGHT
from refgi.vectors.stages.pairs import EQ2, RECEIVERS

FIRST = "multires.first"
SINGLE = ("half of the lights", "last light", "largest light", "0.1 m", "lights shine backwards",
          "the light's cosine is taken")  # what one light cannot show, or the samples do not


def add_lists(
    recipe: Recipe, settings: ByIrradiance, pairs: PairSettings, size: tuple[int, int], filter_all: bool, corner: bool
) -> None:
    """Add representatives, samples, splits, lists and the sum of all lights' pictures; `size`: columns and rows."""
    top = top_level(size[1], size[0], settings.coarsest)
    recipe.facts["multires"] = {"coarsest_level": top, "finest_level": settings.finest, "threshold": settings.threshold,
                                "form": settings.form, "upsampling": settings.upsampling, "filter_all": filter_all,
                                "corner_rule": corner}
    _add_representatives(recipe, top, size)
    _add_samples(recipe, pairs, top)
    _add_splits(recipe, settings, top)
    _add_leaves(recipe, top)
    _add_picture(recipe, settings, top, filter_all, corner)


def _names(key: str, top: int, first: int = 0) -> tuple[str, ...]:
    return tuple(f"multires.{key}.{level}" for level in range(first, top + 1))


def _add_representatives(recipe: Recipe, top: int, size: tuple[int, int]) -> None:
    names, index_of = _names("representative", top), (size[1], size[0])

    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001 whole numbers
        return dict(zip(names, representatives(covered_of(arrays), top), strict=True))

    def literal(half: float = 0.5, nearest: bool = True) -> Run:
        def altered(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
            covered, made = covered_of(arrays), {}
            for level, name in enumerate(names):
                places = np.full(level_shape(covered.shape[0], covered.shape[1], level), -1, np.int32)
                for i, j in np.ndindex(*places.shape):
                    places[i, j] = _representative(covered, level, (i, j), half, nearest)
                made[name] = places
            return made

        return altered

    recipe.add("multires.representatives", "the pixel right and below of each cell's centre, moved into the picture; "
               "where it shows no surface the nearest that does, of equally near ones the upper, then the left", run,
               (IDS,), {name: Spec("row, column", "1", "row * columns + column of the picture; -1 without surface",
                                   tier="T0", index_of=index_of) for name in names}, paper="E-AMS-11", bugs=(
                   Bug("the upper left pixel of the cell", literal(0.0), "E-AMS-11"),
                   Bug("the lower right pixel of the cell", literal(1.0), "E-AMS-11"),
                   Bug("the first pixel with a surface, not the nearest to the centre", literal(nearest=False),
                       "E-AMS-11")))


def _representative(covered: Array, level: int, cell: tuple[int, int], half: float, nearest: bool) -> int:
    side = 1 << level
    top, left = cell[0] * side, cell[1] * side
    row, column = (min(begin + min(int(half * side), side - 1), size - 1)
                   for begin, size in zip((top, left), covered.shape, strict=True))
    if covered[row, column]:
        return int(row * covered.shape[1] + column)
    inside = np.argwhere(covered[top : top + side, left : left + side]) + np.array([top, left])
    if not len(inside):
        return -1
    off = ((inside - (row, column)) ** 2).sum(axis=1) if nearest else np.zeros(len(inside))
    y, x = inside[int(off.argmin())]
    return int(y * covered.shape[1] + x)


def _add_samples(recipe: Recipe, pairs: PairSettings, top: int) -> None:
    places, names = _names("representative", top), _names("sample", top)
    lights, area = light_names(recipe), ("lights.area",) if pairs.needs_footprints else ()
    one_by_one = (*lights, *area)

    def sums(arrays: Arrays, real: Any) -> Arrays:
        position, normal = (np.ascontiguousarray(arrays[name], real) for name in RECEIVERS[:2])
        footprint = np.ascontiguousarray(arrays["lights.area"], np.float64) if area else None
        there = Receivers(position, normal, covered_of(arrays))
        return {"sum.irradiance": irradiance(there, pixel_lights_of(arrays, real), pairs, footprint)}

    def of_each(inner: Run) -> Run:
        """Return the samples of all lights by what sums the light of some at every pixel."""
        def run(arrays: Arrays, real: Any) -> Arrays:
            each = []
            for k in range(arrays["lights.flux"].shape[1]):
                single = {name: arrays[name][..., k : k + 1] for name in one_by_one}
                each.append(inner({**arrays, **single}, real)["sum.irradiance"].reshape(3, -1))
            whole, made = np.array(each), {}
            for place, name in zip(places, names, strict=True):
                pixel = np.asarray(arrays[place])
                made[name] = np.where(pixel >= 0, whole[:, :, np.maximum(pixel, 0)], 0)
            return made

        return run

    bugs = [Bug(one.cause, of_each(one.run), one.paper) for one in pair_bugs(
        sums, bool(area), "lights.lobe_flux" in recipe.specs) if not any(word in one.cause for word in SINGLE)]
    recipe.add("multires.samples", "irradiance of each light at the representative of every cell", of_each(sums),
               (*RECEIVERS, *lights, *area, *places), {name: Spec(
                   "light, rgb, row, column", "W/m^2", "its irradiance; 0 without surface", "linear RGB", EQ2)
                   for name in names}, paper=EQ2, exact=(RECEIVERS[0], "lights.position"), bugs=(
                       *bugs, Bug("1/pi is left out", of_each(reading(sums, lights__flux=lambda a: a * np.pi)), EQ2)))


def _add_splits(recipe: Recipe, settings: ByIrradiance, top: int) -> None:
    names = _names("split", top, 1)

    def levels(arrays: Arrays) -> tuple[list[Array], list[Array]]:
        samples = [np.asarray(arrays[name]) for name in _names("sample", top)]
        return samples, [np.asarray(arrays[name]) >= 0 for name in _names("representative", top)]

    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001 in the type of the samples
        made = splits(*levels(arrays), settings.finest, settings.threshold, settings.form)
        return dict(zip(names, made, strict=True))

    share = "times the largest channel of all samples of the light at the quadrants' level and above" if \
        settings.form == "relative" else "W/m^2"
    recipe.add("multires.splits", f"cells that a light's list comes to and splits: max - min of a channel over the "
               f"samples of its quadrants exceeds {settings.threshold:g} {share}", run,
               (*_names("representative", top), *_names("sample", top)), {name: Spec(
                   "light, row, column", "1", "whether the cell is split; false where the list does not come to it",
                   tier="T0") for name in names}, paper=SPLIT, bugs=tuple(split_bugs(names, levels, settings)))


def _add_leaves(recipe: Recipe, top: int) -> None:
    reads = (*_names("representative", top), *_names("sample", top), *_names("split", top, 1))

    def run(arrays: Arrays, real: Any, empty: bool = False, fine_first: bool = False) -> Arrays:
        there = [np.asarray(arrays[name]) >= 0 for name in _names("representative", top)]
        samples = [np.asarray(arrays[name], real) for name in _names("sample", top)]
        split = [np.zeros((len(samples[0]), *there[0].shape), bool),
                 *(np.asarray(arrays[name]) for name in _names("split", top, 1))]
        cells: list[tuple[int, int, int]] = []
        values, first = [], [0]
        for k in range(len(samples[0])):
            for level in range(top + 1) if fine_first else range(top, -1, -1):
                above = np.ones(there[level].shape, bool) if level == top else _down(split[level + 1][k], there[level])
                leaf = above & (there[level] | empty) & ~split[level][k]
                cells += [(level, int(i), int(j)) for i, j in np.argwhere(leaf)]
                values.append(samples[level][k][:, leaf])
            first.append(len(cells))
        columns = np.array(cells, np.int32).reshape(-1, 3).T
        return {FIRST: np.array(first, np.int32), **dict(zip(SUBSPLATS[:3], columns, strict=True)),
                LIGHT: np.concatenate([np.zeros((3, 0), real), *values], axis=1)}

    recipe.add("multires.lists", "subsplats of each light: cells with a surface that are not split, but whose coarser "
               "cell is; with their samples", run, reads, {
                   FIRST: Spec("light and one more", "1", "where each light's list begins, and the end", tier="T0"),
                   SUBSPLATS[0]: Spec("subsplat", "1", "level: side of 2^level pixels", tier="T0"),
                   SUBSPLATS[1]: Spec("subsplat", "1", "row in the grid of its level", tier="T0"),
                   SUBSPLATS[2]: Spec("subsplat", "1", "column in the grid of its level", tier="T0"),
                   LIGHT: Spec("rgb, subsplat", "W/m^2", "irradiance of its light", "linear RGB", EQ2)},
               paper="AMS Sec. 3.3.1", bugs=(
                   Bug("cells without surface are listed", lambda a, r: run(a, r, empty=True), "never evaluated"),
                   Bug("finest levels come first", lambda a, r: run(a, r, fine_first=True), "coarsest first"),
                   Bug("rows and columns are exchanged", _exchanged(run), "row, column"),
                   Bug("levels count from the coarsest: 0 is the coarsest", writing(
                       run, multires__level=lambda a: top - a), "0 is the picture"),
                   Bug("lists begin one too late", writing(run, multires__first=lambda a: a + 1), "from 0")))


def _down(split: Array, fine: Array) -> Array:
    return np.repeat(np.repeat(split, 2, axis=0), 2, axis=1)[: fine.shape[0], : fine.shape[1]]


def _exchanged(run: Run) -> Run:
    def altered(arrays: Arrays, real: Any) -> Arrays:
        made = run(arrays, real)
        return {**made, SUBSPLATS[1]: made[SUBSPLATS[2]], SUBSPLATS[2]: made[SUBSPLATS[1]]}

    return altered


def _add_picture(recipe: Recipe, settings: ByIrradiance, top: int, filter_all: bool, corner: bool) -> None:
    name = "multires.upsampled.0"

    def run(arrays: Arrays, real: Any, kept: slice = slice(None), how: str = settings.upsampling,
            every: bool = filter_all) -> Arrays:
        covered, first, total = covered_of(arrays), np.asarray(arrays[FIRST]), None
        for begin, end in list(itertools.pairwise(first))[kept]:
            own = {one: np.asarray(arrays[one])[begin:end] for one in SUBSPLATS[:3]}
            values = np.ascontiguousarray(arrays[LIGHT][:, begin:end], real)
            made = upsample(values, subsplats_of({**own, IDS: arrays[IDS]}, top), covered, how,  # type: ignore[arg-type]
                            filter_all=every, corner_rule=corner)
            total = made if total is None else total + made
        return {name: np.zeros((3, *covered.shape), real) if total is None else total}

    def mean(arrays: Arrays, real: Any) -> Arrays:
        return {name: run(arrays, real)[name] / (len(arrays[FIRST]) - 1)}

    recipe.add("multires.sum", "each light's subsplats upsampled by themselves, coarsest level first, and added", run,
               (IDS, FIRST, *SUBSPLATS[:3], LIGHT), {name: Spec(
                   "rgb, row, column", "W/m^2", "indirect irradiance; 0 without surface", "linear RGB")},
               paper="AMS Sec. 3.3.1, 3.5; E-AMS-09", bugs=(
                   Bug("each pixel has the light of its subsplat: nothing is upsampled", lambda a, r: run(
                       a, r, how="nearest"), "E-AMS-09"),
                   Bug("the filter of the authors' demo", lambda a, r: run(a, r, how="demo"), "E-AMS-09"),
                   Bug("cells evaluated at a level are " + ("copied" if filter_all else "filtered as well"),
                       lambda a, r: run(a, r, every=not filter_all), "E-AMS-09"),
                   Bug("the last light is left out", lambda a, r: run(a, r, kept=slice(None, -1)), "all lights"),
                   Bug("the first light alone", lambda a, r: run(a, r, kept=slice(0, 1)), "all lights"),
                   Bug("the mean over lights, not their sum", mean, "a sum")))
