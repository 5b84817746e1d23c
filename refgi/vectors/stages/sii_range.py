"""Stages of the range of pixel lights: peaks, B, reference length, I_low, R_0, pairs that count, sum (SII Sec. 3.4).

B = I(w) / r^2 is the irradiance that a light causes at most; the largest channel of its intensity counts. A pair counts
where B >= I_low, one irradiance for all lights; the parts of a light, diffuse and glossy, have each their own range.
"""

from typing import Any

import numpy as np

from refgi.literal import sii as literal
from refgi.pairs.irradiance import Receivers
from refgi.pairs.packing import Packed, pack
from refgi.pairs.pixel_lights import PixelLights
from refgi.pairs.settings import PairSettings
from refgi.splat.sii.reach.reference_length import PAPER_LIGHTS, PAPER_OVERDRAW, reference_length, strengths
from refgi.splat.sii.reach.threshold import all_peaks, threshold
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Array, Arrays, Spec
from refgi.vectors.stages.lights import light_names, pixel_lights_of
from refgi.vectors.stages.pairs import LOBES, READS, RECEIVERS
from refgi.vectors.stages.sii_range_sum import (
    BARE,
    BOTH,
    LENGTH,
    LOW,
    PAPER,
    add_kept,
    add_squares,
    add_sum,
    lists_of,
    pairs_of,
    peaks_of,
    relative_reach,
)


def add_range(recipe: Recipe, drawn: int, share: float, length: float | None, pairs: PairSettings = BARE) -> None:
    """Add ranges and the sum of the pairs in range.

    `drawn` counts lights without flux as well; I_low is `share` times the largest peak over the square of `length`, or
    of the reference length where that is absent.
    """
    parts = BOTH if "lights.lobe_flux" in recipe.specs else BOTH[:1]
    recipe.facts["range"] = {"share": share, "reference_length": length, "lights_drawn": drawn,
                             "share_of_pairs": PAPER_OVERDRAW / PAPER_LIGHTS}
    recipe.factors["N"] = float(drawn)
    _add_peaks(recipe, parts)
    _add_strengths(recipe, parts)
    if length is None:
        _add_length(recipe, parts, drawn)
    else:
        recipe.give(LENGTH, np.array([length]), Spec("one", "m", "reference length of the share"))
    _add_low(recipe, parts, share)
    add_squares(recipe, parts, share)
    add_kept(recipe, parts)
    add_sum(recipe, parts, pairs)


def _packed(arrays: Arrays) -> tuple[PixelLights, Packed]:
    lights = pixel_lights_of(arrays, np.float64)
    return lights, pack(lights, BARE, np.zeros(lights.flux.shape[1]), np.float64)


def _of_parts(lights: PixelLights, packed: Packed, values: tuple[Array, Array], parts: tuple[str, ...]) -> list[Array]:
    """Return values of the packed parts, (K, ...) each, as (N, ...): 0 for lights without that part."""
    made = []
    for part, chosen, value in zip(BOTH, (packed.shines, packed.glossy), values, strict=True):
        if part in parts:
            whole = np.zeros((lights.flux.shape[1], *value.shape[1:]))
            whole[chosen] = value
            made.append(whole)
    return made


def _add_peaks(recipe: Recipe, parts: tuple[str, ...]) -> None:
    names = [f"range.{part}_peak" for part in parts]

    def run(arrays: Arrays, real: Any) -> Arrays:
        lights, packed = _packed(arrays)
        diffuse, lobes = all_peaks(packed)
        return dict(zip(names, (one.astype(real) for one in _of_parts(lights, packed, (diffuse[:-1], lobes), parts)),
                        strict=True))

    reads = {"normal": READS["light_normal"], "flux": READS["flux"]} | (LOBES if len(parts) > 1 else {})
    form = Form(literal.peaks, reads, tuple(names))
    recipe.add("range.peaks", "I_0, the peak intensity of each part of each light", run, light_names(recipe), {
        name: Spec("light", "W/sr", f"largest channel of I_0 of the {part} part; 0 without it", paper=PAPER)
        for name, part in zip(names, parts, strict=True)}, paper=PAPER, bugs=form.bugs(*lists_of("peaks", parts)),
        variants=(form,))


def _strengths(arrays: Arrays, parts: tuple[str, ...]) -> list[Array]:
    """Return B of each part, light and pixel, float64; 0 without surface."""
    ids = np.asarray(arrays[RECEIVERS[2]])
    here = ids.reshape(-1) >= 0
    position = np.ascontiguousarray(np.asarray(arrays[RECEIVERS[0]], np.float64).reshape(3, -1)[:, here])
    lights, packed = _packed(arrays)
    diffuse, lobes = all_peaks(packed)
    values = strengths(packed, position, 1) * max(diffuse.max(), lobes.max(initial=0.0))
    whole = np.zeros((len(values), ids.size))
    whole[:, here] = values
    whole = whole.reshape(-1, *ids.shape)
    return _of_parts(lights, packed, (whole[: len(diffuse) - 1], whole[len(diffuse) - 1 :]), parts)


def _add_strengths(recipe: Recipe, parts: tuple[str, ...]) -> None:
    names = [f"range.{part}_strength" for part in parts]

    def run(arrays: Arrays, real: Any) -> Arrays:
        return {name: one.astype(real) for name, one in zip(names, _strengths(arrays, parts), strict=True)}

    form = Form(literal.strengths, pairs_of(parts), tuple(names))
    recipe.add("range.strengths", "B, what each light causes at each pixel at most", run,
               (*RECEIVERS, *light_names(recipe)), {name: Spec(
                   "light, row, column", "W/m^2", f"I(w) / r^2 of the {part} part, without the pixel's cosine; 0 "
                   "without surface", paper=PAPER) for name, part in zip(names, parts, strict=True)},
               paper=PAPER, exact=(RECEIVERS[0], "lights.position"), bugs=form.bugs("strengths"),
               variants=(form,))


def _add_length(recipe: Recipe, parts: tuple[str, ...], drawn: int) -> None:
    def run(arrays: Arrays, real: Any) -> Arrays:
        ids = np.asarray(arrays[RECEIVERS[2]])
        position, normal = (np.ascontiguousarray(arrays[name], np.float64) for name in RECEIVERS[:2])
        at = Receivers(position, normal, ids >= 0)
        return {LENGTH: np.array([reference_length(at, pixel_lights_of(arrays, real)._replace(drawn=drawn), BARE)])}

    form = Form(literal.reference_length, pairs_of(parts), (LENGTH,), {"drawn": drawn})
    recipe.add("range.length", "length under which 5 % of the largest peak leave 125 of 768 pairs", run,
               (*RECEIVERS, *light_names(recipe)), {LENGTH: Spec(
                   "one", "m", "sqrt(0.05 / b), b the k-th largest B over the largest I_0 of all pairs of part and "
                   "pixel, k = 125/768 of all pairs of drawn light and pixel, rounded; at most 10 diagonals of pixels "
                   "and lights; 1 where nothing is lit")},
               paper="SII Fig. 8; E-SII-11", exact=(RECEIVERS[0], "lights.position"), bugs=form.bugs("length"),
               variants=(form,))


def _add_low(recipe: Recipe, parts: tuple[str, ...], share: float) -> None:
    def run(arrays: Arrays, real: Any) -> Arrays:
        return {LOW: np.array([threshold(np.concatenate(peaks_of(arrays, parts)), relative_reach(share, arrays))],
                              real)}

    form = Form(literal.low_irradiance, {"length": LENGTH, **{f"{part}_peak": f"range.{part}_peak" for part in parts}},
                (LOW,), {"share": share})
    recipe.add("range.low", f"I_low = {share:g} max I_0 / L^2", run,
               (LENGTH, *(f"range.{part}_peak" for part in parts)), {
        LOW: Spec("one", "W/m^2", "irradiance under which pairs are left out; 0 without lights", paper=PAPER)},
        paper=PAPER, bugs=form.bugs(*lists_of("low", parts)), variants=(form,))
