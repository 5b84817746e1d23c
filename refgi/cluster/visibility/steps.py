"""Visibility of all area lights at all pixels by their maps, one step after the other (VAL Sec. 4.1, 4.2).

Regions are discs of a map's units, [-1, 1]. What is not asked for is 0, V of it 1.

- depth (area light, row, column): Distances to the nearest blocker, m.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from refgi.cluster.maps import ShadowMaps
from refgi.cluster.visibility.pcf import casters_of, pcf_shadow, pcf_tile
from refgi.cluster.visibility.pcss import BlockerTest, PcssShadow, filter_texels, find_blockers
from refgi.cluster.visibility.search_region import (
    DEPTH,
    RADIUS,
    SCRATCH_ROWS,
    D,
    FilterSizing,
    S,
    Scratch,
    Series,
    find_search_regions,
    light_constants,
)
from refgi.stages import stage
from refgi.types import Array


class Places(NamedTuple):
    """Pixels, and the maps they are looked up on."""

    position: Array  # (3, h, w) m
    covered: Array  # (h, w) bool: whether there is a surface
    center: Array  # (area light, 3) m
    frame: Array  # (area light, right down forward, 3) unit vectors
    delta: Array  # (area light,) m: its size; 0: a point
    near: Array  # (area light,) m: least distance on its map; inf on an empty one


class Lane(NamedTuple):
    """One area light and all pixels, as kernels take them."""

    k: int
    pixels: int
    scratch: Scratch
    visible: Array  # (pixels,)
    constants: Array


def lanes(places: Places, sizing: FilterSizing, channels: int = 0, chain: Series | None = None) -> Iterator[Lane]:
    """Return the area lights that have an extent and something on their map, with each pixel's search region."""
    delta, real, points = places.delta, places.position.dtype, _flat(places.position)
    maps = maps_of(places, np.zeros((len(delta), 0, 0), real))
    for k in np.flatnonzero(np.isfinite(places.near) & (delta > 0)):
        count = points.shape[1]
        scratch = Scratch(np.zeros(count, np.bool_), np.zeros((SCRATCH_ROWS, count), real),
                          np.zeros((channels, count), real))
        lane = Lane(int(k), count, scratch, np.ones(count, real), light_constants(maps, int(k), float(delta[k]), chain))
        find_search_regions(lane.constants, sizing, points, count, places.covered.reshape(-1).copy(), scratch.pending,
                            lane.visible, scratch.rows)
        yield lane


def maps_of(places: Places, depth: Array) -> ShadowMaps:
    """Return maps as kernels take them, one an area light."""
    near = np.asarray(places.near, np.float64)
    center, frame = (np.ascontiguousarray(one, np.float64) for one in (places.center, places.frame))
    return ShadowMaps(depth, np.where(np.isfinite(near), np.arange(len(near)), -1), center, frame, near, near, near)


def planes(places: Places, *axes: int, fill: Any = 0, kind: Any = None) -> Array:
    """Return an array (area light, *axes, h, w)."""
    return np.full((len(places.delta), *axes, *places.covered.shape), fill,
                   places.position.dtype if kind is None else kind)


def put(out: Array, k: int, values: Array, flags: Array) -> None:
    """Set an area light's values, (..., n), where flags (n,) are set."""
    here = out[k].reshape(*values.shape[:-1], -1)
    here[..., flags] = values[..., flags]


@stage("cluster.search", kept=False)
def search(
    places: Places, solid_angle: bool, squares: bool, foreshortened: bool, axial: bool
) -> tuple[Array, Array, Array]:
    """Find each pixel's search disc: tan a = Delta (d - near) / (2 d near) (VAL Sec. 4.2, E-VAL-08, 09).

    solid_angle: Blockers half-way, as printed.
    squares: Squares of side alpha / pi, as printed.
    foreshortened: Delta as the pixel sees it.
    axial: All directions in which a blocker at the nearest distance may lie.
    -> pending (area light, h, w) bool: Whether the pixel lies before the light's plane and farther than the nearest
        distance; no others are shadowed.
    -> region (area light, s t radius, h, w): Disc of the map, [-1, 1] units; 0 where none.
    -> distance (area light, h, w): d, from the map's centre, m; 0 where not pending.
    """
    pending, region, distance = planes(places, kind=np.bool_), planes(places, 3), planes(places)
    for lane in lanes(places, FilterSizing(False, squares, solid_angle, foreshortened, axial)):
        flags, rows = lane.scratch.pending, lane.scratch.rows
        put(pending, lane.k, flags, flags)
        put(region, lane.k, rows[S : RADIUS + 1], flags)
        put(distance, lane.k, rows[D], flags)
    return pending, region, distance


@stage("cluster.depth_tests", kept=False)
def depth_tests(places: Places, facing: Array, depth: Array, texels: int, points_only: bool) -> Array:
    """Find the share of texels around a pixel's own that do not hide it (E-VAL-14; docs/methods/val_visibility).

    texels: Side of the square of texels; 1 for lights without extent.
    points_only: Whether area lights with an extent are left out, V being 1.
    -> (area light, h, w): V, 0 hidden to 1 seen; 1 behind the light's plane, on empty maps, without surface.
    """
    maps, made = maps_of(places, depth), planes(places, fill=1)
    points, normals, covered = _flat(places.position), _flat(facing), places.covered.reshape(-1)
    for k in np.flatnonzero(maps.map_of >= 0):
        if places.delta[k] == 0 or not points_only:
            shadow = pcf_shadow(maps, int(k), texels if places.delta[k] > 0 else 1)
            pcf_tile(shadow, points, normals, len(covered), covered.copy(), made[k].reshape(-1), None)
    return made


@stage("cluster.pcss_penumbra", kept=False)
def pcss_penumbra(
    places: Places, facing: Array, depth: Array, pending: Array, region: Array, alpha: bool, squares: bool,
    foreshortened: bool, axial: bool, cone: bool,
) -> tuple[Array, Array, Array]:
    """Average the blockers before the pixel's plane, in the cone to the light; size the penumbra (E-VAL-14).

    pending (area light, h, w) bool: Who searches.
    region (area light, s t radius, h, w): In which disc.
    alpha: The angle of the penumbra as printed.
    squares, foreshortened, axial: As for the search.
    cone: Blockers within the cone from the pixel to the light alone.
    -> shaded (area light, h, w) bool: Whether there are blockers; V is 1 elsewhere.
    -> z_avg (area light, h, w): Mean distance of the blockers, m; 0 where not shaded.
    -> region (area light, s t radius, h, w): Disc of the penumbra, [-1, 1] units; 0 where none.
    """
    shaded, z_avg, final = planes(places, kind=np.bool_), planes(places), planes(places, 3)
    sizing, normals = FilterSizing(alpha, squares, False, foreshortened, axial), _flat(facing)
    for lane in lanes(places, sizing):
        flags, rows = lane.scratch.pending, lane.scratch.rows
        flags[:] = pending[lane.k].reshape(-1)
        rows[S : RADIUS + 1] = region[lane.k].reshape(3, -1)
        shadow = PcssShadow(lane.constants, sizing, BlockerTest(True, cone, 1.0, 0.0), depth[lane.k],
                            casters_of(depth[lane.k]))
        find_blockers(shadow, normals, lane.pixels, flags, rows)
        put_penumbra(lane, shaded, z_avg, final)
    return shaded, z_avg, final


def put_penumbra(lane: Lane, shaded: Array, z_avg: Array, region: Array) -> None:
    """Set what the search of an area light found."""
    flags, rows = lane.scratch.pending, lane.scratch.rows
    put(shaded, lane.k, flags, flags)
    put(z_avg, lane.k, rows[DEPTH], flags)
    put(region, lane.k, rows[S : RADIUS + 1], flags)


@stage("cluster.pcss", kept=False)
def pcss(
    places: Places, facing: Array, depth: Array, shaded: Array, region: Array, hard: Array | None
) -> Array:
    """Find the share of the texels of the penumbra's disc that do not hide the pixel, where shaded (E-VAL-14).

    shaded (area light, h, w) bool: Whether there are blockers.
    region (area light, s t radius, h, w): Disc of the penumbra.
    hard (area light, h, w): V of area lights without extent, where there are some.
    -> (area light, h, w): V, 0 hidden to 1 seen; 1 behind the light's plane, on empty maps, without surface.
    """
    made = planes(places, fill=1) if hard is None else np.array(hard)
    sizing, normals = FilterSizing(False, False, False, False, False), _flat(facing)
    for lane in lanes(places, sizing):
        flags, rows = shaded[lane.k].reshape(-1), lane.scratch.rows
        rows[S : RADIUS + 1] = region[lane.k].reshape(3, -1)
        shadow = PcssShadow(lane.constants, sizing, BlockerTest(True, False, 1.0, 0.0), depth[lane.k],
                            casters_of(depth[lane.k]))
        filter_texels(shadow, normals, lane.pixels, flags, lane.visible, rows)
        made[lane.k].reshape(-1)[flags] = lane.visible[flags]
    return made


@stage("cluster.of_both", kept=False)
def of_both(ahead: Array, behind: Array) -> Array:
    """Take V of the map ahead and of that of the hemisphere behind: the less of both (VAL Sec. 4.2, E-VAL-12).

    ahead, behind (area light, h, w): V by either map, 1 outside of its hemisphere.
    -> (area light, h, w): V, 0 hidden to 1 seen.
    """
    return np.minimum(ahead, behind)


def _flat(planes: Array) -> Array:
    return np.ascontiguousarray(planes.reshape(3, -1))
