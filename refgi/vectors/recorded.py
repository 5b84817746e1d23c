"""Stage data of any scene and settings: what `observe(record=True)` keeps, as a case of a kit.

Each run of a stage becomes a step of the case. Its inputs are the arrays among its parameters, by parameter and field
(`lights.position`); those that an earlier stage made have that stage's name for them (`lights.choose.position`), the
others are given. Its outputs are `stage.field`, or the stage's name alone. A step runs the stage's own function on the
arrays that it is handed, everything that is no array (lamps, settings, numbers) being as it was.
"""

import dataclasses
import inspect
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from refgi import stages
from refgi.diagnostics import diagnosing
from refgi.methods import render
from refgi.scene import Scene
from refgi.settings import flat
from refgi.vectors.forms import described
from refgi.vectors.recipe import Recipe
from refgi.vectors.spec import Array, Arrays, Bug, Case, Run, Spec

LEFT_OUT = frozenset({"scene.load", "rays.build", "rsm.resolve", "rsm.rasterize", "lights.shares", "lights.map_flux",
                      "cluster.occluders", "cluster.blockers",
                      "cluster.distances"})  # parts of others, or no arrays that a port has
GIVEN = {"geometry": "scene", "materials": "materials"}  # parameters whose arrays are the scene's
TOLD_APART = 4  # distinct values that tell an array from a chance one of equal content
UNIT = re.compile(r"(?<![\w^/])(W/m\^2/sr|W/m\^2|W/sr|W|m\^2|m|sr|rad)(?![\w^/])")
SHAPE = re.compile(r"^\(([^()]*)\)")
AXES = {"h": "row", "w": "column", "H": "row", "W": "column", "h x w": "row, column"}
COLOUR = ("W", "W/m^2", "W/m^2/sr", "W/sr")


def recorded_case(
    id: str, scene: Scene, method: str, settings: Any = None, *, only: str = "", what: str = "", **options: Any
) -> Case:
    """Return a method on a scene, stage by stage.

    Parameters
    ----------
    id : str
        The case's name.
    scene : Scene
        The scene.
    method : str
        Short name of the method.
    settings : object, optional
        Its settings; its defaults where absent.
    only : str
        Start of the names of stages to keep; all where empty. What they read of others is given.
    what : str
        One line for people.
    **options : object
        As of `refgi.methods.render`: width, height, rsm_resolution, shadows.

    Returns
    -------
    Case
        The stages in their order, as they ran in float64.
    """
    with stages.observe(record=True) as log, diagnosing(False):
        picture = render(scene, method, settings, dtype=np.float64, **options)
    recipe = Recipe(id, method, what or f"{method} as it ran")
    recipe.scene = scene
    rows, columns = picture.irradiance.shape[1:]
    recipe.facts |= {"camera": {"columns": columns, "rows": rows},
                     "settings": {key: value for key, value in flat(settings).items()
                                  if isinstance(value, bool | int | float | str)} if settings is not None else {}}
    runs = [run for run in log.runs if run.status == "ran" and run.name not in LEFT_OUT and run.name.startswith(only)]
    count = Counter(run.name for run in runs)
    number, known = Counter[str](), _Known(recipe)
    for run in runs:
        outputs = dict(leaves(run.output))
        if outputs and not known.has_all(outputs):  # a run that repeats another tells nothing
            name = f"{run.name}{number[run.name]}" if count[run.name] > 1 else run.name
            number[run.name] += 1
            _add(recipe, known, name, run, outputs)
    return recipe.case()


class _Known:
    """Arrays that stages have made or were given, by what they hold and where."""

    def __init__(self, recipe: Recipe) -> None:
        self._recipe = recipe
        self._at: dict[tuple[Any, ...], str] = {}
        self._held: dict[tuple[Any, ...], str] = {}
        self._kept: list[Array] = []  # so that no address is used anew

    def add(self, name: str, array: Array) -> None:
        """Note an array under a name; the first name stays."""
        self._kept.append(array)
        self._at.setdefault(_place(array), name)
        if array.dtype.kind == "f" and len(np.unique(array)) >= TOLD_APART:
            self._held.setdefault(_content(array), name)

    def name(self, array: Array) -> str | None:
        """Return the name of an array, or of one that holds the same."""
        return self._at.get(_place(array)) or self._held.get(_content(array))

    def has_all(self, arrays: Mapping[str, Array]) -> bool:
        """Return whether all of some arrays are known."""
        return all(self.name(array) is not None for array in arrays.values())

    def give(self, name: str, array: Array, about: str) -> str:
        """Add an array that no stage made; return its name."""
        self._recipe.give(name, array, spec_of(about, array, name))
        self.add(name, array)
        return name


def _place(array: Array) -> tuple[Any, ...]:
    return array.__array_interface__["data"][0], array.shape, array.strides, array.dtype.str


def _content(array: Array) -> tuple[Any, ...]:
    return array.shape, array.dtype.str, array.tobytes()


def _add(recipe: Recipe, known: _Known, name: str, run: stages.Run, outputs: Mapping[str, Array]) -> None:
    """Add a run of a stage."""
    function = inspect.unwrap(stages.STAGES[run.name])
    arguments = run.arguments or {}
    told = descriptions(function)
    reads: dict[str, str] = {}  # leaf of the parameters: array
    for leaf, array in (item for parameter, value in arguments.items() for item in leaves(value, parameter)):
        parameter, _, field = leaf.partition(".")
        own = f"{GIVEN[parameter]}.{field}" if parameter in GIVEN else f"{name}.{leaf}"
        reads[leaf] = known.name(array) or known.give(own, array, told.get(parameter, ""))
    writes = {leaf: f"{name}.{leaf}" if leaf else name for leaf in outputs}
    for leaf, array in outputs.items():
        known.add(writes[leaf], array)
    specs = {writes[leaf]: spec_of(field_description(run.value, leaf) or told.get("", ""), array, leaf or name)
             for leaf, array in outputs.items()}
    form, bugs, exact = None, tuple[Bug, ...](), tuple[str, ...]()
    if (beside := described(run.name, arguments)) is not None:
        form = dataclasses.replace(
            beside.form, reads={key: _named(reads, leaf) for key, leaf in beside.form.reads.items()},
            writes=tuple(writes[leaf] for leaf in beside.form.writes),
            kept={writes[leaf]: reads[read] for leaf, read in beside.form.kept.items()})
        bugs = tuple(bug for module, rows in beside.lists for bug in form.bugs(rows, of=module))
        exact = tuple(reads[leaf] for leaf in beside.exact)
    recipe.add(name, _summary(function), _run(function, arguments, reads, writes), tuple(dict.fromkeys(reads.values())),
               specs, paper=f"{function.__module__}.{function.__name__}", bugs=bugs, exact=exact,
               variants=() if form is None else (form,))


def _named(reads: Mapping[str, str], leaf: Any) -> Any:
    """Return the names of arrays for those of leaves."""
    return tuple(_named(reads, one) for one in leaf) if isinstance(leaf, tuple) else reads[leaf]


def _run(
    function: Callable[..., Any], arguments: Mapping[str, Any], reads: Mapping[str, str], writes: Mapping[str, str]
) -> Run:
    def run(arrays: Arrays, real: Any) -> Arrays:
        def handed(leaf: str, array: Array) -> Array:
            new = arrays[reads[leaf]]
            return np.ascontiguousarray(new, real if array.dtype.kind == "f" else array.dtype)

        changed = {key: np.dtype(real) if _is_float_type(value) else rebuilt(value, key, handed, real)
                   for key, value in arguments.items()}
        made = dict(leaves(stages.recorded(function(**changed))))
        return {array: made[leaf] for leaf, array in writes.items()}

    return run


def _is_float_type(value: Any) -> bool:
    return isinstance(value, type | np.dtype) and np.dtype(value) in (np.float32, np.float64)


def leaves(value: Any, name: str = "") -> Iterator[tuple[str, Array]]:
    """Yield the arrays in a value and where they are: names of fields and indices, joined by dots."""
    if isinstance(value, np.ndarray):
        if value.dtype.kind in "fiub":
            yield name, value
    else:
        for field, part in _parts(value):
            yield from leaves(part, f"{name}.{field}" if name else field)


def _parts(value: Any) -> Iterator[tuple[str, Any]]:
    if hasattr(value, "recorded"):
        yield from stages.recorded(value).items()
    elif isinstance(value, Mapping):
        yield from ((str(key), part) for key, part in value.items())
    elif isinstance(value, tuple) and hasattr(value, "_fields"):
        yield from zip(value._fields, value, strict=True)
    elif isinstance(value, list | tuple):
        yield from ((str(index), part) for index, part in enumerate(value))
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        yield from ((field.name, getattr(value, field.name)) for field in dataclasses.fields(value) if field.init)


def rebuilt(value: Any, name: str, handed: Callable[[str, Array], Array], real: Any) -> Any:
    """Return a value with other arrays: what `handed` returns for each one's name and the array that was there."""
    if isinstance(value, np.ndarray):
        return handed(name, value) if value.dtype.kind in "fiub" else value
    parts = {field: rebuilt(part, f"{name}.{field}", handed, real) for field, part in _parts(value)}
    if not any(True for _ in leaves(value)):
        return value
    if hasattr(value, "recorded"):
        return value.with_channels(parts, np.dtype(real))
    if isinstance(value, Mapping):
        return {key: parts[str(key)] for key in value}
    if hasattr(value, "_fields"):
        return value._replace(**parts)
    if isinstance(value, list | tuple):
        return type(value)(parts.values())
    return dataclasses.replace(value, **parts)


# what arrays are, from docstrings and comments


def descriptions(function: Callable[..., Any]) -> dict[str, str]:
    """Return what a stage's docstring says of its parameters, and under "" of what it returns: type, then text."""
    text = inspect.cleandoc(function.__doc__ or "")
    found: dict[str, str] = {}
    for section in ("Parameters", "Returns"):
        part = re.search(rf"^{section}\n-+\n(.*?)(?=^\w+\n-+\n|\Z)", text, re.MULTILINE | re.DOTALL)
        for entry in re.split(r"\n(?=\S)", part[1].rstrip()) if part else []:
            head, _, about = entry.partition("\n")
            names, colon, kind = head.partition(" : ")
            for name in names.split(", ") if colon and section == "Parameters" else [""]:
                found[name] = f"{kind if colon else head} {' '.join(about.split())}"
    return found


def field_description(value: Any, leaf: str) -> str:
    """Return the comment or docstring of a field of a value, of the last one that a dotted name goes through."""
    said = ""
    for field in leaf.split(".") if leaf else []:
        of = type(value)
        prop = getattr(of, field, None)
        if isinstance(prop, property):
            said = inspect.cleandoc(prop.__doc__ or "")
        elif hasattr(of, "__annotations__") and field in of.__annotations__:
            found = re.search(rf"^    {field}: .*?  # (.*)$", inspect.getsource(of), re.MULTILINE)
            said = found[1] if found else said
        value = value[int(field)] if isinstance(value, list | tuple) and field.isdigit() else (
            value.get(field) if isinstance(value, Mapping) else getattr(value, field, None))
    return said


def spec_of(about: str, array: Array, name: str) -> Spec:
    """Return what an array is, as far as a line says: its axes by the shape written there, its unit, the text."""
    shape = SHAPE.search(about) or re.search(r"\((?:\d+|[A-Za-z]\w*'?)(?:, (?:\d+|[A-Za-z]\w*'?))*,?\)", about)
    names = [one.strip() for one in (shape[1] if shape and shape.re is SHAPE else shape[0].strip("()") if shape else
                                     "").split(",") if one.strip()]
    unit = UNIT.search(about) if array.dtype.kind == "f" else None
    axes = [_axis(one, unit[1] if unit else "") for one in names]
    if len(axes) != array.ndim:
        axes = [f"axis {k}" for k in range(array.ndim)]
    twice = {one for one in axes if axes.count(one) > 1}
    axes = [f"{one} {k}" if one in twice else one for k, one in enumerate(axes)]
    return Spec(", ".join(axes) or "value", unit[1] if unit else "1", about.split("ndarray ")[-1] or name)


def _axis(text: str, unit: str) -> str:
    if text == "3":
        return "rgb" if unit in COLOUR else "xyz"
    return AXES.get(text, text)


def _summary(function: Callable[..., Any]) -> str:
    return (inspect.getdoc(function) or function.__name__).splitlines()[0].rstrip(".")
