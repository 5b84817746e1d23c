"""Where the flat names of a case become a settings object; the one file to change when settings are composed anew."""

import dataclasses
from typing import Any, Literal, get_args, get_origin, get_type_hints

from refgi.methods import METHODS
from refgi.scene import Camera
from refgi.sssil.temporal import TemporalSettings

SETS = ("as_published", "criteria")  # names joined by "+"
VIEWS = {"cornell_side": Camera((0.5, 0.3, -0.6), (0.2, 0.2, 0.3)),
         "stage_side": Camera((0.9, 0.4, 0.9), (0.0, 0.1, 0.0))}


VAL_NAMES = {"dealing": "assignment"}
VAL_KINDS = {"series": "csm", "step": "pcss", "rectangle": "rays_rectangle", "members": "rays_vpls"}


def settings_of(method: str, **flat: Any) -> Any:
    """Return the settings of a method, of which some differ from the default; "temporal" is the temporal filter."""
    for name in flat.keys() & set(SETS):
        flat[name] = frozenset(filter(None, flat[name].split("+")))
    if "views" in flat:
        flat["views"] = (VIEWS[flat["views"]],)
    if method == "val":
        flat = {VAL_NAMES.get(name, name): value for name, value in flat.items()}
        if "visibility" in flat:
            flat["visibility"] = VAL_KINDS.get(flat["visibility"], flat["visibility"])
    return _settings_class(method)(**flat)


def names_of(method: str) -> dict[str, set[Any]]:
    """Return every setting of a method, each with the values that a ledger must have beside the default."""
    settings_class = _settings_class(method)
    types = get_type_hints(settings_class)
    wanted: dict[str, set[Any]] = {}
    for field in dataclasses.fields(settings_class):
        names = get_args(types[field.name]) if get_origin(types[field.name]) is Literal else ()
        wanted[field.name] = {name for name in names if name != field.default}
        if types[field.name] is bool:
            wanted[field.name] = {not field.default}
    wanted.get("as_published", set()).update(getattr(settings_class, "SWITCHES", ()))
    if method == "val":
        old = {new: old for old, new in (VAL_NAMES | VAL_KINDS).items()}
        wanted = {old.get(name, name): {old.get(value, value) for value in values} for name, values in wanted.items()}
    return wanted


def _settings_class(method: str) -> Any:
    return TemporalSettings if method == "temporal" else METHODS[method].load()[1]
