"""Fields of settings, checked when settings are made; the tree of all keys with type, range and one line of help."""

import dataclasses
import math
import numbers
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, ClassVar, Literal, NamedTuple, Union, get_args, get_origin, get_type_hints

import numpy as np

from refgi.errors import expect

LAST_SEED = 2**32 - 1  # of whatever draws numbers


def setting(
    default: Any, about: str, *, least: float | None = None, most: float | None = None, above: float | None = None,
    unit: str = "", study: bool = False,
) -> Any:
    """Describe one field of a `Settings` class.

    Parameters
    ----------
    default : object
        Its value unless given.
    about : str
        What it is, in one line.
    least, most : float, optional
        The range of a number, both ends in it.
    above : float, optional
        What a number exceeds, in place of `least`.
    unit : str
        Its unit.
    study : bool
        Whether it is there to study a method, not to use it; such fields stand apart in tables.

    Returns
    -------
    object
        A field of a dataclass.
    """
    about_it = {"about": about, "least": least, "most": most, "above": above, "unit": unit, "study": study}
    return dataclasses.field(default=default, metadata=about_it)


@dataclasses.dataclass(frozen=True)
class Settings:
    """Base of all settings: checks every field by its type and range, then calls `check`.

    Fields are numbers, `bool`, `Literal` names, `frozenset[str]` out of `SWITCHES`, any of these or None, other
    `Settings`, or a union of `Settings` classes: a choice. Other types are left to `check`.
    """

    NAME: ClassVar[str] = ""  # of a choice; the class's name in lower case with underscores where empty
    PRINCIPAL: ClassVar[str] = ""  # the field that the whole stands for: lights=1024
    SWITCHES: ClassVar[frozenset[str]] = frozenset()

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if (kept := checked(type(self), field, value)) is not value:
                object.__setattr__(self, field.name, kept)
        self.check()

    def check(self) -> None:
        """Check what fields ask of each other; raise `InputError`."""

    @classmethod
    def name(cls) -> str:
        """Return the name by which a choice is chosen."""
        return cls.NAME or re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", cls.__name__.removesuffix("Settings")).lower()


def hints(kind: type[Settings]) -> dict[str, Any]:
    """Return the types of a class's fields, by name."""
    found: dict[str, Any] = _hints(kind)
    return found


_hints: Any = cache(get_type_hints)


@cache
def members(hint: Any) -> tuple[Any, ...]:
    """Return the types that a hint, a type or a union, allows, without None."""
    parts = get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)
    return tuple(part for part in parts if part is not NoneType)


@cache
def may_be_none(hint: Any) -> bool:
    """Return whether a hint allows None."""
    return get_origin(hint) in (Union, UnionType) and NoneType in get_args(hint)


@cache
def choices_of(hint: Any) -> dict[str, type[Settings]]:
    """Return the classes that a field may hold, by name.

    Parameters
    ----------
    hint : type
        The field's type.

    Returns
    -------
    dict
        Empty for a plain value.
    """
    kinds = [kind for kind in members(hint) if isinstance(kind, type) and issubclass(kind, Settings)]
    return {kind.name(): kind for kind in kinds}


def is_choice(hint: Any) -> bool:
    """Return whether a field holds one of several classes, or one or none; not a part that is always there."""
    found = choices_of(hint)
    return len(found) > 1 or (len(found) == 1 and may_be_none(hint))


def expected(owner: type[Settings], field: Any) -> str:
    """Say what a field takes, such as "a whole number, 1 to 64"."""
    hint = hints(owner)[field.name]
    none = "none or " if may_be_none(hint) else ""
    if kinds := choices_of(hint):
        return f"{none}{' or '.join(kinds)}"
    kind = members(hint)[0]
    if get_origin(kind) is Literal:
        return none + " or ".join(map(repr, get_args(kind)))
    if get_origin(kind) is frozenset:
        return f"{none}names out of {', '.join(sorted(names_of(owner, hint)))}"
    if get_origin(kind) is tuple:
        what = get_args(kind)[0]
        inside = dataclasses.fields(what) if dataclasses.is_dataclass(what) else ()
        return f"{none}a list in JSON" + (f" of {{{', '.join(part.name for part in inside)}}}" if inside else "")
    if kind is bool:
        return f"{none}true or false"
    if kind in (Path, str):
        return f"{none}a file's name"
    return f"{none}{'a whole number' if kind is int else 'a number'}{_range(field.metadata)}"


def _range(about: Any) -> str:
    low, high, above = about.get("least"), about.get("most"), about.get("above")
    unit = f" {about['unit']}" if about.get("unit") else ""
    start = f"{above:g} < x" if above is not None else f"{low:,}" if isinstance(low, int) else f"{low:g}" \
        if low is not None else ""
    end = "" if high is None else f"{high:,}" if isinstance(high, int) else f"{high:g}"
    if not (start or end):
        return unit and f" of{unit}"
    if above is not None:
        return f", {start}{f' <= {end}' if end else ''}{unit}"
    return f", {start} to {end}{unit}" if start and end else f", {start} or more{unit}" if start else \
        f", up to {end}{unit}"


def checked(owner: type[Settings], field: Any, value: Any) -> Any:
    """Return what a field keeps of a value: names as a frozenset, all else as it is.

    Raises InputError if the field does not take it.
    """
    hint = hints(owner)[field.name]
    if value is None and may_be_none(hint):
        return value
    kind = members(hint)[0]
    fits = True
    if kinds := choices_of(hint):
        fits = isinstance(value, tuple(kinds.values()))
    elif get_origin(kind) is Literal:
        fits = any(type(value) is type(option) and value == option for option in get_args(kind))
    elif kind is bool:
        fits = isinstance(value, bool | np.bool_)
    elif kind in (int, float):
        fits = _is_in_range(value, kind, field.metadata)
    elif get_origin(kind) is frozenset:
        value, known = frozenset({value} if isinstance(value, str) else value), names_of(owner, hint)
        expect(value <= known, field.name, f"names out of {sorted(known)}", sorted(map(str, value)))
    expect(fits, field.name, expected(owner, field), value)
    return value


def names_of(owner: type[Settings], hint: Any) -> frozenset[str]:
    """Return the names that a set may hold: its `Literal`'s, or the class's `SWITCHES` where it takes any text."""
    (kind,) = get_args(members(hint)[0])
    return frozenset(get_args(kind)) if get_origin(kind) is Literal else owner.SWITCHES


def _is_in_range(value: Any, kind: Any, about: Any) -> bool:
    if isinstance(value, bool | np.bool_) or not isinstance(value, numbers.Integral if kind is int else numbers.Real):
        return False
    try:
        finite = math.isfinite(value)
    except OverflowError:  # a whole number beyond all floats
        return False
    if not finite and value != about.get("most"):
        return False
    low, high, above = about.get("least"), about.get("most"), about.get("above")
    return (low is None or value >= low) and (high is None or value <= high) and (above is None or value > above)


class Leaf(NamedTuple):
    """One key of a settings class."""

    key: str  # dotted
    field: Any  # of a dataclass
    hint: Any  # its type
    owner: type[Settings]  # the class that has it

    @property
    def about(self) -> str:
        """What it is."""
        text: str = self.field.metadata.get("about", "")
        return text

    @property
    def is_for_study(self) -> bool:
        """Whether it is there to study the method."""
        return bool(self.field.metadata.get("study"))

    @property
    def expected(self) -> str:
        """What it takes."""
        return expected(self.owner, self.field)


def leaves(kind: type[Settings]) -> tuple[Leaf, ...]:
    """Return every key of a settings class, those of all choices among them.

    Parameters
    ----------
    kind : type
        Settings.

    Returns
    -------
    tuple of Leaf
        In the order of the fields; a choice before what it holds.
    """
    found: tuple[Leaf, ...] = _listed(kind)
    return found


def _all_leaves(kind: type[Settings]) -> tuple[Leaf, ...]:
    return tuple(_leaves(kind, ""))


_listed: Any = cache(_all_leaves)


def _leaves(kind: type[Settings], prefix: str) -> Iterator[Leaf]:
    for field in dataclasses.fields(kind):
        hint, key = hints(kind)[field.name], prefix + field.name
        kinds = choices_of(hint)
        if is_choice(hint) or not kinds:
            yield Leaf(key, field, hint, kind)
        for one in kinds.values():
            yield from _leaves(one, f"{key}.")


def schema(kind: type[Settings]) -> dict[str, Any]:
    """Return the JSON Schema of settings as records hold them: one object with dotted keys.

    Parameters
    ----------
    kind : type
        Settings.

    Returns
    -------
    dict
        A schema of draft 2020-12.
    """
    properties: dict[str, Any] = {}
    for leaf in leaves(kind):
        properties.setdefault(leaf.key, _property(leaf))
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": kind.__name__, "type": "object",
            "properties": properties, "additionalProperties": False}


def _property(leaf: Leaf) -> dict[str, Any]:
    about = leaf.field.metadata
    made: dict[str, Any] = {"description": about.get("about", "")}
    if is_choice(leaf.hint):
        names: list[Any] = list(choices_of(leaf.hint))
        return made | {"enum": [*names, None] if may_be_none(leaf.hint) else names}
    kind = members(leaf.hint)[0]
    if get_origin(kind) is Literal:
        return made | {"enum": [*get_args(kind), *([None] if may_be_none(leaf.hint) else [])]}
    name = {bool: "boolean", int: "integer", float: "number"}.get(kind, "array" if get_origin(kind) else "string")
    made["type"] = [name, "null"] if may_be_none(leaf.hint) else name
    if get_origin(kind) is frozenset:
        made["items"] = {"enum": sorted(names_of(leaf.owner, leaf.hint))}
    bounds = {"minimum": about.get("least"), "maximum": about.get("most"), "exclusiveMinimum": about.get("above")}
    return made | {word: bound for word, bound in bounds.items() if bound is not None}
