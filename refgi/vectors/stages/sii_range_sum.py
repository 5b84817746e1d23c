"""Stages of the range of pixel lights, from I_low on: R_0, pairs that count, their sum, bounds (SII Sec. 3.4)."""

from typing import Any

import numpy as np

from refgi.literal import sii as literal
from refgi.pairs.irradiance import Receivers
from refgi.pairs.settings import PairSettings
from refgi.splat.sii.reach.bounds import appendix_ellipsoid, tangent_ellipsoid
from refgi.splat.sii.reach.threshold import DIFFUSE, GLOSSY, light_range
from refgi.splat.sii.settings import AbsoluteCut, FullBound, ReachSettings, RelativeCut, SiiSettings
from refgi.splat.sii.sii import splat
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Array, Arrays, Spec
from refgi.vectors.stages.lights import light_names, pixel_lights_of
from refgi.vectors.stages.pairs import LOBES, READS, RECEIVERS

BOTH = ("diffuse", "glossy")
LENGTH, LOW, LIGHT = "range.length", "range.low", "range.irradiance"
BARE = PairSettings(clamp=None)
EXPONENTS = (0.25, 1.0, 2.0, 3.0, 10.0, 40.0, 100.0, 1000.0)
PAPER = "SII Sec. 3.4; E-SII-11"


def add_ellipsoids(recipe: Recipe) -> None:
    """Add the bounds of the region where B >= I_low, for some exponents."""
    recipe.give("range.exponent", np.array(EXPONENTS), Spec("shape", "1", "exponent n of cos^n; 1: diffuse"))
    names = [f"range.{kind}_{key}" for kind in ("appendix", "tangent") for key in ("center", "half_width", "height")]

    def run(arrays: Arrays, real: Any) -> Arrays:
        n = np.asarray(arrays["range.exponent"], np.float64)
        both = (*appendix_ellipsoid(n), *tangent_ellipsoid(n))
        return {name: np.asarray(one, real) for name, one in zip(names, both, strict=True)}

    form = Form(literal.ellipsoids, {"exponent": "range.exponent"}, tuple(names))
    what = {"center": "place of the centre along the axis", "half_width": "half axis along it",
            "height": "half axis across it"}
    recipe.add("range.ellipsoids", "ellipsoids of revolution around the region in units of R_0: centred where it is "
               "widest, and the least wasteful one through the light", run, ("range.exponent",), {
                   name: Spec("shape", "1", what[name.split("_", 1)[1]] + ", in R_0") for name in names},
               paper="SII Eq. 7 and 8; E-SII-12, E-SII-13", bugs=form.bugs("ellipsoids"), variants=(form,))


def pairs_of(parts: tuple[str, ...]) -> dict[str, str]:
    """Return the parameters of a literal form that takes receivers and lights, and their arrays."""
    return {**READS, "triangle_id": RECEIVERS[2], **(LOBES if len(parts) > 1 else {})}


def lists_of(name: str, parts: tuple[str, ...]) -> tuple[str, ...]:
    """Return the lists of rows for lights with or without lobes."""
    return (name, f"{name}/glossy") if len(parts) > 1 else (name,)


def peaks_of(arrays: Arrays, parts: tuple[str, ...]) -> list[Array]:
    """Return I_0 of each part of each light, W/sr."""
    return [np.asarray(arrays[f"range.{part}_peak"], np.float64) for part in parts]


def relative_reach(share: float, arrays: Arrays) -> ReachSettings:
    """Return the settings of a cut at a share of the largest peak."""
    return ReachSettings(cut=RelativeCut(share, float(np.asarray(arrays[LENGTH])[0])))


def add_squares(recipe: Recipe, parts: tuple[str, ...], share: float) -> None:
    """Add R_0^2 of each part of each light."""
    names = [f"range.{part}_square" for part in parts]

    def run(arrays: Arrays, real: Any) -> Arrays:
        low = float(np.asarray(arrays[LOW])[0])
        ranges = [light_range(peak, low, ReachSettings(cut=None), part, real)
                  for part, peak in zip((DIFFUSE, GLOSSY), peaks_of(arrays, parts), strict=False)]
        return {name: one.square for name, one in zip(names, ranges, strict=True)}

    peaks = {f"{part}_peak": f"range.{part}_peak" for part in parts}
    form = Form(literal.squares, {"low": LOW, "length": LENGTH, **peaks}, tuple(names), {"share": share})
    recipe.add("range.squares", "R_0^2 = I_0 / I_low of each part of each light", run,
               (LOW, LENGTH, *(f"range.{part}_peak" for part in parts)), {
                   name: Spec("light", "m^2", f"square of the largest distance at which the {part} part counts")
                   for name, part in zip(names, parts, strict=True)}, paper=PAPER, bugs=form.bugs("squares"),
        variants=(form,))


def add_kept(recipe: Recipe, parts: tuple[str, ...]) -> None:
    """Add which pairs of part and pixel count."""
    names, sources = [f"range.{part}_kept" for part in parts], [f"range.{part}_strength" for part in parts]

    def run(arrays: Arrays, real: Any) -> Arrays:
        low = np.asarray(arrays[LOW], real)[0]
        return {name: (np.asarray(arrays[source], real) >= low) & (np.asarray(arrays[source]) > 0)
                for name, source in zip(names, sources, strict=True)}

    form = Form(literal.kept, {"low": LOW, **{f"{part}_strength": f"range.{part}_strength" for part in parts}},
                tuple(names))
    recipe.add("range.kept", "pairs that count: B >= I_low", run, (LOW, *sources), {
        name: Spec("light, row, column", "1", f"true where the {part} part counts; never where B is 0", tier="T0")
        for name, part in zip(names, parts, strict=True)}, paper=PAPER, bugs=form.bugs("kept"), variants=(form,))


def add_sum(recipe: Recipe, parts: tuple[str, ...], pairs: PairSettings) -> None:
    """Add the sum of the pairs that count."""
    area = ("lights.area",) if pairs.needs_footprints else ()
    names, kept = light_names(recipe), [f"range.{part}_kept" for part in parts]

    def receivers_of(arrays: Arrays, real: Any, covered: Array) -> Receivers:
        position, normal = (np.ascontiguousarray(arrays[name], real) for name in RECEIVERS[:2])
        return Receivers(position, normal, covered)

    def run(arrays: Arrays, real: Any) -> Arrays:
        low = float(np.asarray(arrays[LOW])[0])
        at = receivers_of(arrays, real, np.asarray(arrays[RECEIVERS[2]]) >= 0)
        cut = AbsoluteCut(low) if low > 0 else None
        settings = SiiSettings(pairs=pairs, reach=ReachSettings(cut=cut, bound=FullBound()))
        footprint = np.ascontiguousarray(arrays["lights.area"], np.float64) if area else None
        return {LIGHT: splat(at, pixel_lights_of(arrays, real), settings, footprint)}

    form = Form(literal.range_sum, {**pairs_of(parts), **{f"{part}_kept": f"range.{part}_kept" for part in parts},
                                    "low": LOW, **({"area": "lights.area"} if area else {})}, (LIGHT,),
                {} if len(parts) > 1 else {"glossy_kept": None})
    recipe.add("range.sum", "irradiance of the pairs that count", run, (LOW, *kept, *RECEIVERS, *names, *area), {
        LIGHT: Spec("rgb, row, column", "W/m^2", "indirect irradiance without visibility and albedo/pi", "linear RGB")},
        paper=PAPER, exact=(RECEIVERS[0], "lights.position"), bugs=form.bugs(*lists_of("sum", parts)),
        variants=(form,))
