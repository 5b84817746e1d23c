"""Figure 6: clusters by position alone, and by position and normal, drawn on the picture."""

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from benchmarks.papers.judging import errors_of
from benchmarks.papers.records import Figure, Table
from benchmarks.papers.subjects import seen_by
from benchmarks.papers.val.painting import painted
from benchmarks.papers.val.subjects import (
    CORNER,
    SMALL,
    Clustered,
    clustered,
    frame_of,
    scene_of,
    settings_of,
    shadowed,
)
from refgi.cluster.clustering.measures import mean_angle
from refgi.cluster.settings import ValSettings
from refgi.cluster.val import val

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench

Array = npt.NDArray[Any]

BENT = 30.0  # degrees from its cluster's normal to a light's: such a cluster lies around an edge
LOOK, VFOV = (0.4, 0.42, 0.4), math.radians(20)  # m and rad: at the corner


class Way(NamedTuple):
    """One criterion of clustering."""

    name: str
    title: str
    changes: dict[str, Any]


WAYS = (Way("position", "position alone", {"position_weight": 1.0, "normal_weight": 0.0}),
        Way("both", "position 0.7, normal 0.3", {}),
        Way("raw", "the same, metres and radians as printed", {"distance": "raw"}),
        Way("squared", "the same, squared", {"distance": "squared"}))


class Measured(NamedTuple):
    """What a criterion came to."""

    mean_angle: float  # degrees, between a light's normal and its cluster's
    largest_angle: float
    bent: int  # clusters that hold a light more than BENT off
    radius: float  # mean distance of a light from its cluster's centre, % of the diagonal
    rounds: int
    rmse: float  # % of the mean


def figure6(bench: "Workbench") -> Figure:
    """Make Figure 6 again.

    Parameters
    ----------
    bench : Workbench
        Sizes and frames.

    Returns
    -------
    Figure
        Painted clusters, angles inside them and the error of the picture by criterion.
    """
    scene = scene_of(bench, CORNER)
    frame = seen_by(bench, scene.with_camera(target=LOOK, vfov=VFOV))
    settings = {way.name: settings_of(bench, **way.changes) for way in WAYS}
    found = {name: clustered(frame, one) for name, one in settings.items()}
    measured = {name: _measured(bench, found[name], settings[name]) for name in settings}
    shown = tuple(painted(way.name, way.title, f"mean angle {measured[way.name].mean_angle:.1f}°, "
                          f"{measured[way.name].bent} clusters around an edge", frame, found[way.name],
                          settings[way.name]) for way in WAYS)
    lights, count = found["both"].lights, len(found["both"].clusters.members)
    return Figure(
        shows="Clustered by position alone, groups of lights lie around the edges of the box and have lights of "
              "several normals; with the angle between normals in the distance they are planar.",
        facts=(scene.description, f"{lights.position.shape[1]} lights", f"{count} clusters"),
        pictures=shown, columns=4,
        tables=(Table("Angle between a light's normal and its cluster's, distance from its centre, and the error of "
                      "the picture against a ray to each light",
                      ("", "mean angle, °", "largest, °", f"clusters with more than {BENT:.0f}°",
                       "distance, % of the diagonal", "rounds", "RMSE, % of the mean"),
                      tuple((way.title, *measured[way.name]) for way in WAYS)),),
        notes=_notes(measured))


def angles_inside(found: Clustered) -> Array:
    """Return the angle between each light's normal and its cluster's.

    Parameters
    ----------
    found : Clustered
        Lights and clusters.

    Returns
    -------
    (N,) ndarray of float64
        Angles, rad.
    """
    cosine = (found.lights.normal * found.clusters.normal[:, found.clusters.of]).sum(axis=0, dtype=np.float64)
    angle: Array = np.arccos(np.clip(cosine, -1, 1))
    return angle


def _measured(bench: "Workbench", found: Clustered, settings: ValSettings) -> Measured:
    angle, of = angles_inside(found), found.clusters.of
    bent = len(np.unique(of[np.degrees(angle) > BENT]))
    distance = np.linalg.norm(found.lights.position - found.clusters.center[:, of], axis=0)
    frame = frame_of(bench, CORNER, SMALL)
    off = errors_of(val(frame, settings), shadowed(bench, frame, settings, (CORNER, SMALL)), frame.gbuffer.covered)
    share = 100 * float(distance.mean()) / frame.scene.geometry.diagonal if distance.size else 0.0
    largest = float(np.degrees(angle.max(initial=0.0)))
    mean = math.degrees(mean_angle(found.lights.normal, found.clusters))
    return Measured(mean, largest, bent, share, found.clusters.rounds, off.rmse)


def _notes(measured: dict[str, Measured]) -> tuple[str, ...]:
    position, both, raw = measured["position"], measured["both"], measured["raw"]
    return (
        f"With normals in the distance the mean angle inside clusters falls from {position.mean_angle:.1f} to "
        f"{both.mean_angle:.1f} degrees and the number of clusters around an edge from {position.bent} to "
        f"{both.bent}: the shape of the paper's figure. They are {both.radius / position.radius:.2f} times as wide "
        "for it.",
        "The paper adds metres to radians, so what its weights mean depends on the unit of length: in this box of "
        f"about half a metre the printed form comes to {raw.mean_angle:.1f} degrees and {raw.bent} clusters around an "
        "edge. The default divides distances by the scene's diagonal and angles by pi.",
        f"The error of the picture, which the paper's figure does not show, is {position.rmse:.1f} % of the mean by "
        f"position alone and {both.rmse:.1f} % with normals.")
