"""Table 1: frames per second of four scenes."""

from typing import TYPE_CHECKING

from benchmarks.papers import pictures
from benchmarks.papers.records import Bar, Figure, Ratios, Table
from benchmarks.papers.timing import interleaved
from benchmarks.papers.val.subjects import (
    ATRIUM,
    BLOB,
    BOX,
    HORSE,
    PAPER_SIZE,
    drawing,
    frame_of,
    published,
    rounds,
    scene_of,
    timed_size,
)
from refgi.cluster.val import val

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench

TITLES = {BOX: "Cornell Box", HORSE: "Cornell Horse", ATRIUM: "Sponza", BLOB: "Metaballs"}
PAPER = {BOX: ("18", 20.4), HORSE: ("17 k", 19.7), ATRIUM: ("98 k", 13.4), BLOB: ("5 k", 20.7)}  # faces, fps


def table1(bench: "Workbench") -> Figure:
    """Make Table 1 again.

    Parameters
    ----------
    bench : Workbench
        Sizes and repeats.

    Returns
    -------
    Figure
        Frames per second by scene, interleaved as in the paper and with all lights at every pixel.
    """
    scenes = {name: scene_of(bench, name) for name in TITLES}
    block = {name: published(bench, scene) for name, scene in scenes.items()}
    work = {name: drawing(bench, scene, block[name]) for name, scene in scenes.items()}
    seconds = interleaved(work, rounds(bench))
    rate = {name: 1 / taken for name, taken in seconds.items()}
    rows = tuple((title, PAPER[name][0], scenes[name].face_count, 1e3 * seconds[name], rate[name],
                  PAPER[name][1]) for name, title in TITLES.items())
    shown = []
    for name, title in TITLES.items():
        frame = frame_of(bench, name)
        shown.append(pictures.seen(name.replace(" ", "_"), title, f"{frame.scene.face_count} faces", frame,
                                   val(frame, block[name]), block[name]))
    return Figure(
        shows="Frames per second of four scenes at 800 x 800 pixels with 1024 lights and 30 area lights.",
        facts=(f"{timed_size(bench)}² pixels", f"{block[BOX].lights} lights",
               f"{block[BOX].area_lights} area lights", "whole frames, nothing kept from one to the next",
               f"medians of {rounds(bench)}"),
        pictures=tuple(shown), columns=4,
        ratios=(Ratios("frames per second, relative to the Cornell box", tuple(
            Bar(title, rate[name] / rate[BOX], PAPER[name][1] / PAPER[BOX][1]) for name, title in TITLES.items())),),
        tables=(Table("Frames per second", ("", "faces, paper", "faces", "ms", "fps", "fps, paper"), rows,
                      frozenset({1, 5})),),
        notes=_notes(rate, timed_size(bench)))


def _notes(rate: dict[str, float], size: int) -> tuple[str, ...]:
    here, paper = rate[ATRIUM] / rate[BOX], PAPER[ATRIUM][1] / PAPER[BOX][1]
    return (
        f"The scene of 98 thousand faces comes to {here:.2f} of the plain box's rate, in the paper to {paper:.2f}: "
        "there and here all faces are drawn into 30 maps, here by two cores instead of a graphics processor, but only "
        "those that may occlude anything.",
        f"The four rates are {', '.join(f'{rate[name]:.1f}' for name in TITLES)} at {size}² pixels, the paper's "
        f"{', '.join(f'{fps:g}' for _, fps in PAPER.values())} at {PAPER_SIZE}² on a graphics processor of 2006.")
