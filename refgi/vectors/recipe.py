"""A case in the making: given arrays, stages and what their arrays are."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from refgi.types import Array
from refgi.vectors.spec import Arrays, Bug, Case, Run, Spec, Stage, expected_of

Change = Callable[[Array], Array]


class Recipe:
    """Given arrays and stages of a case, in order; stages read what is given or written before them.

    Parameters
    ----------
    id : str
        Stable name, method-name.
    method : str
        Short name of the method.
    what : str
        What the case shows, one line.
    """

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

    def expected(self) -> dict[str, Array]:
        """Return every array so far as the kit would keep it, for stages whose shape depends on those before."""
        return expected_of(self.case())


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
