"""Literal forms of `@stage` functions, by name: what they read of a stage's parameters, and which rows they have.

Each entry is handed a stage's arguments and returns its form and lists, empty where the literal text does not cover
them. Names of arrays are those of parameters and their fields (`lights.flux`).
"""

from collections.abc import Callable, Mapping

from refgi.vectors.forms import (
    cluster,
    gather,
    lights,
    multires,
    multires_lights,
    pairs,
    rsm,
    sii,
    sssil,
    temporal,
    truth,
    vpl,
)
from refgi.vectors.forms.beside import Arguments, Described

FORMS: Mapping[str, Callable[[Arguments], Described]] = {
    **rsm.FORMS, **lights.FORMS, **pairs.FORMS, **sii.FORMS, **cluster.FORMS, **sssil.FORMS, **multires.FORMS,
    **multires_lights.FORMS, **gather.FORMS, **temporal.FORMS, **truth.FORMS, **vpl.FORMS}


def described(stage: str, arguments: Arguments) -> Described:
    """Return what a run of a stage has beside its function; `form` is None where there is no literal form of it."""
    make = FORMS.get(stage)
    return Described() if make is None else make(arguments)
