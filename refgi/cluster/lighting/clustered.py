"""All pixel lights under the visibility of their area lights (Sec. 4): E(x) = sum_i E_i(x) V_C(i)(x).

Area light by area light, so that what is read of one shadow map stays near the processor: the light of its members,
then V where there is any. Diffuse lights under the map of the hemisphere ahead, the published case, go tile by tile;
everything else takes the longer way, by lists of receivers, to the same bits.
"""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import numba
import numpy as np
import numpy.typing as npt

from refgi.cluster.clustering.rectangle import AreaLights, Given
from refgi.cluster.lighting.area_sum import Tiles, add_hard, add_soft, add_unshadowed, bound_tiles
from refgi.cluster.lighting.interleave import (
    SUBSET,
    MemberLights,
    Subsets,
    add_members,
    dealt,
    member_lights,
    put,
    subsets,
    take,
)
from refgi.cluster.visibility.filtered import build, room_for
from refgi.cluster.visibility.look import choices, numbers_of, scale_of
from refgi.cluster.visibility.series import series
from refgi.cluster.visibility.visible import visibility
from refgi.errors import expect
from refgi.pairs.irradiance import Receivers, checked
from refgi.stages import report_progress, stage

if TYPE_CHECKING:
    from refgi.cluster.maps.shadow_maps import ShadowMaps
    from refgi.cluster.settings import ValSettings
    from refgi.lights import PixelLights
    from refgi.rays import Tracer

Array = npt.NDArray[Any]


@stage("cluster.irradiance")
def clustered_irradiance(
    receivers: Receivers, facing: Array, lights: "PixelLights", areas: AreaLights, maps: "ShadowMaps | None",
    settings: "ValSettings", footprint: Array | None = None, given: Given | None = None, interleaving: int = 1,
    rays: "Tracer | None" = None,
) -> Array:
    """Sum the irradiance of every pixel light under the visibility of its area light.

    Parameters
    ----------
    receivers : Receivers
        Points that are lit; their dtype is that of the result.
    facing : (3, h, w) ndarray
        Normals of the triangles that the points lie on.
    lights : PixelLights
        N lights.
    areas : AreaLights
        The area lights; `of` says which is whose.
    maps : ShadowMaps or None
        Their shadow maps; not read for visibility "none" or where V is given.
    settings : ValSettings
        How one light lights one receiver, and how visibility is found.
    footprint : (N,) ndarray, optional
        Surface area each light stands for, m^2; needed by the clamps "disc" and "sphere" alone.
    given : callable, optional
        V from elsewhere: (m, points (3, n), facing (3, n)) -> (n,).
    interleaving : int
        n: each pixel of n x n sums its own lights, n^2 times; 1: all.
    rays : Tracer, optional
        The scene's triangles, for points behind an area light; needed for ``behind == "raytrace"`` alone.

    Returns
    -------
    (3, h, w) ndarray
        Irradiance, W/m^2, linear RGB; 0 where there is no surface. Excludes the receiver's albedo/pi.

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
    packed = checked(receivers, lights, settings, footprint)
    parts = subsets(np.asarray(receivers.covered, np.bool_), interleaving)
    subset = dealt(areas.of, interleaving, settings.dealing)
    members = member_lights(packed, areas.of, len(areas.members), subset, interleaving**2)
    by_tiles = _goes_by_tiles(members, settings, given)
    tiles = _tiles(receivers, None if by_tiles and not _any_hard(areas, settings) else facing, parts)
    sums = np.zeros_like(tiles.position)
    if by_tiles:
        _add_by_tiles(tiles, members, areas, maps, settings, sums)
    else:
        _add_by_lists(tiles, parts, members, _visibility(areas, maps, settings, given, rays), sums)
    result = np.zeros(np.shape(receivers.position), sums.dtype)
    put(sums, parts, sums.dtype.type(interleaving**2), result.reshape(3, -1))
    return result


def _tiles(receivers: Receivers, facing: Array | None, parts: Subsets) -> Tiles:
    """Sort receivers into tiles; their triangles' normals, which hard tests alone ask for, only where given."""
    real = np.asarray(receivers.position).dtype
    planes = [np.empty((3, len(parts.places) if plane is not None else 0), real)
              for plane in (receivers.position, receivers.normal, facing)]
    for plane, values in zip((receivers.position, receivers.normal, facing), planes, strict=True):
        if plane is not None:
            take(np.ascontiguousarray(plane, real).reshape(3, -1), parts, values)
    position, normal, faces = planes
    low, high = np.empty((2, parts.tiles.shape[1], 6), real)
    tiles = Tiles(position, normal, faces, parts.tiles, low, high)
    bound_tiles(tiles)
    return tiles


def _goes_by_tiles(members: MemberLights, settings: "ValSettings", given: Given | None) -> bool:
    """Tell whether tiles can be lit and shadowed at once."""
    return (members.packed.spheres is None and members.packed.lobes is None and given is None
            and settings.visibility in ("series", "hard", "none") and settings.behind == "visible")


def _any_hard(areas: AreaLights, settings: "ValSettings") -> bool:
    """Tell whether any area light casts a hard shadow."""
    points = (areas.delta == 0) & (areas.members > 0)
    return settings.visibility == "hard" or (settings.visibility == "series" and bool(points.any()))


def _lit_tiles(tiles: Tiles, start: Array) -> Tiles:
    """Leave out tiles whose subset holds none of an area light's members."""
    lit = np.diff(start)[tiles.tiles[SUBSET]] > 0
    if lit.all():
        return tiles
    return tiles._replace(tiles=np.compress(lit, tiles.tiles, axis=1), low=tiles.low[lit], high=tiles.high[lit])


def _add_by_tiles(
    tiles: Tiles, members: MemberLights, areas: AreaLights, maps: "ShadowMaps | None", settings: "ValSettings",
    sums: Array,
) -> None:
    """Add every area light to receivers, tile by tile."""
    lights, clamp, sizes = members.packed.diffuse, members.packed.clamp, choices(settings)
    weight = series(settings).weight.astype(sums.dtype)
    shining = np.flatnonzero(members.start[:, 0] < members.start[:, -1])
    map_of = np.full(len(members.start), -1) if maps is None or settings.visibility == "none" else maps.map_of
    hard = (areas.delta == 0) | (settings.visibility == "hard")
    filters = _filtered(maps, map_of[shining[(map_of[shining] >= 0) & ~hard[shining]]], settings)
    for done, m in enumerate(shining):
        start, k = members.start[m], int(map_of[m])
        lit = _lit_tiles(tiles, start)
        if k < 0 or maps is None:
            add_unshadowed(lit, lights, clamp, start, sums)
        elif hard[m]:
            add_hard(lit, lights, clamp, start, maps.depth[k], maps.center[k], maps.frame[k], sums)
        else:
            numbers, scale = numbers_of(maps, k, float(areas.delta[m]), settings), scale_of(maps, k, settings)
            add_soft(lit, lights, clamp, start, numbers, sizes, scale, weight, next(filters), sums)
        report_progress((done + 1) / len(shining))


def _filtered(maps: "ShadowMaps | None", wanted: Array, settings: "ValSettings") -> Iterator[Any]:
    """Filter some maps in their order, a few ahead: one map is too little for more than one thread."""
    if maps is None or len(wanted) == 0:
        return
    known, workers = maps, numba.get_num_threads()

    rooms = [room_for(known.depth.shape[1], known.depth.dtype, settings) for _ in range(min(workers, len(wanted)))]

    def filtered(k: int, room: Any) -> Any:
        return build(known.depth[k], scale_of(known, k, settings), settings, room)

    with ThreadPoolExecutor(workers) as pool:
        for first in range(0, len(wanted), workers):  # what is filtered before is in use no more
            some = wanted[first : first + workers]
            yield from pool.map(filtered, some, rooms[: len(some)])


def _add_by_lists(
    tiles: Tiles, parts: Subsets, members: MemberLights, seen: Given, sums: Array
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
        lit = np.flatnonzero(part.any(axis=0))
        if len(lit):
            sums[:, lit] += part[:, lit] * np.asarray(seen(m, tiles.position[:, lit], tiles.facing[:, lit]), sums.dtype)
        report_progress((m + 1) / len(members.start))


def _visibility(
    areas: AreaLights, maps: "ShadowMaps | None", settings: "ValSettings", given: Given | None,
    rays: "Tracer | None",
) -> Given:
    """Return what tells V of an area light at some points."""
    if given is not None:
        return given

    def seen(m: int, points: Array, facing: Array) -> Array:
        if maps is None or settings.visibility == "none":
            return np.ones(points.shape[1], points.dtype)
        return visibility(maps, areas, m, points, facing, settings, rays)

    return seen
