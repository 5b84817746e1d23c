"""Literal forms of `@stage` functions, by name: what they read of a stage's parameters, and which rows they have.

Each entry is handed a stage's arguments and returns its form and lists, empty where the literal text does not cover
them. Names of arrays are those of parameters and their fields (`lights.flux`).
"""

from collections.abc import Callable, Mapping

from refgi.vectors.forms import cluster, lights, multires, rsm, splat, sssil, truth
from refgi.vectors.forms.beside import Arguments, Described

FORMS: Mapping[str, Callable[[Arguments], Described]] = {
    **rsm.FORMS, **lights.FORMS, **splat.FORMS, **cluster.FORMS, **sssil.FORMS, **multires.FORMS, **truth.FORMS}


def described(stage: str, arguments: Arguments) -> Described:
    """Return what a run of a stage has beside its function; `form` is None where there is no literal form of it."""
    return FORMS[stage](arguments) if stage in FORMS else Described()
