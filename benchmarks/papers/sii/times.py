"""What takes the time of a frame: what moves and what rests, and the importance warp."""

import statistics
import time
from functools import partial
from typing import Any

from benchmarks.harness import interleaved, moved
from benchmarks.papers.records import Cell, Figure, Table, relative
from benchmarks.papers.sii.subjects import CAUSTIC
from benchmarks.papers.workbench import Redrawing, Workbench, seen_by
from refgi.lights import importance, importance_pyramid
from refgi.lights.warp import Method, warp_samples
from refgi.sampling import halton
from refgi.splat import sii
from refgi.stages import Memory, observe

STEP = 1e-4  # m, from frame to frame
MOVES = {"dynamic light and camera": (True, True), "dynamic light, static camera": (True, False),
         "static light, dynamic camera": (False, True), "static scene, just render": (False, False)}
LEVELS = (1, 2, 3, 4)


def moving_and_resting(bench: Workbench, scene: str, printed: dict[str, float]) -> Figure:
    """Table 1: what a frame of the caustic ring costs when light and camera move or rest (ms by `MOVES`)."""
    drawn = {title: _Animation(bench, scene, moves, Redrawing()) for title, moves in MOVES.items()}
    kept = {title: _Animation(bench, scene, moves, Memory()) for title, moves in MOVES.items()}
    for _ in range(1 + bench.scale.repeats):
        for animation in (*drawn.values(), *kept.values()):
            animation.next_frame()
    taken = {title: 1e3 * animation.seconds for title, animation in drawn.items()}
    both, light, camera, static = taken.values()
    still = 1e3 * kept["static scene, just render"].seconds
    share = printed["static scene, just render"] / printed["dynamic light and camera"]
    return Figure(
        facts=(scene, "4096 lights"),
        ratios=[relative("time, relative to dynamic light and camera", taken, printed)],
        tables=[Table("Time of a frame", ("", "ms", "ms, paper", "ms, splats kept too", "reused"),
                      [(title, ms, printed[title], 1e3 * kept[title].seconds, ", ".join(drawn[title].reused) or
                        "nothing") for title, ms in taken.items()])],
        notes=(
            f"A resting camera saves {both - light:.0f} of {both:.0f} ms here and costs 0.4 of 10.4 ms in the paper, "
            "whose splats are discarded by a depth buffer that only a moving camera redraws. Here tiles find the "
            "depth in the positions that light receives at, so only the buffers that are kept count.",
            f"A resting light saves {both - camera:.0f} ms (paper: 1.1 of 10.4): shadow map and warp. Drawing the "
            f"splats takes {static / both:.0%} of a frame, in the paper {share:.0%}. Where nothing moves refgi keeps "
            f"the splats too: {still:.1f} ms."))


class _Animation:
    """Frames one after another, in which light, camera, both or nothing move."""

    def __init__(self, bench: Workbench, scene: str, moves: tuple[bool, bool], memory: Memory) -> None:
        self.bench, self.memory = bench, memory
        self.scene, (self.light_moves, self.camera_moves) = bench.frame(scene).scene, moves
        self.spent: list[float] = []
        self.reused: list[str] = []

    @property
    def seconds(self) -> float:
        """Median of a frame after the first, which has nothing to reuse."""
        return statistics.median(self.spent[1:])

    def next_frame(self) -> None:
        scene = moved(self.scene, STEP * len(self.spent), light=self.light_moves, camera=self.camera_moves)
        with observe(memory=self.memory) as log:
            started = time.perf_counter()
            frame = seen_by(self.bench, scene)
            frame.radiance(sii(frame, CAUSTIC))
            self.spent.append(time.perf_counter() - started)
        self.reused = sorted({run.name for run in log.runs if run.status == "reused"})


def warp_alone(bench: Workbench, scene: str, printed: dict[tuple[Method, int], tuple[float, ...]]) -> Figure:
    """Table 2: what the importance warp itself costs, by method and number of samples (ms of levels 1 to 4)."""
    values = importance(bench.frame(scene).rsms[0], "peak")
    pyramid = importance_pyramid(values)
    work: dict[Any, Any] = {"pyramid": partial(importance_pyramid, values)}
    work |= {(method, count, level): partial(warp_samples, halton(count), pyramid, level, method)
             for method, count in printed for level in LEVELS}
    taken = {key: 1e3 * seconds for key, seconds in interleaved(work, 30 * bench.scale.repeats).items()}
    bars = {key: f"{key[0]}, {key[1]} samples, {key[2]} level{'s' * (key[2] > 1)}" for key in taken if key != "pyramid"}
    rows: list[tuple[Cell, ...]] = [(f"{method}, {count} samples", *(taken[method, count, n] for n in LEVELS), *row)
                                    for (method, count), row in printed.items()]
    rows.append(("pyramid, before all of them", *(taken["pyramid"] for _ in LEVELS), *(None for _ in LEVELS)))
    dearer = [taken["A", 4096, level] / taken["B", 4096, level] for level in LEVELS]
    grown = {method: taken[method, 4096, 4] / taken[method, 4096, 1] for method in "AB"}
    return Figure(
        facts=(scene, f"a map of {values.shape[1]} by {values.shape[0]} texels"),
        ratios=[relative("time, relative to method A with 1024 samples and one level",
                         {label: taken[key] for key, label in bars.items()},
                         {label: printed[key[:2]][key[2] - 1] for key, label in bars.items()})],
        tables=[Table("Milliseconds by level", ("", *(f"{n}" for n in LEVELS), *(f"{n}, paper" for n in LEVELS)),
                      rows)],
        notes=(
            f"Both methods read the same four sums of a cell here, so A takes {min(dearer):.2f} to {max(dearer):.2f} "
            "times as long as B (paper: 1.11 to 1.36, where A reads more textures).",
            f"Four levels take {grown['A']:.1f} (A) and {grown['B']:.1f} (B) times as long as one, in the paper 23.5 "
            "and 20.7 times: a level is one more step of a loop here, and one of a series of ever longer shaders "
            f"there. Four times the samples take {taken['A', 4096, 3] / taken['A', 1024, 3]:.1f} times as long, in the "
            "paper 1.2 to 2.0: one core works through them, a graphics processor has room left.",
            f"First comes the pyramid of sums, {taken['pyramid']:.2f} ms, "
            f"{taken['pyramid'] / taken['A', 4096, 3]:.1f} times as long as the warp of 4096 samples over three "
            "levels. The paper's mip maps (Sec. 4) are such a pyramid and not in its times."))
