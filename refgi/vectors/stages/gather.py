"""Stages of gathering from reflective shadow maps: discs of texels, sums, interpolation (Dachsbacher, Stamminger 2005).

The samples xi_1, xi_2 are data. A disc's radius is a share of a map's side; texels of several maps lie on one sheet.
"""

import math
from typing import Any

import numpy as np

from refgi.pairs.irradiance import Receivers
from refgi.rsm.buffers.light_projection import light_projection
from refgi.scene import Scene
from refgi.splat.gather.gather import DiscSettings, Interpolation
from refgi.splat.gather.gather_sum import disc_offsets
from refgi.splat.gather.interpolation import SimilarityLimits, coarse_pixels, interpolate
from refgi.vectors.recipe import Recipe, reading, writing
from refgi.vectors.spec import Array, Arrays, Bug, Spec
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

    def run(arrays: Arrays, real: Any, square: bool = squared) -> Arrays:
        pattern = disc_offsets(np.asarray(arrays["gather.xi"], real), square)
        return {OFFSET: pattern[:, :2], WEIGHT: pattern[:, 2]}

    def equal_area(arrays: Arrays, real: Any) -> Arrays:
        return run({"gather.xi": np.asarray(arrays["gather.xi"], real) ** (0.5, 1)}, real)

    weights = "2 pi xi1; the weights' mean is the disc's area, pi" if not squared else "3 pi xi1^2, as is often done"
    recipe.add("gather.pattern", "offsets in a disc of radius 1 and their weights", run, ("gather.xi",), {
        OFFSET: Spec("sample, (down, right)", "1", "xi1 (cos, sin)(2 pi xi2), radii"),
        WEIGHT: Spec("sample", "1", weights)}, paper=PAPER, bugs=(
            Bug("weights are xi1" if squared else "weights are xi1^2", lambda a, r: run(a, r, not squared),
                "papers A.5: density 1 / (2 pi rho)"),
            Bug("all weights are equal", writing(run, gather__weight=lambda a: np.full_like(a, np.pi)), "papers A.5"),
            Bug("samples are spread evenly over the disc's area", equal_area, "radius xi1, not its root"),
            Bug("cosine and sine are exchanged", writing(run, gather__offset=lambda a: a[:, ::-1]), "down, right"),
            Bug("xi2 is the radius and xi1 the angle", reading(run, gather__xi=lambda a: a[:, ::-1]), "xi1: radius"),
            Bug("the angle runs over half a turn", reading(run, gather__xi=lambda a: a * (1, 0.5)), "2 pi xi2"),
            Bug("2 pi is left out of the weights", writing(run, gather__weight=lambda a: a / (2 * np.pi)),
                "papers A.5")))


def _add_total(recipe: Recipe, count: int) -> None:
    names = tuple(f"gather{index}.irradiance" for index in range(count))

    def run(arrays: Arrays, real: Any, maps: int = count) -> Arrays:
        total = np.zeros_like(np.asarray(arrays[names[0]], real))
        for name in names[:maps]:
            total += arrays[name]
        return {"gather.sum": total}

    recipe.add("gather.sum", "light of all maps", run, names, {"gather.sum": Spec(
        "rgb, row, column", "W/m^2", "gathered irradiance where every pixel runs the sum", "linear RGB")}, paper=PAPER,
        bugs=() if count == 1 else (
            Bug("only the first map", lambda a, r: run(a, r, 1), "all lamps"),
            Bug("the mean over the maps", writing(run, gather__sum=lambda a: a / count), "the sum of all lamps")))


def add_interpolation(recipe: Recipe, settings: Interpolation) -> None:
    """Add the light interpolated between coarse pixels, where these are similar, in place of the sum."""
    known = recipe.expected()
    covered = known[RECEIVERS[2]] >= 0
    reach = settings.reach * float(np.linalg.norm(np.ptp(known[RECEIVERS[0]][:, covered].astype(np.float64), axis=1)))
    coarse = coarse_pixels(covered.shape[0], covered.shape[1], settings.grid)
    recipe.facts["gather.interpolation"] = {"rows": coarse[0].tolist(), "columns": coarse[1].tolist(),
                                            "least_cosine": settings.least_cosine, "reach": reach, "least_similar": 3}

    alike = SimilarityLimits(settings.least_cosine, reach)

    def run(arrays: Arrays, real: Any, limits: SimilarityLimits = alike,
            places: tuple[Array, Array] = coarse) -> Arrays:
        position, normal, light = (np.ascontiguousarray(arrays[name], real) for name in (*RECEIVERS[:2], "gather.sum"))
        at = Receivers(position, normal, np.asarray(arrays[RECEIVERS[2]]) >= 0)
        result, chosen = interpolate(at, light, places, limits)
        return {"gather.interpolated": chosen, "gather.irradiance": np.where(chosen, result, light)}

    def between(low: Array, size: int) -> Array:
        return np.asarray(np.minimum(low + 1, size - 1))

    recipe.add("gather.interpolate", "light of similar coarse pixels where three of four around a pixel are, else its "
               "sum",
               run, (*RECEIVERS, "gather.sum"), {
                   "gather.interpolated": Spec("row, column", "1", "true where light is interpolated, and at coarse "
                                               "pixels",
                                               tier="T0"),
                   "gather.irradiance": Spec("rgb, row, column", "W/m^2", "indirect irradiance", "linear RGB")},
               paper="RSM 2005, Sec. 4; SII Fig. 12", exact=(RECEIVERS[0],), bugs=(
                   Bug("normals are not compared", lambda a, r: run(a, r, SimilarityLimits(-2.0, reach)),
                       "similar pixels"),
                   Bug("places are not compared", lambda a, r: run(a, r, SimilarityLimits(
                       settings.least_cosine, math.inf)), "similar pixels"),
                   Bug("the reach is not scaled by the picture's extent", lambda a, r: run(a, r, SimilarityLimits(
                       settings.least_cosine, settings.reach)), "reach times the diagonal"),
                   Bug("coarse pixels are the first of their cells",
                       lambda a, r: run(a, r, places=_first(coarse, covered)),
                       "the middles of cells"),
                   Bug("coarse pixels are one further", lambda a, r: run(a, r, places=(
                       between(coarse[0], covered.shape[0]), between(coarse[1], covered.shape[1]))),
                       "the middles of cells"),
                   Bug("every pixel runs the sum", lambda a, r: {**run(a, r), "gather.irradiance": np.asarray(
                       a["gather.sum"])}, "interpolated where similar"),
                   Bug("coarse pixels of any surface count", lambda a, r: run(a, r, SimilarityLimits(-2.0, math.inf)),
                       "similar pixels")))


def _first(coarse: tuple[Array, Array], covered: Array) -> tuple[Array, Array]:
    rows, columns = (np.arange(len(one)) * size // len(one) for one, size in zip(coarse, covered.shape, strict=True))
    return rows, columns
