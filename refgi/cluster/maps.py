"""Paraboloid shadow maps: the distance from each area light's centre to the nearest occluder (VAL Sec. 4.2, 6).

A map looks along the area light's normal from its centre, lifted a little off the surface. What is near the centre,
which may lie inside geometry, must be ignored (Sec. 5.1, Fig. 7); the paper does not say how near. By steps every area
light has a map; an empty one, inf everywhere, occludes nothing.
"""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi import skips
from refgi.cluster.occluders import Blockers, Ends, blockers, everywhere, occluders, selected_blockers
from refgi.cluster.rectangle import AreaLights
from refgi.cluster.settings import ShadowMapSettings
from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.rsm.buffers.extent import Extent, joined
from refgi.rsm.raster.paraboloid import Ignored, distance_maps
from refgi.rsm.raster.projection import PARABOLOID, Projection
from refgi.scene.model import Geometry
from refgi.stages import skip, stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.rays import Tracer

LIFT = 4e-6  # share of what is lit's largest coordinate: twice what ends of rays are lifted, above float32's rounding
BACKWARD = np.diag([-1.0, 1.0, -1.0])  # the frame of the hemisphere behind: right and forward turned round


def traced_maps(
    projection: Projection, drawn: Blockers, ignored: Ignored, dtype: npt.DTypeLike, tracer: "Tracer | None" = None
) -> tuple[Array, Array, Array]:
    """Measure distances on k paraboloid maps by float32 rays against the triangles drawn, or of `tracer`.

    Returns distances (k, n, n), the smallest on each map (k,), inf where nothing is, and the triangles (k,) that are
    ignored, as `distance_maps`.
    """
    n = projection.width
    distance, left_out = np.full((projection.maps, n, n), np.inf, dtype), np.zeros(projection.maps, np.int64)
    directions, inside = _texel_directions(n)
    for m in range(projection.maps):
        selected, left_out[m] = _select(drawn, projection, m, ignored)
        if selected.all():
            tracer = tracer or _tracer(drawn, selected)
        rays = tracer if selected.all() and tracer else _tracer(drawn, selected)
        toward, start = directions @ projection.frame[m], ignored.ball[m]
        hits = rays.closest(projection.origin[m] + start * toward, toward)
        distance[m][inside] = hits.distance + start
    return distance, distance.min(axis=(1, 2), initial=np.inf).astype(np.float64), left_out


def _texel_directions(n: int) -> tuple[Array, Array]:
    """Return unit vectors through the texels inside the disc, and which these are."""
    s, t = np.meshgrid(*[(2.0 * np.arange(n) + 1.0) / n - 1.0] * 2)
    square = s * s + t * t
    inside = square <= 1.0
    local = np.stack([2.0 * s, 2.0 * t, 1.0 - square], axis=-1) / (1.0 + square)[..., None]
    return local[inside], inside


def _select(drawn: Blockers, projection: Projection, m: int, ignored: Ignored) -> tuple[Array, int]:
    """Return which planes do not pass too near the centre; count what reaches ahead and is ignored."""
    corners = drawn.vertices[drawn.faces] - projection.origin[m]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    height = np.abs((normal * corners[:, 0]).sum(axis=1))
    near_plane = (height < ignored.planes[m] * np.linalg.norm(normal, axis=1)) & (height > 0.0)
    inside = ((corners * corners).sum(axis=2) < ignored.ball[m] ** 2).all(axis=1)
    ahead = (corners @ projection.frame[m, 2] >= 0.0).any(axis=1)
    return ~near_plane, int((ahead & (near_plane | inside)).sum())


def _tracer(drawn: Blockers, selected: Array) -> "Tracer":
    from refgi.rays import Tracer

    return Tracer(drawn.geometry(selected))


class ShadowMaps(NamedTuple):
    """K maps of M area lights; all that concerns a map is measured from its centre."""

    depth: Array  # (K, n, n) float32 or float64, m: distance to the nearest occluder; inf where there is none
    map_of: Array  # (M,) int32: the map of each area light; -1 where nothing can occlude it
    center: Array  # (K, 3) float64, m
    frame: Array  # (K, 3, 3) float64: rows right, down, forward, unit vectors
    near: Array  # (K,) float64, m: smallest distance in `depth`, inf if there is none
    far: Array  # (K,) float64, m: largest finite distance in `depth`, 0 if there is none
    scene_far: Array  # (K,) float64, m: to the farthest corner of the scene's extent
    behind: Array | None = None  # (K, n, n): the hemisphere behind, its frame with right and forward turned round
    near_behind: Array | None = None  # (K,) float64, m: smallest distance in `behind`
    far_behind: Array | None = None  # (K,) float64, m: largest finite one
    left_out: int = 0  # triangles left out because they are near a centre, summed over all maps


@stage("cluster.shadow_maps", steps="refgi.cluster.maps.map_steps")
def shadow_maps(
    geometry: Geometry, areas: AreaLights, settings: ShadowMapSettings, dtype: npt.DTypeLike,
    tracer: "Tracer | None" = None, ends: Ends | None = None,
) -> ShadowMaps:
    """Draw a paraboloid map of distances for every area light that something may occlude.

    settings: Size and kind of the maps, and what is left out of them.
    tracer: Rays against `geometry`, for ``renderer == "rays"``; made where it is needed and absent.
    ends: Where light begins and ends; absent: anywhere in the scene.
    -> ShadowMaps: At most M maps. An area light without lights, or with nothing in the hemispheres that its maps show,
        has none.

    Raises
    ------
    InputError
        If the type is not float32 or float64.
    """
    expect(np.dtype(dtype) in (np.float32, np.float64), "dtype", "float32 or float64", np.dtype(dtype).name)
    whole = Extent(*geometry.bounds)
    extent, illuminated = (whole, whole) if ends is None else (ends.extent, ends.illuminated)
    drawn, both = blockers(geometry, settings.occluders_alone, ends), settings.behind == "dual_paraboloid"
    used = np.flatnonzero(areas.members > 0)
    if not len(drawn.faces) and skips.left_out("cluster.maps", lambda: (len(used), len(used))):
        used = used[:0]
    center = np.ascontiguousarray(map_centers(areas.center, areas.normal, illuminated)[used])
    frame, radius = areas.frame[used], settings.near_share * areas.radius[used]
    rays = tracer if len(drawn.faces) == len(geometry.faces) else None
    depth, near, left_out = draw_maps(drawn, center, frame, radius, settings, dtype, rays)
    behind = near_behind = None
    needed = np.isfinite(near)
    if both:
        behind, near_behind, more = draw_maps(drawn, center, BACKWARD @ frame, radius, settings, dtype, rays)
        needed, left_out = needed | np.isfinite(near_behind), left_out + more
    empty = np.flatnonzero(~needed)
    if skips.left_out("cluster.maps", lambda: (len(empty), len(used)) if len(drawn.faces) else (0, 0)):
        empty = empty[:0]
    needed[empty] = True
    map_of = np.full(len(areas.members), -1, np.int32)
    map_of[used[needed]] = np.arange(needed.sum())
    if (map_of < 0).any():
        skip("cluster.depth_maps", f"nothing occludes {(map_of < 0).sum()} of {len(map_of)} area lights")
    maps = ShadowMaps(depth, map_of, center, frame, near, farthest(depth), farthest_corner(extent, center), behind,
                      near_behind, None if behind is None else farthest(behind), int(left_out.sum()))
    for values in (maps.near, maps.far, maps.near_behind, maps.far_behind):
        if values is not None:  # maps that hold nothing hold it where no receiver is: none is shadowed by them
            values[empty] = 2.0 * maps.scene_far[empty]
    if needed.all():
        return maps
    shown: dict[str, Any] = {name: values[needed] for name, values in maps._asdict().items()
                             if name not in ("map_of", "left_out") and values is not None}
    return maps._replace(**shown)


def map_centers(center: Array, normal: Array, illuminated: Extent) -> Array:
    """Return where maps look from, (M, 3), m: centres (3, M), lifted a little off their surface along normals."""
    return np.asarray((center + LIFT * illuminated.largest * normal).T)


def farthest_corner(extent: Extent, center: Array) -> Array:
    """Return distances to the farthest corner of the scene's extent, m."""
    low, high = extent
    return np.asarray(np.linalg.norm(np.maximum(np.abs(low - center), np.abs(high - center)), axis=1))


def farthest(depth: Array) -> Array:
    """Return the largest finite distance on each map, 0 where there is none, m."""
    columns = np.empty((depth.shape[0], depth.shape[2]), depth.dtype)
    _farthest_in_columns(depth, columns)
    return np.asarray(columns.max(axis=1, initial=0.0), np.float64)


@kernel(parallel=True)
def _farthest_in_columns(depth: Array, columns: Array) -> None:
    for k in prange(len(depth)):
        for j in range(depth.shape[2]):
            columns[k, j] = 0
        for i in range(depth.shape[1]):
            for j in range(depth.shape[2]):
                z = depth[k, i, j]
                columns[k, j] = z if (z > columns[k, j]) & (z < np.inf) else columns[k, j]


@stage("cluster.distances")
def draw_maps(
    drawn: Blockers, center: Array, frame: Array, radius: Array, settings: ShadowMapSettings, dtype: npt.DTypeLike,
    tracer: "Tracer | None",
) -> tuple[Array, Array, Array]:
    """Measure distances on paraboloid maps, as settings ask for.

    center (k, 3): Where maps look from, m.
    frame (k, 3, 3): Rows right, down, forward of each.
    radius (k,): What is nearer to a centre counts as the settings say, m.
    tracer: Rays against the same triangles.
    -> distance (k, n, n): Distance, m; inf where the map is empty and outside the disc.
    -> nearest (k,) float64: Smallest distance on each map, m; inf where nothing is.
    -> left_out (k,) int64: Triangles that reach into each map's hemisphere and are ignored.
    """
    n = settings.resolution
    projection = Projection(PARABOLOID, n, n, center, np.ascontiguousarray(frame), np.ones(2), np.inf)
    none = np.zeros_like(radius)
    rule = settings.near_geometry
    ignored = Ignored(radius if rule == "planes" else none, radius if rule == "ball" else none)
    if settings.renderer == "rays":
        return traced_maps(projection, drawn, ignored, dtype, tracer)
    return distance_maps(projection, drawn.chunks, dtype, ignored, drawn.cut)


@stage("cluster.map_views", kept=False)
def map_views(
    visible: Extent, illuminated: Extent, center: Array, normal: Array, radius: Array, near_distance: float
) -> tuple[Array, Array, Array]:
    """Place maps, with a ball around each within which nothing blocks (VAL Sec. 5.1, E-VAL-12).

    visible: Box of what the camera sees.
    illuminated: Box of what reflects direct light.
    center (3, area light): Centres of clusters, m.
    normal (3, area light): Their unit normals.
    radius (area light,): From the centre to the cluster's farthest light, m.
    near_distance: Radius of the ball, as a share of the cluster's.
    -> center (area light, 3): Centre of the map, a little off the surface, m.
    -> ball (area light,): What is nearer to the centre blocks nothing, m.
    -> scene_far (area light,): To the farthest corner of the boxes' common box, m.
    """
    place = np.ascontiguousarray(map_centers(center, normal, illuminated))
    return place, near_distance * radius, farthest_corner(joined(visible, illuminated), place)


@stage("cluster.frames_behind", kept=False)
def frames_behind(frame: Array) -> Array:
    """Turn maps to the hemisphere behind the light: right and forward are turned round (VAL Sec. 4.2, E-VAL-12).

    frame (area light, right down forward, 3): Axes of the map, unit vectors.
    -> (area light, right down forward, 3): Axes of the map behind, unit vectors.
    """
    return np.asarray(BACKWARD.astype(frame.dtype) @ frame)


@stage("cluster.depth_maps", kept=False)
def depth_maps(
    geometry: Geometry, blocks: Array, center: Array, frame: Array, ball: Array, members: Array, texels: int,
    renderer: Any, near_geometry: Any, tracer: "Tracer | None" = None,
) -> Array:
    """Measure the distance from each map's centre to the nearest blocker (VAL Sec. 4.2, E-VAL-06, E-VAL-12).

    blocks (triangle,) bool: Which of them may block.
    center (area light, 3): Where maps look from, m.
    frame (area light, right down forward, 3): Axes of the map, unit vectors.
    ball (area light,): What is nearer to the centre counts as `near_geometry` says, m.
    members (area light,) int: Lights of the cluster; without any its map is empty.
    texels: Along a side.
    renderer {"raster", "rays"}: What finds the distances.
    near_geometry {"ball", "planes", "keep"}: What is left out: hits within the ball, triangles whose planes reach into
        it, nothing.
    tracer: Rays against all triangles.
    -> (area light, row, column): Distance along the texel's direction (2s, 2t, 1 - q) / (1 + q), q = s^2 + t^2, m; inf
        without blocker, outside of the disc, without lights.
    """
    chosen = ShadowMapSettings(texels, renderer, near_geometry)
    drawn = selected_blockers(geometry, blocks)
    x, axes, radius = (np.ascontiguousarray(one, np.float64) for one in (center, frame, ball))
    depth = draw_maps(drawn, x, axes, radius, chosen, center.dtype, tracer if blocks.all() else None)[0]
    depth[members == 0] = np.inf
    return depth


@stage("cluster.map_ranges", kept=False)
def map_ranges(depth: Array) -> tuple[Array, Array]:
    """Find the nearest and the farthest distance on each map (E-VAL-05).

    depth (area light, row, column): Distances, m.
    -> near (area light,): Least distance, m; inf on an empty map.
    -> far (area light,): Greatest finite distance, m; 0 on an empty map.
    """
    return depth.min(axis=(1, 2)), farthest(depth)


def map_steps(
    geometry: Geometry, areas: AreaLights, settings: ShadowMapSettings, dtype: npt.DTypeLike,  # noqa: ARG001
    tracer: "Tracer | None" = None, ends: Ends | None = None,
) -> dict[str, Array]:
    """Return maps of all area lights, made by steps; `frame_behind` is that of the hemisphere behind."""
    ends = ends or everywhere(geometry)
    blocks = occluders(geometry, ends, not settings.occluders_alone)
    center, ball, scene_far = map_views(ends.visible, ends.illuminated, areas.center, areas.normal, areas.radius,
                                        settings.near_share)

    def drawn(axes: Array) -> tuple[Array, Array, Array]:
        depth = depth_maps(geometry, blocks, center, axes, ball, areas.members, settings.resolution,
                           settings.renderer, settings.near_geometry, tracer)
        return depth, *map_ranges(depth)

    made = {"center": center, "frame": areas.frame, "scene_far": scene_far, "ball": ball}
    made |= dict(zip(("depth", "near", "far"), drawn(areas.frame), strict=True))
    if settings.behind == "dual_paraboloid":
        made["frame_behind"] = frames_behind(areas.frame)
        made |= dict(zip(("behind", "near_behind", "far_behind"), drawn(made["frame_behind"]), strict=True))
    return made
