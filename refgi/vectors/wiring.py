"""Likely bugs of wiring: the right stage reads a wrong buffer, or the right one by another layout.

Each input of a stage gives way to each array of its shape and type that is given or written before the stage, and to
its own of another lamp, level or round, written when it may be; to larger ones of its own name, such as those of a
finer level, read by rows of its own size; all fields of an input, such as both corners of a box, give way to another's
at once, and two change places; all inputs of another lamp, level or round give way to that one's. An input of vectors
or colours is read as triples side by side as well, one of pictures pixel by pixel. Names in causes are without numbers,
so that a bug has one name in all cases, but where a stage reads several of a kind.
"""

import functools
import re
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from itertools import chain, combinations, permutations

import numpy as np

from refgi.types import Array
from refgi.vectors.bounds import is_estimate
from refgi.vectors.forms.beside import NO_BUGS
from refgi.vectors.rows import Form
from refgi.vectors.spec import Arrays, Bug, Case, Run, Stage, axes_of, kind_of

Layout = Callable[[Array], Array]
Fits = Callable[[str, Array], bool]  # whether a stage runs with an array in the place of an input
Left = Callable[[str], bool]  # whether a cause is still to be told
ANOTHER = "that of another lamp, level or round"
NUMBER = re.compile(r"\d+(?=(\.[a-z_]\w*)*$)")  # of a lamp, level or round in the name of an array


def wirings(
    case: Case, step: Stage, known: Arrays, wanted: Callable[[str], bool] = lambda _: True
) -> Iterator[Bug]:
    """Yield the wrong wirings of a stage whose causes are `wanted`, each once.

    The bug runs the stage's literal form, or the stage itself.
    """
    if is_estimate(case, step) or NO_BUGS in case.facts.get(step.name, {}):
        return
    form = next((one for one in step.variants if isinstance(one, Form)), None)
    run = step.run if form is None else form.sharing()  # NumPy says where an index is none, a kernel reads beyond
    several = {kind for kind, count in Counter(map(kind_of, step.reads)).items() if count > 1}
    told = set()

    def fits(name: str, wrong: Array) -> bool:
        return _fits(known[name], wrong, decides=form is None and name in step.exact)

    def left(cause: str) -> bool:
        return cause not in told and wanted(cause)

    for cause, wrong in chain(_one_by_one(case, step, known, fits, left, several),
                              _together(case, step, known, fits, left)):
        told.add(cause)
        yield Bug(cause, partial(_bound_to, run, wrong))
    for name in step.reads:
        planes = LAYOUTS if _is_planes(case, name, known[name]) and name not in step.exact else {}
        pictures = {PIXEL_BY_PIXEL: _pixel_by_pixel} if _is_pictures(case, name, known[name]) else {}
        for said, layout in (pictures | planes).items():
            if left(cause := f"{kind_of(name)} {said}"):
                told.add(cause)
                yield Bug(cause, partial(_laid_out, run, name, layout))


def _one_by_one(
    case: Case, step: Stage, known: Arrays, fits: Fits, left: Left, several: set[str]
) -> Iterator[tuple[str, Arrays]]:
    """Yield causes, and the array that takes an input's place: first its kind, also what is made later; then its field.

    Of kinds that the stage reads `several` of, causes say which. Those that are not `left` to tell are passed over.
    """
    at = case.stages.index(step)
    before = [*case.given, *(name for one in case.stages[:at] for name in one.writes)]
    after = [name for one in case.stages[at + 1 :] for name in one.writes]
    for name in step.reads:
        kind = kind_of(name)
        alike = [other for other in (*before, *after) if kind_of(other) == kind and other != name]
        others = sorted((one for one in before if kind_of(one) != kind), key=lambda one: _leaf(one) != _leaf(name))
        for other in (*alike, *others):
            read = [known[other]] if _leaf(other) != _leaf(name) else _read_by(known[other], known[name].shape)
            cause = f"{name} is bound to {other}" if kind in several and other in alike else _cause(name, other)
            for wrong, how in zip(read, ("", ", by its index"), strict=False):
                if left(cause + how) and fits(name, wrong):
                    yield cause + how, {name: wrong}


def _together(case: Case, step: Stage, known: Arrays, fits: Fits, left: Left) -> Iterator[tuple[str, Arrays]]:
    """Yield causes, and the arrays that take the places of several inputs at once."""
    groups: dict[str, dict[str, list[str]]] = {}
    for name in step.reads:
        groups.setdefault(kind_of(_home(name)), {}).setdefault(_leaf(name), []).append(name)
    homes = dict.fromkeys(_home(one) for one in (*case.given, *(
        name for stage in case.stages if stage is not step for name in stage.writes)))
    wrong: list[tuple[str, dict[str, str]]] = []
    for home, fields in groups.items():
        wrong += [(f"{home} is bound to {kind_of(other)}, all of it", {
            name: f"{other}{name[len(_home(name)):]}" for names in fields.values() for name in names})
            for other in homes if len(fields) > 1 and kind_of(other) != home]
        wrong += [(f"{kind_of(one[0])} is bound to {kind_of(two[0])}, all of them", dict(zip(one, two, strict=True)))
                  for one, two in permutations(fields.values(), 2) if 1 < len(one) == len(two)]
        wrong += [(f"{kind_of(one[0])} and {_leaf(two[0])} are exchanged",
                   dict(zip([*one, *two], [*two, *one], strict=True)))
                  for one, two in combinations(fields.values(), 2) if len(one) == len(two)]
        wrong += [(f"{kind_of(names[0])} is that of the first for all", dict.fromkeys(names[1:], names[0]))
                  for names in fields.values() if len(names) > 2]
    wrong += _of_another(step, known)
    for cause, taken in wrong:
        if not left(cause):
            continue
        differing = {name: other for name, other in taken.items()
                     if other in known and not np.array_equal(known[name], known[other])}
        if {*taken.values()} <= known.keys() and differing and all(
                fits(name, known[other]) for name, other in differing.items()):
            yield cause, {name: known[other] for name, other in differing.items()}


def _of_another(step: Stage, known: Arrays) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield all fields of an input, and all inputs, that have another lamp, level or round, of the same one."""
    kinds: dict[str, list[str]] = {}
    for name in filter(NUMBER.search, step.reads):
        kinds.setdefault(kind_of(_home(name)), []).append(name)
    sets = [(f"{kind} is all bound to {ANOTHER}", names) for kind, names in kinds.items() if "." in kind]
    sets += [(f"all inputs are bound to {ANOTHER}", [*chain(*kinds.values())])] if len(kinds) > 1 else []
    for cause, names in sets:
        for number in sorted({found.group() for name in known if (found := NUMBER.search(name))}):
            taken = {name: other for name in names if (other := NUMBER.sub(number, name)) in known and other != name}
            if len(taken) > 1:
                yield cause, taken


@functools.cache
def _home(name: str) -> str:
    """Return what an array is a field of, or a list of fields: multires.depth_ranges of multires.depth_ranges.low.1."""
    return re.sub(r"\.\d+$", "", name).rpartition(".")[0]


@functools.cache
def _leaf(name: str) -> str:
    return kind_of(name.removeprefix(f"{_home(name)}."))


def _read_by(array: Array, shape: tuple[int, ...]) -> list[Array]:
    """Return an array as one of a smaller shape reads it: by row and column, and by the index within its planes."""
    if array.ndim != len(shape) or array.shape == shape or any(
            here < one for here, one in zip(array.shape, shape, strict=True)):
        return [array]
    cut = array[tuple(slice(one) for one in shape)]
    if len(shape) != 3:
        return [cut]
    return [cut, array[: shape[0]].reshape(shape[0], -1)[:, : shape[1] * shape[2]].reshape(shape)]


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


def _is_pictures(case: Case, name: str, array: Array) -> bool:
    axes = axes_of(case.specs[name].axes)
    return axes[1:] == ["row", "column"] and axes[0] not in ("xyz", "rgb") and len(array) > 1 and (
        array.dtype.kind == "b" or (array.dtype.kind == "f" and bool(np.isfinite(array).all())))


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
    return numbers.reshape(count, step)[:, : len(planes)].T.reshape(planes.shape)


def _pixel_by_pixel(pictures: Array) -> Array:
    return _read_in_steps(pictures, len(pictures))


PIXEL_BY_PIXEL = "is read pixel by pixel, (h, w, n), not picture by picture, (n, h, w)"
LAYOUTS: dict[str, Layout] = {
    "is read as triples side by side, (h, w, 3), not as planes": partial(_read_in_steps, step=3),
    "is read in steps of 4 numbers: a vec3 of std430 takes 16 bytes": partial(_read_in_steps, step=4)}
