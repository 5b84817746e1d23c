"""Stages of the range of pixel lights, from I_low on: R_0, pairs that count, their sum, bounds (SII Sec. 3.4)."""

from typing import Any

import numpy as np

from refgi.pairs.irradiance import Receivers, irradiance
from refgi.pairs.settings import PairSettings
from refgi.splat.sii.reach.bounds import appendix_ellipsoid, tangent_ellipsoid
from refgi.splat.sii.reach.threshold import DIFFUSE, GLOSSY, light_range
from refgi.splat.sii.settings import AbsoluteCut, FullBound, ReachSettings, RelativeCut, SiiSettings
from refgi.splat.sii.sii import splat
from refgi.vectors.recipe import Recipe, reading, writing
from refgi.vectors.spec import Array, Arrays, Bug, Run, Spec
from refgi.vectors.stages.lights import light_names, pixel_lights_of
from refgi.vectors.stages.pairs import RECEIVERS

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

    def printed(arrays: Arrays, real: Any) -> Arrays:
        n = np.asarray(arrays["range.exponent"], np.float64)
        return {**run(arrays, real), names[0]: n / (n + 2) * (n + 2) / 4}

    what = {"center": "place of the centre along the axis", "half_width": "half axis along it",
            "height": "half axis across it"}
    recipe.add("range.ellipsoids", "ellipsoids of revolution around the region in units of R_0: centred where it is "
               "widest, and the least wasteful one through the light", run, ("range.exponent",), {
                   name: Spec("shape", "1", what[name.split("_", 1)[1]] + ", in R_0") for name in names},
               paper="SII Eq. 7 and 8; E-SII-12, E-SII-13", bugs=(
                   Bug("the exponent of Eq. 8 is printed as a factor", printed, "E-SII-12"),
                   Bug("the ellipsoid is as wide as its centre is far", writing(run, **{
                       names[1].replace(".", "__"): lambda a: a * 0 + 0.438691}), "E-SII-13: max(c, 1 - c)"),
                   Bug("the height is that of the diffuse light", writing(run, **{
                       names[2].replace(".", "__"): lambda a: np.full_like(a, a[1])}), "E-SII-13: F(c)"),
                   Bug("the tangent ellipsoid is the appendix's", lambda a, r: dict(zip(names, [
                       run(a, r)[name] for name in names[:3]] * 2, strict=True)), "E-SII-13"),
                   Bug("n is one too high", reading(run, range__exponent=lambda a: a + 1), "SII Eq. 8")))


def peaks_of(arrays: Arrays, parts: tuple[str, ...]) -> list[Array]:
    """Return I_0 of each part of each light, W/sr."""
    return [np.asarray(arrays[f"range.{part}_peak"], np.float64) for part in parts]


def relative_reach(share: float, arrays: Arrays, switches: frozenset[str] = frozenset()) -> ReachSettings:
    """Return the settings of a cut at a share of the largest peak."""
    return ReachSettings(cut=RelativeCut(share, float(np.asarray(arrays[LENGTH])[0]), switches))


def add_squares(recipe: Recipe, parts: tuple[str, ...], share: float) -> None:
    """Add R_0^2 of each part of each light."""
    names = [f"range.{part}_square" for part in parts]

    def run(arrays: Arrays, real: Any, own: bool = False) -> Arrays:
        low = float(np.asarray(arrays[LOW])[0])
        reach = relative_reach(share, arrays, frozenset({"per_light_ilow"})) if own else ReachSettings(cut=None)
        ranges = [light_range(peak, low, reach, part, real)
                  for part, peak in zip((DIFFUSE, GLOSSY), peaks_of(arrays, parts), strict=False)]
        return {name: one.square for name, one in zip(names, ranges, strict=True)}

    def all_of(change: Any) -> Run:
        return writing(run, **{name.replace(".", "__"): change for name in names})

    recipe.add("range.squares", "R_0^2 = I_0 / I_low of each part of each light", run,
               (LOW, LENGTH, *(f"range.{part}_peak" for part in parts)), {
                   name: Spec("light", "m^2", f"square of the largest distance at which the {part} part counts")
                   for name, part in zip(names, parts, strict=True)}, paper=PAPER, bugs=(
                   Bug("R_0 in place of its square", all_of(np.sqrt), PAPER),
                   Bug("I_low is a share of the light's own peak: all reach equally far",
                       lambda a, r: run(a, r, True), "E-SII-11"),
                   Bug("all have the range of the brightest", all_of(lambda a: np.full_like(a, a.max(initial=0))),
                       PAPER),
                   Bug("a diameter in place of a radius", all_of(lambda a: a / 4), PAPER)))


def add_kept(recipe: Recipe, parts: tuple[str, ...]) -> None:
    """Add which pairs of part and pixel count."""
    names, sources = [f"range.{part}_kept" for part in parts], [f"range.{part}_strength" for part in parts]

    def run(arrays: Arrays, real: Any) -> Arrays:
        low = np.asarray(arrays[LOW], real)[0]
        return {name: (np.asarray(arrays[source], real) >= low) & (np.asarray(arrays[source]) > 0)
                for name, source in zip(names, sources, strict=True)}

    recipe.add("range.kept", "pairs that count: B >= I_low", run, (LOW, *sources), {
        name: Spec("light, row, column", "1", f"true where the {part} part counts; never where B is 0", tier="T0")
        for name, part in zip(names, parts, strict=True)}, paper=PAPER, bugs=(
            Bug("pairs below I_low count", writing(run, **{
                name.replace(".", "__"): np.logical_not for name in names}), PAPER),
            Bug("all pairs count", reading(run, range__low=np.zeros_like), PAPER),
            Bug("I_low is divided by pi", reading(run, range__low=lambda a: a / np.pi), PAPER)))


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

    def every(arrays: Arrays, real: Any) -> Arrays:
        return run({**arrays, LOW: np.zeros(1, real)}, real)

    def masked(change: Any, own: bool = False) -> Run:
        """Return the sum of parts, each where a mask made of those that count says; `own`: by its light."""
        def altered(arrays: Arrays, real: Any) -> Arrays:
            total, fluxes = np.zeros_like(np.asarray(arrays[RECEIVERS[0]], real)), ("lights.flux", "lights.lobe_flux")
            covered = np.asarray(arrays[RECEIVERS[2]]) >= 0
            for part, mask in enumerate(change([np.asarray(arrays[name]) for name in kept])):
                alone = {fluxes[1 - part]: np.zeros_like(arrays["lights.flux"])} if len(parts) > 1 else {}
                for k, here in enumerate(mask):
                    one = {name: (alone.get(name, arrays[name]))[..., k : k + 1] for name in names}
                    footprint = np.asarray(arrays["lights.area"], np.float64)[k : k + 1] if area else None
                    at = receivers_of(arrays, real, covered & (own | here))
                    light = irradiance(at, pixel_lights_of(one, real), pairs, footprint)
                    total += np.where(light.max(axis=0) >= np.asarray(arrays[LOW])[0], light, 0) if own else light
            return {LIGHT: total}

        return altered

    bugs = [Bug("nothing is cut", every, PAPER),
            Bug("what is cut is summed", lambda a, r: {LIGHT: every(a, r)[LIGHT] - run(a, r)[LIGHT]}, PAPER),
            Bug("a light counts at all pixels or at none", masked(lambda masks: [
                  np.broadcast_to(mask.any(axis=(1, 2), keepdims=True), mask.shape) for mask in masks]),
                  "pair by pair"),
            Bug("pairs count by their light, the pixel's cosine included", masked(lambda masks: masks, own=True),
                PAPER),
            Bug("1/pi is left out", reading(run, lights__flux=lambda a: a * np.pi), "I_0 = Phi / pi")]
    if len(parts) > 1:
        bugs += [Bug("a light's lobe counts where its diffuse part does", masked(lambda masks: [masks[0]] * 2),
                     "each part has its range"),
                 Bug("a light counts whole where one of its parts does",
                     masked(lambda masks: [masks[0] | masks[1]] * 2), "each part has its range")]
    recipe.add("range.sum", "irradiance of the pairs that count", run, (LOW, *kept, *RECEIVERS, *names, *area), {
        LIGHT: Spec("rgb, row, column", "W/m^2", "indirect irradiance without visibility and albedo/pi", "linear RGB")},
        paper=PAPER, exact=(RECEIVERS[0], "lights.position"), bugs=tuple(bugs))
