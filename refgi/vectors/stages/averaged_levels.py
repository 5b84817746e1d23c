"""Stages of mip levels whose texels are means: of all, or of radiance alone beside the closest (HSS Sec. 4).

Means weigh by surface area, the area is the sum: texels send what their pixels send. Radiance alone is a mean over
pixels with a surface, whose number is an array of its own.
"""

from typing import Any

import numpy as np

from refgi.rsm.raster.projection import Projection
from refgi.sssil.pyramid.levels import next_level
from refgi.sssil.pyramid.view import Level
from refgi.vectors.bugs.averaged import MEANS, averaged_bugs, counted, counted_bugs
from refgi.vectors.bugs.nearest_texels import PLANES
from refgi.vectors.recipe import Recipe
from refgi.vectors.spec import Array, Arrays, Spec
from refgi.vectors.stages import levels

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

    bugs = averaged_bugs(view, index, number) if whole else counted_bugs(view, index, number)
    parts = f"the {1 << first} x {1 << first} pixels" if index == 0 else "four finer texels, or those that there are"
    what = f"means of {parts} by area, areas added, normals of unit length again" if whole else \
        f"the nearest of {parts}, with the mean radiance of all pixels that show a surface"
    recipe.add(f"level{index}", what, run, reads, own, paper=MEANS,
               exact=(levels.PICTURE[0],) if index == 0 else (f"level{index - 1}.depth",), bugs=tuple(bugs))
