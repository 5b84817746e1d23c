"""Slow literal twin of rays from receivers to pixel lights and to points on the rectangle of their cluster.

A view has n receivers: `position`, `normal`, `facing` (n, 3), the lights' `light` (N, n, 3) there, and `corners` of all
triangles; an area is the rectangle of a cluster.
"""

from typing import Any, NamedTuple

import numpy as np

from refgi.literal.lights import radical_inverse
from tests.naive.crossings import LIFT, free

FROM_BEHIND = (np.arange(4) + 0.5) / 4  # points along a side of the rectangle that rays from behind end at
NEAR = {"csm": 0.4, "pcss": 0.7, "pcf": 0.6, "hard": 0.6, "back_projection": 0.25, "rays_rectangle": 0.7}
POINTS = 256  # on a rectangle that rays go to


class Area(NamedTuple):
    """The rectangle of a cluster."""

    center: Any
    frame: Any  # (3, 3) right, down, forward of its map
    axes: Any  # (2, 3) along its sides
    side: Any  # (2,) m
    offset: Any  # (2,) m, of its middle, along the axes
    radius: float
    members: list


def ahead_of(view, area):
    """Tell which receivers lie before an area light's plane."""
    return (view.position - area.center) @ area.frame[2] > 0


def visible_members(view, members):
    """Return the share of a cluster's flux that rays reach, of lights that face the receiver and lie above it.

    Those above the horizon of a receiver's normal and below its face are there, and the face hides them.
    """
    starts = view.position + LIFT * view.facing
    reached, whole = np.zeros((2, len(starts)))
    for i in members:
        place, up = view.lights.position[:, i].astype(float), view.lights.normal[:, i].astype(float)
        toward = place - view.position
        flux = sum(float(part[:, i].sum()) for part in (view.lights.flux, view.lights.lobe_flux) if part is not None)
        counts = flux * (((toward * view.normal).sum(axis=1) > 0) & (toward @ up < 0))
        whole += counts
        above = (toward * view.facing).sum(axis=1) > 0
        reached += counts * (above & free(view.corners, starts, place + LIFT * up))
    return np.divide(reached, whole, out=np.ones_like(whole), where=whole > 0)


def visible_rectangle(view, area):
    """Return the share of Hammersley's points on the rectangle that rays reach; behind it 1, or from behind as well."""
    i = np.arange(POINTS)
    points = on_rectangle(area, np.stack([(i + 0.5) / POINTS, radical_inverse(i, 2) + 0.5 / POINTS]))
    ahead, settings = ahead_of(view, area), view.settings.maps
    near = near_share(view.settings) * area.radius
    ball = near if settings.near_geometry == "ball" else 0.0
    corners = view.corners
    if settings.near_geometry == "planes":
        corners = without_near_planes(view.drawn, area.center, near)
    shares = np.where(ahead, free_points(view, area, points, area.frame[2], ball, corners, ahead), 1.0)
    if settings.behind != "visible":
        shares = np.where(ahead, shares, free_points(view, area, points, -area.frame[2], ball, corners, ~ahead))
    return shares


def from_behind(view, area):
    """Return the share of 4 x 4 points of the rectangle that rays from behind reach; nothing near its centre blocks."""
    points = on_rectangle(area, np.array(np.meshgrid(FROM_BEHIND, FROM_BEHIND)).reshape(2, -1))
    ball = near_share(view.settings) * area.radius
    return free_points(view, area, points, -area.frame[2], ball, view.corners, ~ahead_of(view, area))


def near_share(settings):
    """Return the share of a cluster's radius within which nothing blocks."""
    given = settings.maps.near_distance
    return NEAR[settings.visibility.name()] if given is None else given


def on_rectangle(area, on_square):
    """Return points of the rectangle, (k, 3)."""
    return area.center + (area.offset[:, None] + (on_square - 0.5) * area.side[:, None]).T @ area.axes


def free_points(view, area, points, up, ball, corners, asked):
    """Return the share of points above a receiver's horizon that its rays reach, with nothing in a ball to block."""
    shares = np.ones(len(view.pixels))
    for p in np.flatnonzero(asked & view.light[area.members].any(axis=(0, 2))):
        x, facing = view.position[p], view.facing[p]
        above = points[(points - x) @ view.normal[p] > 0]
        if len(above):
            most = way_to_ball(x, above - x, area.center, ball)
            reached = free(corners, x + LIFT * facing, above + LIFT * up, most)
            shares[p] = (reached & ((above - x) @ facing > 0)).mean()  # the face hides what lies below it
    return shares


def way_to_ball(start, toward, center, radius):
    """Return the share of each way that lies before a ball."""
    a, b = (toward**2).sum(axis=1), toward @ (start - center)
    root = b * b - a * ((start - center) @ (start - center) - radius**2)
    share = (-b - np.sqrt(np.maximum(root, 0))) / a
    return np.where((radius > 0) & (root > 0), np.clip(share, 0, 1), 1.0)


def without_near_planes(corners, center, distance):
    """Leave out triangles whose plane passes within a distance of a point."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    height = np.abs((normal * (corners[:, 0] - center)).sum(axis=1)) / np.linalg.norm(normal, axis=1)
    return corners[height >= distance]
