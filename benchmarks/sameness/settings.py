"""Where the names of a case become settings: names of a ledger stay as they are when settings are renamed."""

import dataclasses
from typing import Any, Literal, get_args, get_origin, get_type_hints

from refgi.methods import METHODS
from refgi.scene import Camera
from refgi.settings import Settings, choices_of, flat, leaves, replaced
from refgi.settings.fields import is_choice, may_be_none
from refgi.settings.keys import PRINTED, SEED, find_key
from refgi.sssil.temporal import TemporalSettings

SETS = ("as_published", "criteria")  # names joined by "+"
VIEWS = {"cornell_side": Camera((0.5, 0.3, -0.6), (0.2, 0.2, 0.3)),
         "stage_side": Camera((0.9, 0.4, 0.9), (0.0, 0.1, 0.0))}
# names of the ledger that are no short keys today, and values that have another name
RENAMED: dict[str, dict[str, str]] = {
    "sii": {"i_low": "reach.cut.share", "irradiance_low": "reach.cut.irradiance", "mesh_faces": "reach.bound.faces",
            "stochastic_range": "reach.stochastic"},
}
# single values that are another key's value today
RENAMED_CASES: dict[tuple[str, str, Any], tuple[str, Any]] = {("gather", "grid", 0): ("interpolation", "none")}
RENAMED_VALUES: dict[tuple[str, str], dict[Any, Any]] = {}


def settings_of(method: str, **named: Any) -> Any:
    """Return the settings of a method, of which some differ from the default; "temporal" is the temporal filter."""
    for name in named.keys() & set(SETS):
        named[name] = frozenset(filter(None, named[name].split("+")))
    if "views" in named:
        named["views"] = (VIEWS[named["views"]],)
    kind = _settings_class(method)
    if not issubclass(kind, Settings):
        return kind(**named)
    return replaced(kind(), dict(renamed(method, name, value) for name, value in named.items()))


def renamed(method: str, name: str, value: Any) -> tuple[str, Any]:
    """Return what a name and a value of the ledger are called today."""
    if isinstance(value, str):
        value = RENAMED_VALUES.get((method, name), {}).get(value, value)
    elif (method, name, value) in RENAMED_CASES:
        return RENAMED_CASES[method, name, value]
    return RENAMED.get(method, {}).get(name, name), value


def key_of(method: str, name: str) -> str:
    """Return the whole key that a name means."""
    kind = _settings_class(method)
    if not issubclass(kind, Settings) or name in (PRINTED, SEED):
        return name
    return find_key(kind(), RENAMED.get(method, {}).get(name, name)).key


def choice_of(method: str, key: str) -> tuple[str, str] | None:
    """Return the choice that has a setting, and its name; None for a setting that is always there."""
    kind = _settings_class(method)
    found = [leaf for leaf in leaves(kind) if leaf.key == key] if issubclass(kind, Settings) else []
    above = [leaf for leaf in leaves(kind) if leaf.key == key.rpartition(".")[0]] if len(found) == 1 else []
    return (above[0].key, found[0].owner.name()) if above else None


def names_of(method: str) -> dict[str, set[Any]]:
    """Return every setting of a method, each with the values that a ledger must have beside the default."""
    kind = _settings_class(method)
    if not issubclass(kind, Settings):
        return _names_of_fields(kind)
    wanted: dict[str, set[Any]] = {}
    defaults = flat(kind())
    for leaf in leaves(kind):
        last = leaf.key.rpartition(".")[2]
        values = wanted.setdefault(last if last in (PRINTED, SEED) else leaf.key, set())
        if last == PRINTED:
            values |= leaf.owner.SWITCHES
        elif is_choice(leaf.hint):
            names = {*choices_of(leaf.hint), *(["none"] if may_be_none(leaf.hint) else [])}
            values |= names - {defaults.get(leaf.key) or "none"}
        elif get_origin(leaf.hint) is Literal:
            values |= {*get_args(leaf.hint)} - {defaults.get(leaf.key, leaf.field.default)}
        elif leaf.hint is bool:
            values |= {not leaf.field.default}
    return wanted


def _names_of_fields(kind: Any) -> dict[str, set[Any]]:
    types = get_type_hints(kind)
    wanted: dict[str, set[Any]] = {}
    for field in dataclasses.fields(kind):
        names = get_args(types[field.name]) if get_origin(types[field.name]) is Literal else ()
        wanted[field.name] = {name for name in names if name != field.default}
        if types[field.name] is bool:
            wanted[field.name] = {not field.default}
    wanted.get("as_published", set()).update(getattr(kind, "SWITCHES", ()))
    return wanted


def _settings_class(method: str) -> Any:
    return TemporalSettings if method == "temporal" else METHODS[method].settings
