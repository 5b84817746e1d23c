"""Maps of area lights one step after the other: views, distances to the nearest blocker, their ranges (VAL Sec. 4.2).

Every area light has a map here. One that is empty, inf everywhere, occludes nothing: V is 1.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.cluster.clustering.rectangle import AreaLights
from refgi.cluster.maps.occluders import Ends, everywhere, occluders, selected_blockers
from refgi.cluster.maps.shadow_maps import BACKWARD, draw_maps, farthest, farthest_corner, map_centers
from refgi.cluster.settings import ShadowMapSettings
from refgi.rsm.buffers.extent import Extent, joined
from refgi.scene.model import Geometry
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.rays import Tracer


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

    def drawn(frame: Array) -> tuple[Array, Array, Array]:
        depth = depth_maps(geometry, blocks, center, frame, ball, areas.members, settings.resolution,
                           settings.renderer, settings.near_geometry, tracer)
        return depth, *map_ranges(depth)

    made = {"center": center, "frame": areas.frame, "scene_far": scene_far, "ball": ball}
    made |= dict(zip(("depth", "near", "far"), drawn(areas.frame), strict=True))
    if settings.behind == "dual_paraboloid":
        made["frame_behind"] = frames_behind(areas.frame)
        made |= dict(zip(("behind", "near_behind", "far_behind"), drawn(made["frame_behind"]), strict=True))
    return made
