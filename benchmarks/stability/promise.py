"""Tasks of a part, and promises of stages: drawn cases, each with a figure; the worst is the row.

A case is drawn from a generator of its own, so that case `i` of a seed is the same in every run.
"""

import math
from collections.abc import Callable, Iterable
from functools import partial
from typing import NamedTuple

import numpy as np

from refgi.stress.promises import Kind, Row

Tell = Callable[[str], None]
SEED = 17


class Task(NamedTuple):
    """Some rows that are made together; a run that was interrupted goes on after the last finished one."""

    name: str  # unique in its part
    run: Callable[[Tell], Iterable[Row]]


class Case(NamedTuple):
    """One case: how far it is from what is promised, and what it is in words."""

    figure: float
    about: str


class Promise(NamedTuple):
    """What is promised of a stage, and a generator of cases."""

    name: str  # of the task
    property: str
    subject: str
    domain: str
    draw: Callable[[np.random.Generator], Case]
    unit: str
    limit: float
    kind: Kind
    source: str
    cases: int
    brief: int  # cases of the short form
    adds: bool = False  # the figure is the sum over all cases, as of counts, and not the worst


def case_of(promise: Promise, seed: int, case: int) -> Case:
    """Return one case."""
    return promise.draw(np.random.default_rng((seed, case)))


def row_of(promise: Promise, part: str, short: bool, seed: int = SEED) -> Row:
    """Return the row: the worst case, where a figure that is no number is the worst there can be."""
    count = promise.brief if short else promise.cases
    found = [case_of(promise, seed, case) for case in range(count)]
    figures = [math.inf if math.isnan(one.figure) else one.figure for one in found]
    worst = int(np.argmax(figures))
    return Row(part=part, property=promise.property, subject=promise.subject, domain=promise.domain,
               figure=sum(figures) if promise.adds else figures[worst], unit=promise.unit, limit=promise.limit,
               kind=promise.kind, source=promise.source, cases=count, seed=seed, detail=found[worst].about,
               reproduce=f"python -m benchmarks.stability.again {part} {promise.name} {seed} {worst}")


def promise_tasks(promises: Iterable[Promise], part: str, short: bool) -> list[Task]:
    """Return a task for each promise."""
    def run(promise: Promise, _: Tell) -> Iterable[Row]:
        return [row_of(promise, part, short)]

    return [Task(one.name, partial(run, one)) for one in promises]


def again(promise: Promise, seed: int, case: int) -> str:
    """Return one case in words."""
    found = case_of(promise, seed, case)
    return (f"{promise.name}, seed {seed}, case {case}\n  {found.about}\n  figure     {found.figure:.6g} {promise.unit}"
            f", limit {promise.limit:g}")
