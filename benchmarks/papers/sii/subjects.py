"""Scenes, references and the reference length that the figures share; what takes the time of a frame; bounds.

The paper's I_low is "x % of I_0", an irradiance of an intensity: its unit of length is missing, and with it how far
splats reach. The reference length of a scene is chosen so that splats of 5 % have the overdraw of Figure 8, 125 of 768
lights a pixel, from a picture of one size so that all figures of a scene share it.

The paper names no clamp and its pictures show no dots beside walls: the default clamp bounds near pairs, but for the
narrow lobes of Figure 4 and the walk of Figure 6, whose lights stand for no area.
"""

import statistics
import time
from functools import partial
from typing import Any

import numpy as np

from benchmarks.harness import interleaved, moved
from benchmarks.papers.records import Cell, Figure, Plot, Table, relative
from benchmarks.papers.workbench import Redrawing, Workbench, seen_by
from refgi.compare.pages import Axes, Curve, curves_plot
from refgi.frame import Frame
from refgi.lights import importance, importance_pyramid
from refgi.lights.selection import choose_lights, footprints
from refgi.lights.settings import with_clamp
from refgi.lights.warp import Method, warp_samples
from refgi.sampling import halton
from refgi.settings import of
from refgi.splat import Receivers, SiiSettings, sii
from refgi.splat.sii.bounds import appendix_ellipsoid
from refgi.splat.sii.fragments import Fragments, fragments
from refgi.splat.sii.settings import RelativeCut
from refgi.splat.sii.threshold import PAPER_CUT, PAPER_LIGHTS
from refgi.splat.sii.threshold import reference_length as reference_length_of
from refgi.stages import Memory, observe
from refgi.types import Array

BOX = "cornell_sphere:faces=17000"  # as many faces as the scenes of a game in 2006
CAUSTIC = of(SiiSettings, lights=4096, warp="B", warp_levels=3, importance="peak", cut_share=PAPER_CUT,
             reference_length=1.0, clamp="none")  # Figure 4, Table 1
COARSE = 64  # pixels along a side of the picture that the reference length is chosen by


def full_sum(bench: Workbench, scene: str) -> Array:
    """Return the uncut sum over every texel of the shadow maps: what pixel lights converge to."""
    every = of(SiiSettings, pattern="all")
    return bench.once(("full sum", scene), lambda: sii(bench.frame(scene), every))


def splats(bench: Workbench, scene: str, share: float = PAPER_CUT, **changes: Any) -> SiiSettings:
    """Return settings of 768 lights, but for `changes`, cut at a share of I_0 under the scene's reference length.

    A share of 0 cuts nothing.
    """
    cut = RelativeCut(share, reference_length(bench, scene)) if share > 0 else None
    return of(SiiSettings, **{"cut": cut} | changes)


def reference_length(bench: Workbench, scene: str) -> float:
    """Return the reference length (m) under which 768 splats of 5 % have the overdraw of Figure 8."""
    def length() -> float:
        frame = bench.frame(scene, width=COARSE, height=COARSE)
        settings = of(SiiSettings, lights=PAPER_LIGHTS, clamp="none")
        receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
        return reference_length_of(receivers, choose_lights(frame, settings.lights), settings.pairs)

    return bench.once(("reference length", scene), length)


def counted(frame: Frame, settings: SiiSettings) -> Fragments:
    """Count the fragments of a frame's splats: the overdraw map and what it adds up to."""
    buffer = frame.gbuffer
    receivers = Receivers(buffer.position, buffer.normal, buffer.covered)
    settings = with_clamp(settings)
    footprint = footprints(frame, settings.lights, settings.pairs)
    return fragments(receivers, choose_lights(frame, settings.lights), settings, footprint, buffer.projection)


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


ANGLES = np.linspace(0.0, np.pi / 2, 721)


def isosurfaces(_: Workbench, exponents: tuple[int, ...], *, bounded: bool) -> Figure:
    """Draw r = cos^(n/2) of Figure 9 as x along the light's axis and F(x) across it, in R_0; Figure 10: with ellipses.

    The volume of r^2 <= cos^n turned about the axis is 4 pi / (3 (3 n + 2)); an ellipsoid's is 4 pi w h^2 / 3.
    """
    curves, rows = [], []
    for n in exponents:
        r = np.cos(ANGLES) ** (n / 2)
        x, across = r * np.cos(ANGLES), r * np.sin(ANGLES)
        center, half_width, height = (float(part) for part in appendix_ellipsoid(float(n)))
        beyond = float(np.max((across / height) ** 2 + ((x - center) / half_width) ** 2)) - 1
        curves.append(Curve(f"n = {n}", x.tolist(), across.tolist()))
        if bounded:
            turn = 2 * ANGLES
            curves.append(Curve(f"ellipse, n = {n}", (center + half_width * np.cos(turn)).tolist(),
                                (height * np.sin(turn)).tolist(), dashed=True))
        rows.append((f"n = {n}", float(across.max()), center, half_width, height, beyond,
                     half_width * height**2 * (3 * n + 2)))
    closest = max(row[5] for row in rows)
    return Figure(
        facts=("I_0 = 1, I_low = 1", "lengths in R_0, the range along the axis"),
        tables=[Table("Ellipses of Eq. 7 and 8: centre, half axes, the region's farthest point outside (square of its "
                      "distance in half axes, less 1) and their volume over the region's",
                      ("", "region's height", "centre c", "half width", "height", "outside by", "volume"), rows)],
        plots=[Plot(curves_plot(curves, Axes("x, along the light's axis", "F(x), across it")),
                    "The upper half of sections along the axis.")],
        notes=("As high as the region where it is highest and wide enough for [0, 1], no ellipse leaves any of it out: "
               f"the farthest point lies {closest:.1g} of a squared half axis outside, rounding. They hold "
               + ", ".join(f"{row[6]:.2f}" for row in rows) + " times the region's volume; the paper gives no figure.",
               "Eq. 8 is read with its exponent (n + 2) / 4, which print shows as a factor."))
