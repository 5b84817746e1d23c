"""Stages that join levels: blur along surfaces, joint bilateral upsampling, coarsest level first (HSS Sec. 3.2, 5)."""

from typing import Any

import numpy as np

from refgi.sssil.blur import blur
from refgi.sssil.settings import Bilateral, GeometryBlur, HssilSettings
from refgi.sssil.upsampling.upsample import Guide, upsample
from refgi.vectors.bugs.blur import BLUR, blur_bugs
from refgi.vectors.bugs.light import BILATERAL, sum_bugs, upsampling_bugs
from refgi.vectors.recipe import Recipe
from refgi.vectors.spec import Arrays, Spec
from refgi.vectors.stages.levels import level_names, level_of

GUIDE = ("depth", "normal")


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

    def run(arrays: Arrays, real: Any) -> Arrays:
        guides = [np.ascontiguousarray(arrays[one], real) for one in (*below, *here)]
        own = np.ascontiguousarray(arrays[added], real) if adds else None
        return {name: upsample(np.ascontiguousarray(arrays[coarse], real), Guide(*guides[:2]), Guide(*guides[2:]),
                               settings, own)}

    weights = settings.upsampling
    assert isinstance(weights, Bilateral)
    recipe.facts["upsampling"] = {"depth_sigma": weights.depth_sigma, "normal_power": weights.normal_power,
                                  "depth_of_a_texel": "mean, at its centre" if settings.senders.downsample == "average"
                                  else "nearest, at its corner along the slope"}
    bugs = upsampling_bugs(name, coarse, below, here, weights, added if adds else None,
                           settings.senders.downsample == "average")
    bugs += sum_bugs(recipe, run, index, name, coarse, added) if adds else []
    recipe.add(name.split(".")[0], "light of the coarser levels at this level's texels, and this level's own" if adds
               else "light of all levels at the pixels", run, (coarse, *below, *here, *((added,) if adds else ())), {
                   name: Spec("rgb, row, column", "W/m^2", "irradiance; 0 without surface", "linear RGB", BILATERAL)},
               paper=BILATERAL, exact=(below[0], here[0]), bugs=tuple(bugs))
    return name
