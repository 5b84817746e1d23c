"""Table 2: where the time of a frame goes."""

import statistics
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from benchmarks.papers.records import Bar, Cell, Figure, Ratios, Table
from benchmarks.papers.val.subjects import ATRIUM, HORSE, clamped, drawing, published, rounds, scene_of, timed_size
from refgi.stages import Run, observe

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench
    from refgi.cluster.settings import ValSettings
    from refgi.scene import Scene


class Step(NamedTuple):
    """One line of the table."""

    title: str
    stages: tuple[str, ...]  # how their names begin
    paper_ms: float


STEPS = (Step("deferred rendering", ("rsm.gbuffer", "rsm.resolve", "rsm.rasterize", "rsm.direct", "rsm.shadow_map",
                                     "rsm.facing", "frame."), 0.4),
         Step("VPL generation", ("rsm.reflective", "rsm.pixel_lights", "rsm.refraction", "rsm.solid_angles"), 0.1),
         Step("VAL clustering", ("cluster.kmeans", "cluster.area_lights"), 0.5),
         Step("CSSM", ("cluster.shadow_maps", "cluster.occluders", "cluster.blockers", "rsm.paraboloid"), 4.2),
         Step("indirect illumination", ("cluster.irradiance", "cluster.visibility", "splat."), 35.0),
         Step("geometry-aware blur", ("cluster.blur",), 10.7))
REST = "all else"  # between stages: memory, arrays that are laid out anew
WAYS = {"interleaved": published, "all lights": clamped}
LOOKED_AT = ((HORSE, "interleaved"), (HORSE, "all lights"), (ATRIUM, "interleaved"))
SCENES = {HORSE: "Cornell Horse", ATRIUM: "Sponza"}


def table2(bench: "Workbench") -> Figure:
    """Make Table 2 again.

    Parameters
    ----------
    bench : Workbench
        Sizes and repeats.

    Returns
    -------
    Figure
        Time by step, for the paper's scene and a larger one, interleaved and not.
    """
    scenes = {name: scene_of(bench, name) for name in SCENES}
    ways = {(name, way): WAYS[way](bench, scenes[name]) for name, way in LOOKED_AT}
    spent = {key: profile(bench, scenes[key[0]], one) for key, one in ways.items()}
    usual = ways[HORSE, "interleaved"]
    main = spent[HORSE, "interleaved"]
    rows = [_row(step.title, step.paper_ms, spent) for step in STEPS]
    rows += [_row(REST, None, spent), _row("frame", sum(step.paper_ms for step in STEPS), spent)]
    whole, paper = main["frame"], sum(step.paper_ms for step in STEPS)
    columns = ("", *(f"{SCENES[name]}, {way}, {unit}" for name, way in spent for unit in ("ms", "%")), "ms, paper",
               "%, paper")
    last = len(columns)
    return Figure(
        shows="Of a frame of 51 ms 69 % are indirect illumination, 21 % the blur, 8 % the shadow maps; clustering, "
              "lights and buffers take 2 %.",
        facts=(*(f"{title}: {scenes[name].face_count} faces" for name, title in SCENES.items()),
               f"{timed_size(bench)}² pixels", f"{usual.lights} lights",
               f"{usual.area_lights} area lights"),
        ratios=(Ratios("per cent of a frame's time, Cornell Horse, interleaved", tuple(
            Bar(step.title, 100 * main[step.title] / whole, 100 * step.paper_ms / paper) for step in STEPS)),),
        tables=(Table("Time by step", columns, tuple(rows), frozenset({last - 2, last - 1})),),
        notes=_notes(spent))


def profile(bench: "Workbench", scene: "Scene", settings: "ValSettings") -> dict[str, float]:
    """Time the steps of a frame.

    Parameters
    ----------
    bench : Workbench
        Sizes and repeats.
    scene : Scene
        What is drawn.
    settings : ValSettings
        How.

    Returns
    -------
    dict of str to float
        Median seconds of each step, of what lies between them, and of the frame.
    """
    draw = drawing(bench, scene, settings)
    draw()
    found = []
    for _ in range(rounds(bench)):
        with observe() as log:
            started = time.perf_counter()
            draw()
            whole = time.perf_counter() - started
        own = own_seconds(log.runs)
        parts = {step.title: sum(taken for name, taken in own.items() if name.startswith(step.stages))
                 for step in STEPS}
        found.append(parts | {REST: whole - sum(parts.values()), "frame": whole})
    return {key: statistics.median(one[key] for one in found) for key in found[0]}


def own_seconds(runs: Sequence[Run]) -> dict[str, float]:
    """Return how long stages took without the stages inside them.

    Parameters
    ----------
    runs : sequence of Run
        A log, each stage before those inside it.

    Returns
    -------
    dict of str to float
        Seconds by name, summed over calls.
    """
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


def _row(title: str, paper_ms: float | None, spent: dict[tuple[str, str], dict[str, float]]) -> tuple[Cell, ...]:
    paper = sum(step.paper_ms for step in STEPS)
    cells: list[Cell] = [title]
    for one in spent.values():
        cells += [1e3 * one[title], 100 * one[title] / one["frame"]]
    return (*cells, paper_ms, None if paper_ms is None else 100 * paper_ms / paper)


def _notes(spent: dict[tuple[str, str], dict[str, float]]) -> tuple[str, ...]:
    def share(title: str, name: str = HORSE, way: str = "interleaved") -> float:
        return 100 * spent[name, way][title] / spent[name, way]["frame"]

    buffers, cssm, light, blur = (STEPS[k].title for k in (0, 3, 4, 5))
    return (
        f"Indirect illumination takes {share(light):.0f} % of the frame (paper: 69 %), the blur {share(blur):.0f} % "
        f"(21 %), the shadow maps {share(cssm):.0f} % (8 %), buffers and direct light {share(buffers):.0f} % (1 %): "
        "cores have no units that draw triangles or filter textures, so what those did for next to nothing has its "
        "price here.",
        "The shadow maps hold the search for faces that may occlude anything at all, which bodies at rest would need "
        "once. Series and mip levels of a map are built where they are looked up, inside the indirect illumination, so "
        "that they stay in the cache: the paper counts them with its shadow maps.",
        f"In the scene of 98 thousand faces shadow maps take {share(cssm, ATRIUM):.0f} % and indirect illumination "
        f"{share(light, ATRIUM):.0f} %. Without interleaving and blur the frame of the Cornell Horse takes "
        f"{spent[HORSE, 'all lights']['frame'] / spent[HORSE, 'interleaved']['frame']:.1f} times as long: an area "
        "light's visibility is looked up once for all of its lights at a pixel, so a 64th of the lights is not a 64th "
        "of the work.")
