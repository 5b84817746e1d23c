"""What levels do: where their samples lie (Figure 2), and what light each adds (Figure 4)."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from benchmarks.papers.hssil.subjects import (
    RADIUS,
    every_texel,
    light_of,
    settings_of,
    wide_frame,
)
from benchmarks.papers.records import Cell, Figure, Picture, Plot, Table
from benchmarks.papers.workbench import Gallery, Workbench, mapped, mean_of, palette
from refgi.compare.pages import Axes, Curve, curves_plot
from refgi.compare.pictures import DIVERGING, Scale, luminance
from refgi.frame import Frame
from refgi.settings import replaced
from refgi.sssil import HssilSettings
from refgi.sssil.pattern import coverage, samples_at
from refgi.sssil.settings import PRESETS
from refgi.types import Array

ROWS = 256  # of receivers whose samples are counted, in units of a run's repeats
GROUND, RINGS = 0.08, 0.3  # grey values
COVERAGE = Scale(0.0, 2.0, DIVERGING, "times covered")
SHOWN = 4  # levels, the paper's


def crowns(bench: Workbench) -> Figure:
    """Figure 2: where samples lie, and how often the levels cover each pair of pixels."""
    settings = replaced(PRESETS["paper"], {"radius": max(2.0, RADIUS * bench.scale.size / 512)})
    sampling = settings.sampling
    assert sampling.radius is not None
    rows = ROWS * bench.scale.repeats
    sampled, exact = covered(settings, rows), covered(every_texel(settings), 1)
    curves = [Curve(name, range(len(values)), values) for name, values in (
        ("64 samples, mean of many rows", profile(sampled)), ("every texel", profile(exact)))]
    everywhere, said = np.ones(sampled.shape, bool), "white: once; red: more often"
    texels = 3 * math.pi * sampling.radius**2 / sampling.samples
    inside = _distance(sampled) < sampling.radius * 2**sampling.levels * (1 - 0.5**sampling.levels)
    return Figure(
        facts=(f"radius {sampling.radius:g}", f"{sampling.levels} levels", f"{sampling.samples} samples in a crown, "
               f"{sampling.inner} in the disc", f"means over {rows} rows of receivers"),
        pictures=(Picture("samples", "the samples of one receiver", "squares: texels of their level", _placed(settings),
                          settings=settings),
                  mapped("coverage", "coverage by 64 samples", said, sampled, everywhere, COVERAGE),
                  mapped("exact", "coverage by every texel", said, exact, everywhere, COVERAGE)),
        tables=[Table("Crowns", ("", "from, texels of the first level", "to", "samples", "texels for each sample",
                                 "covered within, mean"), _crowns(settings, sampled, texels))],
        plots=[Plot(curves_plot(curves, Axes("distance, texels of the first level", "times covered")),
                    "How often a pair of pixels at a distance is covered: once but where circles cut coarse texels.")],
        notes=(
            f"Within the last circle every pair of pixels is covered {sampled[inside].mean():.3f} times in the mean by "
            f"samples and {exact[inside].mean():.3f} times by every texel: no cracks and no overlaps, as the paper "
            "says, but where a circle cuts a coarse texel, whose pairs are all within or all without.",
            f"Around that mean the coverage by every texel varies by {100 * float(np.std(exact[inside])):.1f} %, at "
            f"the circles; that by samples by {100 * float(np.std(sampled[inside])):.1f} %, at softer circles and by "
            "the chance of the rows that were counted.",
            f"A sample of a crown stands for {texels:.0f} texels: that is what its disc of Eq. 4 is as large as."))


def covered(settings: HssilSettings, rows: int) -> Array:
    """Return how often a pair of pixels is covered, by offset in texels of the first level (n, n), 0 in the middle.

    Offsets go as far as the last crown reaches; `rows` of receivers draw samples.
    """
    side = round((settings.sampling.radius or 1) * 2**settings.sampling.levels) + 1
    return coverage(settings.sampling, (side, side), rows)


def profile(times: Array) -> list[float]:
    """Return the mean of offsets over all directions, by distance rounded to whole texels."""
    distance = _distance(times)
    counts = np.bincount(distance.ravel())[: len(times) // 2 + 1]
    sums = np.bincount(distance.ravel(), times.ravel())[: len(counts)]
    means: list[float] = (sums / counts).tolist()
    return means


def _distance(times: Array) -> Array:
    row, column = np.indices(times.shape) - len(times) // 2
    rounded: Array = np.asarray(np.round(np.hypot(row, column)), np.int64)
    return rounded


def _placed(settings: HssilSettings) -> npt.NDArray[np.uint8]:
    """Draw the samples of one receiver as squares of their texels, each level in its colour.

    A pixel is a texel of the first level; rings show where crowns begin and end.
    """
    radius = settings.sampling.radius or 1
    reach = round(radius * 2**settings.sampling.levels)
    colours = palette(settings.sampling.levels)
    pixels = np.full((2 * reach + 1, 2 * reach + 1, 3), GROUND)
    row, column = np.indices(pixels.shape[:2]) - reach
    distance = np.hypot(row, column)
    for k in range(settings.sampling.levels + 1):
        pixels[np.abs(distance - radius * 2**k) < 0.5 + reach / 640] = RINGS
    for k in reversed(range(settings.sampling.levels)):
        for ox, oy in 2**k * samples_at(settings.sampling, k, settings.sampling.first_level + k, 0, 0)[0]:
            top, left = (max(0, reach + o - 2**k // 2) for o in (oy, ox))
            pixels[top : top + 2**k, left : left + 2**k] = colours[k]
    return (255 * pixels + 0.5).astype(np.uint8)


def _crowns(settings: HssilSettings, times: Array, texels: float) -> list[tuple[Cell, ...]]:
    radius, distance = settings.sampling.radius or 1, _distance(times)
    rows: list[tuple[Cell, ...]] = []
    for k in range(settings.sampling.levels):
        near, far = (0.0 if k == 0 else radius * 2**k), radius * 2 ** (k + 1)
        within = (distance >= near) & (distance < far)
        samples = sum(settings.sampling.counts(k))
        rows.append((f"level {k + 1}", near, far, samples, texels, float(times[within].mean())))
    return rows


class Parts(NamedTuple):
    """The light of a picture, level by level."""

    single: list[Array]  # each level alone, the first one first
    whole: Array  # of the paper's number of levels

    @property
    def apart(self) -> float:
        """How far the levels' sum is from the light of all, in parts of its largest value: rounding alone."""
        total = np.sum(np.asarray(self.single[:SHOWN], np.float64), axis=0)
        return float(np.abs(total - self.whole).max() / max(float(np.abs(self.whole).max()), 1e-30))


def parts_of(frame: Frame, settings: HssilSettings) -> Parts:
    """Light a frame by one level after another, and by the paper's four together."""
    single = [light_of(frame, replaced(settings, {"only_level": k})) for k in range(settings.sampling.levels)]
    return Parts(single, light_of(frame, replaced(settings, {"levels": SHOWN})))


def level_by_level(bench: Workbench, scene: str, levels: int, line: float) -> Figure:
    """Figure 4: what each level adds, under a spot that shines straight down; `line` is a share of the height."""
    frame = wide_frame(bench, scene)
    settings = settings_of(frame, levels=levels)
    parts, row = parts_of(frame, settings), round(line * frame.height)
    curves = [scan_line(f"level {k + 1}", light, row) for k, light in enumerate(parts.single[:SHOWN])]
    curves.append(scan_line("levels 1 to 4", parts.whole, row, dashed=True))
    gallery, rows = Gallery(frame, parts.whole), []
    means = [mean_of(light, gallery.covered) for light in parts.single]
    share = [100 * mean / (sum(means) or 1.0) for mean in means]
    gallery.camera("direct", "direct light", "a vertical spot", np.zeros_like(parts.whole))
    for k, light in enumerate(parts.single):
        near, far = _crown(settings, k)
        rows.append((f"level {k + 1}", near, far, means[k], share[k]))
        if k < SHOWN:
            gallery.indirect(f"level{k + 1}", f"level {k + 1}", f"{near:g} to {far:g} pixels away", light,
                             replaced(settings, {"only_level": k}))
    gallery.indirect("levels", "levels 1 to 4", "indirect light", parts.whole)
    gallery.camera("seen", "with direct light", "what the camera receives", parts.whole)
    gallery.indirect("further", "levels 5 and 6", "what four levels do not reach", np.sum(parts.single[SHOWN:], axis=0))
    return Figure(
        facts=(frame.scene.description, f"{frame.width} x {frame.height} pixels", "half resolution",
               f"radius {settings.sampling.radius:g} texels", f"{settings.sampling.samples} samples a level"),
        pictures=gallery.pictures,
        tables=[Table("Light by level", ("", "from, pixels away", "to", "mean, W/m²", "% of six levels"), rows)],
        plots=[Plot(curves_plot(curves, Axes("pixel", "irradiance, W/m²")),
                    f"Luminance along row {row + 1}, level by level.")],
        notes=(
            f"Levels 1 to 6 hold {', '.join(f'{one:.0f}' for one in share)} % of the light here: the nearest level, "
            "which takes most of the time (Figure 7), holds the light of edges and folds, the far ones that of the "
            "room.",
            f"The levels' pictures add up to the picture of all to {parts.apart:.1g} of its largest value: upsampling "
            "takes no light away and adds none, as the paper says, up to rounding.",
            "In levels 2 and 3 the shape of the crown shows as an arc around the lit floor, as in the paper: a "
            "receiver whose crown has left it gets nothing from that level, and all from the next."))


def _crown(settings: HssilSettings, index: int) -> tuple[float, float]:
    """Return where a level's samples lie, in pixels from the receiver."""
    assert settings.sampling.radius is not None
    near = settings.sampling.radius * 2.0 ** (settings.sampling.first_level + index)
    return (0.0 if index == 0 else round(near, 1)), round(2 * near, 1)


def scan_line(name: str, light: Array, row: int, *, dashed: bool = False) -> Curve:
    """Return the luminance (W/m^2) along a row of a picture."""
    values = luminance(light[:, row : row + 1])[0].tolist()
    return Curve(name, range(len(values)), values, dashed)
