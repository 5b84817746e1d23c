"""Stages of subsplats that each light refines by its own irradiance (Nichols and Wyman 2009, Sec. 3.3.1).

Every cell of every level has a representative pixel, and each light's irradiance there is an array: a port evaluates no
more than its lists come to. Lists follow each other light by light, coarsest level first, row by row.
"""

import itertools
from typing import Any

import numpy as np

from refgi.literal import multires as criteria
from refgi.literal import multires_lights as literal
from refgi.literal import multires_upsample as enlarging
from refgi.pairs.irradiance import Receivers, irradiance
from refgi.pairs.settings import PairSettings
from refgi.splat.multires.refinement.grid import representatives, top_level
from refgi.splat.multires.settings import ByIrradiance
from refgi.splat.multires.subsplats.upsample import upsample
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Arrays, Spec
from refgi.vectors.stages.lights import light_names, pixel_lights_of
from refgi.vectors.stages.multires_light import light_parameters, pair_bugs
from refgi.vectors.stages.multires_list import SUBSPLATS, subsplats_of
from refgi.vectors.stages.multires_ranges import IDS, covered_of
from refgi.vectors.stages.multires_upsample import LIGHT, LIST
from refgi.vectors.stages.pairs import EQ2, RECEIVERS

FIRST = "multires.first"
SPLIT = "AMS Sec. 3.3.1: max - min of any channel over the quadrants exceeds T"
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

    form = Form(criteria.representatives, {"triangle_id": IDS}, names, {"top": top})
    recipe.add("multires.representatives", "the pixel right and below of each cell's centre, moved into the picture; "
               "where it shows no surface the nearest that does, of equally near ones the upper, then the left", run,
               (IDS,), {name: Spec("row, column", "1", "row * columns + column of the picture; -1 without surface",
                                   tier="T0", index_of=index_of) for name in names}, paper="E-AMS-11",
               variants=(form,), bugs=form.bugs("representatives"))


def _add_samples(recipe: Recipe, pairs: PairSettings, top: int) -> None:
    places, names = _names("representative", top), _names("sample", top)
    lights, area = light_names(recipe), ("lights.area",) if pairs.needs_footprints else ()
    one_by_one = (*lights, *area)

    def run(arrays: Arrays, real: Any) -> Arrays:
        position, normal = (np.ascontiguousarray(arrays[name], real) for name in RECEIVERS[:2])
        there, each = Receivers(position, normal, covered_of(arrays)), []
        for k in range(arrays["lights.flux"].shape[1]):
            one = {**arrays, **{name: arrays[name][..., k : k + 1] for name in one_by_one}}
            footprint = np.ascontiguousarray(one["lights.area"], np.float64) if area else None
            each.append(irradiance(there, pixel_lights_of(one, real), pairs, footprint).reshape(3, -1))
        whole, made = np.array(each), {}
        for place, name in zip(places, names, strict=True):
            pixel = np.asarray(arrays[place])
            made[name] = np.where(pixel >= 0, whole[:, :, np.maximum(pixel, 0)], 0)
        return made

    form = Form(literal.samples, {"position": RECEIVERS[0], "normal": RECEIVERS[1], "pixels": places,
                                  **light_parameters(recipe, bool(area))}, names)
    bugs = [one for one in pair_bugs(form, recipe, bool(area)) if not any(word in one.cause for word in SINGLE)]
    recipe.add("multires.samples", "irradiance of each light at the representative of every cell", run,
               (*RECEIVERS, *lights, *area, *places), {name: Spec(
                   "light, rgb, row, column", "W/m^2", "its irradiance; 0 without surface", "linear RGB", EQ2)
                   for name in names}, paper=EQ2, exact=(RECEIVERS[0], "lights.position"), variants=(form,),
               bugs=(*bugs, *form.bugs("samples")))


def _add_splits(recipe: Recipe, settings: ByIrradiance, top: int) -> None:
    names = _names("split", top, 1)
    form = Form(literal.splits, {"pixels": _names("representative", top), "sampled": _names("sample", top)}, names,
                {"finest": settings.finest, "threshold": settings.threshold,
                 "relative": settings.form == "relative"})
    share = "times the largest channel of all samples of the light at the quadrants' level and above" if \
        settings.form == "relative" else "W/m^2"
    recipe.add("multires.splits", f"cells that a light's list comes to and splits: max - min of a channel over the "
               f"samples of its quadrants exceeds {settings.threshold:g} {share}", form,
               (*_names("representative", top), *_names("sample", top)), {name: Spec(
                   "light, row, column", "1", "whether the cell is split; false where the list does not come to it",
                   tier="T0") for name in names}, paper=SPLIT,
               variants=(form,), bugs=form.bugs("splits", f"splits/{settings.form}"))


def _add_leaves(recipe: Recipe, top: int) -> None:
    reads = (*_names("representative", top), *_names("sample", top), *_names("split", top, 1))
    form = Form(literal.lists, {
        "pixels": _names("representative", top), "sampled": _names("sample", top),
        "split_levels": _names("split", top, 1)}, (FIRST, *SUBSPLATS[:3], LIGHT))
    recipe.add("multires.lists", "subsplats of each light: cells with a surface that are not split, but whose coarser "
               "cell is; with their samples", form, reads, {
                   FIRST: Spec("light and one more", "1", "where each light's list begins, and the end", tier="T0"),
                   SUBSPLATS[0]: Spec("subsplat", "1", "level: side of 2^level pixels", tier="T0"),
                   SUBSPLATS[1]: Spec("subsplat", "1", "row in the grid of its level", tier="T0"),
                   SUBSPLATS[2]: Spec("subsplat", "1", "column in the grid of its level", tier="T0"),
                   LIGHT: Spec("rgb, subsplat", "W/m^2", "irradiance of its light", "linear RGB", EQ2)},
               paper="AMS Sec. 3.3.1", variants=(form,), bugs=form.bugs("lists"))


def _add_picture(recipe: Recipe, settings: ByIrradiance, top: int, filter_all: bool, corner: bool) -> None:
    name = "multires.upsampled.0"
    form = Form(enlarging.sum_of_pictures, {**LIST, "first": FIRST}, (name,), {
        "top": top, "mode": settings.upsampling, "filter_all": filter_all, "corner_rule": corner})

    def run(arrays: Arrays, real: Any) -> Arrays:
        covered, first = covered_of(arrays), np.asarray(arrays[FIRST])
        total = np.zeros((3, *covered.shape), real)
        for begin, end in itertools.pairwise(first):
            own = {one: np.asarray(arrays[one])[begin:end] for one in SUBSPLATS[:3]}
            values = np.ascontiguousarray(arrays[LIGHT][:, begin:end], real)
            total = total + upsample(values, subsplats_of({**own, IDS: arrays[IDS]}, top), covered,
                                     settings.upsampling, filter_all=filter_all, corner_rule=corner)
        return {name: total}

    recipe.add("multires.sum", "each light's subsplats upsampled by themselves, coarsest level first, and added", run,
               (IDS, FIRST, *SUBSPLATS[:3], LIGHT), {name: Spec(
                   "rgb, row, column", "W/m^2", "indirect irradiance; 0 without surface", "linear RGB")},
               paper="AMS Sec. 3.3.1, 3.5; E-AMS-09", variants=(form,), bugs=form.bugs(
                   "sum_of_pictures", f"sum_of_pictures/{'filter all' if filter_all else 'copy'}"))
