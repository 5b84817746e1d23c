"""Stages that join levels: blur along surfaces, joint bilateral upsampling, coarsest level first (HSS Sec. 3.2, 5)."""

from typing import Any

import numpy as np

from refgi.literal import upsampling as literal
from refgi.sssil.blur import blur
from refgi.sssil.settings import Bilateral, GeometryBlur, HssilSettings
from refgi.sssil.upsampling.upsample import Guide, upsample
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Arrays, Bug, Run, Spec
from refgi.vectors.stages.levels import level_names, level_of

BILATERAL = "HSS Sec. 3.2, 5: joint bilateral, 3 x 3; weights in docs/methods/hssil (E-HSS-12)"
BLUR = "docs/methods/hssil: mean over a tile's texels on one plane (after Keller and Heidrich 2001)"
LEVELS = "HSS Sec. 3.2: sums of disjoint crowns"
GUIDE = ("depth", "normal")


def add_blur(recipe: Recipe, settings: GeometryBlur, index: int, number: int) -> None:
    """Add the mean over a window of texels of the same surface."""
    light, name = f"gather{index}.irradiance", f"blur{index}.irradiance"
    planes = level_names(index, "position", "normal", "depth")

    def run(arrays: Arrays, real: Any) -> Arrays:
        return {name: blur(np.ascontiguousarray(arrays[light], real), level_of(arrays, index, number, real), settings)}

    numbers = {"size": settings.size, "plane_tolerance": settings.plane_tolerance, "cosine": settings.cosine}
    form = Form(literal.blur, {"light": light, **dict(zip(("position", "normal", "depth"), planes, strict=True))},
                (name,), numbers)
    recipe.facts["blur"] = numbers
    recipe.add(f"blur{index}", "mean over a window along the row, then along the column, of texels on the texel's "
               "tangent plane that face as it does", run, (light, *planes), {
                   name: Spec("rgb, row, column", "W/m^2", "irradiance by this level, averaged", "linear RGB", BLUR)},
               paper=BLUR, exact=planes, bugs=form.bugs("blur", *(("blur/even",) if settings.size % 2 == 0 else ())),
               variants=(form,))


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
    mean = settings.senders.downsample == "average"
    reads = dict(zip(("coarse", "below_depth", "below_normal", "depth", "normal"), (coarse, *below, *here),
                     strict=True))
    form = Form(literal.level_sum if adds else literal.upsample, reads | ({"own": added} if adds else {}), (name,), {
        "factor": 2 if adds else 1 << settings.sampling.first_level, "depth_sigma": weights.depth_sigma,
        "normal_power": weights.normal_power, "nearest": not mean})
    lists = "upsample", *(("level_sum",) if adds else ()), *(("upsample/mean",) if mean else ())
    recipe.add(name.split(".")[0], "light of the coarser levels at this level's texels, and this level's own" if adds
               else "light of all levels at the pixels", run, (coarse, *below, *here, *((added,) if adds else ())), {
                   name: Spec("rgb, row, column", "W/m^2", "irradiance; 0 without surface", "linear RGB", BILATERAL)},
               paper=BILATERAL, exact=(below[0], here[0]), variants=(form,),
               bugs=(*form.bugs(*lists), *(_other_light(recipe, run, coarse, added) if adds else ())))
    return name


def _other_light(recipe: Recipe, run: Run, coarse: str, added: str) -> tuple[Bug, ...]:
    """Return bugs of a sum that takes another light of the case for its own, `added`, or that of the coarser levels."""
    def taking(**others: str) -> Run:
        def wrong(arrays: Arrays, real: Any) -> Arrays:
            known = recipe.expected()
            return run({**arrays, **{{"coarse": coarse, "added": added}[key]: known[other].astype(real)
                                     for key, other in others.items()}}, real)

        return wrong

    before, bugs = "that of the gather, before the blur", []
    raw, below = added.replace("blur", "gather"), coarse.replace("blur", "gather")
    if added.startswith("blur"):
        bugs.append(Bug(f"unblurred light of the level is added: {before}", taking(added=raw), LEVELS))
        if coarse.startswith("blur"):
            bugs += [Bug(f"unblurred light of the coarser level: {before}", taking(coarse=below), LEVELS),
                     Bug(f"unblurred light of both levels: {before}", taking(coarse=below, added=raw), LEVELS)]
    if coarse.startswith("light"):
        own = coarse.replace("light", added.split(".")[0].rstrip("0123456789"))
        bugs.append(Bug("only the next coarser level's own light is added, not the sum of all coarser ones",
                        taking(coarse=own), LEVELS))
    return tuple(bugs)
