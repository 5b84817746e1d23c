"""Figure 9: the shadows of single area lights, all clusters, and the picture that they add up to."""

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from benchmarks.papers import pictures
from benchmarks.papers.judging import errors_of
from benchmarks.papers.records import Cell, Figure, Picture, Table
from benchmarks.papers.val.lit import alone, lit, maps_of, strongest
from benchmarks.papers.val.painting import painted
from benchmarks.papers.val.subjects import CORNER, SMALL, Clustered, clustered, frame_of, rays_to, settings_of, shadowed
from refgi.cluster.settings import ValSettings

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench

Array = npt.NDArray[Any]

SHOWN = 4  # single area lights


def figure9(bench: "Workbench") -> Figure:
    """Make Figure 9 again.

    Parameters
    ----------
    bench : Workbench
        Sizes and frames.

    Returns
    -------
    Figure
        Pictures by single area lights, their clusters and the sum; errors of each and of the sum.
    """
    frame, settings = frame_of(bench, CORNER), settings_of(bench)
    found = clustered(frame, settings)
    maps, chosen = maps_of(frame, found, settings), strongest(found, SHOWN)
    parts = {m: lit(frame, alone(found, m), settings, maps) for m in chosen}
    total = lit(frame, found, settings, maps)
    lost = _left_over(frame, found, settings, total)
    rows, off_sum = _judged(bench, settings, chosen)
    return Figure(
        shows="A spot lights a corner of the box, so that most light is indirect: soft shadows of some area lights, "
              "the clusters of all 30, and the whole picture.",
        facts=(frame.scene.description, f"{found.lights.position.shape[1]} lights",
               f"{len(found.clusters.members)} area lights",
               f"{np.count_nonzero(maps.map_of >= 0)} of them with a map"),
        pictures=_pictures(frame, found, parts, total, settings), columns=4,
        tables=(Table("Single area lights and their sum: error against a ray to each of their lights, in % of the mean "
                      "of each picture", ("", "lights", "size, cm", "% of the flux", "RMSE", "MAE", "darker by"),
                      tuple(rows)),),
        notes=_notes(rows, off_sum, lost))


def _pictures(frame: Any, found: Clustered, parts: dict[int, Array], total: Array,
              settings: ValSettings) -> tuple[Picture, ...]:
    covered = frame.gbuffer.covered
    shown = [pictures.indirect(f"light{rank + 1}", f"area light {m + 1} alone",
                               f"{found.clusters.members[m]} lights, {100 * found.areas.delta[m]:.1f} cm", part,
                               pictures.exposure_of(part, covered)) for rank, (m, part) in enumerate(parts.items())]
    shown.append(painted("clusters", "all clusters", f"{len(found.clusters.members)} area lights", frame, found))
    shown.append(pictures.indirect("indirect", "the sum of all", "indirect light", total,
                                   pictures.exposure_of(total, covered), settings))
    shown.append(pictures.seen("seen", "with direct light", "as the paper's", frame, total, settings))
    return tuple(shown)


def _left_over(frame: Any, found: Clustered, settings: ValSettings, total: Array) -> float:
    """Return how far the sum of single area lights is from the picture by all, in parts of its largest value."""
    maps = maps_of(frame, found, settings)
    single = sum(np.asarray(lit(frame, alone(found, m), settings, maps), np.float64)
                 for m in range(len(found.clusters.members)))
    return float(np.abs(single - total).max() / max(float(np.abs(total).max()), 1e-30))


def _judged(bench: "Workbench", settings: ValSettings, chosen: list[int]) -> tuple[list[tuple[Cell, ...]], float]:
    frame = frame_of(bench, CORNER, SMALL)
    found, covered = clustered(frame, settings), frame.gbuffer.covered
    maps, flux = maps_of(frame, found, settings), found.lights.flux.sum()
    rows: list[tuple[Cell, ...]] = []
    for m in chosen:
        single = alone(found, m)
        off = errors_of(lit(frame, single, settings, maps), rays_to(frame, single.lights), covered)
        rows.append((f"area light {m + 1}", int(found.clusters.members[m]), 100 * float(found.areas.delta[m]),
                     100 * float(single.lights.flux.sum() / flux), *off))
    right = shadowed(bench, frame, settings, (CORNER, SMALL))
    whole = errors_of(lit(frame, found, settings, maps), right, covered)
    rows.append(("all", found.lights.position.shape[1], None, 100.0, *whole))
    return rows, whole.rmse


def _notes(rows: list[tuple[Cell, ...]], off_sum: float, lost: float) -> tuple[str, ...]:
    single = [float(row[4]) for row in rows[:-1] if isinstance(row[4], float)]
    return (
        f"Single area lights are {min(single):.1f} to {max(single):.1f} % of their mean off, the sum of all "
        f"{off_sum:.1f} %: errors of many overlapping soft shadows do hide each other, as the paper says.",
        f"Pictures of all single area lights add up to the whole one to {lost:.1g} of its largest value; float32 sums "
        "in another order.",
        "Area lights near an edge of the box give most of their light to the wall next to them.")
