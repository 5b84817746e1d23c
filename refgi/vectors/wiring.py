"""Likely bugs of wiring: the right stage reads a wrong buffer, or the right one by another layout.

Each input of a stage gives way to each array of its shape and type that is given or written before the stage, among
them its own of another lamp, level or round; to larger ones of its own name, such as those of a finer level, read by
rows of its own size; all fields of an input, such as both corners of a box, give way to another's at once, and two
change places. An input of vectors or colours is read as triples side by side as well. Names in causes are without
numbers, so that a bug has one name in all cases.
"""

from collections.abc import Callable, Iterator
from functools import partial
from itertools import combinations, takewhile
from typing import Any

import numpy as np

from refgi.types import Array
from refgi.vectors.bounds import is_estimate
from refgi.vectors.forms.beside import NO_BUGS
from refgi.vectors.rows import Form
from refgi.vectors.spec import Arrays, Bug, Case, Run, Stage, axes_of, kind_of

Layout = Callable[[Array], Array]
ANOTHER = "that of another lamp, level or round"


def wirings(case: Case, step: Stage, known: Arrays) -> Iterator[Bug]:
    """Yield the wrong wirings of a stage, each cause once; the bug runs its literal form, or the stage itself."""
    if is_estimate(case, step) or NO_BUGS in case.facts.get(step.name, {}):
        return
    form = next((one for one in step.variants if isinstance(one, Form)), None)
    run = step.run if form is None else form  # NumPy says where an index is none, a kernel reads what lies there
    earlier = takewhile(lambda one: one is not step, case.stages)
    before = [*case.given, *(name for one in earlier for name in one.writes)]
    told = set()

    def bug(cause: str, make: Callable[..., Arrays], *given: Any) -> Iterator[Bug]:
        if cause not in told:
            told.add(cause)
            yield Bug(cause, partial(make, run, *given))

    for name in step.reads:
        right, decides = known[name], form is None and name in step.exact
        for other in before:
            wrong = known[other] if _leaf(other) != _leaf(name) else _cut_to(known[other], right.shape)
            if other != name and _fits(right, wrong, decides=decides):
                yield from bug(_cause(name, other), _bound_to, {name: wrong})
        for said, layout in LAYOUTS.items():
            if _is_planes(case, name, right) and name not in step.exact:
                yield from bug(f"{kind_of(name)} {said}", _laid_out, name, layout)
    fields = {home: [one for one in step.reads if _home(one) == home] for home in map(_home, step.reads) if home}
    for home, names in fields.items():
        if len(names) < 2:
            continue
        for other in dict.fromkeys(_home(one) for one in before):
            all_ = {name: known[f"{other}.{_leaf(name)}"] for name in names if f"{other}.{_leaf(name)}" in known}
            if other != home and len(all_) == len(names) and all(
                    _fits(known[name], one, decides=form is None and name in step.exact) for name, one in all_.items()):
                yield from bug(f"{kind_of(home)} is bound to {kind_of(other)}, all of it", _bound_to, all_)
        for name, other in combinations(names, 2):
            if _fits(known[name], known[other], decides=form is None):
                yield from bug(f"{kind_of(name)} and {_leaf(other)} are exchanged", _bound_to,
                               {name: known[other], other: known[name]})


def _home(name: str) -> str:
    return name.rpartition(".")[0]


def _leaf(name: str) -> str:
    return name.rpartition(".")[2].rstrip("0123456789")


def _cut_to(array: Array, shape: tuple[int, ...]) -> Array:
    """Return the first numbers along each axis of an array that is larger than a shape."""
    larger = array.ndim == len(shape) and all(here >= one for here, one in zip(array.shape, shape, strict=True))
    return array[tuple(slice(one) for one in shape)] if larger else array


def _cause(name: str, other: str) -> str:
    kind, wrong = kind_of(name), kind_of(other)
    return f"{kind} is bound to {wrong if wrong != kind else ANOTHER}"


def _fits(right: Array, wrong: Array, *, decides: bool) -> bool:
    """Return whether a stage runs with another array in the place of one: what chooses stays in its range."""
    if wrong.shape != right.shape or wrong.dtype != right.dtype or not right.size or np.array_equal(wrong, right):
        return False
    if right.dtype.kind == "f" and np.isfinite(right).all() and not np.isfinite(wrong).all():
        return False
    return not (decides or right.dtype.kind == "i") or bool(wrong.min() >= right.min() and wrong.max() <= right.max())


def _is_planes(case: Case, name: str, array: Array) -> bool:
    vectors = axes_of(case.specs[name].axes)[0] in ("xyz", "rgb")
    return vectors and array.dtype.kind == "f" and array.ndim > 1 and len(array) == 3 and bool(np.isfinite(array).all())


def _bound_to(run: Run, wrong: Arrays, arrays: Arrays, real: type) -> Arrays:
    changed = {name: one.astype(real) if one.dtype.kind == "f" else one for name, one in wrong.items()}
    with np.errstate(all="ignore"):
        return run({**arrays, **changed}, real)


def _laid_out(run: Run, name: str, layout: Layout, arrays: Arrays, real: type) -> Arrays:
    with np.errstate(all="ignore"):
        return run({**arrays, name: np.ascontiguousarray(layout(arrays[name]))}, real)


def _read_in_steps(planes: Array, step: int) -> Array:
    """Return planes whose numbers are read as vectors, so many numbers apart; 0 beyond the end."""
    count = planes[0].size
    numbers = np.zeros(step * count, planes.dtype)
    numbers[: planes.size] = planes.reshape(-1)[: numbers.size]
    return numbers.reshape(count, step)[:, :3].T.reshape(planes.shape)


LAYOUTS: dict[str, Layout] = {
    "is read as triples side by side, (h, w, 3), not as planes": partial(_read_in_steps, step=3),
    "is read in steps of 4 numbers: a vec3 of std430 takes 16 bytes": partial(_read_in_steps, step=4)}
