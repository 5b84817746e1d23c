"""Values by key: find what a key means, change several at once, and list them."""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from typing import Any, TypeVar

from refgi.errors import InputError, first_faults, nearest
from refgi.settings.fields import Leaf, Settings, checked, choices_of, expected, hints, is_choice, leaves, may_be_none

S = TypeVar("S", bound=Settings)

PRINTED = "as_published"  # the field of every part that has printed forms
SEED = "seed"  # the field of every part that draws random numbers


def of(kind: type[S], /, **values: Any) -> S:
    """Make settings from values by key.

    Parameters
    ----------
    kind : type
        A settings class.
    **values : object
        By key, whole or short, with dots or underscores; a choice by its name or as an instance.

    Returns
    -------
    Settings
        The defaults but for what is given.

    Raises
    ------
    InputError
        If keys or values are not usable; names all of them.
    """
    return replaced(kind(), values)


def replaced(settings: S, values: Mapping[str, Any]) -> S:
    """Return settings with other values.

    Parameters
    ----------
    settings : Settings
        What to start from.
    values : mapping
        As for `of`.

    Returns
    -------
    Settings
        A new instance.

    Raises
    ------
    InputError
        If keys or values are not usable; names all of them.
    """
    errors: list[InputError] = []
    found: dict[str, Any] = {}
    for key, value in values.items():
        try:
            shared = _shared(settings, key, value, values)
            found |= {meant(settings, find_key(settings, key), value).key: value} if shared is None else shared
        except InputError as error:
            errors.append(error)
    made: S = _rebuilt(settings, _nested(found), "", errors)
    raise_all(errors)
    return made


def _shared(settings: Settings, key: str, value: Any, values: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return what a key sets that is meant for every part of a tree, the seed or printed forms; None for other keys."""
    if key == PRINTED and not any(other.endswith(f".{PRINTED}") for other in values):
        return _printed_forms(settings, value)
    if key == SEED and not any(other.endswith(f".{SEED}") for other in values):
        return {leaf.key: value for leaf in leaves(type(settings)) if leaf.key.rpartition(".")[2] == SEED
                and leaf.key in flat(settings)} or None
    return None


def _printed_forms(settings: Settings, names: Any) -> dict[str, Any]:
    """Give each part of a tree those names of printed forms that are its own."""
    names = frozenset({names} if isinstance(names, str) else names)
    parts = [leaf for leaf in leaves(type(settings)) if leaf.key.rpartition(".")[2] == PRINTED]
    known = frozenset[str]().union(*(leaf.owner.SWITCHES for leaf in parts))
    if not names <= known:
        raise InputError(f"{PRINTED}: expected names out of {sorted(known)}, got {sorted(map(str, names))}",
                         key=PRINTED)
    own = [(leaf.key, names & leaf.owner.SWITCHES) for leaf in parts]
    there = flat(settings)
    return {key: chosen for key, chosen in own if chosen or (there.get(key))}


def raise_all(errors: Iterable[InputError]) -> None:
    """Raise one error for all, if there are any."""
    errors = list(errors)
    if not errors:
        return
    keys = dict.fromkeys(error.key for error in errors if error.key)
    raise InputError(first_faults(list(dict.fromkeys(map(str, errors))), "; "), key=", ".join(keys))


def find_key(settings: Settings, key: str) -> Leaf:
    """Return what a key means: whole, or shortened to its last parts; with dots or underscores.

    Where several choices have a field of one name, the one chosen in `settings` is meant. Raises InputError if there is
    none, or more than one.
    """
    wanted = "." + key.replace("_", ".")
    ranked: list[dict[str, Leaf]] = [{}, {}, {}]  # whole keys; ends of keys; what parts stand for
    for leaf in leaves(type(settings)):
        whole = "." + leaf.key.replace("_", ".")
        if whole.endswith(wanted):
            ranked[0 if whole == wanted else 1].setdefault(leaf.key, leaf)
    for leaf in _principals(type(settings)):
        part = "." + leaf.key.rpartition(".")[0].replace("_", ".")
        if part.endswith(wanted):
            ranked[0 if part == wanted else 2].setdefault(leaf.key, leaf)
    known = next(filter(None, ranked), {})
    if len(known) > 1:  # a name that is a whole last part, then what is chosen now, before others
        known = {name: leaf for name, leaf in known.items() if name.rpartition(".")[2] == key} or known
    if len(known) > 1:
        there = flat(settings)
        known = {name: leaf for name, leaf in known.items() if name in there} or known
    if len(known) == 1:
        return next(iter(known.values()))
    if known:
        raise InputError(f"{key!r} may be {' or '.join(known)}", key=key)
    hint = _hint(key, leaves(type(settings)))
    raise InputError(f"{key!r} is not a setting of {type(settings).__name__}{hint}", key=key)


def meant(settings: Settings, leaf: Leaf, value: Any) -> Leaf:
    """Return where a value, or the text of it, belongs: `leaf`, or a field of what `leaf` chooses.

    A choice given what is none of its names stands for the principal setting of what is chosen now or by default.
    """
    kinds = choices_of(leaf.hint)
    if not kinds or value is None or isinstance(value, Settings) or value in (*kinds, "none"):
        return leaf
    chosen = flat(settings).get(leaf.key, leaf.field.default)  # the default where another choice holds the part
    kind = kinds.get(chosen.name() if isinstance(chosen, Settings) else chosen or "")
    if kind is None or not kind.PRINCIPAL:
        return leaf
    return next(one for one in leaves(type(settings)) if one.key == f"{leaf.key}.{kind.PRINCIPAL}")


def _all_principals(kind: type[Settings]) -> tuple[Leaf, ...]:
    """Return, for every part that a bare value may stand for, the key of that value."""
    return tuple(_principals_below(kind, ""))


_principals: Any = cache(_all_principals)


def _principals_below(kind: type[Settings], prefix: str) -> Iterable[Leaf]:
    for field in dataclasses.fields(kind):
        hint = hints(kind)[field.name]
        for part in choices_of(hint).values():
            inner = f"{prefix}{field.name}."
            if part.PRINCIPAL and not is_choice(hint):  # what a bare value of a choice means depends on what is chosen
                principal = next(one for one in dataclasses.fields(part) if one.name == part.PRINCIPAL)
                yield Leaf(inner + part.PRINCIPAL, principal, hints(part)[part.PRINCIPAL], part)
            yield from _principals_below(part, inner)


def _hint(key: str, tree: Sequence[Leaf]) -> str:
    whole = {name: leaf.key for leaf in tree for name in (leaf.key.rpartition(".")[2], leaf.key)}
    whole |= {part: part for leaf in tree for part in leaf.key.split(".")[:-1]}
    near = nearest(key, whole)
    return f"; did you mean {whole[near]!r}?" if near else ""


def _nested(values: Mapping[str, Any]) -> dict[str, Any]:
    """Turn dotted keys into a tree; what a choice is set to stands under the empty key."""
    tree: dict[str, Any] = {}
    for key, value in values.items():
        *above, last = key.split(".")
        node = tree
        for part in above:
            node = node.setdefault(part, {})
        node.setdefault(last, {})[""] = value
    return tree


def _rebuilt(settings: Any, tree: dict[str, Any], prefix: str, errors: list[InputError]) -> Any:
    """Return settings with the values of a tree; what is wrong goes to `errors`."""
    changes = {}
    before = len(errors)
    for name, node in tree.items():
        field = next(field for field in dataclasses.fields(settings) if field.name == name)
        hint, key = hints(type(settings))[name], prefix + name
        inner = {part: value for part, value in node.items() if part}
        try:
            changes[name] = _value(settings, node, field, hint, key)
            changes[name] = checked(type(settings), field, changes[name])
        except InputError as error:
            errors.append(_with_prefix(prefix, error))
            continue
        if inner:
            part = changes[name]
            if part is None and "" not in node and (fitting := _having(hint, inner)):
                part = fitting
            unknown = [one for one in inner if part is None or not hasattr(part, one)]
            chosen = "none" if part is None else part.name()
            errors += [InputError(f"{key}.{one}: not a setting of {key}={chosen}", key=f"{key}.{one}")
                       for one in unknown]
            if not unknown:
                changes[name] = _rebuilt(part, inner, f"{key}.", errors)
    if len(errors) > before:
        return settings
    try:
        return dataclasses.replace(settings, **changes)
    except InputError as error:
        errors.append(_with_prefix(prefix, error))
        return settings


def _value(settings: Settings, node: dict[str, Any], field: Any, hint: Any, key: str) -> Any:
    """Return what a field is set to, before what is set inside it."""
    now = getattr(settings, field.name)
    if "" not in node:
        return now
    value, kinds = node[""], choices_of(hint)
    if isinstance(value, str) and kinds:
        if value == "none" and may_be_none(hint):
            return None
        if value not in kinds:
            raise InputError(f"{key}: expected {expected(type(settings), field)}, got {value!r}", key=key)
        return now if isinstance(now, kinds[value]) else kinds[value]()
    return value


def _having(hint: Any, names: Iterable[str]) -> Any:
    """Return the one choice that has fields of all names, at its defaults; None if there is none or several."""
    fitting = [kind for kind in choices_of(hint).values() if set(names) <= set(hints(kind))]
    return fitting[0]() if len(fitting) == 1 else None


def _with_prefix(prefix: str, error: InputError) -> InputError:
    """Return an error with the whole key that it is about."""
    if (error.key or "").startswith(prefix):
        return error
    return InputError(f"{prefix}{error}", key=f"{prefix}{error.key}")


def flat(settings: Settings) -> dict[str, Any]:
    """Return all values by dotted key; a choice's own value is its name.

    Parameters
    ----------
    settings : Settings
        Any.

    Returns
    -------
    dict
        What `of` makes the same settings from.
    """
    found: dict[str, Any] = {}
    for field in dataclasses.fields(settings):
        value, hint = getattr(settings, field.name), hints(type(settings))[field.name]
        if not choices_of(hint):
            found[field.name] = value
            continue
        if is_choice(hint):
            found[field.name] = None if value is None else value.name()
        if value is not None:
            found |= {f"{field.name}.{key}": inner for key, inner in flat(value).items()}
    return found


def changed(settings: Settings, base: Settings | None = None) -> dict[str, Any]:
    """Return the values that differ from others.

    Parameters
    ----------
    settings : Settings
        Any.
    base : Settings, optional
        Of the same class; the defaults where absent.

    Returns
    -------
    dict
        By dotted key.
    """
    there = flat(type(settings)() if base is None else base)
    return {key: value for key, value in flat(settings).items() if key not in there or there[key] != value}
