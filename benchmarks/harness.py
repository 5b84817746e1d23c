"""How benchmarks measure: interleaved runs, medians, ratios within one process, and how far pictures are off."""

import dataclasses
import os
import statistics
import time
from collections.abc import Callable, Hashable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from refgi.scene import Scene, load_scene
from refgi.stages import Run
from refgi.types import Array

K = TypeVar("K", bound=Hashable)

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


def seconds_of(run: Callable[[], object], clock: Callable[[], float] = time.perf_counter) -> float:
    """Return the time of one call, s."""
    started = clock()
    run()
    return clock() - started


def in_turn(work: Mapping[K, Callable[[], object]], repeats: int,
            clock: Callable[[], float] = time.perf_counter) -> dict[K, list[float]]:
    """Time pieces of work in turn, A B C A B C ..., after one run of each that compiles."""
    for run in work.values():
        run()
    spent: dict[K, list[float]] = {name: [] for name in work}
    for _ in range(repeats):
        for name, run in work.items():
            spent[name].append(seconds_of(run, clock))
    return spent


def interleaved(work: Mapping[K, Callable[[], object]], repeats: int) -> dict[K, float]:
    """Return the median seconds of pieces of work in turn."""
    return {name: statistics.median(times) for name, times in in_turn(work, repeats).items()}


def ratio(a: Callable[[], object], b: Callable[[], object], repeats: int = 7) -> Ratio:
    """Return the time of A over that of B, pair by pair."""
    times = in_turn({"a": a, "b": b}, repeats)
    quotients = [x / y for x, y in zip(times["a"], times["b"], strict=True)]
    return Ratio(statistics.median(quotients), min(quotients), max(quotients), *map(statistics.median, times.values()))


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


def relative_rmse(found: Array, full: Array) -> float:
    """Return the RMSE over the mean of what is in full, both over all pixels and channels."""
    return float(np.sqrt(np.mean((found.astype(np.float64) - full) ** 2)) / full.mean(dtype=np.float64))


def moved(scene: Scene, step: float, *, light: bool = True, camera: bool = True) -> Scene:
    """Return a scene whose first light and camera lie `step` farther along x, m."""
    if light:
        lamp: Any = scene.lights[0]
        a, b, c = lamp.position
        scene = scene.with_lights(dataclasses.replace(lamp, position=(a + step, b, c)), *scene.lights[1:])
    if camera:
        x, y, z = scene.camera.eye
        scene = scene.with_camera(eye=(x + step, y, z))
    return scene
