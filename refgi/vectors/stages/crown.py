"""Stages of crown sampling: shifted points, offsets and weights of samples, sum of their light (HSS Sec. 3.1, 3.2).

The points of a level are one Kronecker sequence (u, v): u says how far from the receiver, 2 pi v in which direction.
Each texel of a tile adds its own shift modulo 1. The random start of the shifts is given.
"""

from typing import Any

import numpy as np

from refgi.sampling import FIRST_STEP, SECOND_STEP
from refgi.settings import replaced
from refgi.sssil.crown.gather import gather
from refgi.sssil.crown.pattern import PHASES, tile_offsets
from refgi.sssil.crown.points import key_shift, level_key, sample_points, tile_shifts
from refgi.sssil.settings import HssilSettings, SamplingSettings
from refgi.vectors.bugs.crown_gather import EQ4, SENDER, gather_bugs
from refgi.vectors.bugs.crown_points import sequence_bugs
from refgi.vectors.bugs.crown_sample import CROWN, sample_bugs
from refgi.vectors.recipe import Recipe
from refgi.vectors.spec import Arrays, Spec
from refgi.vectors.stages.levels import level_names, level_of


def add_samples(recipe: Recipe, sampling: SamplingSettings, index: int, rows: int, radius: float) -> None:
    """Add shifts, offsets and weights of the samples of a level with a number of rows; patterns with tiles alone."""
    inner, crown = sampling.counts(index)
    tile = (rows, PHASES) if sampling.pattern == "row" else (sampling.tile, sampling.tile)
    name = f"samples{index}"
    shift, points, shifts = f"{name}.shift", f"{name}.points", f"{name}.shifts"
    start = key_shift(level_key(sampling.seed, sampling.first_level + index))
    recipe.give(shift, np.minimum(start, 1.0 - 2.0**-24), Spec("uv", "1", "random numbers: shift of the tile's first "
                                                               "texel"))
    recipe.facts[name] = {"disc": inner, "crown": crown, "radius": radius, "tile": list(tile),
                          "pattern": sampling.pattern, "density": sampling.density, "steps": [FIRST_STEP, SECOND_STEP]}
    _add_shifts(recipe, name, (inner, crown), tile)

    def run(arrays: Arrays, real: Any) -> Arrays:
        offsets, weight = tile_offsets(np.ascontiguousarray(arrays[points], real), inner,
                                       np.ascontiguousarray(arrays[shifts], real), radius, sampling.density)
        return {f"{name}.offsets": offsets, f"{name}.weight": weight}

    recipe.add(name, "texels around a receiver that are its samples, and how many texels each stands for", run,
               (points, shifts), {
                   f"{name}.offsets": Spec("row modulo tile, column modulo tile, sample, (right, down)", "1",
                                           "texels from the receiver to the sample, the disc's first", tier="T0"),
                   f"{name}.weight": Spec("row modulo tile, column modulo tile, sample; 1: all alike", "1",
                                          "texels of this level that a sample stands for", paper="E-HSS-06"),
               }, paper=CROWN, bugs=tuple(sample_bugs(name, inner, radius, sampling.density)))


def add_gather(recipe: Recipe, settings: HssilSettings, index: int) -> None:
    """Add the light that each texel of a level receives of its samples."""
    name, number = f"gather{index}.irradiance", settings.sampling.first_level + index
    samples = f"samples{index}.offsets", f"samples{index}.weight"
    planes = level_names(index, *SENDER)
    plain = replaced(settings, {"sampling.pattern": "interleaved"})

    def run(arrays: Arrays, real: Any) -> Arrays:
        chosen = np.ascontiguousarray(arrays[samples[0]], np.int32), np.ascontiguousarray(arrays[samples[1]], real)
        return {name: gather(level_of(arrays, index, number, real), index, plain, samples=chosen)}

    bugs = gather_bugs(index, *settings.sampling.counts(index))
    recipe.facts[name.split(".")[0]] = {"form_factor": settings.senders.form_factor}
    recipe.add(name.split(".")[0], "irradiance of a level's texels by their samples, those outside the picture, on "
               "nothing or on the texel itself left out", run, (*planes, *samples), {
                   name: Spec("rgb, row, column", "W/m^2", "irradiance by this level; 0 without surface", "linear RGB",
                              EQ4)}, paper=f"HSS Eq. 1; {EQ4}", exact=(planes[0],), bugs=tuple(bugs))


def _add_shifts(recipe: Recipe, name: str, counts: tuple[int, int], tile: tuple[int, int]) -> None:
    inner, crown = counts

    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001 one precision: double
        start = np.asarray(arrays[f"{name}.shift"], np.float64)
        return {f"{name}.points": sample_points(inner, crown),
                f"{name}.shifts": np.minimum(tile_shifts(start, tile, crown), 1.0 - 2.0**-24)}

    recipe.add(f"shifts of {name}", "points of the sequence, j steps from 1/2, the disc's then the crown's; texel n of "
               "the tile, row by row, is shifted by n times the crown's number of steps more; all modulo 1, in double "
               "precision", run, (f"{name}.shift",), {
                   f"{name}.points": Spec("sample, (u, cos 2 pi v, sin 2 pi v)", "1", "points that all texels share"),
                   f"{name}.shifts": Spec("row of the tile, column of the tile, uv", "1",
                                          "what each texel of a tile adds to u and v, modulo 1"),
               }, paper=CROWN, exact=(f"{name}.shift",), bugs=tuple(sequence_bugs(name, inner, crown, tile)))
