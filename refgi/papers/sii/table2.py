"""Table 2: what the importance warp itself costs, by method, level and number of samples."""

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from refgi.papers.records import Bar, Cell, Figure, Ratios, Table
from refgi.papers.timing import interleaved
from refgi.rsm.importance import importance
from refgi.rsm.pyramid import importance_pyramid
from refgi.rsm.warp import Method, warp_samples
from refgi.sampling import halton

if TYPE_CHECKING:
    from refgi.papers.workbench import Workbench

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
    seconds = interleaved(work, 3 * bench.scale.repeats)
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
                      tuple(rows), frozenset({5, 6, 7, 8})),))


def _key(method: str, count: int, level: int) -> str:
    return f"{method} {count} {level}"
