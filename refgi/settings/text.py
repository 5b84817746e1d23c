"""Settings from text: `lights=1024 visibility=csm visibility.terms=8`, all errors at once."""

import json
import math
from collections.abc import Iterable, Mapping
from typing import Any, TypeVar, get_args, get_origin

from refgi.errors import InputError
from refgi.settings.fields import Leaf, Settings, choices_of, leaves, may_be_none
from refgi.settings.keys import PRINTED, SEED, find_key, meant, raise_all, replaced

S = TypeVar("S", bound=Settings)

ABSENT = frozenset({"none", "null", ""})


def from_text(base: S, pairs: Iterable[str]) -> S:
    """Return settings with values given as text.

    Parameters
    ----------
    base : Settings
        What to start from.
    pairs : iterable of str
        Such as ``lights=1024``, ``visibility.terms=8`` or ``as_published=sii_no_pi,sii_widening``.

    Returns
    -------
    Settings
        A new instance.

    Raises
    ------
    InputError
        If a key is unknown or a value not usable; names all of them.
    """
    errors: list[InputError] = []
    values: dict[str, Any] = {}
    for pair in pairs:
        key, equals, text = pair.partition("=")
        try:
            if not equals:
                raise InputError(f"{key!r} is not key=value", key="--set")
            if key == PRINTED:
                values[key] = _names(text)
            elif key == SEED:
                seeds = [leaf for leaf in leaves(type(base)) if leaf.key.rpartition(".")[2] == SEED]
                values[key] = _read(seeds[0] if seeds else find_key(base, key), text)
            else:
                leaf = meant(base, find_key(base, key), text.lower() if text.lower() in ABSENT else text)
                values[leaf.key] = _read(leaf, text)
        except InputError as error:
            errors.append(error)
    try:
        made = replaced(base, values)
    except InputError as error:
        if not errors:
            raise
        errors.append(error)
    raise_all(errors)
    return made


def of_record(kind: type[S], values: Mapping[str, Any]) -> S:
    """Return settings from what a record holds of them: JSON values by whole key.

    Parameters
    ----------
    kind : type
        A settings class.
    values : mapping
        As `flat` gives them, in the values of JSON.

    Returns
    -------
    Settings
        The same settings.

    Raises
    ------
    InputError
        If a key or value is not usable.
    """
    known = {leaf.key: leaf for leaf in leaves(kind)}
    if unknown := [key for key in values if key not in known]:
        raise InputError(f"{', '.join(unknown)}: not a setting of {kind.__name__}", key=unknown[0])
    return replaced(kind(), {key: _from_json(known[key], value) for key, value in values.items()})


def _from_json(leaf: Leaf, value: Any) -> Any:
    from pydantic import ConfigDict, TypeAdapter, ValidationError

    if value is None or choices_of(leaf.hint):
        return value
    try:
        return TypeAdapter(leaf.hint, config=ConfigDict(extra="forbid")).validate_python(value)
    except ValidationError as error:
        raise InputError(f"{leaf.key}: {_reason(error.errors()[0])}, got {value!r}", key=leaf.key) from error


def _read(leaf: Leaf, text: str) -> Any:
    """Return the value that a text stands for."""
    from pydantic import ConfigDict, TypeAdapter, ValidationError

    if text.lower() in ABSENT and may_be_none(leaf.hint):
        return None
    if choices_of(leaf.hint):
        return text
    adapter = TypeAdapter(leaf.hint, config=ConfigDict(extra="forbid"))
    first: ValidationError | None = None
    for candidate in _candidates(text, leaf.hint):
        try:
            return adapter.validate_python(candidate)
        except ValidationError as error:
            first = first or error
    assert first is not None
    reasons = dict.fromkeys(_reason(error) for error in first.errors() if error["type"] != "none_required")
    raise InputError(f"{leaf.key}: {' or '.join(reasons)}, got {text!r}", key=leaf.key)


def _reason(error: Any) -> str:
    of = f"{error['loc'][-1]}: " if error["type"] in ("missing", "unexpected_keyword_argument") else ""
    text = error["msg"].removeprefix("Value error, ")
    return f"{of}{text[:1].lower()}{text[1:]}"


def _names(text: str) -> list[str]:
    return [part.strip() for part in text.split(",") if part.strip()]


def _candidates(text: str, hint: Any) -> list[Any]:
    """Return what a text may stand for: itself, JSON, a list with commas; what was probably meant comes first."""
    if get_origin(hint) is frozenset or any(get_origin(part) is frozenset for part in get_args(hint)):
        return [_names(text)]
    try:
        read = json.loads(text, object_hook=_in_radians)
    except ValueError:
        return [text, _names(text)]
    return [read, text] if isinstance(read, list | dict) else [text, read]


def _in_radians(entry: dict[str, Any]) -> dict[str, Any]:
    """Return an object with its angles in radians: `vfov_deg`, as in a scene file, is a camera's `vfov`."""
    return {key.removesuffix("_deg"): math.radians(value)
            if key.endswith("_deg") and isinstance(value, int | float) else value for key, value in entry.items()}
