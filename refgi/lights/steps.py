"""Pixel lights one step after the other: points, texels, lights, the surface that each stands for (SII Sec. 3.1)."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from refgi.lights.importance import importance as importance_of
from refgi.lights.pixel_lights import Drawn, MapPlanes, gathered_lights
from refgi.lights.shares import Pattern, areas_of, cell_sums, cells_of_grid, cells_of_nearest, map_shares
from refgi.lights.warp import Warp, _clamped_to_texel, texel_of, warp_stacked
from refgi.rsm.buffers.gbuffer import values_at
from refgi.rsm.buffers.reflective import Rsm
from refgi.rsm.raster.projection import Projection
from refgi.sampling import PIXEL_LIGHTS, draws, grid, halton
from refgi.scene.light import lamp_of
from refgi.stages import stage
from refgi.types import Array

Lobes = Sequence[Array | None] | None

NAMES = ("position", "normal", "flux", "lobe_flux", "lobe_axis", "lobe_exponent", "texel", "map_index")
BELOW_1 = 1.0 - 2.0**-24  # the largest float32 below 1


@stage("lights.halton_points", kept=False, each="lamp")
def halton_points(counts: tuple[int, ...], shifts: Array, number: int) -> Array:
    """Compute the Halton points of a map in bases 2 and 3 from index 0 (SII Sec. 3.1).

    counts: Points of each map.
    shifts (maps, uv): What is added to the points of each map, modulo 1.
    number: Which map.
    -> (point, uv): Points of the unit square in [0, 1): u along columns, v along rows downwards.
    """
    return np.minimum(halton(counts[number], shift=shifts[number].tolist()), BELOW_1)


@stage("lights.grid_points", kept=False, each="lamp")
def grid_points(n: int, maps: int, rows: int) -> Array:
    """Compute the centres of n x n cells of each map, row by row (SII Sec. 3.1).

    n: Cells along a side.
    maps: How many are stacked along rows.
    rows: Texels along a column of one map.
    -> (point, uv): Points of the unit square in [0, 1): u along columns, v along rows downwards.
    """
    one = grid(n)
    if maps == 1:
        return one
    return np.concatenate([np.stack([one[:, 0], _clamped_to_texel((k + one[:, 1]) * rows, maps * rows)], axis=1)
                           for k in range(maps)])


@stage("lights.texels", kept=False, each="lamp")
def texels(
    points: Array, counts: tuple[int, ...], number: int, maps: int, rows: int, columns: int,
    density_weight: Array | None = None, gain: float = 1.0, renormalise: bool = False,
) -> tuple[Array, Array]:
    """Find the texel that each point falls on, and T/N w (SII Sec. 3.1).

    points (point, uv): Points of the unit square.
    counts: Lights of each map.
    number: Which map.
    maps, rows, columns: Stacked maps of rows and columns.
    density_weight (point,): Weight w of the warp.
    gain: What lights carry beside T/N where lamps are drawn.
    renormalise: Scale w to a sum of N.
    -> texel (light,) int64: Row * columns + column over the stacked maps.
    -> weight (light,): T/N times the weight of the warp: how many texels a light stands for.
    """
    height, count = maps * rows, counts[number]
    at = texel_of(points[:, 1], height) * columns + texel_of(points[:, 0], columns)
    own = np.ones(len(points), points.dtype) if density_weight is None else density_weight
    if renormalise:
        own = own * (count / own.sum())
    return at, height * columns / count * gain * own


@stage("lights.every_texel", kept=False, each="lamp")
def every_texel(count: int) -> tuple[Array, Array]:
    """List all texels of a map as lights (SII Sec. 3.1).

    count: Texels.
    -> texel (light,) int64: Row * columns + column over the stacked maps.
    -> weight (light,): 1: each stands for itself.
    """
    return np.arange(count), np.ones(count)


@stage("lights.cells", kept=False, each="lamp")
def cells(texel: Array, maps: int, rows: int, columns: int, on_grid: bool) -> Array:
    """Find the light that carries the flux of each texel (SII Sec. 4).

    texel (light,) int64: Texels of the lights.
    maps, rows, columns: Stacked maps of rows and columns.
    on_grid: By cells of a grid; else by the nearest light.
    -> (texels,) int64: Index of a light for each texel of the flattened map.
    """
    view = Projection(0, rows, columns, np.zeros((maps, 3)), np.zeros((maps, 3, 3)), np.ones(2), math.inf)
    return cells_of_grid(view, len(texel)) if on_grid else cells_of_nearest(view, texel)


@stage("lights.pixel_lights", kept=False)
def pixel_lights(
    texel: Sequence[Array], weight: Sequence[Array], position: Sequence[Array], normal: Sequence[Array],
    flux: Sequence[Array], lobe_flux: Lobes = None, lobe_axis: Lobes = None, lobe_exponent: Lobes = None,
    cell: Sequence[Array | None] = (), gain: tuple[float, ...] = (),
) -> tuple[Array | None, ...]:
    """Make lights of texels with flux; those without are dropped (SII Sec. 3.1).

    texel, weight sequence of (light,): Texels of each map and T/N w.
    position sequence of (3, h, w): Surface points of each map, m.
    normal sequence of (3, h, w): Their unit normals.
    flux sequence of (3, h, w): Flux of the diffuse part, W.
    lobe_flux sequence of (3, h, w): Flux of the lobe, W.
    lobe_axis sequence of (3, h, w): Its axis, unit vectors.
    lobe_exponent sequence of (h, w): Its Phong exponent.
    cell sequence of (texels,): Light that carries the flux of each texel.
    gain: With cells, what lights of a map carry beside that.
    -> position (3, light): Places of the lights, m.
    -> normal (3, light): Unit normals of their surfaces.
    -> flux (3, light): Diffuse flux, W, T/N w included: Phi_i = T/N w Phi_t.
    -> lobe_flux (3, light): Flux of the lobe, W, T/N w included; absent without glossy materials.
    -> lobe_axis (3, light): Axis of the lobe, unit vectors.
    -> lobe_exponent (light,): Phong exponent of the lobe.
    -> texel (light,) int32: Each light's texel.
    -> map_index (light,) int32: Each light's map.
    """
    lobes = ([None] * len(texel) if one is None else one for one in (lobe_flux, lobe_axis, lobe_exponent))
    maps = list(map(MapPlanes, position, normal, flux, *lobes))
    drawn = [Drawn(at, w, cell[k] if cell else None, gain[k] if gain else 1.0)
             for k, (at, w) in enumerate(zip(texel, weight, strict=True))]
    lights = gathered_lights(maps, drawn)
    return tuple(getattr(lights, name) for name in NAMES)


@stage("lights.footprints", kept=False)
def footprints(
    position: Array, normal: Array, texel: Array, number: Array, solid_angle: Sequence[Array], drawn: Sequence[Array],
    weight: Sequence[Array], lamp: Sequence[Array], near: tuple[bool, ...],
) -> Array:
    """Compute the surface that each light stands for (docs/methods/sii_sum).

    position (3, light): Places of the lights, m.
    normal (3, light): Unit normals of their surfaces.
    texel, number (light,) int32: Each light's texel and map.
    solid_angle sequence of (h, w): Solid angles of each map's texels, sr; of a directional lamp areas across the light,
        m^2.
    drawn, weight sequence of (light,): Texels drawn from each map and T/N w.
    lamp sequence of (3,): Places of the lamps, m; where one is not near its direction.
    near: Whether each lamp has a place.
    -> (light,): Area Omega d^2 / cos of the light's texel, times T/N w, m^2.
    """
    area = np.zeros(len(texel), position.dtype)
    for k, angles in enumerate(solid_angle):
        here = number == k
        at, order = texel[here], np.argsort(drawn[k], kind="stable")
        first = order[np.minimum(np.searchsorted(drawn[k], at, sorter=order), max(len(order) - 1, 0))]
        own = areas_of(position[:, here], normal[:, here], values_at(angles, at), np.ones((3, len(at))), None,
                       np.asarray(lamp[k], np.float64), not near[k])
        area[here] = own * weight[k][first]
    return area


@stage("lights.cell_areas", kept=False)
def cell_areas(
    position: Array, normal: Array, solid_angle: Array, flux: Array, lobe_flux: Array | None, cell: Array, lights: int,
    lamp: Array, near: bool,
) -> Array:
    """Sum the surface of each light's cell that reflects (SII Sec. 4).

    position (3, h, w): Surface points of a map, m.
    solid_angle (h, w): Solid angles of its texels, sr; of a directional lamp areas across the light, m^2.
    flux, lobe_flux (3, h, w): Flux of the diffuse part and of the lobe, W.
    cell (texels,) int64: Light that carries the flux of each texel.
    lights: How many are drawn from the map.
    lamp (3,): Place of the lamp, m; where it is not near its direction.
    near: Whether the lamp has a place.
    -> (light,): Area, m^2, of those lights that have any.
    """
    points, normals, fluxes = (one.reshape(3, -1) for one in (position, normal, flux))
    lobes = None if lobe_flux is None else lobe_flux.reshape(3, -1)
    areas = areas_of(points, normals, solid_angle.reshape(-1), fluxes, lobes, np.asarray(lamp, np.float64), not near)
    (area,) = cell_sums(areas[None], cell, lights)
    return np.asarray(area[area != 0])


def draw_steps(
    rsms: Sequence[Rsm], *, count: int | None, pattern: Pattern, seed: int = 0, filtered: bool = False,
    warp: Warp | None = None, importance: Sequence[Array] | None = None, renormalise: bool = False,
) -> dict[str, Array]:
    """Return texels, weights and cells of each map, as `draw_texels` does, by steps."""
    shares = map_shares(rsms, count, pattern, seed)
    counts = tuple(one.drawn for one in shares)
    shifts = np.stack([np.zeros(2) if seed == 0 and one.place == 0 else draws(seed, PIXEL_LIGHTS, 2, one.place)
                       for one in shares])
    made = dict[str, Array]()
    for number, (rsm, share) in enumerate(zip(rsms, shares, strict=True)):
        maps, rows, columns = rsm.projection.maps, rsm.projection.height, rsm.projection.width
        if share.drawn == 0:
            continue
        if pattern == "all":
            texel, weight = every_texel(rsm.texels)
        else:
            points, own = _points(pattern, counts, shifts, number, (maps, rows), draws(
                seed, PIXEL_LIGHTS, 2 * share.drawn, share.place).reshape(-1, 2)), None
            if warp is not None:
                given = importance_of(rsm) if importance is None else importance[number]
                points, own = warp_stacked(points, given, maps, warp)
            texel, weight = texels(points, counts, number, maps, rows, columns, own, share.gain, renormalise)
        made |= {f"{number}.texel": texel, f"{number}.weight": weight}
        if filtered and pattern != "all":
            made[f"{number}.cell"] = cells(texel, maps, rows, columns, pattern == "grid" and warp is None)
    return made


def _points(
    pattern: Pattern, counts: tuple[int, ...], shifts: Array, number: int, stacked: tuple[int, int], random: Array
) -> Array:
    maps, rows = stacked
    if pattern == "random":
        return random
    if pattern == "grid":
        return grid_points(math.isqrt(counts[number] // maps), maps, rows)
    return halton_points(counts, shifts, number)


def light_steps(rsms: Sequence[Rsm], drawn: Sequence[Drawn]) -> dict[str, Any]:
    """Return pixel lights by field, as `lights_of` does, by a step."""
    filtered, glossy = any(one.cell is not None for one in drawn), any(rsm.lobe_flux is not None for rsm in rsms)
    flux, axis, exponent = ([getattr(rsm, name) for rsm in rsms] if glossy else None for name in NAMES[3:6])
    made = pixel_lights(
        [one.texel for one in drawn], [one.weight for one in drawn], [rsm.position for rsm in rsms],
        [rsm.normal for rsm in rsms], [rsm.flux for rsm in rsms], flux, axis, exponent,
        *(([one.cell for one in drawn], tuple(one.gain for one in drawn)) if filtered else ((), ())))
    return dict(zip(NAMES, made, strict=True))


def area_steps(rsms: Sequence[Rsm], drawn: Sequence[Drawn]) -> Array:
    """Return the surface of each light, as `footprints_of` does, by steps."""
    lamps = [lamp_of(rsm.light) for rsm in rsms]
    near = tuple(lamp.place is not None for lamp in lamps)
    places: list[Any] = [lamp.direction if lamp.place is None else lamp.place for lamp in lamps]
    if any(one.cell is not None for one in drawn):
        return np.concatenate([
            cell_areas(rsm.position, rsm.normal, rsm.solid_angle, rsm.flux, rsm.lobe_flux, one.cell, len(one.texel),
                       place, is_near)
            for rsm, one, place, is_near in zip(rsms, drawn, places, near, strict=True) if one.cell is not None])
    lights = light_steps(rsms, drawn)
    weights = [one.weight if one.gain == 1 else one.weight / one.gain for one in drawn]
    return footprints(lights["position"], lights["normal"], lights["texel"], lights["map_index"],
                      [rsm.solid_angle for rsm in rsms], [one.texel for one in drawn], weights, places, near)
