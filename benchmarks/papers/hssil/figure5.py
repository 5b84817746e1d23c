"""Figure 5: Eq. 3 and Eq. 4 against path tracing, by exact direct light, along a line of the picture."""

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from benchmarks.papers import pictures
from benchmarks.papers.curves import Axes, Curve, drawn
from benchmarks.papers.hssil.references import doubt, noise_of, scan_line, traced
from benchmarks.papers.hssil.subjects import (
    BOX,
    LARGE,
    RADIUS_FIGURE_5,
    every_texel,
    frame_of,
    lit,
    reach_of,
    scaled_radius,
)
from benchmarks.papers.judging import Errors, errors_of
from benchmarks.papers.records import Figure, Picture, Plot, Table
from refgi.compare.maps import luminance
from refgi.sssil import HssilSettings

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench
    from refgi.frame import Frame

Array = npt.NDArray[Any]

LINE = 0.83  # of the picture's height: across both blocks and near edges
SEEN, OPEN, ALL = "seen", "open", "all"
TRUTHS: dict[str, tuple[str, dict[str, Any]]] = {
    OPEN: ("path tracing, v = 1", {"emitters": "seen", "visibility": False}),
    SEEN: ("path tracing, seen emitters", {"emitters": "seen"}),
    ALL: ("path tracing", {})}
POINT, DISC, POINT_LIMIT, DISC_LIMIT = "point", "disc", "point_limit", "disc_limit"
NAMES = {POINT: "Eq. 3, 64 samples", DISC: "Eq. 4, 64 samples", POINT_LIMIT: "Eq. 3, every texel",
         DISC_LIMIT: "Eq. 4, every texel"}


def figure5(bench: "Workbench") -> Figure:
    """Make Figure 5 again.

    Parameters
    ----------
    bench : Workbench
        Sizes and samples.

    Returns
    -------
    Figure
        Both form factors beside path tracing of what the camera sees, and a line across all.
    """
    frame = frame_of(bench, BOX, LARGE, shadows="exact")
    settings = settings_of_figure(frame)
    ways = ways_of(settings)
    light = {key: lit(frame, one) for key, one in ways.items()}
    right = {key: traced(bench, frame, (BOX, LARGE), **changes) for key, (_, changes) in TRUTHS.items()}
    covered = frame.gbuffer.covered
    row = round(LINE * frame.height)
    off = {key: errors_of(one, right[OPEN], covered) for key, one in (light | right).items()}
    spikes = {key: noise_of(frame, ways[key], light[key]) ** 2 for key in (POINT, DISC)}
    names = NAMES | {key: title for key, (title, _) in TRUTHS.items()}
    top = {key: largest(one, right[OPEN], row) for key, one in (light | right).items()}
    noise = {key: doubt(bench, frame, (BOX, LARGE), **changes) for key, (_, changes) in TRUTHS.items()}
    rows = tuple((names[key], *off[key], top[key], noise.get(key)) for key in light | right)
    return Figure(
        shows="One bounce by path tracing and by the method, fed with exact direct light: with the point form factor "
              "(Eq. 3) spikes, with that of a disc (Eq. 4) none.",
        facts=(frame.scene.description, f"{frame.width}² pixels", f"radius {settings.radius:g}", "4 levels from full "
               "resolution", "64 samples a level, every pixel its own", "direct light with a shadow ray a pixel",
               f"path tracing with {bench.scale.truth_samples} samples a pixel"),
        pictures=_pictures(frame, light, right, off, row, ways), columns=4,
        tables=(Table("Errors in % of the mean, against path tracing in which only what the camera sees shines and "
                      "nothing blocks", ("", "RMSE", "MAE", "darker by", "highest above it along the line, %",
                              "standard error"), rows),),
        plots=(Plot(drawn(_curves(light, right, row), Axes("pixel", "irradiance, W/m²")),
                    f"Luminance along row {row + 1}, which the first pictures mark."),),
        notes=_notes(off, spikes, top, reach_of(frame, settings)))


def settings_of_figure(frame: "Frame") -> HssilSettings:
    """Return Figure 5's settings: full resolution, 4 levels of 64 samples, a radius of 40 in 720 rows.

    Parameters
    ----------
    frame : Frame
        Says how large the picture is.

    Returns
    -------
    HssilSettings
        Every pixel has its own samples, so that noise shows along the line.
    """
    return HssilSettings(radius=scaled_radius(frame, RADIUS_FIGURE_5), start="full", pattern="pixel")


def ways_of(settings: HssilSettings) -> dict[str, HssilSettings]:
    """Return both form factors, with the paper's samples and with all.

    Parameters
    ----------
    settings : HssilSettings
        What they share.

    Returns
    -------
    dict of str to HssilSettings
        By the keys of `NAMES`.
    """
    point = dataclasses.replace(settings, form_factor="point")
    return {POINT: point, DISC: settings, POINT_LIMIT: every_texel(point), DISC_LIMIT: every_texel(settings)}


def largest(light: Array, right: Array, row: int) -> float:
    """Return how far a picture is above the reference along a row, at most.

    Parameters
    ----------
    light, right : (3, h, w) ndarray
        Irradiance, W/m^2.
    row : int
        Which row.

    Returns
    -------
    float
        In % of the reference's mean along the row; 0 where it is nowhere above.
    """
    line, true = luminance(light)[row], luminance(right)[row]
    return 100 * max(0.0, float((line - true).max())) / max(float(true.mean()), 1e-30)


def _curves(light: dict[str, Array], right: dict[str, Array], row: int) -> list[Curve]:
    made = [scan_line(NAMES[key], light[key], row) for key in (POINT, DISC, DISC_LIMIT)]
    return [*made, *(scan_line(title, right[key], row, dashed=True) for key, (title, _) in TRUTHS.items())]


def _pictures(frame: "Frame", light: dict[str, Array], right: dict[str, Array], off: dict[str, Errors], row: int,
              ways: dict[str, HssilSettings]) -> tuple[Picture, ...]:
    covered = frame.gbuffer.covered
    exposure = pictures.exposure_of(right[OPEN], covered)
    shown = [_marked(pictures.indirect(key, NAMES[key], f"RMSE {off[key].rmse:.1f} %", light[key], exposure,
                                       ways[key]), row) for key in (POINT, DISC)]
    shown += [pictures.indirect(key, title, _said(key), right[key], exposure) for key, (title, _) in TRUTHS.items()]
    made = {key: (NAMES[key], light[key]) for key in (POINT, DISC, DISC_LIMIT)}
    return (*shown, *pictures.errors(made, right[OPEN], covered))


def _marked(picture: Picture, row: int) -> Picture:
    """Draw the line that is plotted."""
    pixels = picture.pixels.copy()
    thick = max(1, len(pixels) // 240)  # so that it is seen on a page, where pictures are small
    pixels[row - thick // 2 : row - thick // 2 + thick] = (255, 60, 60)
    return dataclasses.replace(picture, pixels=pixels)


def _said(key: str) -> str:
    return {OPEN: "what the camera sees shines, nothing blocks", SEEN: "what the camera sees shines",
            ALL: "everything shines"}[key]


def _notes(off: dict[str, Errors], spikes: dict[str, float], top: dict[str, float], reach: float) -> tuple[str, ...]:
    ratio = spikes[POINT] / max(spikes[DISC], 1e-30)
    return (
        f"With 64 samples Eq. 3 has {ratio:.1f} times the variance of Eq. 4, and along the line it "
        f"rises up to {top[POINT]:.0f} % of the mean above path tracing, Eq. 4 up to {top[DISC]:.0f} %: the spikes of "
        "the paper's red curve, and their absence from its green one.",
        f"In the limit of every texel Eq. 3 is {off[POINT_LIMIT].rmse:.1f} % off path tracing of the same emitters "
        f"without visibility (RMSE) and Eq. 4 {off[DISC_LIMIT].rmse:.1f} %. Eq. 4 is the darker one, by "
        f"{off[DISC_LIMIT].lost - off[POINT_LIMIT].lost:.1f} % of the mean: a disc near a receiver sends less than its "
        "point form says, and a texel at full resolution is a small disc only where surfaces are some texels apart.",
        f"Where surfaces block each other, path tracing of the same emitters falls by {off[SEEN].lost:.1f} %; what the "
        f"camera does not see would add {off[SEEN].lost - off[ALL].lost:.1f} %: the bias that the paper speaks of.",
        f"Four levels reach {100 * reach:.0f} % of the picture's diagonal, as in the paper.")
