"""Table 1: what a frame of the caustic ring costs when light and camera move or rest."""

import dataclasses
import statistics
import time
from typing import TYPE_CHECKING, Any, NamedTuple

from benchmarks.papers.records import Bar, Figure, Ratios, Table
from benchmarks.papers.sii.subjects import CAUSTIC
from benchmarks.papers.timing import Redrawing
from refgi.frame import Frame
from refgi.splat import sii
from refgi.stages import Memory, observe

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench
    from refgi.scene import Scene

SCENE = "ring"
STEP = 1e-4  # m, from frame to frame


class Row(NamedTuple):
    """One line of the table."""

    title: str
    light_moves: bool
    camera_moves: bool
    paper: float  # ms


ROWS = (Row("dynamic light and camera", True, True, 10.4), Row("dynamic light, static camera", True, False, 10.8),
        Row("static light, dynamic camera", False, True, 9.3), Row("static scene, just render", False, False, 6.9))


def table1(bench: "Workbench") -> Figure:
    """Make Table 1 again.

    Parameters
    ----------
    bench : Workbench
        Sizes and repeats.

    Returns
    -------
    Figure
        Milliseconds and their ratios, with splats drawn in every frame as in the paper and with all reused.
    """
    scene = bench.scene(SCENE)
    drawn = {row.title: _Animation(scene, row, Redrawing(), bench) for row in ROWS}
    kept = {row.title: _Animation(scene, row, Memory(), bench) for row in ROWS}
    for _ in range(1 + bench.scale.repeats):
        for animation in (*drawn.values(), *kept.values()):
            animation.next_frame()
    seconds = {title: animation.seconds for title, animation in drawn.items()}
    both = seconds[ROWS[0].title]
    rows = tuple((row.title, 1e3 * seconds[row.title], row.paper, 1e3 * kept[row.title].seconds,
                  ", ".join(drawn[row.title].reused) or "nothing") for row in ROWS)
    return Figure(
        shows="Milliseconds a frame of the caustic ring with 4096 importance-sampled lights (three levels, method B).",
        facts=(SCENE, "4096 lights"),
        ratios=(Ratios("time, relative to dynamic light and camera",
                tuple(Bar(row.title, seconds[row.title] / both, row.paper / ROWS[0].paper) for row in ROWS)),),
        tables=(Table("Time of a frame", ("", "ms", "ms, paper", "ms, splats kept too", "reused"), rows,
                      frozenset({2})),),
        notes=_notes(seconds, kept[ROWS[3].title].seconds))


def _notes(seconds: dict[str, float], still: float) -> tuple[str, ...]:
    both, light, camera, static = (1e3 * seconds[row.title] for row in ROWS)
    return (
        f"A resting camera saves {both - light:.0f} of {both:.0f} ms here and costs 0.4 of 10.4 ms in the paper, whose "
        "splats are discarded by a depth buffer that only a moving camera redraws. These bounds know no depth buffer, "
        "so only the buffers that are kept count.",
        f"A resting light saves {both - camera:.0f} ms (paper: 1.1 of 10.4): shadow map and warp. Drawing the splats "
        f"takes {static / both:.0%} of a frame, in the paper {ROWS[3].paper / ROWS[0].paper:.0%}. Where nothing moves "
        f"refgi keeps the splats too: {1e3 * still:.1f} ms.",
    )


class _Animation:
    """Frames one after another, in which light, camera, both or nothing move."""

    def __init__(self, scene: "Scene", row: Row, memory: Memory, bench: "Workbench") -> None:
        self.scene, self.row, self.memory, self.resolution = scene, row, memory, bench.scale.rsm_resolution
        self.spent: list[float] = []
        self.reused: list[str] = []

    @property
    def seconds(self) -> float:
        """Median of a frame after the first, which has nothing to reuse."""
        return statistics.median(self.spent[1:])

    def next_frame(self) -> None:
        scene, offset = self.scene, STEP * len(self.spent)
        if self.row.light_moves:
            light: Any = scene.lights[0]
            x, y, z = light.position
            scene = scene.with_lights(dataclasses.replace(light, position=(x + offset, y, z)))
        if self.row.camera_moves:
            x, y, z = scene.camera.eye
            scene = scene.with_camera(eye=(x + offset, y, z))
        with observe(memory=self.memory) as log:
            started = time.perf_counter()
            frame = Frame(scene, rsm_resolution=self.resolution)
            frame.radiance(sii(frame, CAUSTIC))
            self.spent.append(time.perf_counter() - started)
        self.reused = sorted({run.name for run in log.runs if run.status == "reused"})
