"""`--set key=value`: text checked against a settings dataclass, all errors at once."""

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import fields
from typing import Any, get_args, get_type_hints

from refgi.errors import InputError, first_faults
from refgi.scene.files import did_you_mean
from refgi.scene.values import is_number
from refgi.settings import Settings, from_text

ABSENT = frozenset({"none", "null", ""})


def read_settings(
    wanted: type[Any], pairs: Iterable[str], seed: int | None = None, owner: str = "", base: Any = None
) -> Any:
    """Make a method's settings from text.

    Parameters
    ----------
    wanted : type
        The settings class, a dataclass.
    pairs : iterable of str
        Such as ``lights=1024``, ``pattern=grid``, ``as_published=sii_no_pi,sii_widening`` or ``seconds=none``.
    seed : int, optional
        Value of the key ``seed``.
    owner : str
        The method, for messages.
    base : object, optional
        What to start from; the defaults where absent.

    Returns
    -------
    object
        An instance of `wanted`.

    Raises
    ------
    InputError
        If a key is unknown or a value not usable; names all of them.
    """
    if issubclass(wanted, Settings):
        return from_text(base or wanted(), [*pairs, *([] if seed is None else [f"seed={seed}"])])
    hints = get_type_hints(wanted)
    known = [field.name for field in fields(wanted)]
    values: dict[str, Any] = {}
    errors: list[InputError] = []
    for pair in [*pairs, *([] if seed is None else [f"seed={seed}"])]:
        key, equals, text = pair.partition("=")
        if not equals:
            errors.append(InputError(f"{pair!r} is not key=value", key="--set"))
        elif key not in known:
            errors.append(InputError(_unknown(key, known, owner), key=key))
        elif (problem := _read(values, key, text, hints[key])) is not None:
            errors.append(InputError(problem, key=key))
    made, refused = _make(wanted, values)
    if errors := errors + refused:
        keys = dict.fromkeys(error.key for error in errors if error.key)
        texts = first_faults([str(error) for error in errors], "; ")
        raise InputError(f"{texts} (settings: {', '.join(known)})", key=", ".join(keys))
    return made


def by_method(pairs: Iterable[str], methods: Iterable[str]) -> dict[str, list[str]]:
    """Sort ``method.key=value`` by method.

    Parameters
    ----------
    pairs : iterable of str
        Such as ``sii.lights=1024``.
    methods : iterable of str
        Methods there are.

    Returns
    -------
    dict of str to list of str
        ``key=value`` texts for each method.

    Raises
    ------
    InputError
        If a method is missing or unknown; names all of them.
    """
    sorted_pairs: dict[str, list[str]] = {name: [] for name in methods}
    errors = []
    for pair in pairs:
        name, dot, rest = pair.partition(".")
        if not dot or "=" in name:
            errors.append(f"--set {pair!r}: expected METHOD.key=value")
        elif name not in sorted_pairs:
            errors.append(f"--set {pair!r}: {name!r} is not compared here ({', '.join(sorted_pairs)})"
                          + did_you_mean(name, sorted_pairs))
        else:
            sorted_pairs[name].append(rest)
    if errors:
        raise InputError(first_faults(errors, "; "), key="--set")
    return sorted_pairs


def _unknown(key: str, known: list[str], owner: str) -> str:
    of = f" of {owner}" if owner else ""
    return f"{key!r} is not a setting{of}" + did_you_mean(key, known)


def _read(values: dict[str, Any], key: str, text: str, hint: Any) -> str | None:
    from pydantic import ConfigDict, TypeAdapter, ValidationError

    adapter = TypeAdapter(hint, config=ConfigDict(extra="forbid"))
    first: ValidationError | None = None
    for candidate in _candidates(text, hint):
        try:
            values[key] = adapter.validate_python(candidate)
        except ValidationError as error:
            first = first or error
        else:
            return None
    assert first is not None
    reasons = dict.fromkeys(_reason(error) for error in first.errors() if error["type"] != "none_required")
    return f"{key}: {' or '.join(reasons)}, got {text!r}"


def _reason(error: Any) -> str:
    of = f"{error['loc'][-1]}: " if error["type"] in ("missing", "unexpected_keyword_argument") else ""
    text = error["msg"].removeprefix("Value error, ")
    return f"{of}{text[:1].lower()}{text[1:]}"


def _candidates(text: str, hint: Any) -> list[Any]:
    """Return what a text may stand for: None, itself, JSON, a list with commas."""
    if text.lower() in ABSENT and type(None) in get_args(hint):
        return [None]
    try:
        read = json.loads(text, object_hook=_in_radians)
    except ValueError:
        return [text, [part.strip() for part in text.split(",") if part.strip()]]
    return [read, text] if isinstance(read, list | dict) else [text, read]  # what was meant is tried, and blamed, first


def _in_radians(entry: dict[str, Any]) -> dict[str, Any]:
    """Return an object with its angles in radians: `vfov_deg`, as in a scene file, is a camera's `vfov`."""
    return {key.removesuffix("_deg"): math.radians(value) if key.endswith("_deg") and is_number(value) else value
            for key, value in entry.items()}


def _make(wanted: type, values: Mapping[str, Any]) -> tuple[Any, list[InputError]]:
    try:
        return wanted(**values), []
    except InputError as error:
        alone = {}
        for key, value in values.items():
            try:
                wanted(**{key: value})
            except InputError as other:
                alone[str(other)] = other
        return None, list(alone.values()) or [error]
