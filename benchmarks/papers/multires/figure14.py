"""Figure 14 and Section 5.1: frame rate over the number of lights, and how lights flicker when they move."""

import dataclasses
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from benchmarks.papers.curves import Axes, Curve, drawn
from benchmarks.papers.multires.subjects import (
    DRAGON,
    LARGE,
    every_texel,
    frame_of,
    levels_of,
    scene_of,
    settings_of,
    subsplats_of,
    without_indirect,
)
from benchmarks.papers.records import Cell, Figure, Plot, Table
from benchmarks.papers.timing import interleaved
from refgi.frame import Frame
from refgi.splat.multires import MultiresSettings, multires

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench

Array = npt.NDArray[Any]

SIDES = (4, 8, 16, 32, 64)  # lights along a side of the map
RESOLUTIONS = (16, 64, 256, 512, 1024)
STEP, MOVES = 0.01, 5  # m that the light moves between two frames; how often


def figure14(bench: "Workbench") -> Figure:
    """Make Figure 14 again.

    Parameters
    ----------
    bench : Workbench
        Sizes and frames.

    Returns
    -------
    Figure
        Frame rate by lights and resolution, pairs, and flicker by lights.
    """
    frame, scene, base = frame_of(bench, DRAGON, LARGE), scene_of(bench, DRAGON), settings_of(bench, DRAGON)
    settings = {(side, n): dataclasses.replace(base, lights=n * n, finest=level)
                for side, level in levels_of(frame, RESOLUTIONS).items() for n in SIDES}
    work = {str(key): partial(multires, frame, s) for key, s in settings.items()}
    seconds = interleaved(work | {"rest": without_indirect(bench, scene)}, bench.scale.repeats)
    grown = sorted({side for side, _ in settings})
    subsplats = {side: len(subsplats_of(frame, settings[side, SIDES[0]]).pixel) for side in grown}
    lights = [n * n for n in SIDES]
    curves = [Curve(f"{side}²", lights, [1 / (seconds["rest"] + seconds[str((side, n))]) for n in SIDES])
              for side in grown]
    rows: list[tuple[Cell, ...]] = [(f"{side}²", subsplats[side], *(1e3 * seconds[str((side, n))] for n in SIDES))
                                    for side in grown]
    noise = flicker(bench, base)
    return Figure(
        shows="Frame rates of the dragon scene fall as lights are added, the faster the finer indirect light is "
              "resolved; in simple scenes 16² to 32² lights gave smooth results under animation.",
        facts=(DRAGON, f"{2 * bench.scale.size}² pixels",
               f"all but the indirect part takes {1e3 * seconds['rest']:.0f} ms"),
        tables=(Table("Milliseconds of the indirect part, by indirect resolution and number of lights",
                      ("", "subsplats", *(f"{n}²" for n in SIDES)), tuple(rows)),
                Table("Flicker when the light moves by 1 cm a frame: change from frame to frame that the sum over "
                      "every texel does not show, mean magnitude in % of the mean",
                      ("", *(f"{n}²" for n in SIDES)), (("lights", *noise),))),
        plots=(Plot(drawn(curves, Axes("lights", "frames per second", log_x=True)),
                    "Frames per second, by indirect resolution."),
               Plot(drawn([Curve("flicker", lights, noise)], Axes("lights", "flicker, %", log_x=True, log_y=True)),
                    "Flicker over the number of lights.")),
        notes=_notes(seconds, subsplats, noise))


def flicker(bench: "Workbench", base: MultiresSettings) -> list[float]:
    """Return how much more a picture changes from frame to frame than light does, for each number of lights.

    Parameters
    ----------
    bench : Workbench
        Sizes; the pictures are of half the run's.
    base : MultiresSettings
        All but the number of lights.

    Returns
    -------
    list of float
        Per cent of the mean irradiance: the change of the picture less that of the sum over every texel, mean
        magnitude over pixels and frames.
    """
    size, scene = bench.scale.size // 2, scene_of(bench, DRAGON)
    light: Any = scene.lights[0]
    x, y, z = light.position
    frames = [Frame(scene.with_lights(dataclasses.replace(light, position=(x + STEP * k, y, z))), width=size,
                    height=size, rsm_resolution=bench.scale.rsm_resolution) for k in range(MOVES + 1)]
    smooth = [every_texel(frame, base) for frame in frames]
    mean = float(np.mean([s[:, f.gbuffer.covered].mean() for s, f in zip(smooth, frames, strict=True)]))
    found = []
    for n in SIDES:
        settings = dataclasses.replace(base, lights=n * n)
        excess = [multires(frame, settings) - right for frame, right in zip(frames, smooth, strict=True)]
        jumps = np.diff(np.stack(excess), axis=0)[..., frames[0].gbuffer.covered]
        found.append(100 * float(np.abs(jumps).mean(dtype=np.float64)) / mean)
    return found


def _notes(seconds: dict[str, float], subsplats: dict[int, int], noise: list[float]) -> tuple[str, ...]:
    sides = sorted(subsplats)
    pairs = [float(subsplats[side] * n * n) for side in sides for n in SIDES]
    taken = [1e3 * seconds[str((side, n))] for side in sides for n in SIDES]
    slope, fixed = np.polyfit(pairs, taken, 1)
    fit = float(np.corrcoef(pairs, taken)[0, 1])
    at = dict(zip(SIDES, noise, strict=True))
    seen = np.log([(n * n, value) for n, value in at.items() if value > 0])
    order = float(np.polyfit(seen[:, 0], seen[:, 1], 1)[0]) if len(seen) > 1 else 0.0
    return (
        f"The time of the indirect part follows the number of pairs of subsplat and light: {fixed:.1f} ms and "
        f"{1e6 * slope:.2f} ms for each million pairs, with a correlation of {fit:.3f} over all {len(pairs)} runs. "
        "Curves are flat while the rest of a frame leads, and fall as one over the number of lights where pairs do.",
        f"Flicker falls with the number of lights N as N to the {order:.2f}: {at[16]:.1f} % of the mean at 16² lights, "
        f"{at[32]:.1f} % at 32², {at[64]:.1f} % at 64². The paper's judgement that 16² to 32² show little of it was "
        "by eye, with clamped lights as here.",
    )
