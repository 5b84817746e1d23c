"""Stages of gathering from reflective shadow maps: discs of texels, sums, interpolation (Dachsbacher, Stamminger 2005).

The samples xi_1, xi_2 are data. A disc's radius is a share of a map's side; texels of several maps lie on one sheet.
"""

from typing import Any

import numpy as np

from refgi.literal import gather as literal
from refgi.pairs.irradiance import Receivers
from refgi.rsm.buffers.light_projection import light_projection
from refgi.scene import Scene
from refgi.splat.gather.gather import DiscSettings, Interpolation
from refgi.splat.gather.gather_sum import disc_offsets
from refgi.splat.gather.interpolation import SimilarityLimits, coarse_pixels, interpolate
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Array, Arrays, Spec
from refgi.vectors.stages.gather_disc import OFFSET, PAPER, WEIGHT, Disc, add_centers, add_disc_sum, add_texels
from refgi.vectors.stages.pairs import RECEIVERS


def add_gather(
    recipe: Recipe, scene: Scene, resolution: int, disc: DiscSettings, points: Array, *, decided: bool = False
) -> None:
    """Add the gathered light of all maps; `points` (samples, 2) are xi_1 and xi_2.

    `decided`: places on the maps are exact numbers, such as those on a border, and decide.
    """
    count = len(scene.lights)
    squared = "rsm_weight_squared" in disc.as_published
    _add_pattern(recipe, points, squared)
    recipe.facts["gather"] = {"samples": len(points), "radius": disc.radius, "offset": disc.offset,
                              "weights_squared": squared}
    recipe.factors["samples"] = float(len(points))
    for index in range(count):
        maps = light_projection(scene.lights[index], scene.geometry, resolution)
        here = Disc(disc.radius, maps.height, maps.width)
        recipe.factors[f"texels of a map of rsm{index}"] = float(maps.height * maps.width)
        add_centers(recipe, index, maps, decided)
        add_texels(recipe, index, maps, here, decided)
        add_disc_sum(recipe, index, here, disc.offset)
    _add_total(recipe, count)


def _add_pattern(recipe: Recipe, points: Array, squared: bool) -> None:
    recipe.give("gather.xi", points, Spec("sample, (xi1, xi2)", "1", "numbers in [0, 1): radius and angle of samples"))

    def run(arrays: Arrays, real: Any) -> Arrays:
        pattern = disc_offsets(np.asarray(arrays["gather.xi"], real), squared)
        return {OFFSET: pattern[:, :2], WEIGHT: pattern[:, 2]}

    weights = "2 pi xi1; the weights' mean is the disc's area, pi" if not squared else "3 pi xi1^2, as is often done"
    form = Form(literal.pattern, {"xi": "gather.xi"}, (OFFSET, WEIGHT), {"weight_squared": squared})
    recipe.add("gather.pattern", "offsets in a disc of radius 1 and their weights", run, ("gather.xi",), {
        OFFSET: Spec("sample, (down, right)", "1", "xi1 (cos, sin)(2 pi xi2), radii"),
        WEIGHT: Spec("sample", "1", weights)}, paper=PAPER,
        bugs=form.bugs("pattern", "pattern/squared" if squared else "pattern/plain"), variants=(form,))


def _add_total(recipe: Recipe, count: int) -> None:
    names = tuple(f"gather{index}.irradiance" for index in range(count))

    def run(arrays: Arrays, real: Any) -> Arrays:
        total = np.zeros_like(np.asarray(arrays[names[0]], real))
        for name in names:
            total += arrays[name]
        return {"gather.sum": total}

    form = Form(literal.all_maps, {"irradiance": names}, ("gather.sum",))
    recipe.add("gather.sum", "light of all maps", run, names, {"gather.sum": Spec(
        "rgb, row, column", "W/m^2", "gathered irradiance where every pixel runs the sum", "linear RGB")}, paper=PAPER,
        bugs=form.bugs("maps") if count > 1 else (), variants=(form,))


def add_interpolation(recipe: Recipe, settings: Interpolation) -> None:
    """Add the light interpolated between coarse pixels, where these are similar, in place of the sum."""
    known = recipe.expected()
    covered = known[RECEIVERS[2]] >= 0
    reach = settings.reach * float(np.linalg.norm(np.ptp(known[RECEIVERS[0]][:, covered].astype(np.float64), axis=1)))
    coarse = coarse_pixels(covered.shape[0], covered.shape[1], settings.grid)
    recipe.facts["gather.interpolation"] = {"rows": coarse[0].tolist(), "columns": coarse[1].tolist(),
                                            "least_cosine": settings.least_cosine, "reach": reach, "least_similar": 3}

    def run(arrays: Arrays, real: Any) -> Arrays:
        position, normal, light = (np.ascontiguousarray(arrays[name], real) for name in (*RECEIVERS[:2], "gather.sum"))
        at = Receivers(position, normal, np.asarray(arrays[RECEIVERS[2]]) >= 0)
        result, chosen = interpolate(at, light, coarse, SimilarityLimits(settings.least_cosine, reach))
        return {"gather.interpolated": chosen, "gather.irradiance": np.where(chosen, result, light)}

    names = ("position", "normal", "triangle_id", "irradiance")
    form = Form(literal.interpolate, dict(zip(names, (*RECEIVERS, "gather.sum"), strict=True)),
                ("gather.interpolated", "gather.irradiance"), {
                    "grid": settings.grid, "least_cosine": settings.least_cosine, "reach": settings.reach})
    recipe.add("gather.interpolate", "light of similar coarse pixels where three of four around a pixel are, else its "
               "sum",
               run, (*RECEIVERS, "gather.sum"), {
                   "gather.interpolated": Spec("row, column", "1", "true where light is interpolated, and at coarse "
                                               "pixels",
                                               tier="T0"),
                   "gather.irradiance": Spec("rgb, row, column", "W/m^2", "indirect irradiance", "linear RGB")},
               paper="RSM 2005, Sec. 4; SII Fig. 12", exact=(RECEIVERS[0],), bugs=form.bugs("interpolate"),
               variants=(form,))
