"""All pixel lights under the visibility of their area lights (VAL Sec. 4): E(x) = sum_i E_i(x) V_C(i)(x).

Area light by area light, so that what is read of one shadow map stays near the processor. Diffuse lights under one map
go tile by tile in one kernel; other lights, and visibility found in Python, by lists of receivers, to the same bits.
Glossy receivers sum all lights, L_s(x) = sum_m V_m(x) sum_i f_s I_i cos / r^2: nothing is interleaved or blurred.
"""

from inspect import signature
from typing import TYPE_CHECKING

import numpy as np

from refgi.cluster.area_sum import ReceiverTiles, add_shadowed, add_unshadowed, bound_tiles, members_behind
from refgi.cluster.interleave import (
    SUBSET,
    MemberLights,
    Subsets,
    add_members,
    assigned_subsets,
    gather_pixels,
    member_lights,
    scatter_pixels,
    some_lights,
    subsets,
)
from refgi.cluster.rectangle import AreaLights, VisibilityFunction
from refgi.cluster.settings import BY_MAPS, Csm
from refgi.cluster.visibility.shadow import Shadows, filter_channels, shadows_of, visibility
from refgi.errors import expect
from refgi.pairs.irradiance import Receivers, as_receivers, block_order, checked, glossy_summed
from refgi.pairs.tiles import clear, receiving
from refgi.rsm.buffers.leaving import GlossyPoints
from refgi.skips import left_out
from refgi.stages import report_progress, stage, tally
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.cluster.maps import ShadowMaps
    from refgi.cluster.settings import ValSettings
    from refgi.lights import PixelLights
    from refgi.rays import Tracer

BEYOND_REACH = 1e15  # m: bounds of a tile that every light reaches


@stage("cluster.irradiance", steps="refgi.cluster.clustered_steps.irradiance_steps")
def clustered_irradiance(
    receivers: Receivers, facing: Array, lights: "PixelLights", areas: AreaLights, maps: "ShadowMaps | None",
    settings: "ValSettings", footprint: Array | None = None, visibility_of: VisibilityFunction | None = None,
    interleaving: int = 1, rays: "Tracer | None" = None, kept: Shadows | None = None,
) -> Array:
    """Sum the irradiance of every pixel light under the visibility of its area light.

    receivers: Receivers; their dtype is that of the result.
    facing (3, h, w): Normals of the triangles that the points lie on; the receivers' own array where nothing is
        interpolated.
    areas: The area lights; `of` says which is whose.
    maps: Their shadow maps; not read without visibility or where `visibility_of` is there.
    visibility_of: V from elsewhere, a `VisibilityFunction`: (m, points (3, n), facing (3, n)) -> (n,). One with a
        parameter `shading` is given the receivers' normals as well where they are not the faces'.
    interleaving: n: each pixel of n x n sums its own lights, n^2 times; 1: all.
    rays: The scene's triangles, for points behind an area light; needed for ``behind == "raytrace"`` alone.
    kept: The shadows of all area lights, where they are kept for other receivers (`kept_shadows`).
    -> (3, h, w): Irradiance, W/m^2, linear RGB; 0 where there is no surface. Excludes the receiver's albedo/pi.

    Raises
    ------
    InputError
        As `pairs.irradiance.irradiance`; if `areas` is not of these lights.

    Notes
    -----
    [Dong09] Sec. 4 prints Phi_i where Phi_i / pi is meant. V is found only where the members of an area light give
    light, and is 1 where nothing can occlude it. Area lights are added in their order.
    """
    expect(len(areas.of) == lights.position.shape[1], "areas.of", f"one place for each of {lights.position.shape[1]} "
           "lights", len(areas.of))
    expect(np.shape(facing) == np.shape(receivers.position), "facing", f"shape {np.shape(receivers.position)}",
           np.shape(facing))
    packed = checked(receivers, lights, settings.pairs, footprint)
    covered = np.asarray(receivers.covered, np.bool_)
    shown = receiving(covered)
    parts = subsets(shown, interleaving)
    subset = assigned_subsets(areas.of, interleaving, settings.interleaving.assignment)
    members = member_lights(packed, areas.of, len(areas.members), subset, interleaving**2)
    by_tiles = _goes_by_tiles(members, settings, visibility_of)
    reads_facing = not by_tiles or _reads_facing(areas, settings) or not left_out("cluster.facing", lambda: (
        len(parts.places), len(parts.places)))
    tiles = _tiles(receivers, facing if reads_facing else None, parts)
    tally("pairs", lambda: _pairs(parts, members))
    sums = np.zeros_like(tiles.position)
    if members.packed.spheres is None and members.packed.lobes is None:
        _cull(tiles, members)
    if by_tiles:
        _add_by_tiles(tiles, members, areas, maps, settings, kept, sums)
    else:
        visible_from = visibility_by(areas, maps, settings, visibility_of, rays)
        _add_by_lists(tiles, parts, members, visible_from, asks_shading(visible_from, receivers.normal, facing), sums)
    result = np.zeros(np.shape(receivers.position), sums.dtype)
    scatter_pixels(sums, parts, sums.dtype.type(interleaving**2), result.reshape(3, -1))
    clear(result, covered, shown)
    return result


def _pairs(parts: Subsets, members: MemberLights) -> int:
    """Return how many pairs of receiver and light of its subset there are."""
    lights = (np.diff(members.start) + np.diff(members.lobe_start)).sum(axis=0)
    return int((np.diff(parts.start) * lights).sum())


def _tiles(receivers: Receivers, facing: Array | None, parts: Subsets) -> ReceiverTiles:
    """Sort receivers into tiles; with their triangles' normals where a shadow reads them."""
    real = np.asarray(receivers.position).dtype
    planes = [np.empty((3, len(parts.places) if plane is not None else 0), real)
              for plane in (receivers.position, receivers.normal, facing)]
    for plane, values in zip((receivers.position, receivers.normal, facing), planes, strict=True):
        if plane is not None:
            gather_pixels(np.ascontiguousarray(plane, real).reshape(3, -1), parts, values)
    position, normal, faces = planes
    low, high = np.empty((2, parts.tiles.shape[1], 6), real)
    tiles = ReceiverTiles(position, normal, faces, parts.tiles, low, high)
    bound_tiles(tiles)
    return tiles


def _cull(tiles: ReceiverTiles, members: MemberLights) -> None:
    """Leave the bounds of tiles as they are; without the skip let every light reach all."""
    if not left_out("pairs.tiles", lambda: members_behind(tiles, members.packed.diffuse, members.start)):
        tiles.low[:], tiles.high[:] = -BEYOND_REACH, BEYOND_REACH


def _goes_by_tiles(members: MemberLights, settings: "ValSettings", visibility_of: VisibilityFunction | None) -> bool:
    """Return whether one kernel can light and shadow tiles."""
    return (members.packed.spheres is None and members.packed.lobes is None and visibility_of is None
            and (settings.visibility is None or isinstance(settings.visibility, BY_MAPS))
            and settings.maps.behind == "visible")


def _reads_facing(areas: AreaLights, settings: "ValSettings") -> bool:
    """Return whether any area light's shadow reads the normals of triangles: all but CSM do."""
    if settings.visibility is None or not isinstance(settings.visibility, Csm):
        return settings.visibility is not None
    return bool(((areas.delta == 0) & (areas.members > 0)).any())


def _with_lights(tiles: ReceiverTiles, start: Array) -> ReceiverTiles:
    """Leave out tiles whose subset holds none of an area light's members."""
    with_lights = np.diff(start)[tiles.tiles[SUBSET]] > 0
    if with_lights.all() or not left_out("cluster.subsets", lambda: (np.count_nonzero(~with_lights), len(with_lights))):
        return tiles
    return tiles._replace(tiles=np.compress(with_lights, tiles.tiles, axis=1), low=tiles.low[with_lights],
                          high=tiles.high[with_lights])


def _add_by_tiles(
    tiles: ReceiverTiles, members: MemberLights, areas: AreaLights, maps: "ShadowMaps | None", settings: "ValSettings",
    kept: Shadows | None, sums: Array,
) -> None:
    """Add every area light to receivers, tile by tile."""
    lights, clamp = members.packed.diffuse, members.packed.clamp
    shining = np.flatnonzero(members.start[:, 0] < members.start[:, -1])
    shadows = shadows_of(maps, areas, shining, settings) if kept is None else ((m, kept[m]) for m in map(int, shining))
    for done, (m, shadow) in enumerate(shadows):
        start = members.start[m]
        if shadow is None:
            add_unshadowed(_with_lights(tiles, start), lights, clamp, start, sums)
        else:
            add_shadowed(_with_lights(tiles, start), lights, clamp, start, shadow, filter_channels(shadow), sums)
        report_progress((done + 1) / len(shining))


def _add_by_lists(
    tiles: ReceiverTiles, parts: Subsets, members: MemberLights, visibility_of: VisibilityFunction,
    shading: bool, sums: Array
) -> None:
    """Add every area light to receivers: the light of its members first, then V where there is any."""
    packed = members.packed
    diffuse_alone = packed.spheres is None and packed.lobes is None
    for m, start in enumerate(members.start):
        part = np.zeros_like(sums)
        if diffuse_alone:
            add_unshadowed(tiles, packed.diffuse, packed.clamp, start, part)
        else:
            add_members(tiles.position, tiles.normal, parts, members, m, part)
        _add_visible(part, visibility_of, m, tiles.position, tiles.facing, tiles.normal if shading else None, sums)
        report_progress((m + 1) / len(members.start))


def asks_shading(visibility_of: VisibilityFunction, normal: Array, facing: Array) -> bool:
    """Return whether V asks for the normals of cosines, and these are not the faces' own array (`facing_normals`)."""
    return not np.may_share_memory(normal, facing) and "shading" in signature(visibility_of).parameters


def _add_visible(
    part: Array, visibility_of: VisibilityFunction, m: int, position: Array, facing: Array, shading: Array | None,
    sums: Array,
) -> None:
    """Add the light (3, n) of area light m under its V, which is found where there is any; without the skip at all."""
    with_light = np.asarray(part.any(axis=0))
    skips = left_out("cluster.receivers", lambda: (len(with_light) - np.count_nonzero(with_light), len(with_light)))
    places = np.flatnonzero(with_light) if skips else np.arange(len(with_light))
    if len(places):
        beside = {} if shading is None else {"shading": shading[:, places]}
        visible = visibility_of(m, position[:, places], facing[:, places], **beside)
        # Sec. 4: sum_m V_m L_m
        sums[:, places] += part[:, places] * np.asarray(visible, sums.dtype)


def visibility_by(
    areas: AreaLights, maps: "ShadowMaps | None", settings: "ValSettings", visibility_of: VisibilityFunction | None,
    rays: "Tracer | None",
) -> VisibilityFunction:
    """Return the function that finds V of an area light at some points."""
    if visibility_of is not None:
        return visibility_of

    def by_maps(m: int, points: Array, facing: Array, shading: Array | None = None) -> Array:
        if maps is None or settings.visibility is None:
            return np.ones(points.shape[1], points.dtype)
        return visibility(maps, areas, m, points, facing, settings, rays, shading)

    return by_maps


@stage("cluster.glossy")
def clustered_radiance(
    points: GlossyPoints, facing: Array, lights: "PixelLights", areas: AreaLights, maps: "ShadowMaps | None",
    settings: "ValSettings", footprint: Array | None = None, visibility_of: VisibilityFunction | None = None,
    rays: "Tracer | None" = None, width: int = 0,
) -> Array:
    """Sum the radiance that lobes make of every pixel light under the visibility of its area light.

    points: The n receivers; their dtype is that of the result.
    facing (3, n): Normals of the triangles that the points lie on; the points' own array where nothing is interpolated.
    areas: The area lights; `of` says which is whose.
    maps: Their shadow maps; not read without visibility or where `visibility_of` is there.
    visibility_of: As for `clustered_irradiance`.
    rays: As for `clustered_irradiance`.
    width: Of the picture that the points are pixels of; 0: neighbours follow each other already.
    -> (3, n): W/m^2/sr, linear RGB.

    Raises
    ------
    InputError
        As `clustered_irradiance`.
    """
    expect(len(areas.of) == lights.position.shape[1], "areas.of", f"one place for each of {lights.position.shape[1]} "
           "lights", len(areas.of))
    packed = checked(as_receivers(points), lights, settings.pairs, footprint)
    members = member_lights(packed, areas.of, len(areas.members), np.zeros(len(areas.of), np.int64), 1)
    visible_from = visibility_by(areas, maps, settings, visibility_of, rays)
    order = np.arange(len(points.pixel)) if width == 0 else block_order(points.pixel, width)
    here = GlossyPoints(*(np.ascontiguousarray(plane[..., order]) for plane in points))
    faces = np.ascontiguousarray(facing[:, order], here.position.dtype)
    sums, shading = np.zeros_like(here.position), asks_shading(visible_from, points.normal, facing)
    for m, (start, lobe_start) in enumerate(zip(members.start, members.lobe_start, strict=True)):
        some = some_lights(members.packed, start, lobe_start)
        if some.diffuse.shape[1] > 1 or some.lobes is not None:
            part = glossy_summed(here, some, (None, None))
            _add_visible(part, visible_from, m, here.position, faces, here.normal if shading else None, sums)
        report_progress((m + 1) / len(members.start))
    result = np.empty_like(sums)
    result[:, order] = sums
    return result
