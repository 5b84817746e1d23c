"""Table 2: frame rates of four scenes at four indirect resolutions."""

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.papers import pictures
from benchmarks.papers.judging import errors_of
from benchmarks.papers.multires.subjects import (
    BUDDHA,
    BUNNIES,
    DRAGON,
    LARGE,
    TEAPOT,
    drawing,
    frame_of,
    full_sum,
    levels_of,
    scene_of,
    settings_of,
    subsplats_of,
    unclamped,
)
from benchmarks.papers.records import Bar, Cell, Figure, Picture, Ratios, Table
from benchmarks.papers.timing import interleaved
from refgi.splat.multires import MultiresSettings, multires

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench

TITLES = {TEAPOT: "Simple Teapot", BUDDHA: "Spinning Buddha", DRAGON: "Dragon & Bunny", BUNNIES: "Flying Bunnies"}
PAPER = {128: (68, 60, 59, 52), 256: (50, 42, 42, 41), 512: (33, 30, 28, 31), 1024: (22, 24, 21, 25)}  # fps
PAPER_SIZE = 1024
Key = tuple[str, int]  # scene, parts of the picture's side: 8, 4, 2, 1


def table2(bench: "Workbench") -> Figure:
    """Make Table 2 again.

    Parameters
    ----------
    bench : Workbench
        Sizes and frames.

    Returns
    -------
    Figure
        Frame rates, subsplats and errors by scene and resolution.
    """
    settings = _settings(bench)
    seconds = interleaved({str(key): drawing(bench, scene_of(bench, key[0]), s) for key, s in settings.items()},
                          bench.scale.repeats)
    counts = {key: len(subsplats_of(frame_of(bench, key[0], LARGE), s).pixel) for key, s in settings.items()}
    off = {key: _error(bench, key[0], s) for key, s in settings.items()}
    side = LARGE * bench.scale.size
    parts = sorted({part for _, part in settings}, reverse=True)
    rows = tuple(_row(part, side, {name: 1 / seconds[str((name, part))] for name in TITLES}) for part in parts)
    costs = tuple((f"{TITLES[name]}, {scene_of(bench, name).face_count} faces, {side // part}²", counts[name, part],
                   1e3 * seconds[str((name, part))], *off[name, part]) for name in TITLES for part in parts)
    return Figure(
        shows="Frame rates fall with the resolution of indirect light, and hardly depend on the number of triangles: "
              "at 1024² a teapot and 417 thousand triangles run alike.",
        facts=(f"{side}² pixels", "256 lights", "whole frames", "stand-ins of the paper's face counts"),
        pictures=tuple(_picture(bench, name) for name in TITLES), columns=4,
        ratios=(Ratios("frames per second, relative to an eighth of the picture's side", tuple(
            Bar(f"{TITLES[name]}, 1/{part}" if part > 1 else f"{TITLES[name]}, full",
                seconds[str((name, parts[0]))] / seconds[str((name, part))], _printed(name, part, parts[0]))
            for name in TITLES for part in parts)),),
        tables=(Table("Frames per second", ("indirect resolution", *TITLES.values(),
                                            *(f"{title}, paper" for title in TITLES.values())), rows,
                      frozenset({5, 6, 7, 8})),
                Table("What each takes; errors against the same lights at every pixel, in % of the mean irradiance",
                      ("", "subsplats", "ms", "RMSE", "RMSE, no clamp"), costs)),
        notes=_notes(bench, seconds, counts, parts))


def _settings(bench: "Workbench") -> dict[Key, MultiresSettings]:
    found: dict[Key, MultiresSettings] = {}
    for name in TITLES:
        frame, base = frame_of(bench, name, LARGE), settings_of(bench, name)
        side = LARGE * bench.scale.size
        levels = levels_of(frame, tuple(side // part for part in (8, 4, 2, 1)))
        found |= {(name, side // n): dataclasses.replace(base, finest=level) for n, level in levels.items()}
    return found


def _error(bench: "Workbench", name: str, settings: MultiresSettings) -> tuple[float, float]:
    frame = frame_of(bench, name, LARGE)
    off = []
    for one in (settings, unclamped(settings)):
        key = ("full sum", name, one.clamp)
        full = bench.once(key, lambda one=one: full_sum(frame, one))  # type: ignore[misc]
        off.append(errors_of(multires(frame, one), full, frame.gbuffer.covered).rmse)
    return off[0], off[1]


def _picture(bench: "Workbench", name: str) -> Picture:
    frame, settings = frame_of(bench, name), settings_of(bench, name)
    faces = scene_of(bench, name).face_count
    return pictures.seen(name, TITLES[name], f"{faces} faces stand in", frame, multires(frame, settings), settings)


def _row(part: int, side: int, rate: dict[str, float]) -> tuple[Cell, ...]:
    paper = PAPER.get(PAPER_SIZE // part, (None,) * 4)
    return (f"{side // part}²", *rate.values(), *(None if n is None else float(n) for n in paper))


def _printed(name: str, part: int, first: int) -> float | None:
    column = list(TITLES).index(name)
    rows = [PAPER.get(PAPER_SIZE // n) for n in (part, first)]
    return None if rows[0] is None or rows[1] is None else rows[0][column] / rows[1][column]


def _notes(bench: "Workbench", seconds: dict[str, float], counts: dict[Key, int],
           parts: list[int]) -> tuple[str, ...]:
    def spread(part: int) -> float:
        taken = [seconds[str((name, part))] for name in TITLES]
        return max(taken) / min(taken)

    fine, coarse = parts[-1], parts[0]
    rates = [1 / seconds[str((name, fine))] for name in TITLES]
    paper = PAPER[PAPER_SIZE]
    faces = [scene_of(bench, name).face_count for name in TITLES]
    lit = [counts[name, fine] for name in TITLES]
    pairs = [1e3 * seconds[str((name, part))] for name in TITLES for part in parts]
    fit = float(np.corrcoef([counts[name, part] for name in TITLES for part in parts], pairs)[0, 1])
    return (
        f"At the finest resolution frames of {min(faces)} to {max(faces)} triangles differ in time by a factor of "
        f"{spread(fine):.2f}, at the coarsest by {spread(coarse):.2f} (paper: {max(paper) / min(paper):.2f} and "
        f"{max(PAPER[128]) / min(PAPER[128]):.2f}). Triangles cost time to rasterize on this machine's cores, whatever "
        f"is lit; subsplats, {min(lit)} to {max(lit)} of them, cost the rest.",
        f"Frames per second here are {min(rates):.0f} to {max(rates):.0f} at {LARGE * bench.scale.size}², the paper's "
        f"{min(paper)} to {max(paper)} at {PAPER_SIZE}² on a graphics processor of 2008.",
        f"Over all {len(pairs)} entries time and number of subsplats have a correlation of {fit:.2f}: where it is low, "
        "what does not depend on subsplats leads.",
    )
