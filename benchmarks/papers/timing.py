"""Run times that can be compared with each other: warm, in turn, medians."""

import statistics
import time
from collections.abc import Callable, Mapping
from typing import Any

from refgi.stages import Memory


class Redrawing(Memory):
    """Keeps what the papers keep in textures between frames, and draws splats in every frame."""

    def recall(self, name: str, inputs: tuple[Any, ...]) -> tuple[bool, Any]:
        """Return whether a result for these inputs is kept, and the result; of splats none is."""
        return (False, None) if name.startswith("splat.") else super().recall(name, inputs)


def interleaved(work: Mapping[str, Callable[[], object]], repeats: int) -> dict[str, float]:
    """Time several pieces of work in turn, A B C A B C ..., after one run of each that compiles what it needs.

    Parameters
    ----------
    work : mapping of str to callable
        What to time.
    repeats : int
        Rounds, 1 or more.

    Returns
    -------
    dict of str to float
        Median seconds of each.

    Examples
    --------
    >>> sorted(interleaved({"a": list, "b": dict}, 3))
    ['a', 'b']
    """
    for run in work.values():
        run()
    spent: dict[str, list[float]] = {name: [] for name in work}
    for _ in range(repeats):
        for name, run in work.items():
            started = time.perf_counter()
            run()
            spent[name].append(time.perf_counter() - started)
    return {name: statistics.median(times) for name, times in spent.items()}
