"""Stage data of any scene and settings: what `observe(record=True)` keeps, as a case of a kit.

Each run of a stage becomes a step of the case. Its inputs are the arrays among its parameters, by parameter and field
(`lights.position`); those that an earlier stage made have that stage's name for them (`lights.choose.position`), the
others are given. Its outputs are `stage.field`, or the stage's name alone. A step runs the stage's own function on the
arrays that it is handed, everything that is no array (lamps, settings, numbers) being as it was.
"""

import dataclasses
import hashlib
import inspect
import time
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from refgi import stages
from refgi.diagnostics import diagnosing
from refgi.frame import Frame
from refgi.methods import find_method, render
from refgi.scene import Scene
from refgi.settings import flat
from refgi.types import Array
from refgi.vectors.docstrings import field_description, input_spec, returned, spec_of, summary, taken
from refgi.vectors.forms import described
from refgi.vectors.forms.beside import MOST_WORK, NO_BUGS, Described, ways
from refgi.vectors.leaves import leaves, named_outputs, rebuilt, run_of
from refgi.vectors.spec import Bug, Case, Recipe, Run, Spec

LEFT_OUT = frozenset({"scene.load", "rays.build", "rsm.resolve", "rsm.rasterize", "rsm.solid_angles", "rays.openness",
                      "rsm.lamp_irradiance", "lights.shares", "lights.map_flux", "cluster.blockers",
                      "cluster.distances"})  # parts of others, or no arrays that a port has
GIVEN = {"geometry": "scene", "materials": "materials"}  # parameters whose arrays are the scene's
VIEW = ("origin", "frame", "half")  # fields of a view
TOLD_APART = 4  # distinct values that tell an array from a chance one of equal content


def recorded_case(
    id: str, scene: Scene, method: str, settings: Any = None, *, only: str = "", what: str = "", indirect: bool = False,
    call: Callable[[], Array] | None = None, **options: Any,
) -> Case:
    """Return a method on a scene as a case `id`, stage by stage as they ran in float64; `what`: one line for people.

    `only`: start of the names of stages to keep, all where empty; what they read of others is given. `indirect`: end at
    the indirect irradiance, without direct light and receivers' lobes. `call` makes that irradiance in place of the
    method alone. `options` are those of `refgi.methods.render`: width, height, rsm_resolution, shadows.
    """
    recipe = Recipe(id, method, what or f"{method} as it ran")
    recipe.scene = scene

    def irradiance() -> Array:
        if not indirect:
            return render(scene, method, settings, dtype=np.float64, **options).irradiance
        known = find_method(method)
        return known.function(Frame(scene, dtype=np.float64, **options), settings or known.settings())

    with diagnosing(False):
        rows, columns = record(recipe, call or irradiance, only).shape[1:]
    recipe.facts |= {"camera": {"columns": columns, "rows": rows}}
    if settings is not None:
        recipe.facts["settings"] = plain(flat(settings))
    return recipe.case()


def record(recipe: Recipe, call: Callable[[], Any], only: str = "") -> Any:
    """Add each stage that runs in a call to a case, those whose names begin with `only`; return what it returns."""
    with stages.observe(record=True, steps=True) as log:
        value = call()
    ran = [run for run in log.runs if run.status == "ran"]
    outputs, first = _made(ran, only)
    count, number = Counter(ran[k].name for k in set(first.values())), Counter[str]()
    known, whole = _Known(recipe), list[stages.Run]()  # `whole`: those whose steps run
    names: dict[int, dict[str, str]] = {}  # of the arrays that a run makes
    for k, run in enumerate(ran):
        while whole and whole[-1].depth >= run.depth:
            known.same(whole.pop())
        if run.steps is not None:
            whole.append(run)
        elif k in outputs and first[k] == k:
            several = count[run.name] > 1 or stages.STAGES[run.name].each  # type: ignore[attr-defined]
            name = f"{run.name}{number[run.name]}" if several else run.name
            number[run.name] += 1
            names[k] = _add(recipe, known, name, run, outputs[k])
        elif k in outputs:
            for leaf, array in outputs[k].items():
                known.add(names[first[k]][leaf], array)
    return value


def _made(ran: list[stages.Run], only: str) -> tuple[dict[int, dict[str, Array]], dict[int, int]]:
    """Return what runs made that a case keeps, by number, and of each the first that made the same of the same."""
    made, first, seen = dict[int, dict[str, Array]](), dict[int, int](), dict[tuple[Any, ...], int]()
    for k, run in enumerate(ran):
        if run.name.startswith(only) and run.name not in LEFT_OUT and run.steps is None:
            outputs = named_outputs(inspect.unwrap(stages.STAGES[run.name]), run.output)
            if outputs:
                made[k] = outputs
                read = dict(leaves(run.arguments)).values()
                first[k] = seen.setdefault((run.name, *map(_content, read), *map(_content, outputs.values())), k)
    return made, first


class _Known:
    """Arrays that stages have made or were given, by what they hold and where."""

    def __init__(self, recipe: Recipe) -> None:
        self._recipe = recipe
        self._at: dict[tuple[Any, ...], str] = {}
        self._held: dict[tuple[Any, ...], str] = {}
        self._ids: list[tuple[str, Array]] = []
        self._views: dict[str, dict[str, Array]] = {}  # fields of views that are given
        self._kept: list[Array] = []  # so that no address is used anew

    def add(self, name: str, array: Array) -> None:
        """Note an array under a name; the first name stays."""
        self._kept.append(array)
        if array.dtype == np.int32 and array.ndim == 2:
            self._ids.append((name, array))
        self._at.setdefault(_place(array), name)
        if array.dtype.kind == "f" and len(np.unique(array)) >= TOLD_APART:
            self._held.setdefault(_content(array), name)

    def name(self, array: Array) -> str | None:
        """Return the name of an array, or of one that holds the same."""
        return self._at.get(_place(array)) or self._held.get(_content(array))

    def ids(self, covered: Array) -> str | None:
        """Return the name of triangle ids that say where there is a surface: what only asks for that reads them."""
        return next((name for name, ids in self._ids if covered.dtype == np.bool_ and covered.shape == ids.shape
                     and np.array_equal(covered, ids >= 0)), None)

    def view(self, leaf: str, arrays: Mapping[str, Array]) -> str | None:
        """Return the name of a field of a view among arrays, or of where a camera is, if that view is given already."""
        start, _, field = leaf.rpartition(".")
        own = {"origin": arrays[leaf]} if field == "eye" else {
            key: arrays[f"{start}.{key}"] for key in VIEW if f"{start}.{key}" in arrays} if field in VIEW else {}
        return next((f"{name}.{'origin' if field == 'eye' else field}" for name, fields in self._views.items() if own
                     and all(np.array_equal(fields.get(key, ()), array) for key, array in own.items())), None)

    def same(self, whole: stages.Run) -> None:
        """Note what a stage made by the names that its steps have for it."""
        steps = dict(leaves(whole.steps))
        for leaf, array in leaves(whole.output):
            if leaf in steps and (name := self.name(steps[leaf])) is not None:
                self.add(name, array)

    def give(self, name: str, array: Array, spec: Spec) -> str:
        """Add an array that no stage made; return its name."""
        self._recipe.give(name, array, spec)
        start, _, field = name.rpartition(".")
        if field in VIEW:
            self._views.setdefault(start, {})[field] = array
        self.add(name, array)
        return name


def _place(array: Array) -> tuple[Any, ...]:
    return array.__array_interface__["data"][0], array.shape, array.strides, array.dtype.str


def _content(array: Array) -> tuple[Any, ...]:
    return array.shape, array.dtype.str, hashlib.blake2b(array.tobytes(), digest_size=16).digest()


def _add(
    recipe: Recipe, known: _Known, name: str, run: stages.Run, outputs: Mapping[str, Array]
) -> dict[str, str]:
    """Add a run of a stage; return the names of its arrays by their leaves."""
    function = inspect.unwrap(stages.STAGES[run.name])
    arguments = run.arguments or {}
    told, made = taken(function), returned(function)
    reads: dict[str, str] = {}  # leaf of the parameters: array
    handed = dict(item for parameter, value in arguments.items() for item in leaves(value, parameter))
    for leaf, array in handed.items():
        parameter, _, field = leaf.partition(".")
        own = f"{GIVEN[parameter]}.{field}" if parameter in GIVEN else (
            f"{name}.given.{leaf}" if leaf in outputs else f"{name}.{leaf}")
        if not np.array_equal(recipe.given.get(own, array), array):  # materials as they light others
            own = f"{name}.{leaf}"
        reads[leaf] = known.name(array) or known.ids(array) or known.view(leaf, handed) or known.give(
            own, array, input_spec(own, arguments[parameter], handed) or spec_of(
                field_description(arguments[parameter], field) or told.get(parameter), array, own))
    writes = {leaf: f"{name}.{leaf}" if leaf else name for leaf in outputs}
    for leaf, array in outputs.items():
        known.add(writes[leaf], array)
    beside = described(run.name, arguments)
    specs = {writes[leaf]: dataclasses.replace(spec_of(made.get(leaf) or made.get(leaf.partition(".")[0]) or
        field_description(run.value, leaf) or made.get(""), array, leaf or name), **beside.specs.get(leaf, {}))
        for leaf, array in outputs.items()}
    stage = run_of(function, arguments, reads, writes)
    what, paper = summary(function)
    recipe.add(name, what, stage, tuple(dict.fromkeys(reads.values())), specs,
               paper=beside.paper or paper or f"{function.__module__}.{function.__name__}",
               exact=tuple(reads[leaf] for leaf in beside.exact), **_beside(beside, stage, reads, writes))
    numbers = plain({key: value for key, value in arguments.items() if not isinstance(value, str) or value})
    if beside.work > MOST_WORK:
        numbers[NO_BUGS] = f"left out: their text would handle {beside.work:.0e} triangles times texels"
    if numbers or beside.facts:
        recipe.facts[name] = {**numbers, **beside.facts}
    recipe.factors |= {f"{what} of {name}": float(value) for what, value in beside.factors.items()}
    return writes


def _beside(beside: Described, stage: Run, reads: Mapping[str, str], writes: Mapping[str, str]) -> dict[str, Any]:
    """Return the likely bugs and other ways of a stage by the names that a case has for its arrays."""
    bugs, variants, makes = tuple[Bug, ...](), tuple[Run, ...](), beside.variants
    if beside.form is not None and beside.work <= MOST_WORK:
        form = beside.form.named(reads, writes)
        rows = (bug for module, name, *most in beside.lists for bug in form.bugs(name, of=module)[:most[0] if most else
                                                                                              None])
        bugs = tuple(bug for bug in rows if not any(word in bug.cause for word in beside.without))
        variants, makes = (form,), (*makes, *ways(beside.form))
    return {"bugs": bugs + tuple(bug for make in beside.bugs for bug in make(stage, reads, writes)),
            "variants": variants + tuple(make(stage, reads, writes) for make in makes)}


def plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values that JSON can say."""
    return {key: list(value) if isinstance(value, tuple) else value for key, value in values.items() if all(
        isinstance(one, bool | int | float | str) for one in (value if isinstance(value, tuple) else (value,)))}


class Timed(NamedTuple):
    """A stage that ran by its literal form."""

    stage: str
    literal: float  # s
    kernel: float  # s, of the stage's own function, compiling included


class Literal:
    """What runs stages: `stages.observe(substitute=Literal())`; afterwards `timed` says which, and how slowly."""

    def __init__(self) -> None:
        self.timed: list[Timed] = []

    def __call__(
        self, name: str, function: Callable[..., Any], args: tuple[Any, ...], kwargs: Mapping[str, Any]
    ) -> Any:
        """Return what a stage returns: an object as its own function makes it, with the arrays of its literal form."""
        bound = inspect.signature(function).bind(*args, **kwargs)
        bound.apply_defaults()
        beside = described(name, bound.arguments)
        started = time.perf_counter()
        value = function(*args, **kwargs)
        kernel = time.perf_counter() - started
        if beside.form is None:
            return value
        arrays = {leaf: array for parameter, part in bound.arguments.items() for leaf, array in leaves(part, parameter)}
        started = time.perf_counter()
        made = beside.form(arrays, None)
        self.timed.append(Timed(name, time.perf_counter() - started, kernel))

        def handed(leaf: str, array: Array) -> Array:
            new = made.get(leaf.removeprefix("."), array)
            return np.ascontiguousarray(new, array.dtype)

        return rebuilt(value, "", handed, np.float64)
