"""Trials of likely bugs: in how many stages each is tried, and which elements tell it."""

import functools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from refgi.types import Array
from refgi.vectors.bounds import Bound, distance
from refgi.vectors.causes import FEWEST
from refgi.vectors.manifest import BugEntry, BugWriter, Told
from refgi.vectors.spec import Arrays, Bug, Stage, kind_of, stored
from refgi.vectors.wiring import ANOTHER

TOLD_BY, BESIDE = 64, 24  # elements of a likely bug that are kept: those that tell it, and others
WIRING_TOLD_BY, WIRING_BESIDE = 20, 6  # the same of wrong wirings, of which there are many
SMALL = 16  # elements: of fewer, fewer than FEWEST differing ones do not tell a wrong wiring
TOLD_IN = 3  # stages of a method that tell a likely bug: it is tried in no further ones
TOLD_AGAIN = 2  # the same of stages that all methods begin with
COMMON = ("rsm.", "rays.", "lights.")  # such stages
WIRING_TRIED = 2  # cases of a method in which a wrong wiring is tried; in no further ones once it is told


class Trials:
    """Which likely bugs the cases of a method tell: a few stages are enough, of wrong wirings one."""

    def __init__(self) -> None:
        self.stages: dict[tuple[str, str], int] = {}  # by kind and cause
        self._wirings: dict[tuple[str, str], int] = {}

    def wiring(self, stage: str, cause: str) -> bool:
        """Return whether a wrong wiring is to be tried in a further case."""
        return self._wirings.get(_wiring_key(stage, cause), 0) < WIRING_TRIED

    def tried(self, stage: str, cause: str, told: bool) -> None:
        """Count a case in which a wrong wiring is tried; no further one where it is told."""
        key = _wiring_key(stage, cause)
        self._wirings[key] = WIRING_TRIED if told else self._wirings.get(key, 0) + 1

    def enough(self, stage: str, cause: str) -> bool:
        """Return whether enough stages tell a bug."""
        return self.stages.get((kind_of(stage), cause), 0) >= (TOLD_AGAIN if stage.startswith(COMMON) else TOLD_IN)

    def add(self, stage: str, cause: str, told: bool) -> None:
        """Count a stage that tells a bug, or cannot."""
        key = kind_of(stage), cause
        self.stages[key] = self.stages.get(key, 0) + told


def _wiring_key(stage: str, cause: str) -> tuple[str, str]:
    """Return what a wrong wiring is counted by: each lamp, level and round by itself where it is one of them."""
    return stage if cause.endswith(ANOTHER) else kind_of(stage), cause


@dataclass(frozen=True)
class Right:
    """A stage without a bug: what it reads in float64, all arrays of its case, its bounds."""

    step: Stage
    read: Arrays
    known: Arrays
    bounds: Mapping[str, Bound]


def keep_bug(bugs: BugWriter, right: Right, bug: Bug, *, wired: bool = False) -> bool:
    """Run a stage with a likely bug and keep elements that tell it; return whether none does.

    `wired`: a wrong wiring, of which fewer elements are kept, and none where none tells it, or a few numbers alone,
    which nearly any array can lead to.
    """
    step, known, bounds = right.step, right.known, right.bounds
    try:
        made = bug.run(dict(right.read), np.float64)
        made = {name: stored(made[name]) for name in step.writes}
    except Exception:  # whatever a wrong buffer leads to: it is seen at once
        if wired:
            return True
        raise
    told, blind, elements, differing = {}, True, 0, 0
    counts = (WIRING_TOLD_BY, WIRING_BESIDE) if wired else (TOLD_BY, BESIDE)
    for name in step.writes:
        array, expected = made[name], known[name]
        if array.shape != expected.shape:
            blind = False
            continue
        elements += array.size
        if np.array_equal(array, expected):
            continue
        off = (distance(array, expected) > bounds[name].limit) & ~bounds[name].masked
        differing += (count := int(np.count_nonzero(off)))
        if count:
            blind = False
            places = np.concatenate([_spread(np.flatnonzero(one), most) for one, most in zip((off, ~off), counts,
                                                                                             strict=True)])
            told[name] = Told(places, array.reshape(-1)[places], count)
    blind = blind or (wired and differing < FEWEST and 0 < elements < SMALL)
    if not (blind and wired):
        entry = BugEntry(cause=bug.cause, paper=bug.paper, arrays={}, blind=blind, wired=wired,
                         shapes={name: made[name].shape for name in step.writes})
        bugs.add(step.name, entry, told, known, {name: bound.limit for name, bound in bounds.items()})
    return blind


def _spread(indices: Array, count: int) -> Array:
    """Return at most so many of some indices, evenly spread."""
    if len(indices) <= count:
        return indices
    return np.asarray(indices[_evenly(len(indices), count)])


@functools.cache
def _evenly(size: int, count: int) -> Array:
    return np.linspace(0, size - 1, count).astype(np.int64)
