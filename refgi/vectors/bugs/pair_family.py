"""More that goes wrong in sums over pixel lights: other constants, clamps, powers and lobes (SII Eq. 2 and 3)."""

from functools import partial
from typing import Any

import numpy as np

from refgi.vectors.bugs.pair import CLAMPED, DISC, EQ2, as_printed
from refgi.vectors.recipe import reading
from refgi.vectors.spec import Array, Arrays, Bug, Run

NO_CLAMP, NORM = "no clamp unless asked for", "E-SII-03: (P + 1) / 2 pi K"
SPREAD = {"the sphere: 1/(4 pi) in place of 1/pi, as of an isotropic light": 0.25,
          "the hemisphere: 1/(2 pi) in place of 1/pi, the cosine's factor 2 is missing": 0.5,
          "nothing: 1/pi is missing": np.pi, "1/pi^2: 1/pi is there twice": 1 / np.pi}
LEAST_SQUARES = {0.001: "sqrt(0.001)", 0.04: "0.2", 0.1: "sqrt(0.1)", 0.2: "sqrt(0.2)", 0.25: "0.5", 1.0: "1"}
ADDED = (1e-4, 1e-3, 0.01, 0.1, 1.0)


def pair_family(run: Run, clamped: bool, glossy: bool, count: int, own: bool = False) -> tuple[Bug, ...]:
    """Return likely bugs of sums over pixel lights beside those of `pair_bugs`; `count`: number of lights."""
    literal = partial(as_printed, own)
    found = [
        Bug("the cosine at the receiver is squared", literal(arrives="squared"), EQ2),
        Bug("the light's cosine is squared: cos^2", literal(leaves="squared"), EQ2),
        Bug("sine in place of cosine at the receiver", literal(arrives="sine"), EQ2),
        Bug("sine in place of cosine at the light", literal(leaves="sine"), EQ2),
        Bug("no cosine at the receiver and no test of its side: light from behind counts", literal(arrives="one"),
            CLAMPED),
        Bug("no cosine at the light and no test of its side: lights shine backwards", literal(leaves="one"), CLAMPED),
        Bug("1/r^3 in place of 1/r^2", literal(power=3), "E-SII-02"),
        *(Bug("flux is divided by the number of lights: the mean of all and not the sum", _times(
            run, 1 / count, glossy), "all lights") for _ in range(count > 1)),
        *(() if not glossy else _lobe_bugs(literal, run)),
        *(Bug(f"diffuse flux is spread over {what}", reading(run, lights__flux=_scaled(factor)), "Phi cos / pi")
          for what, factor in SPREAD.items()),
    ]
    found += _disc_bugs(literal, run) if clamped else [
        *(Bug(f"distances count as at least {text} m: a clamp of the minimum distance", literal(least=square**0.5),
              NO_CLAMP) for square, text in LEAST_SQUARES.items() if own or square < 1),
        *(Bug(f"distances count as at least {text} m and so directions are shortened: a clamp before normalisation",
              literal(least=square**0.5, shortened=True), NO_CLAMP) for square, text in LEAST_SQUARES.items()
          if own or square < 1),
        *(Bug(f"{term:g} is added to r^2: a softened distance", literal(softened=term), NO_CLAMP) for term in ADDED),
        *(Bug(f"{term:g} is added to r^2 before directions are normalised", literal(softened=term, shortened=True),
              NO_CLAMP) for term in ADDED),
        *(Bug(f"the geometry term is bounded by {most}", literal(most=most), NO_CLAMP) for most in (1, 10)
          if not glossy)]
    if not own:
        found += [
            Bug("the last light replaces the others: overwritten, not added", literal(joined="last"), "all lights"),
            Bug("the first light is left out", _without(run, slice(0, 1), glossy), "all lights"),
            Bug("only every second light counts", _without(run, slice(1, None, 2), glossy), "all lights"),
            Bug("the first light's normal for all lights", reading(run, lights__normal=_first), EQ2),
            Bug("the first light's flux for all lights", reading(run, lights__flux=_first, **(
                {"lights__lobe_flux": _first} if glossy else {})), EQ2),
            Bug("normals and positions of lights are one light apart: an index off by one",
                reading(run, lights__normal=lambda a: np.roll(a, 1, axis=-1)), EQ2),
            Bug("flux and positions of lights are one light apart: an index off by one",
                reading(run, lights__flux=lambda a: np.roll(a, 1, axis=-1), **(
                    {"lights__lobe_flux": lambda a: np.roll(a, 1, axis=-1)} if glossy else {})), EQ2),
        ]
    return tuple(found)


def _lobe_bugs(literal: Any, run: Run) -> list[Bug]:
    return [
        Bug("the lobe's power has the exponent P + 1: one cosine too many, the norm is right",
            literal(lobe_power=(1.0, 1.0)), "SII Eq. 3: cos^P"),
        Bug("the lobe's power has the exponent P - 1", literal(lobe_power=(1.0, -1.0)), "SII Eq. 3: cos^P"),
        Bug("the lobe's power has twice the exponent: cos^2P", literal(lobe_power=(2.0, 0.0)), "SII Eq. 3: cos^P"),
        Bug("the lobe's power has half the exponent", literal(lobe_power=(0.5, 0.0)), "SII Eq. 3: cos^P"),
        Bug("the lobe's power is missing: the cosine itself", literal(lobe_power=(0.0, 1.0)), "SII Eq. 3: cos^P"),
        Bug("lobes are normalised by (P + 1) / pi: over pi in place of 2 pi, a factor 2 too many",
            reading(run, lights__lobe_flux=_scaled(2)), NORM),
        Bug("lobes are normalised by (P + 1) / (4 pi), as over the sphere: a factor 2 is missing",
            reading(run, lights__lobe_flux=_scaled(0.5)), NORM),
        Bug("lobes are normalised by P + 1: 1/(2 pi) is missing", reading(run, lights__lobe_flux=_scaled(2 * np.pi)),
            NORM),
        Bug("lobes are divided by pi as the diffuse part is", reading(run, lights__lobe_flux=_scaled(1 / np.pi)),
            NORM),
        Bug("lobes are normalised by P / (2 pi): the + 1 is missing", literal(norm="short"), NORM),
        Bug("lobes leave out the receiver's cosine", literal(lobe_arrives=False), "SII Eq. 3"),
        Bug("the lobe's cosine is taken as absolute value: lobes on both sides", literal(lobe_abs=True),
            "<a.b> = max(0, a.b)"),
        Bug("the direction in the lobe's cosine is not normalised", literal(lobe_unit=False), "unit directions"),
        Bug("lobes have the diffuse flux", lambda a, r: run({**a, "lights.lobe_flux": a["lights.flux"]}, r),
            "SII Eq. 3"),
        Bug("the diffuse part has the lobes' flux", lambda a, r: run({**a, "lights.flux": a["lights.lobe_flux"]}, r),
            "SII Eq. 3"),
        Bug("fluxes of lobe and diffuse part are exchanged", lambda a, r: run({
            **a, "lights.flux": a["lights.lobe_flux"], "lights.lobe_flux": a["lights.flux"]}, r), "SII Eq. 3"),
        Bug("the first light's exponent for all lobes", reading(run, lights__lobe_exponent=_first), "SII Eq. 3"),
        Bug("the lobe's axis is turned round", reading(run, lights__lobe_axis=lambda a: -a), "SII Eq. 3"),
        Bug("the lobe's axis is mirrored at the normal: where light came from", _retro(run), "SII Eq. 3"),
    ]


def _disc_bugs(literal: Any, run: Run) -> list[Bug]:
    return [
        Bug("the larger of r^2 and A/pi in place of their sum", literal(disc="largest"), DISC),
        Bug("the disc's radius is added to the distance, not its square", literal(disc="radius"), DISC),
        Bug("the first light's footprint for all lights", reading(run, lights__area=_first), DISC),
        Bug("the footprint's root in place of the footprint", reading(run, lights__area=np.sqrt), DISC),
        Bug("the footprint is divided by 4 pi", reading(run, lights__area=_scaled(0.25)), DISC),
    ]


def _scaled(factor: float) -> Any:
    return lambda array: array * factor


def _times(run: Run, factor: float, glossy: bool) -> Run:
    return reading(run, lights__flux=_scaled(factor), **({"lights__lobe_flux": _scaled(factor)} if glossy else {}))


def _without(run: Run, which: slice, glossy: bool) -> Run:
    def kept(array: Array) -> Array:
        made = array.copy()
        made[..., which] = 0
        return made

    return reading(run, lights__flux=kept, **({"lights__lobe_flux": kept} if glossy else {}))


def _first(array: Array) -> Array:
    return np.ascontiguousarray(np.broadcast_to(array[..., :1], array.shape))


def _retro(run: Run) -> Run:
    def altered(arrays: Arrays, real: Any) -> Arrays:
        normal, axis = arrays["lights.normal"], arrays["lights.lobe_axis"]
        return run({**arrays, "lights.lobe_axis": 2 * (normal * axis).sum(axis=0) * normal - axis}, real)

    return altered
