"""Few cases in place of many: each sets several independent keys at once, and any two keys stand together somewhere.

A covering array of strength two (pairwise testing), built case by case: deterministic, from the cases of a method.
"""

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from itertools import combinations, permutations
from typing import Any

from refgi.errors import InputError
from tests.wiring.cases import NOTHING, Case

MOST = 9  # cases at once


def fold(
    kind: type, cases: Mapping[str, Case], base: Mapping[str, Any] = NOTHING, elsewhere: tuple[str, ...] = (),
    fits: Callable[[Any], bool] | None = None,
) -> dict[str, Case]:
    """Return cases by number: each case is part of one, and any two keys that settings take together stand in one.

    Two keys that both begin with a word of `elsewhere` need not: another method's cases have them. `fits` says whether
    the expected picture is known for settings.
    """
    names, folded = list(cases), {}
    keys = {name: set(words({**case.values, **case.over})) for name, case in cases.items()}
    own = {name: set(words(case.values)) for name, case in cases.items()}
    candidates = [pair for pair in combinations(names, 2) if joined(*(cases[name] for name in pair))]
    wanted: dict[str, set[str]] = {}  # of each key those that it has yet to stand with
    for pair in candidates:
        for a, b in permutations(own[pair[0]] | own[pair[1]], 2):
            if not any(a.startswith(word) and b.startswith(word) for word in elsewhere):
                wanted.setdefault(a, set()).add(b)

    def gain(name: str, held: set[str]) -> int:
        new = keys[name] - held
        return sum(len(wanted[key] & held) + len(wanted[key] & new) / 2 for key in new & wanted.keys())

    left = list(names)
    while True:
        while not left and candidates and not (
                gain(candidates[0][0], set()) + gain(candidates[0][1], keys[candidates[0][0]])
                and allowed(joined(*(cases[name] for name in candidates[0])), kind, base, fits)):
            candidates.pop(0)
        if not left and not candidates:
            return folded
        row = [left[0]] if left else list(candidates[0])
        whole = cases[row[0]] if left else joined(*(cases[name] for name in row))
        held = set().union(*(keys[name] for name in row))
        tried = set(row)  # what a row refuses once it refuses as it grows
        while len(row) < MOST:
            gains = {name: (gain(name, held), name in left) for name in names if name not in tried}
            for name in sorted((name for name, one in gains.items() if any(one)), key=gains.__getitem__, reverse=True):
                tried.add(name)
                if (more := joined(whole, cases[name])) and allowed(more, kind, base, fits):
                    row.append(name)
                    whole, held = more, held | keys[name]
                    break
            else:
                break
        for key in held & wanted.keys():
            wanted[key] -= held
        left = [name for name in left if name not in row]
        folded[f"{len(folded)}: {row[0]}"] = dataclasses.replace(whole, parts=tuple(row))


def words(values: Mapping[str, Any]) -> Iterator[str]:
    """Yield keys; each name of a set is one of its own."""
    for key, value in values.items():
        yield from (f"{key} {name}" for name in value) if isinstance(value, set | frozenset) else (key,)


def joined(one: Case, other: Case) -> Case | None:
    """Return the case that is both, or None where they want different things."""
    scenes = {one.scene, other.scene} - {"lamps"}
    if len(scenes) > 1 or (one.frame and other.frame and one.frame != other.frame):
        return None
    keys = {**one.over, **one.values}
    for key, value in {**other.over, **other.values}.items():
        tested = [value_of for case in (one, other) for name, value_of in case.values.items() if name == key]
        if isinstance(value, set | frozenset):
            value = value | keys.get(key, frozenset())
        elif isinstance(value, int | float) and not isinstance(value, bool) and len(tested) < 2:
            value = tested[0] if tested else keys.get(key, value)  # numbers that only help others to matter give way
        elif keys.get(key, value) != value:
            return None
        keys[key] = value
    for mine, others in ((one, other), (other, one)):  # parts of a choice that the other case makes otherwise
        chosen, relied = {**mine.over, **mine.values}, {**others.over, **others.values}
        if any(key.startswith(f"{choice}.") and choice not in relied for choice in chosen for key in relied):
            return None
    values = {key: keys[key] for key in {**one.values, **other.values}}
    over = {key: value for key, value in keys.items() if key not in values}
    return Case(values, over, min(scenes, default="lamps"), one.frame or other.frame)


def allowed(case: Case, kind: type, base: Mapping[str, Any], fits: Callable[[Any], bool] | None) -> bool:
    """Tell whether settings take all keys of a case."""
    try:
        settings = case.settings(kind, base)
    except InputError:
        return False
    return fits is None or fits(settings)
