"""What a kit is made of: arrays with axes and units, stages that map arrays to arrays, cases.

A `Recipe` is a case in the making. Stages run in float64 on arrays as the kit stores them, so that each expected value
is the stage's own, to the rounding of its storage, for exactly the inputs that a port reads.
"""

import functools
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from refgi.types import Array

Arrays = Mapping[str, Array]
Tier = Literal["T0", "T1", "T3"]
Run = Callable[[Arrays, Any], Arrays]  # inputs by name in the dtype of the second argument -> outputs by name


@dataclass(frozen=True)
class Spec:
    """What one array is, wherever it occurs."""

    axes: str  # outermost first: "rgb, row, column"; "(inner, outer)" is one axis of two elements
    unit: str  # "1" for none
    what: str
    space: str = ""  # "world", "camera", "linear RGB"
    paper: str = ""  # equation or section, and erratum
    tier: Tier = "T1"  # T0: equal; T1: float32 rounding; T3: an estimate, judged by its standard error
    alone: bool = False  # elements have nothing to do with each other: none is judged by the size of others
    index_of: tuple[int, int] | None = None  # (rows, columns) of the map that indices row * columns + column count


@dataclass(frozen=True)
class Bug:
    """A likely bug of a stage: what its outputs are with it."""

    cause: str  # for people: "the receiver's cosine is missing"
    run: Run
    paper: str = ""  # where it is said how it should be


@dataclass(frozen=True)
class Stage:
    """One step: arrays in, arrays out."""

    name: str
    what: str
    reads: tuple[str, ...]
    writes: tuple[str, ...]
    run: Run
    paper: str = ""
    bugs: tuple[Bug, ...] = ()
    variants: tuple[Run, ...] = ()  # other ways to compute it in float32, as ports do: the bound holds them too
    exact: tuple[str, ...] = ()  # inputs whose differences are exact in float32, or that decide: they are not changed


@dataclass(frozen=True)
class Case:
    """A method on a scene, stage by stage."""

    id: str  # stable: method-name
    method: str
    what: str
    given: Arrays  # inputs of the first stages: scene, camera, lights, random numbers
    specs: Mapping[str, Spec]  # of every array
    stages: tuple[Stage, ...]
    facts: Mapping[str, Any] = field(default_factory=dict)  # settings, sizes, counts: JSON values
    factors: Mapping[str, float] = field(default_factory=dict)  # numbers that a port may forget or repeat: "N", "T/N"
    scene: Any = None  # the Scene, where there is one; None: arrays are all there is


def axes_of(axes: str) -> list[str]:
    """Return the names of an array's axes, outermost first; "(inner, outer)" is one."""
    return [one.strip() for one in re.split(r",(?![^(]*\))", axes)]


@functools.cache
def kind_of(stage: str) -> str:
    """Return a stage's name without the numbers of maps, levels and rounds: rsm.map_surface0 and 1 are one kind."""
    return re.sub(r"\.?\d+", "", stage)


def stored(array: Array) -> Array:
    """Return an array as a kit keeps it: float32, int32 or bool, C order, little-endian."""
    array = np.asarray(array)
    kind = {"f": "<f4", "i": "<i4", "u": "<i4", "b": "|b1"}[array.dtype.kind]
    with np.errstate(over="ignore", under="ignore"):
        return np.ascontiguousarray(array, dtype=kind)


def as_read(arrays: Arrays, names: tuple[str, ...], real: Any) -> dict[str, Array]:
    """Return stored arrays by name, floats in the type that a stage is to compute in."""
    return {name: arrays[name].astype(real) if arrays[name].dtype.kind == "f" else arrays[name] for name in names}


def expected_of(case: Case) -> dict[str, Array]:
    """Return every array of a case as a kit keeps it, each stage run in float64 on what is stored before it."""
    known = {name: stored(array) for name, array in case.given.items()}
    for step in case.stages:
        known.update(outputs_of(step, known, np.float64))
    return known


def outputs_of(step: Stage, known: Arrays, real: Any, run: Run | None = None) -> dict[str, Array]:
    """Return what a stage writes, as stored; by another `run` in its place, such as that of a bug."""
    made = (run or step.run)(as_read(known, step.reads, real), real)
    return {name: stored(made[name]) for name in step.writes}


Change = Callable[[Array], Array]


class Recipe:
    """Given arrays and stages of a case, in order; stages read what is given or written before them."""

    def __init__(self, id: str, method: str, what: str) -> None:
        self.id, self.method, self.what = id, method, what
        self.scene: Any = None
        self.given: dict[str, Array] = {}
        self.specs: dict[str, Spec] = {}
        self.stages: list[Stage] = []
        self.facts: dict[str, Any] = {}
        self.factors: dict[str, float] = {}

    def give(self, name: str, array: Any, spec: Spec) -> None:
        """Add an input that no stage writes."""
        self.given[name], self.specs[name] = np.asarray(array), spec

    def add(
        self, name: str, what: str, run: Run, reads: tuple[str, ...], writes: Mapping[str, Spec], *, paper: str = "",
        bugs: tuple[Bug, ...] = (), exact: tuple[str, ...] = (),
        variants: tuple[Run, ...] = (),
    ) -> None:
        """Add a stage that writes the arrays named, which are what their specs say; the rest as in `Stage`."""
        missing = [one for one in reads if one not in self.specs]
        if missing:
            raise ValueError(f"{self.id}: stage {name} reads {', '.join(missing)}, which nothing gives or writes")
        self.stages.append(Stage(name, what, reads, tuple(writes), run, paper, bugs, variants, exact))
        self.specs.update(writes)

    def case(self) -> Case:
        """Return the case."""
        return Case(self.id, self.method, self.what, dict(self.given), dict(self.specs), tuple(self.stages),
                    dict(self.facts), dict(self.factors), self.scene)


def reading(run: Run, **changes: Change) -> Run:
    """Return a stage that reads some inputs changed; a name's dots are written as two underscores."""
    named = {name.replace("__", "."): change for name, change in changes.items()}

    def altered(arrays: Arrays, real: Any) -> Arrays:
        return run({name: named[name](array) if name in named else array for name, array in arrays.items()}, real)

    return altered


def writing(run: Run, **changes: Change) -> Run:
    """Return a stage whose outputs are changed; a name's dots are written as two underscores."""
    named = {name.replace("__", "."): change for name, change in changes.items()}

    def altered(arrays: Arrays, real: Any) -> Arrays:
        made = run(arrays, real)
        return {name: named[name](array) if name in named else array for name, array in made.items()}

    return altered
