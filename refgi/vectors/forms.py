"""Literal forms of `@stage` functions, by name: what they read of a stage's parameters, and which rows they have.

Each entry is handed a stage's arguments and returns its form and lists, or None where the literal text does not cover
them. Names of arrays are those of parameters and their fields (`lights.flux`).
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from refgi.literal import pairs
from refgi.vectors.rows import Form
from refgi.vectors.spec import Array

Arguments = Mapping[str, Any]


class Described(NamedTuple):
    """What a stage has beside its function."""

    form: Form
    lists: tuple[tuple[str, str], ...]  # literal module, "" for the form's own, and list of rows
    exact: tuple[str, ...] = ()  # leaves of parameters, as `Stage.exact`


def described(stage: str, arguments: Arguments) -> Described | None:
    """Return what a run of a stage has beside its function; None where there is no literal form of it."""
    make = FORMS.get(stage)
    return None if make is None else make(arguments)


def ids(covered: Array) -> Array:
    """Return triangle ids of receivers of which only whether there is one is known."""
    return np.where(covered, np.int32(0), np.int32(-1))


def pair_sum(arguments: Arguments) -> Described | None:
    """Return Eq. 2 and 3 without clamp or with discs."""
    lights, settings = arguments["lights"], arguments["settings"]
    clamp = "none" if settings.clamp is None else settings.clamp.name()
    plain = settings.offset == 0 and not settings.as_published and settings.lobe.norm == "clamped"
    if clamp not in ("none", "disc") or not plain or settings.lobe.widening or arguments["lightcuts"] is not None:
        return None
    glossy, disc = lights.lobe_flux is not None, clamp == "disc"
    reads = {"position": "receivers.position", "normal": "receivers.normal", "triangle_id": "receivers.covered",
             "light_position": "lights.position", "light_normal": "lights.normal", "flux": "lights.flux"}
    if glossy:
        reads |= {name: f"lights.{name}" for name in ("lobe_flux", "lobe_axis", "lobe_exponent")}
    if disc:
        reads["area"] = "footprint"
    form = Form(pairs.irradiance, reads, ("",), adapt={"triangle_id": ids})
    return Described(form, tuple(("", name) for name in pair_lists("irradiance", glossy, disc, lights.flux.shape[1])),
                     ("receivers.position", "lights.position"))


def pair_lists(entry: str, glossy: bool, disc: bool, count: int) -> tuple[str, ...]:
    """Return the lists of rows that hold for sums over lights with or without lobes and discs."""
    kind = "glossy" if glossy else "diffuse"
    return ("pair", *((entry,) if entry == "irradiance" else ()),
            *(("pair/disc",) if disc else ("pair/free", f"{entry}/free", f"pair/{kind} free")), f"pair/{kind}",
            f"{entry}/{kind}", *(("pair/several",) if count > 1 else ()))


FORMS: Mapping[str, Callable[[Arguments], Described | None]] = {"pairs.sum": pair_sum}
