"""Figure 2: where samples lie, and how often the levels cover each pair of pixels."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from benchmarks.papers import pictures
from benchmarks.papers.curves import Axes, Curve, drawn
from benchmarks.papers.hssil.subjects import RADIUS, every_texel
from benchmarks.papers.records import Cell, Figure, Picture, Plot, Table
from benchmarks.papers.val.painting import palette
from refgi.compare.maps import DIVERGING, Scale
from refgi.sssil import HssilSettings
from refgi.sssil.crown.coverage import coverage
from refgi.sssil.crown.pattern import offsets_at

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench

Array = npt.NDArray[Any]

ROWS = 256  # of receivers whose samples are counted, in units of a run's repeats
GROUND, RINGS = 0.08, 0.3  # grey values
SCALE = Scale(0.0, 2.0, DIVERGING, "times covered")


def figure2(bench: "Workbench") -> Figure:
    """Make Figure 2 again.

    Parameters
    ----------
    bench : Workbench
        Sizes, and how many receivers are counted.

    Returns
    -------
    Figure
        The samples of one receiver, and how often each distance between pixels is covered.
    """
    settings = HssilSettings(radius=max(2.0, RADIUS * bench.scale.size / 512))
    rows = ROWS * bench.scale.repeats
    drawn_by, exact = covered(settings, rows), covered(every_texel(settings), 1)
    along = {"64 samples, mean of many rows": profile(drawn_by), "every texel": profile(exact)}
    return Figure(
        shows="Each level samples a crown from r to 2 r of its texels, the first one the disc within as well: together "
              "they cover the picture without cracks or overlaps.",
        facts=(f"radius {settings.radius:g}", f"{settings.levels} levels", f"{settings.samples} samples in a crown, "
               f"{settings.inner} in the disc", f"means over {rows} rows of receivers"),
        pictures=_pictures(settings, drawn_by, exact), columns=3,
        tables=(Table("Crowns", ("", "from, texels of the first level", "to", "samples", "texels for each sample",
                                 "covered within, mean"), tuple(_rows(settings, drawn_by))),),
        plots=(Plot(drawn([Curve(name, range(len(values)), values) for name, values in along.items()],
                          Axes("distance, texels of the first level", "times covered")),
                    "How often a pair of pixels at a distance is covered: once but where circles cut coarse texels."),),
        notes=_notes(settings, drawn_by, exact))


def covered(settings: HssilSettings, rows: int) -> Array:
    """Return how often a pair of pixels is covered, by where one lies from the other.

    Parameters
    ----------
    settings : HssilSettings
        Radius, levels and pattern.
    rows : int
        How many rows of receivers draw samples.

    Returns
    -------
    (n, n) ndarray
        Offsets in texels of the first level as far as the last crown reaches, 0 in the middle.
    """
    side = round((settings.radius or 1) * 2**settings.levels) + 1
    return coverage(settings, (side, side), rows)


def profile(times: Array) -> list[float]:
    """Return the mean over all directions.

    Parameters
    ----------
    times : (n, n) ndarray
        How often an offset is covered, 0 in the middle.

    Returns
    -------
    list of float
        By distance, rounded to whole texels.
    """
    distance = _distance(times)
    counts = np.bincount(distance.ravel())[: len(times) // 2 + 1]
    sums = np.bincount(distance.ravel(), times.ravel())[: len(counts)]
    means: list[float] = (sums / counts).tolist()
    return means


def _distance(times: Array) -> Array:
    middle = len(times) // 2
    row, column = np.indices(times.shape) - middle
    rounded: Array = np.asarray(np.round(np.hypot(row, column)), np.int64)
    return rounded


def placed(settings: HssilSettings) -> npt.NDArray[np.uint8]:
    """Draw the samples of one receiver as squares of their texels, each level in its colour.

    Parameters
    ----------
    settings : HssilSettings
        Radius, levels and samples.

    Returns
    -------
    (n, n, 3) ndarray of uint8
        A pixel is a texel of the first level; rings show where crowns begin and end.
    """
    radius = settings.radius or 1
    reach = round(radius * 2**settings.levels)
    colours = palette(settings.levels)
    pixels = np.full((2 * reach + 1, 2 * reach + 1, 3), GROUND)
    row, column = np.indices(pixels.shape[:2]) - reach
    distance = np.hypot(row, column)
    for k in range(settings.levels + 1):
        pixels[np.abs(distance - radius * 2**k) < 0.5 + reach / 640] = RINGS
    for k in reversed(range(settings.levels)):
        for ox, oy in 2**k * offsets_at(settings, k, settings.first_level + k, 0, 0):
            top, left = (max(0, reach + o - 2**k // 2) for o in (oy, ox))
            pixels[top : top + 2**k, left : left + 2**k] = colours[k]
    return (255 * pixels + 0.5).astype(np.uint8)


def _pictures(settings: HssilSettings, drawn_by: Array, exact: Array) -> tuple[Picture, ...]:
    everywhere = np.ones(drawn_by.shape, bool)
    said = "white: once; red: more often"
    return (Picture("samples", "the samples of one receiver", "squares: texels of their level", placed(settings),
                    settings=settings),
            pictures.mapped("coverage", "coverage by 64 samples", said, drawn_by, everywhere, SCALE),
            pictures.mapped("exact", "coverage by every texel", said, exact, everywhere, SCALE))


def _rows(settings: HssilSettings, times: Array) -> list[tuple[Cell, ...]]:
    radius, distance = settings.radius or 1, _distance(times)
    rows: list[tuple[Cell, ...]] = []
    for k in range(settings.levels):
        near, far = (0.0 if k == 0 else radius * 2**k), radius * 2 ** (k + 1)
        within = (distance >= near) & (distance < far)
        share = 3 * math.pi * radius**2 / settings.samples
        samples = settings.samples + (settings.inner if k == 0 else 0)
        rows.append((f"level {k + 1}", near, far, samples, share, float(times[within].mean())))
    return rows


def _notes(settings: HssilSettings, drawn_by: Array, exact: Array) -> tuple[str, ...]:
    reach = (settings.radius or 1) * 2**settings.levels
    inside = _distance(drawn_by) < reach * (1 - 0.5**settings.levels)
    away = [float(np.std(one[inside])) for one in (drawn_by, exact)]
    return (
        f"Within the last circle every pair of pixels is covered {drawn_by[inside].mean():.3f} times in the mean by "
        f"samples and {exact[inside].mean():.3f} times by every texel: no cracks and no overlaps, as the paper says, "
        "but where a circle cuts a coarse texel, whose pairs are all within or all without.",
        f"Around that mean the coverage by every texel varies by {100 * away[1]:.1f} %, at the circles; that by "
        f"samples by {100 * away[0]:.1f} %, at softer circles and by the chance of the rows that were counted.",
        f"A sample of a crown stands for {3 * math.pi * (settings.radius or 1) ** 2 / settings.samples:.0f} texels: "
        "that is what its disc of Eq. 4 is as large as.")
