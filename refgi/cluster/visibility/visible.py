"""How much of an area light points see, by its map: any points, any mode (Sec. 4.1, 5.1)."""

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.cluster.clustering.rectangle import AreaLights
from refgi.cluster.filters.depth_scale import DepthScale
from refgi.cluster.maps.hard import hard_visibility
from refgi.cluster.maps.shadow_maps import ShadowMaps
from refgi.cluster.reference.rays import Ball, free_share, rectangle_points
from refgi.cluster.settings import ValSettings
from refgi.cluster.visibility.filtered import build
from refgi.cluster.visibility.look import ROOM_ROWS, Choices, choices, look, numbers_of, scale_of
from refgi.cluster.visibility.series import series
from refgi.cluster.visibility.soft import soft_tile
from refgi.cluster.visibility.step import Rules, rules, step_lanes
from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.stages import stage

if TYPE_CHECKING:
    from refgi.rays import Tracer

Array = npt.NDArray[Any]

TILE = 256  # receivers a thread works on at once
BESIDE = (np.arange(4) + 0.5) / 4  # points along a side of the rectangle that rays from behind end at


@stage("cluster.visibility", kept=False)
def visibility(
    maps: ShadowMaps, areas: AreaLights, m: int, points: Array, facing: Array, settings: ValSettings,
    tracer: "Tracer | None" = None,
) -> Array:
    """Return how much of one area light each point sees.

    Parameters
    ----------
    maps : ShadowMaps
        The maps.
    areas : AreaLights
        The area lights that the maps were drawn for.
    m : int
        Which area light.
    points : (3, n) ndarray
        World space, m.
    facing : (3, n) ndarray
        Normals of their surfaces; on the lit side for rays, else on either.
    settings : ValSettings
        `visibility` is "series", "step", "hard" or "none"; `behind` says what points behind the area light see.
    tracer : Tracer, optional
        Rays against the scene, for points behind the area light and ``behind == "raytrace"``.

    Returns
    -------
    (n,) ndarray
        V, 0 to 1, in the dtype of the maps.

    Raises
    ------
    InputError
        If there is no such area light, a mode is asked for that works without maps, or rays without a tracer.

    Notes
    -----
    An area light without extent casts a hard shadow. Points behind its plane see it whole (Sec. 5.1), unless a second
    map or rays to its rectangle say otherwise; nothing within `near_distance` of the centre blocks such rays.
    """
    expect(0 <= m < len(areas.members), "m", f"an area light, 0 to {len(areas.members) - 1}", m)
    mode = settings.visibility
    expect(mode in ("series", "step", "hard", "none"), "visibility", "'series', 'step', 'hard' or 'none'", mode)
    traced = settings.behind == "raytrace" and mode != "none"
    expect(not traced or tracer is not None, "tracer", "rays where behind is 'raytrace'", tracer)
    points = np.ascontiguousarray(points, maps.depth.dtype)
    facing = np.ascontiguousarray(facing, maps.depth.dtype)
    k = int(maps.map_of[m])
    if mode == "none" or k < 0:
        visible = np.ones(points.shape[1], points.dtype)
    elif mode == "hard" or areas.delta[m] == 0.0:
        visible = hard_visibility(maps, areas, m, points, facing)
    else:
        visible = _soft(maps, k, float(areas.delta[m]), points, facing, settings)
    if traced and tracer is not None:
        back = areas.normal[:, m] @ (points - areas.center[:, m, None]) <= 0
        near = settings.near_distance * float(areas.radius[m])
        visible[back] = _traced(tracer, areas, m, near, points[:, back], facing[:, back])
    return visible


def _soft(
    maps: ShadowMaps, k: int, delta: float, points: Array, facing: Array, settings: ValSettings
) -> Array:
    """Return V by the map ahead and, where there is one, the map behind: each sees its own hemisphere alone."""
    visible = np.ones(points.shape[1], points.dtype)
    chosen = choices(settings)
    for depth, near, behind in ((maps.depth, maps.near, False), (maps.behind, maps.near_behind, True)):
        if depth is None or near is None or not np.isfinite(near[k]):
            continue
        numbers, scale = numbers_of(maps, k, delta, settings, behind), scale_of(maps, k, settings, behind)
        if settings.visibility == "step":
            _step_tiles(numbers, chosen, rules(settings, scale), depth[k], points, facing, visible)
        else:
            weight = series(settings).weight.astype(points.dtype)
            _series_tiles(numbers, chosen, scale, weight, build(depth[k], scale, settings), points, visible)
    return visible


def _traced(tracer: "Tracer", areas: AreaLights, m: int, near: float, points: Array, facing: Array) -> Array:
    targets = rectangle_points(areas, m, np.array(np.meshgrid(BESIDE, BESIDE)).reshape(2, -1))
    ball = Ball(areas.center[:, m], near)
    return free_share(tracer, points, facing, targets, -areas.normal[:, m, None], None, tracer.grain, ball)



@kernel(parallel=True)
def _series_tiles(
    numbers: Array, chosen: Choices, scale: DepthScale, weight: Array, filters: Any, points: Array, visible: Array
) -> None:
    count, terms, real = points.shape[1], len(weight), points.dtype
    for tile in prange((count + TILE - 1) // TILE):
        first = np.int64(tile) * TILE
        size = min(TILE, count - first)
        wanted, todo = np.ones(TILE, np.bool_), np.empty(TILE, np.bool_)
        room, means = np.empty((ROOM_ROWS, TILE), real), np.empty((4 * terms + 1, TILE), real)
        part, here = points[:, first : first + size], np.empty(TILE, real)
        soft_tile(numbers, chosen, scale, weight, filters, part, size, wanted, todo, here, room, means)
        for i in range(size):
            visible[first + i] = min(visible[first + i], here[i])


@kernel(parallel=True)
def _step_tiles(
    numbers: Array, chosen: Choices, rule: Rules, depth: Array, points: Array, facing: Array, visible: Array
) -> None:
    count, real = points.shape[1], points.dtype
    for tile in prange((count + TILE - 1) // TILE):
        first = np.int64(tile) * TILE
        size = min(TILE, count - first)
        wanted, todo = np.ones(TILE, np.bool_), np.empty(TILE, np.bool_)
        room, here = np.empty((ROOM_ROWS, TILE), real), np.empty(TILE, real)
        if look(numbers, chosen, points[:, first : first + size], size, wanted, todo, here, room) > 0:
            step_lanes(numbers, chosen, rule, depth, facing[:, first : first + size], size, todo, here, room)
        for i in range(size):
            visible[first + i] = min(visible[first + i], here[i])
