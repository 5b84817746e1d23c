"""How benchmarks measure: interleaved runs, medians, and ratios within one process."""

import os
import statistics
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from refgi.scene import Scene, load_scene
from refgi.stages import Run

STAND_INS = {  # built-in scenes of as many faces, where the papers' are absent
    "cornell_horse": "cornell_sphere:faces=17000", "sponza": "atrium:faces=262000",
    "kitchen": "atrium:faces=100000,seed=3", "dragon_bunny": "atrium:faces=405000",
    "flying_bunnies": "atrium:faces=417000,seed=2", "caustic_ring": "ring"}
DATA = Path(os.environ.get("REFGI_DATA", Path(__file__).parents[2] / "shared" / "data"))


def real_scene(name: str) -> Path | None:
    """Return the file of a scene of REFGI_DATA, the folder of real scenes; none where there is no such file."""
    path = DATA / f"{name}.json"
    return path if path.is_file() else None


def paper_scene(name: str) -> Scene:
    """Return a scene of REFGI_DATA, its stand-in where that has none, or the built-in one of that name."""
    return load_scene(real_scene(name) or STAND_INS.get(name, name))


class Row(NamedTuple):
    """One figure of a benchmark."""

    name: str
    value: float
    unit: str
    aim: str = ""  # what the project aims for, such as "<= 0.15"; empty: reported only
    note: str = ""

    @property
    def meets_aim(self) -> bool | None:
        """Whether the value meets the aim; None without one."""
        if not self.aim:
            return None
        sign, bound = self.aim.split()
        return self.value <= float(bound) if sign == "<=" else self.value >= float(bound)


class Ratio(NamedTuple):
    """Time of A over time of B, pair by pair."""

    median: float
    low: float
    high: float
    seconds_a: float  # median
    seconds_b: float


def seconds(function: Callable[[], object], repeats: int = 5) -> float:
    """Return the median wall time of `function` after one warm-up call, s."""
    function()
    return statistics.median(_time(function) for _ in range(repeats))


def ratio(a: Callable[[], object], b: Callable[[], object], repeats: int = 7) -> Ratio:
    """Time A and B in turn, A B A B ..., after one warm-up call of each."""
    a(), b()
    pairs = [(_time(a), _time(b)) for _ in range(repeats)]
    quotients = sorted(x / y for x, y in pairs)
    return Ratio(statistics.median(quotients), quotients[0], quotients[-1],
                 statistics.median(x for x, _ in pairs), statistics.median(y for _, y in pairs))


def _time(function: Callable[[], object]) -> float:
    started = time.perf_counter()
    function()
    return time.perf_counter() - started


def own_seconds(runs: Sequence[Run]) -> dict[str, float]:
    """Return how long stages took without the stages inside them, by name; a log has each before those inside it."""
    own: dict[str, float] = {}
    open_runs: list[Run] = []
    for run in runs:
        if run.status != "ran":
            continue
        del open_runs[run.depth:]
        own[run.name] = own.get(run.name, 0.0) + run.seconds
        if open_runs:
            own[open_runs[-1].name] -= run.seconds
        open_runs.append(run)
    return own
