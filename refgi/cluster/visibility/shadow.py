"""The shadow of area lights as kernels read it, PCF, PCSS or CSM; its visibility at any points (Sec. 4.1, 5.1).

One pass over all receivers filters few maps at a time, while they are in the cache. Receivers that come in lists would
filter every map again for each: their filtered maps are kept, as far as they fit into `MOST_KEPT`.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from refgi.cluster.filters.prefilter import allocate_mips, build_filters, build_several
from refgi.cluster.maps import ShadowMaps
from refgi.cluster.rectangle import AreaLights
from refgi.cluster.reference import Ball, free_share, rectangle_points
from refgi.cluster.settings import BY_MAPS, ConstantBias, Csm, Hard, Pcf, Pcss, ValSettings
from refgi.cluster.visibility.csm import CsmShadow, csm_tile
from refgi.cluster.visibility.pcf import PcfShadow, casters_of, pcf_shadow, pcf_tile
from refgi.cluster.visibility.pcss import PcssShadow, blocker_test, pcss_tile
from refgi.cluster.visibility.search_region import (
    SCRATCH_ROWS,
    Scratch,
    filter_sizing,
    light_constants,
    scale_of,
    series,
)
from refgi.errors import expect
from refgi.jit import by_type, kernel, prange, thread_count
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.cluster.settings import ValSettings
    from refgi.rays import Tracer

TILES: dict[Any, Any] = {PcfShadow: pcf_tile, PcssShadow: pcss_tile, CsmShadow: csm_tile}


def shadow_of(
    maps: ShadowMaps, areas: AreaLights, m: int, settings: "ValSettings", behind: bool = False, filters: Any = None
) -> Any:
    """Return the shadow of area light m, by its map ahead or `behind`; hard where the light has no extent."""
    k, delta, kind = int(maps.map_of[m]), float(areas.delta[m]), settings.visibility
    if isinstance(kind, Hard) or delta == 0.0:
        return pcf_shadow(maps, k, 1, behind)
    if isinstance(kind, Pcf):
        return pcf_shadow(maps, k, kind.texels, behind)
    depth, sizing = (maps.behind if behind else maps.depth), filter_sizing(settings)
    assert depth is not None
    if isinstance(kind, Pcss):
        bias = kind.constant_bias or ConstantBias()
        scale = scale_of(maps, k, bias.scale, series(Csm(bias=bias.value)), behind)
        return PcssShadow(light_constants(maps, k, delta, None, behind), sizing, blocker_test(kind, scale), depth[k],
                          casters_of(depth[k]))
    assert isinstance(kind, Csm)
    chain = series(kind)
    scale = scale_of(maps, k, kind.depth_scale, chain, behind)
    if filters is None:
        filters = build_filters(depth[k], scale, kind, "val_alpha_over_pi" in settings.as_published)
    constants = light_constants(maps, k, delta, chain, behind)
    return CsmShadow(constants, sizing, scale, chain.weight.astype(depth.dtype), filters)


def filter_channels(shadow: Any) -> int:
    """Return how many channels of a filtered map a shadow reads."""
    return 4 * len(shadow.weight) + 1 if isinstance(shadow, CsmShadow) else 0


def shadow_tile(
    shadow: Any, points: Array, facing: Array, size: int, active: Array, visible: Array, scratch: Any
) -> None:
    """Fill V, 0 to 1, of the active ones of `size` receivers; `active` and `scratch` are overwritten.

    Points and the normals of their surfaces are (>= 3, >= size), world space, m; normals may be empty for CSM.
    """
    TILES[type(shadow)](shadow, points, facing, size, active, visible, scratch)


@by_type(shadow_tile)
def _by_type(
    shadow: Any, points: Any, facing: Any, size: Any, active: Any, visible: Any, scratch: Any  # noqa: ARG001
) -> Any:
    tile = TILES[shadow.instance_class]

    def call(shadow: Any, points: Any, facing: Any, size: Any, active: Any, visible: Any, scratch: Any) -> None:
        tile(shadow, points, facing, size, active, visible, scratch)

    return call


TILE = 256  # receivers a thread works on at once
BESIDE = (np.arange(4) + 0.5) / 4  # points along a side of the rectangle that rays from behind end at


@stage("cluster.visibility", kept=False)
def visibility(
    maps: ShadowMaps, areas: AreaLights, m: int, points: Array, facing: Array, settings: ValSettings,
    tracer: "Tracer | None" = None, shading: Array | None = None,
) -> Array:
    """Return how much of one area light each point sees.

    areas: The area lights that the maps were drawn for.
    m: Which area light.
    points (3, n): World space, m.
    facing (3, n): Normals of their faces; on the lit side for rays, else on either.
    settings: `visibility` is one of `BY_MAPS` or None; `maps.behind` says what points behind the area light see.
    tracer: Rays against the scene, for points behind the area light and ``maps.behind == "raytrace"``.
    shading (3, n): Normals that cosines are taken with, for the same; the faces' where absent.
    -> (n,): V, 0 to 1, in the dtype of the maps.

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
    kind = settings.visibility
    expect(kind is None or isinstance(kind, BY_MAPS), "visibility", "none, csm, pcss, pcf or hard",
           kind and kind.name())
    traced = settings.maps.behind == "raytrace" and kind is not None
    expect(not traced or tracer is not None, "tracer", "rays where behind is 'raytrace'", tracer)
    points = np.ascontiguousarray(points, maps.depth.dtype)
    facing = np.ascontiguousarray(facing, maps.depth.dtype)
    visible, k = np.ones(points.shape[1], points.dtype), int(maps.map_of[m])
    if kind is not None and k >= 0:  # the maps ahead and behind: each sees its own hemisphere alone
        for near, behind in ((maps.near, False), (maps.near_behind, True)):
            if near is not None and np.isfinite(near[k]):
                shadow = shadow_of(maps, areas, m, settings, behind)
                _shadow_tiles(shadow, filter_channels(shadow), points, facing, visible)
    if traced and tracer is not None:
        back = areas.normal[:, m] @ (points - areas.center[:, m, None]) <= 0
        radius = settings.drawn_maps.near_share * float(areas.radius[m])
        visible[back] = _by_rays(tracer, areas, m, radius, points[:, back], facing[:, back],
                                 None if shading is None else shading[:, back])
    return visible


def _by_rays(tracer: "Tracer", areas: AreaLights, m: int, radius: float, points: Array, facing: Array,
             shading: Array | None) -> Array:
    targets = rectangle_points(areas, m, np.array(np.meshgrid(BESIDE, BESIDE)).reshape(2, -1))
    ball = Ball(areas.center[:, m], radius)
    return free_share(tracer, points, facing, targets, -areas.normal[:, m, None], None, tracer.grain, ball, shading)


@kernel(parallel=True)
def _shadow_tiles(shadow: Any, channels: int, points: Array, facing: Array, visible: Array) -> None:
    """Lower `visible` to V where that is less."""
    count, real = points.shape[1], points.dtype
    for tile in prange((count + TILE - 1) // TILE):
        first = np.int64(tile) * TILE
        size = min(TILE, count - first)
        active, here = np.ones(TILE, np.bool_), np.empty(TILE, real)
        scratch = Scratch(np.empty(TILE, np.bool_), np.empty((SCRATCH_ROWS, TILE), real),
                          np.empty((channels, TILE), real))
        part, normals = points[:, first : first + size], facing[:, first : first + size]
        shadow_tile(shadow, part, normals, size, active, here, scratch)
        for i in range(size):
            visible[first + i] = min(visible[first + i], here[i])


MOST_KEPT = 1 << 23  # texels of all maps whose filters are kept: some 240 MB of four terms in float32

Shadows = dict[int, Any]  # by area light; None for one that nothing occludes


def kept_shadows(areas: AreaLights, maps: "ShadowMaps | None", settings: "ValSettings") -> Shadows | None:
    """Return the shadows of all area lights; None where maps are not read by kernels, or are too many to keep."""
    if not isinstance(settings.visibility, BY_MAPS) or (maps is not None and maps.depth.size > MOST_KEPT):
        return None
    every = np.flatnonzero(areas.members > 0)
    return dict(shadows_of(maps, areas, every, settings, len(every)))


def shadows_of(
    maps: "ShadowMaps | None", areas: AreaLights, chosen: Array, settings: "ValSettings", at_once: int | None = None
) -> Iterator[tuple[int, Any]]:
    """Return some area lights with their shadows, None where nothing occludes; `at_once` maps are filtered together."""
    map_of = np.full(len(areas.delta), -1) if maps is None or settings.visibility is None else maps.map_of
    filtered = (map_of >= 0) & (areas.delta != 0) & isinstance(settings.visibility, Csm)
    filters = _filters(maps, map_of[chosen[filtered[chosen]]], settings, at_once or thread_count())
    for m in chosen:
        if maps is None or map_of[m] < 0:
            yield m, None
        else:
            yield m, shadow_of(maps, areas, m, settings, filters=next(filters) if filtered[m] else None)


def _filters(maps: "ShadowMaps | None", chosen: Array, settings: "ValSettings", at_once: int) -> Iterator[Any]:
    """Filter some maps in their order, one for each thread at a time: all at once would leave the cache."""
    if maps is None or len(chosen) == 0:
        return
    csm, box = settings.visibility, "val_alpha_over_pi" in settings.as_published
    assert isinstance(csm, Csm)
    depth, scratch = maps.depth, None
    if csm.prefilter == "mip":
        scratch = allocate_mips(min(at_once, len(chosen)), depth.shape[1], depth.dtype, csm)
    for first in range(0, len(chosen), at_once):  # what was filtered before is no longer in use
        some = chosen[first : first + at_once]
        scales = [scale_of(maps, k, csm.depth_scale, series(csm)) for k in some]
        yield from build_several(depth[some], scales, csm, box, scratch)
