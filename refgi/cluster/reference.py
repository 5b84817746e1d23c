"""Visibility of an area light by rays: to its rectangle, which soft shadows approximate, or to its pixel lights.

By pixel lights V_C(x) = sum over the cluster of w_i V(p_i, x) / sum of w_i. With w_i = L_i(x), what each light gives to
x, no error of clustering is left, and none of soft shadows.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from refgi.cluster.back_projection import back_projection_visibility
from refgi.cluster.occluders import Blockers, Ends, blockers, ends_of
from refgi.cluster.rectangle import AreaLights, VisibilityFunction
from refgi.cluster.settings import BackProjection, RaysRectangle, RaysVpls, ShadowMapSettings, ValSettings
from refgi.rays import Tracer
from refgi.sampling import halton
from refgi.scene.model import Geometry
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.cluster.maps import ShadowMaps
    from refgi.frame import Frame
    from refgi.lights import PixelLights

RAYS_AT_ONCE = 1 << 18
SHORTEST = 1e-6  # of a ray: a reach of 0 would count as blocked
POINTS = 256  # on each rectangle: at most 1/256 off for an edge along a side, about 1/60 for others


class Ball(NamedTuple):
    """Where nothing blocks."""

    center: Array  # (3,) m
    radius: float  # m


def free_share(
    tracer: "Tracer", points: Array, facing: Array, targets: Array, upward: Array,
    contribution: Callable[[Array], Array] | None, grain: float, ball: Ball | None = None,
    shading: Array | None = None,
) -> Array:
    """Return the share of each receiver's rays that arrives, weighted by contribution: (n,), 1 without weight.

    Receivers and the unit normals of their faces are (3, n), `targets` on lights (3, k), m, `upward` (3, k) or (3, 1)
    normals there. `contribution` takes vectors (n, k, 3) to the targets to weights (n, k). Targets below the horizon of
    `shading` (3, n), the normals of cosines, do not count; those above it and below the face are hidden. `grain` is
    that of `ray_offset`, m; rays end where they enter `ball`.
    """
    from refgi.rays import STEPS

    visible = np.ones(points.shape[1], points.dtype)
    step = max(1, RAYS_AT_ONCE // max(1, targets.shape[1]))
    for first in range(0, len(visible), step):
        part = slice(first, first + step)
        at, face = points[:, part].T.astype(np.float64), facing[:, part].T.astype(np.float64)
        up = face if shading is None else shading[:, part].T.astype(np.float64)
        toward = targets.T[None] - at[:, None]
        counts, above = (np.einsum("nkc,nc->nk", toward, n) > 0 for n in (up, face))
        weight = np.where(counts, 1.0 if contribution is None else contribution(toward), 0.0)
        reach = np.where(above & (weight > 0), _way_to(ball, at, toward), 0.0)
        starts = at + STEPS * (np.abs(at).sum(axis=1, keepdims=True) + grain) * face
        lift = STEPS * (np.abs(targets).sum(axis=0) + grain + np.abs(toward).sum(axis=2))
        arrives = ~_blocked(tracer, starts, targets.T + lift[..., None] * upward.T, reach)
        whole = weight.sum(axis=1)
        share = np.divide((weight * arrives).sum(axis=1), whole, out=np.ones_like(whole), where=whole > 0)
        visible[part] = np.minimum(share, 1.0)
    return visible


def _blocked(tracer: "Tracer", origins: Array, ends: Array, reach: Array) -> Array:
    """Return which of the rays from each origin (n, 3) to its ends (n, k, 3) are blocked, (n, k) bool."""
    shape = (*reach.shape, 3)
    starts = np.broadcast_to(origins[:, None], shape)
    directions = (ends - starts).astype(np.float32).reshape(-1, 3)
    blocked = np.zeros(reach.size, np.bool_)
    tracer.fill_occluded(np.ascontiguousarray(starts, np.float32).reshape(-1, 3), directions,
                         reach.reshape(-1).astype(np.float32), blocked)
    return blocked.reshape(reach.shape)


def _way_to(ball: Ball | None, at: Array, toward: Array) -> Any:
    """Return the share of each way `toward` (n, k, 3) that lies before the ball, (n, k); 1 where it misses it."""
    if ball is None or ball.radius == 0:
        return 1.0
    start = at - ball.center
    square, half = np.einsum("nkc,nkc->nk", toward, toward), np.einsum("nkc,nc->nk", toward, start)
    root = half**2 - square * (np.einsum("nc,nc->n", start, start) - ball.radius**2)[:, None]
    share = np.divide(-half - np.sqrt(np.maximum(root, 0)), square, out=np.ones_like(square), where=square > 0)
    return np.where(root > 0, np.clip(share, SHORTEST, 1.0), 1.0)


def rectangle_visibility(
    tracer: Tracer, geometry: Geometry, areas: AreaLights, settings: ShadowMapSettings, points: int = POINTS,
    ends: Ends | None = None,
) -> VisibilityFunction:
    """Return V of an area light as the share of its rectangle, with its own sides, that a receiver sees.

    Rays end at `points` of it, spread evenly. As in the maps, nothing within `near_distance` of the centre blocks, or
    no plane that passes there. Points below the receiver's horizon do not count; where none is left V is 1. Behind the
    area light V is 1 ("visible"), or what rays say in all other modes of `behind`. `ends`: where light begins and ends.
    """
    drawn = blockers(geometry, settings.occluders_alone, ends)
    on_square = _even(points)

    @lru_cache(maxsize=1)
    def tracer_of(m: int) -> Tracer:
        return tracer_without_near(tracer, drawn, areas, m, settings)

    def visibility_of(m: int, points: Array, facing: Array, shading: Array | None = None) -> Array:
        visible = np.ones(points.shape[1], points.dtype)
        radius = settings.near_share * float(areas.radius[m])
        ball = Ball(areas.center[:, m], radius) if settings.near_geometry == "ball" else None
        height = areas.normal[:, m] @ (points - areas.center[:, m, None])
        within = np.where(height > 0, True, settings.behind != "visible")
        for side in (1.0, -1.0):
            on = within & (height * side > 0)
            visible[on] = free_share(tracer_of(m), points[:, on], facing[:, on], rectangle_points(areas, m, on_square),
                                     side * areas.normal[:, m, None], None, tracer.grain, ball,
                                     None if shading is None else shading[:, on])
        return visible

    return visibility_of


def rectangle_points(areas: AreaLights, m: int, on_square: Array) -> Array:
    """Return points (3, k), world space, m, of area light m's rectangle at places (2, k) in [0, 1]^2."""
    along = areas.offset[:, m, None] + (on_square - 0.5) * areas.side[:, m, None]
    points: Array = areas.center[:, m, None] + areas.axes[m].T @ along
    return points


def tracer_without_near(
    tracer: Tracer, drawn: Blockers, areas: AreaLights, m: int, settings: ShadowMapSettings
) -> Tracer:
    """Return rays against what area light m's map is drawn from; `tracer` where no planes are left out."""
    distance = settings.near_share * areas.radius[m]
    if settings.near_geometry != "planes" or distance == 0:
        return tracer
    corner = drawn.vertices[drawn.faces] - areas.center[:, m]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    height = np.abs((normal * corner[:, 0]).sum(axis=1))
    return Tracer(drawn.geometry(height >= distance * np.linalg.norm(normal, axis=1)))


def _even(count: int) -> Array:
    """Return Hammersley's points: as many distinct lines each way as there are points."""
    second = halton(count, bases=(2,))[:, 0] + 0.5 / count
    return np.stack([(np.arange(count) + 0.5) / count, second])


def vpl_visibility(tracer: Tracer, lights: "PixelLights", areas: AreaLights) -> VisibilityFunction:
    """Return V of an area light as the share of its lights, by their flux in all channels, that a receiver sees.

    Lights that face away from a receiver, or lie below its horizon, do not count; where none is left V is 1. Those
    above the horizon of an interpolated normal and below the face are hidden. There is no rule for receivers behind the
    area light.
    """
    position, normal = (np.asarray(a, np.float64) for a in (lights.position, lights.normal))
    flux = np.asarray(lights.flux, np.float64).sum(axis=0)
    if lights.lobe_flux is not None:
        flux = flux + np.asarray(lights.lobe_flux, np.float64).sum(axis=0)
    order = np.argsort(areas.of, kind="stable")
    first = np.searchsorted(areas.of[order], np.arange(len(areas.members) + 1))

    def visibility_of(m: int, points: Array, facing: Array, shading: Array | None = None) -> Array:
        of = order[first[m] : first[m + 1]]

        def contribution(toward: Array) -> Array:
            away = -np.einsum("nkc,ck->nk", toward, normal[:, of])
            counted: Array = np.where(away > 0, flux[of], 0.0)
            return counted

        return free_share(tracer, points, facing, position[:, of], normal[:, of], contribution, tracer.grain,
                          shading=shading)

    return visibility_of


def reference_visibility(
    frame: "Frame", lights: "PixelLights", areas: AreaLights, maps: "ShadowMaps | None",
    settings: ValSettings,
) -> VisibilityFunction | None:
    """Return the reference visibility of `settings.visibility`; None where it is not by reference."""
    if isinstance(settings.visibility, RaysVpls):
        return vpl_visibility(frame.tracer, lights, areas)
    projected = maps if isinstance(settings.visibility, BackProjection) else None
    rectangle = None
    if isinstance(settings.visibility, RaysRectangle) or (projected is not None and settings.maps.behind == "raytrace"):
        rectangle = rectangle_visibility(frame.tracer, frame.scene.geometry, areas, settings.drawn_maps,
                                         ends=ends_of(frame, lights))
    return rectangle if projected is None else back_projection_visibility(areas, projected, rectangle)
