"""Likely bugs of wiring: the right stage reads a wrong buffer, or the right one by another layout.

Each input of a stage gives way to each array of its shape and type that is given or written before the stage, among
them its own of another lamp, level or round; an input of vectors or colours is read as triples side by side as well.
Names in causes are without numbers, so that a bug has one name in all cases.
"""

from collections.abc import Callable, Iterator
from functools import partial
from itertools import takewhile

import numpy as np

from refgi.types import Array
from refgi.vectors.bounds import is_estimate
from refgi.vectors.rows import Form
from refgi.vectors.spec import Arrays, Bug, Case, Run, Stage, axes_of, kind_of

Layout = Callable[[Array], Array]
ANOTHER = "that of another lamp, level or round"


def wirings(case: Case, step: Stage, known: Arrays) -> Iterator[Bug]:
    """Yield the wrong wirings of a stage, each cause once; the bug runs its literal form, or the stage itself."""
    if is_estimate(case, step):
        return
    run = next((one for one in step.variants if isinstance(one, Form)), step.run)  # NumPy says where an index is none
    earlier = takewhile(lambda one: one is not step, case.stages)
    before = [*case.given, *(name for one in earlier for name in one.writes)]
    told = set()
    for name in step.reads:
        for other in before:
            cause = _cause(name, other)
            if other != name and cause not in told and _fits(known[name], known[other], decides=name in step.exact):
                told.add(cause)
                yield Bug(cause, partial(_bound_to, run, name, known[other]))
        for said, layout in LAYOUTS.items():
            cause = f"{kind_of(name)} {said}"
            if _is_planes(case, name, known[name]) and name not in step.exact and cause not in told:
                told.add(cause)
                yield Bug(cause, partial(_laid_out, run, name, layout))


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


def _bound_to(run: Run, name: str, wrong: Array, arrays: Arrays, real: type) -> Arrays:
    changed = wrong.astype(real) if wrong.dtype.kind == "f" else wrong
    with np.errstate(all="ignore"):
        return run({**arrays, name: changed}, real)


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
