"""Stages of mip levels whose texels are means: of all, or of radiance alone beside the closest (HSS Sec. 4).

Means weigh by surface area, the area is the sum: texels send what their pixels send. Radiance alone is a mean over
pixels with a surface, whose number is an array of its own.
"""

from typing import Any

import numpy as np

from refgi.literal import hssil_levels as literal
from refgi.rsm.raster.projection import Projection
from refgi.sssil.pyramid.levels import next_level
from refgi.sssil.pyramid.view import Level
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Array, Arrays, Spec
from refgi.vectors.stages import levels
from refgi.vectors.stages.levels import PLANES

MEANS = "HSS Sec. 4: average; docs/methods/hssil"
COUNT = Spec("row, column", "1", "pixels with a surface that the texel covers", tier="T0")


def add_averaged(recipe: Recipe, view: Projection, numbers: tuple[int, int], whole: bool) -> None:
    """Add levels from the first of `numbers`, (first, how many), on; `whole`: all is a mean, not radiance alone."""
    first, count = numbers
    for index in range(count):
        _add_level(recipe, view, index, first, whole)


def _add_level(recipe: Recipe, view: Projection, index: int, first: int, whole: bool) -> None:
    keys = tuple(key for key in PLANES if key != "pixel") if whole else PLANES
    downsample, number, shape = "average" if whole else "closest_average", first + index, (view.height, view.width)
    own = {f"level{index}.{key}": spec for key in keys if (spec := levels.level_specs(index, view)[
        f"level{index}.{key}"])}
    own |= {} if whole else {f"level{index}.count": COUNT}
    reads = levels.PICTURE if index == 0 else tuple(name.replace(f"level{index}", f"level{index - 1}") for name in own)

    def made_of(level: Level, arrays: Arrays) -> dict[str, Array]:
        made = {f"level{index}.{key}": getattr(level, key) for key in keys}
        side = 1 << first if index == 0 else 2
        return made if whole else made | {f"level{index}.count": counted(arrays, index, side)}

    def run(arrays: Arrays, real: Any) -> Arrays:
        if index == 0:
            return made_of(levels.first_level_of(arrays, view, first, real, downsample), arrays)
        fine = levels.level_of(arrays, index - 1, number - 1, real)
        weight = None if whole else np.ascontiguousarray(arrays[f"level{index - 1}.count"], real)
        return made_of(next_level(fine, shape, downsample, weight), arrays)

    form, rows = _form(index, number, shape, whole), "level_of_means" if whole else "mean_radiance"
    parts = f"the {1 << first} x {1 << first} pixels" if index == 0 else "four finer texels, or those that there are"
    what = f"means of {parts} by area, areas added, normals of unit length again" if whole else \
        f"the nearest of {parts}, with the mean radiance of all pixels that show a surface"
    recipe.add(f"level{index}", what, run, reads, own, paper=MEANS,
               exact=(levels.PICTURE[0],) if index == 0 else (f"level{index - 1}.depth",), bugs=form.bugs(rows),
               variants=(form,))


def _form(index: int, number: int, size: tuple[int, int], whole: bool) -> Form:
    """Return the literal form of a level; `whole`: all is a mean."""
    keys = (*PLANES[:5],) if whole else (*PLANES, "count")
    writes = levels.level_names(index, *keys)
    if index == 0:
        function = literal.first_mean if whole else literal.first_mean_radiance
        return Form(function, levels.picture_reads(), writes, {"number": number})
    reads = levels.level_reads(index - 1, *keys)
    if whole:
        return Form(literal.level_of_means, reads, writes, {"side": 2})
    return Form(literal.coarser_mean_radiance, reads, writes, {"number": number, "size": size})


def counted(arrays: Arrays, index: int, side: int) -> Array:
    """Return the pixels with a surface that texels cover, from pixels or from the finer level's."""
    fine = np.isfinite(arrays["gbuffer.depth"]) if index == 0 else arrays[f"level{index - 1}.count"]
    return np.asarray(literal.parts(np.asarray(fine, np.int32), side).sum(axis=-1, dtype=np.int32))
