"""Table 2: what the importance warp itself costs, by method, level and number of samples."""

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from benchmarks.papers.records import Bar, Cell, Figure, Ratios, Table
from benchmarks.papers.timing import interleaved
from refgi.rsm.importance import importance
from refgi.rsm.pyramid import importance_pyramid
from refgi.rsm.warp import Method, warp_samples
from refgi.sampling import halton

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench

Array = npt.NDArray[Any]

SCENE = "ring"
LEVELS = (1, 2, 3, 4)
# ms in the paper for levels 1 to 4; "32" and "64" samples are read as 32^2 and 64^2
PAPER: dict[tuple[Method, int], tuple[float, ...]] = {
    ("A", 1024): (0.123, 0.238, 0.541, 1.739), ("A", 4096): (0.148, 0.358, 1.019, 3.484),
    ("B", 1024): (0.111, 0.183, 0.422, 1.274), ("B", 4096): (0.125, 0.258, 0.754, 2.584),
}


def table2(bench: "Workbench") -> Figure:
    """Make Table 2 again.

    Parameters
    ----------
    bench : Workbench
        Repeats and the map.

    Returns
    -------
    Figure
        Milliseconds of the warp with and without its pyramid, and their ratios.
    """
    worth = importance(bench.frame(SCENE).rsms[0], "peak")
    pyramid = importance_pyramid(worth)
    work: dict[str, Any] = {"pyramid": partial(importance_pyramid, worth)}
    for method, count in PAPER:
        points = halton(count)
        for level in LEVELS:
            work[_key(method, count, level)] = partial(warp_samples, points, pyramid, level, method)
    seconds = interleaved(work, 30 * bench.scale.repeats)
    first, first_paper = seconds[_key("A", 1024, 1)], PAPER["A", 1024][0]
    bars = [Bar(f"{method}, {count} samples, {level} level{'s' * (level > 1)}",
                seconds[_key(method, count, level)] / first, paper / first_paper)
            for (method, count), row in PAPER.items() for level, paper in zip(LEVELS, row, strict=True)]
    rows: list[tuple[Cell, ...]] = [
        (f"{method}, {count} samples", *(1e3 * seconds[_key(method, count, level)] for level in LEVELS), *row)
        for (method, count), row in PAPER.items()]
    rows.append(("pyramid, before all of them", *(1e3 * seconds["pyramid"] for _ in LEVELS), *(None for _ in LEVELS)))
    return Figure(
        shows="Milliseconds of the importance warp for 32² and 64² samples: method A dearer than B, both rising.",
        facts=(SCENE, f"a map of {worth.shape[1]} by {worth.shape[0]} texels"),
        ratios=(Ratios("time, relative to method A with 1024 samples and one level", tuple(bars)),),
        tables=(Table("Milliseconds by level", ("", *(f"{n}" for n in LEVELS), *(f"{n}, paper" for n in LEVELS)),
                      tuple(rows), frozenset({5, 6, 7, 8})),),
        notes=_notes(seconds))


def _notes(seconds: dict[str, float]) -> tuple[str, ...]:
    def grown(method: str) -> float:
        return seconds[_key(method, 4096, 4)] / seconds[_key(method, 4096, 1)]

    dearer = [seconds[_key("A", 4096, level)] / seconds[_key("B", 4096, level)] for level in LEVELS]
    samples = seconds[_key("A", 4096, 3)] / seconds[_key("A", 1024, 3)]
    return (
        f"Both methods read the same four sums of a cell here, so A takes {min(dearer):.2f} to {max(dearer):.2f} times "
        "as long as B (paper: 1.11 to 1.36, where A reads more textures).",
        f"Four levels take {grown('A'):.1f} (A) and {grown('B'):.1f} (B) times as long as one, in the paper 23.5 and "
        f"20.7 times: a level is one more step of a loop here, and one of a series of ever longer shaders there. Four "
        f"times the samples take {samples:.1f} times as long, in the paper 1.2 to 2.0: one core works through them, a "
        "graphics processor has room left.",
        f"First comes the pyramid of sums, {1e3 * seconds['pyramid']:.2f} ms, "
        f"{seconds['pyramid'] / seconds[_key('A', 4096, 3)]:.1f} times as long as the warp of 4096 samples over three "
        "levels. The paper's mip maps (Sec. 4) are such a pyramid and not in its times.",
    )


def _key(method: str, count: int, level: int) -> str:
    return f"{method} {count} {level}"
