"""Where the flat names of a case become a settings object; the one file to change when settings are composed anew."""

import dataclasses
from typing import Any, Literal, get_args, get_origin, get_type_hints

from refgi.methods import METHODS
from refgi.scene import Camera
from refgi.settings import Settings, choices_of, leaves, of
from refgi.sssil.temporal import TemporalSettings

SETS = ("as_published", "criteria")  # names joined by "+"
FLAT_NAMES = {("HssilSettings", "cameras.count"): "cameras"}  # keys whose name in the tables is not their last part
VIEWS = {"cornell_side": Camera((0.5, 0.3, -0.6), (0.2, 0.2, 0.3)),
         "stage_side": Camera((0.9, 0.4, 0.9), (0.0, 0.1, 0.0))}


def settings_of(method: str, **flat: Any) -> Any:
    """Return the settings of a method, of which some differ from the default; "temporal" is the temporal filter."""
    for name in flat.keys() & set(SETS):
        flat[name] = frozenset(filter(None, flat[name].split("+")))
    if "views" in flat:
        flat["views"] = (VIEWS[flat["views"]],)
    kind = _settings_class(method)
    return of(kind, **flat) if issubclass(kind, Settings) else kind(**flat)


def names_of(method: str) -> dict[str, set[Any]]:
    """Return every setting of a method, each with the values that a ledger must have beside the default."""
    settings_class = _settings_class(method)
    if issubclass(settings_class, Settings):
        return _names_of_keys(settings_class)
    types = get_type_hints(settings_class)
    wanted: dict[str, set[Any]] = {}
    for field in dataclasses.fields(settings_class):
        names = get_args(types[field.name]) if get_origin(types[field.name]) is Literal else ()
        wanted[field.name] = {name for name in names if name != field.default}
        if types[field.name] is bool:
            wanted[field.name] = {not field.default}
    wanted.get("as_published", set()).update(getattr(settings_class, "SWITCHES", ()))
    return wanted


def _names_of_keys(kind: type[Settings]) -> dict[str, set[Any]]:
    """Return the name of every key in the tables, each with its values beside the default."""
    wanted: dict[str, set[Any]] = {}
    for leaf in leaves(kind):
        name = FLAT_NAMES.get((kind.__name__, leaf.key), leaf.key.rpartition(".")[2])
        names: tuple[Any, ...] = tuple(choices_of(leaf.hint)) or (
            get_args(leaf.hint) if get_origin(leaf.hint) is Literal else (True, False) if leaf.hint is bool else ())
        default = leaf.field.default.name() if isinstance(leaf.field.default, Settings) else leaf.field.default
        wanted[name] = {value for value in names if value != default}
    wanted.get("as_published", set()).update(kind.SWITCHES)
    return wanted


def _settings_class(method: str) -> Any:
    return TemporalSettings if method == "temporal" else METHODS[method].load()[1]
