"""Figure 4: what each level adds, under a spot that shines straight down."""

import dataclasses
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from benchmarks.papers import pictures
from benchmarks.papers.curves import Axes, drawn
from benchmarks.papers.hssil.references import mean_of, scan_line
from benchmarks.papers.hssil.subjects import SPOT, lit, settings_of, wide_frame
from benchmarks.papers.records import Figure, Picture, Plot, Table
from refgi.sssil import HssilSettings

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench
    from refgi.frame import Frame

Array = npt.NDArray[Any]

LEVELS = 6  # beyond the paper's four, so that the far end is seen as well
SHOWN = 4  # the paper's
LINE = 0.42  # of the picture's height: across curtains and columns


class Parts(NamedTuple):
    """The light of a picture, level by level."""

    single: list[Array]  # each level alone, the first one first
    whole: Array  # of the paper's number of levels


def figure4(bench: "Workbench") -> Figure:
    """Make Figure 4 again.

    Parameters
    ----------
    bench : Workbench
        Sizes.

    Returns
    -------
    Figure
        Direct light, each level alone, all together, and a line across them.
    """
    frame = wide_frame(bench, SPOT)
    settings = settings_of(frame, levels=LEVELS)
    parts = parts_of(frame, settings)
    row = round(LINE * frame.height)
    curves = [scan_line(f"level {k + 1}", light, row) for k, light in enumerate(parts.single[:SHOWN])]
    curves.append(scan_line("levels 1 to 4", parts.whole, row, dashed=True))
    return Figure(
        shows="Under a vertical spot, the light that each of four levels gathers, and all together: each level reaches "
              "twice as far as the one before, and they blend smoothly.",
        facts=(frame.scene.description, f"{frame.width} x {frame.height} pixels", "half resolution",
               f"radius {settings.radius:g} texels", f"{settings.samples} samples a level"),
        pictures=_pictures(frame, settings, parts), columns=3,
        tables=(Table("Light by level", ("", "from, pixels away", "to", "mean, W/m²", "% of six levels"),
                      tuple(_rows(frame, settings, parts))),),
        plots=(Plot(drawn(curves, Axes("pixel", "irradiance, W/m²")),
                    f"Luminance along row {row + 1}, level by level."),),
        notes=_notes(frame, parts))


def parts_of(frame: "Frame", settings: HssilSettings) -> Parts:
    """Light a frame by one level after another.

    Parameters
    ----------
    frame : Frame
        The scene, seen and lit.
    settings : HssilSettings
        How many levels.

    Returns
    -------
    Parts
        Each level alone and the paper's four together.
    """
    single = [lit(frame, dataclasses.replace(settings, only_level=k)) for k in range(settings.levels)]
    return Parts(single, lit(frame, dataclasses.replace(settings, levels=SHOWN)))


def apart(parts: Parts) -> float:
    """Return how far the levels' sum is from the light of all, in parts of its largest value.

    Parameters
    ----------
    parts : Parts
        What `parts_of` gave.

    Returns
    -------
    float
        Upsampling is linear: rounding alone.
    """
    total = np.sum(np.asarray(parts.single[:SHOWN], np.float64), axis=0)
    return float(np.abs(total - parts.whole).max() / max(float(np.abs(parts.whole).max()), 1e-30))


def _pictures(frame: "Frame", settings: HssilSettings, parts: Parts) -> tuple[Picture, ...]:
    exposure = pictures.exposure_of(parts.whole, frame.gbuffer.covered)
    nothing = np.zeros_like(parts.whole)
    shown = [pictures.seen("direct", "direct light", "a vertical spot", frame, nothing)]
    for k, light in enumerate(parts.single[:SHOWN]):
        near, far = _crown(settings, k)
        shown.append(pictures.indirect(f"level{k + 1}", f"level {k + 1}", f"{near:g} to {far:g} pixels away", light,
                                       exposure, dataclasses.replace(settings, only_level=k)))
    shown += [pictures.indirect("levels", "levels 1 to 4", "indirect light", parts.whole, exposure),
              pictures.seen("seen", "with direct light", "what the camera receives", frame, parts.whole),
              pictures.indirect("further", "levels 5 and 6", "what four levels do not reach",
                                np.sum(parts.single[SHOWN:], axis=0), exposure)]
    return tuple(shown)


def _crown(settings: HssilSettings, index: int) -> tuple[float, float]:
    """Return where a level's samples lie, in pixels from the receiver."""
    assert settings.radius is not None
    near = settings.radius * 2.0 ** (settings.first_level + index)
    return (0.0 if index == 0 else round(near, 1)), round(2 * near, 1)


def _rows(frame: "Frame", settings: HssilSettings, parts: Parts) -> list[tuple[Any, ...]]:
    covered = frame.gbuffer.covered
    means = [mean_of(light, covered) for light in parts.single]
    total = sum(means) or 1.0
    rows = []
    for k, mean in enumerate(means):
        near, far = _crown(settings, k)
        rows.append((f"level {k + 1}", near, far, mean, 100 * mean / total))
    return rows


def _notes(frame: "Frame", parts: Parts) -> tuple[str, ...]:
    covered = frame.gbuffer.covered
    means = [mean_of(light, covered) for light in parts.single]
    total = sum(means) or 1.0
    share = [f"{100 * mean / total:.0f}" for mean in means]
    return (
        f"Levels 1 to 6 hold {', '.join(share)} % of the light here: the nearest level, which takes most of "
        "the time (Figure 7), holds the light of edges and folds, the far ones that of the room.",
        f"The levels' pictures add up to the picture of all to {apart(parts):.1g} of its largest value: upsampling "
        "takes no light away and adds none, as the paper says, up to rounding.",
        "In levels 2 and 3 the shape of the crown shows as an arc around the lit floor, as in the paper: a receiver "
        "whose crown has left it gets nothing from that level, and all from the next.")
