"""Visibility of an area light's rectangle by rays: what every soft shadow approximates (Sec. 4.1, Fig. 4)."""

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.cluster.area_lights import AreaLights, Given
from refgi.cluster.maps.occluders import Blockers, Ends, blockers
from refgi.cluster.reference.unobstructed import Ball, free_share
from refgi.cluster.settings import ValSettings
from refgi.rays import Tracer
from refgi.sampling import halton
from refgi.scene.model import Geometry

if TYPE_CHECKING:
    from refgi.frame import Frame

Array = npt.NDArray[Any]

POINTS = 256  # on each rectangle: at most 1/256 off for an edge along a side, about 1/60 for others


def rectangle_visibility(
    frame: "Frame", areas: AreaLights, settings: ValSettings, points: int = POINTS, ends: Ends | None = None
) -> Given:
    """Return V of an area light as the share of its rectangle that a receiver sees.

    Parameters
    ----------
    frame : Frame
        The scene.
    areas : AreaLights
        The area lights.
    settings : ValSettings
        What blocks near an area light, and what is seen from behind it.
    points : int
        Points on each rectangle, spread evenly.
    ends : Ends, optional
        Where light begins and ends; absent: anywhere in the scene.

    Returns
    -------
    callable
        ``(m, points (3, n), facing (3, n)) -> (n,)``, in the dtype of the points.

    Notes
    -----
    The rectangle is the bounding one with its own sides, not a disc or square of size Delta. As in the maps,
    nothing within a share `near_distance` of the cluster's radius around the centre blocks, or no plane that passes
    there (`near_geometry`). Points below the receiver's surface do not count; where none is left V is 1. Behind the
    area light V is 1 ("visible"), or what rays say in all other modes of `behind`.
    """
    drawn = blockers(frame.scene.geometry, settings.occluders_alone, ends)
    on_square = _even(points)

    @lru_cache(maxsize=1)
    def tracer_of(m: int) -> Tracer:
        return tracer_without_near(frame, drawn, areas, m, settings)

    def given(m: int, points: Array, facing: Array) -> Array:
        tracer, visible = tracer_of(m), np.ones(points.shape[1], points.dtype)
        radius = settings.near_distance * float(areas.radius[m])
        ball = Ball(areas.center[:, m], radius) if settings.near_geometry == "ball" else None
        height = areas.normal[:, m] @ (points - areas.center[:, m, None])
        within = np.where(height > 0, True, settings.behind != "visible")
        for side in (1.0, -1.0):
            on = within & (height * side > 0)
            visible[on] = free_share(tracer, points[:, on], facing[:, on], rectangle_points(areas, m, on_square),
                                     side * areas.normal[:, m, None], None, frame.tracer.grain, ball)
        return visible

    return given


def rectangle_points(areas: AreaLights, m: int, on_square: Array) -> Array:
    """Return points of an area light's rectangle.

    Parameters
    ----------
    areas : AreaLights
        The area lights.
    m : int
        Which.
    on_square : (2, k) ndarray
        Places in [0, 1]^2.

    Returns
    -------
    (3, k) ndarray
        World space, m.
    """
    along = areas.offset[:, m, None] + (on_square - 0.5) * areas.side[:, m, None]
    points: Array = areas.center[:, m, None] + areas.axes[m].T @ along
    return points


def tracer_without_near(
    frame: "Frame", drawn: Blockers, areas: AreaLights, m: int, settings: ValSettings
) -> Tracer:
    """Return rays against what an area light's map is drawn from.

    Parameters
    ----------
    frame : Frame
        The scene.
    drawn : Blockers
        Triangles that can block at all.
    areas : AreaLights
        The area lights.
    m : int
        Which.
    settings : ValSettings
        Whether planes near the centre are left out.

    Returns
    -------
    Tracer
        That of the frame where nothing is left out.
    """
    distance = settings.near_distance * areas.radius[m]
    if settings.near_geometry != "planes" or distance == 0:
        return frame.tracer
    corner = drawn.vertices[drawn.faces] - areas.center[:, m]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    height = np.abs((normal * corner[:, 0]).sum(axis=1))
    faces = drawn.faces[height >= distance * np.linalg.norm(normal, axis=1)]
    return Tracer(Geometry(drawn.vertices, faces, np.zeros(len(faces), np.int32)))


def _even(count: int) -> Array:
    """Return Hammersley's points: as many distinct lines each way as there are points."""
    second = halton(count, bases=(2,))[:, 0] + 0.5 / count
    return np.stack([(np.arange(count) + 0.5) / count, second])
