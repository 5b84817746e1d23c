"""The tree of a settings class: every key with its type, default, range and help."""

import dataclasses
from collections.abc import Iterator
from functools import cache
from typing import Any, Literal, NamedTuple, get_args, get_origin

from refgi.settings.fields import Settings, choices_of, expected, hints, is_choice, may_be_none, members


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
        return expected(self.field, self.hint)


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
    bounds = {"minimum": about.get("least"), "maximum": about.get("most"), "exclusiveMinimum": about.get("above")}
    return made | {word: bound for word, bound in bounds.items() if bound is not None}
