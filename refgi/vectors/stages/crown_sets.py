"""Stages of samples that all receivers share: a mirror-symmetric set, and every texel within reach (HSS Sec. 3.2)."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from refgi.literal import hssil_crown as literal
from refgi.sssil.crown.pattern import every_texel, mirrored_offsets
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Arrays, Spec

CROWN = "HSS Sec. 3.2: from r to 2 r around the receiver, at the first level the disc as well"


def add_mirrored(
    recipe: Recipe, index: int, counts: tuple[int, int], reach: tuple[float, Any], specs: Mapping[str, Spec]
) -> None:
    """Add the samples of a fixed set: `counts` in disc and crown, `reach` the radius and the density."""
    name, (radius, density) = f"samples{index}", reach

    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001 one precision: double
        shift = np.asarray(arrays[f"{name}.shift"], np.float64)
        offsets, weight = mirrored_offsets(*counts, shift, radius, density)
        return {f"{name}.offsets": offsets[None, None], f"{name}.weight": weight[None, None]}

    form = Form(literal.mirrored_samples, {"start": f"{name}.shift"}, (*specs,),
                {"inner": counts[0], "crown": counts[1], "radius": radius, "density": density})
    recipe.add(name, "half of the points, shifted, at angles pi (v - 1/2), to the right of the receiver, each followed "
               "by its mirror image to the left; the disc's pairs, the crown's; then the odd point of each, straight "
               "above or below", run, (f"{name}.shift",), specs, paper=CROWN, exact=(f"{name}.shift",),
               bugs=form.bugs("mirrored_samples", f"mirrored_samples/{density}"), variants=(form,))


def add_every_texel(recipe: Recipe, index: int, radius: float, specs: Mapping[str, Spec]) -> None:
    """Add every texel within reach, once."""
    name, low = f"samples{index}", 0.0 if index == 0 else radius

    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001 whole numbers
        offsets = every_texel(low, 2.0 * radius)
        return {f"{name}.offsets": offsets[None, None], f"{name}.weight": np.ones((1, 1, len(offsets)), real)}

    form = Form(literal.every_texel, {}, (*specs,), {"low": low, "high": 2.0 * radius})
    recipe.add(name, f"every texel less than {2 * radius:g} texels away" + (f" and {low:g} at least" if low else "")
               + ", row by row: those to the right, nearest first, each followed by its mirror image to the left; then "
               "those straight above and below", run, (), specs, paper=CROWN,
               bugs=form.bugs("every_texel", *(("every_texel/ring",) if low else ())), variants=(form,))
