"""Slow literal twin of pixel lights: from the maps of a frame and the scene, light by light (SII Sec. 3.1, 3.5 to 3.7).

Written from the radiometry's text: of the T texels of a map N are drawn, and a light carries T/N w of its texel's flux.
"""

import dataclasses
import math
from typing import Any

import numpy as np

from refgi.literal.lights import grid_points, halton_points
from refgi.literal.warp import warp
from tests.naive.draws import draw
from tests.naive.light_maps import maps_of, walk
from tests.naive.openness import openness
from tests.naive.shares import nearest_grid, shares_of

PATTERN, ROULETTE = 0, 2  # uses of the random streams


@dataclasses.dataclass
class Light:
    """One pixel light; one without a lobe has zeros there, one of a light path has neither map nor footprint."""

    position: Any  # (3,) m
    normal: Any  # (3,) unit
    flux: Any  # (3,) W
    lobe_flux: Any  # (3,) W
    lobe_axis: Any  # (3,) unit
    lobe_exponent: float
    footprint: float = math.nan  # m^2
    map_index: int = -1
    texel: int = -1


def pixel_lights(frame, arriving, settings):
    """Return the lights; `arriving` is what falls on each map's texels, (3, H, W) W."""
    if settings.source.name() == "walk":
        found = [Light(*vertex) for vertex in walk(frame.scene, settings.count, settings.source.bounces, settings.seed)]
    else:
        maps = maps_of(frame, arriving, settings.source)
        found = [light for index, (here, share) in enumerate(zip(maps, shares_of_maps(maps, settings), strict=True))
                 for light in lights_of_map(here, index, share, frame, settings)]
    lit = [light for light in found if any(light.flux) or any(light.lobe_flux)]
    return in_the_open(lit, frame, settings)


def drawn(frame, arriving, settings):
    """Return N over all lamps, draws without flux included."""
    if settings.source.name() == "walk":
        return settings.count * settings.source.bounces
    return sum(shares_of_maps(maps_of(frame, arriving, settings.source), settings))


def shares_of_maps(maps, settings):
    """Return N of each map: its share of the count by flux, of the grid the nearest k n^2; or all its texels."""
    if settings.source.pattern == "all":
        return [here.texels for here in maps]
    shares = shares_of(settings.count, [float(here.flux.sum() + here.lobe_flux.sum()) for here in maps])
    if settings.source.pattern == "grid":
        return [nearest_grid(share, here.stacked) for share, here in zip(shares, maps, strict=True)]
    return shares


def lights_of_map(here, index, share, frame, settings):
    """Return the N lights of one map, those without flux included."""
    source = settings.source
    if source.warp is None:
        places = [(texel, 1.0) for texel in texels_of(here, index, share, settings)]
    else:
        places = warped_texels(here, index, share, frame, settings)
    if source.filtered:
        on_grid = source.pattern == "grid" and source.warp is None
        cells = cells_of(here, [texel for texel, _ in places], share, on_grid=on_grid)
        return [light_of_cell(here, index, texel, cell, share, source)
                for (texel, _), cell in zip(places, cells, strict=True)]
    return [light_of_texel(here, index, texel, weight, share, source) for texel, weight in places]


def light_of_texel(here, index, texel, weight, share, source):
    """Phi_i = T/N w Phi_t; as printed without T/N. The footprint is the surface of as many texels."""
    stands_for = here.texels / share * weight
    factor = weight if "sii_no_tn" in source.as_published else stands_for
    return Light(here.position[texel], here.normal[texel], factor * here.flux[texel], factor * here.lobe_flux[texel],
                 here.lobe_axis[texel], here.lobe_exponent[texel], stands_for * here.area[texel], index, texel)


def light_of_cell(here, index, texel, cell, share, source):
    """Sum a cell at the chosen texel, or if that is dark at the cell's nearest with flux; as printed their mean.

    A texel without a lobe reflects diffusely what the cell's lobes do.
    """
    factor = share / here.texels if "sii_no_tn" in source.as_published else 1.0
    bright = [other for other in cell if any(here.flux[other]) or any(here.lobe_flux[other])]
    at = min(bright, key=lambda other: (square_between(here, texel, other), other)) if bright else texel
    diffuse, glossy = (factor * plane[cell].sum(axis=0) for plane in (here.flux, here.lobe_flux))
    if not any(here.lobe_flux[at]):
        diffuse, glossy = diffuse + glossy, np.zeros(3)
    return Light(here.position[at], here.normal[at], diffuse, glossy, here.lobe_axis[at], here.lobe_exponent[at],
                 here.area[cell].sum(), index, at)


def square_between(here, one, other):
    """Return the squared distance of two texels' places."""
    (row, column), (row_there, column_there) = divmod(one, here.width), divmod(other, here.width)
    return (row - row_there) ** 2 + (column - column_there) ** 2


def cells_of(here, chosen, share, *, on_grid):
    """Return the texels of each light's cell: those centres in it, or those nearest to it on its own stacked map."""
    cells = [[] for _ in chosen]
    n, size = math.isqrt(share // here.stacked), here.width * here.width
    for texel in range(here.texels):
        layer, (row, column) = texel // size, divmod(texel % size, here.width)
        if on_grid:
            down, right = (math.floor((place + 0.5) * n / here.width) for place in (row, column))
            cell = (layer * n + down) * n + right
        else:
            rivals = [k for k, other in enumerate(chosen) if other // size == layer] or range(len(chosen))
            cell = min(rivals, key=lambda k: square_between(here, texel, chosen[k]))
        cells[cell].append(texel)
    return cells


def texels_of(here, index, share, settings):
    """Return the texels of an unwarped pattern."""
    if settings.source.pattern == "all":
        return list(range(here.texels))
    if settings.source.pattern == "grid":
        return [(layer * here.width + math.floor(v * here.width)) * here.width + math.floor(u * here.width)
                for layer in range(here.stacked) for u, v in grid_points(math.isqrt(share // here.stacked))]
    return [texel_at(here, u, v) for u, v in points_of(here, index, share, settings)]


def points_of(here, index, share, settings):
    """Return the pattern as points (u, v) over the stacked maps: columns, rows downwards."""
    stream = PATTERN + 256 * index
    if settings.source.pattern == "grid":
        return [(u, (layer + v) / here.stacked)
                for layer in range(here.stacked) for u, v in grid_points(math.isqrt(share // here.stacked))]
    if settings.source.pattern == "random":
        return [(draw(settings.seed, stream, 2 * k), draw(settings.seed, stream, 2 * k + 1)) for k in range(share)]
    shift = [draw(settings.seed, stream, axis) if settings.seed or index else 0.0 for axis in (0, 1)]
    return halton_points([share], np.array([shift]), 0)


def texel_at(here, u, v):
    """Return the texel of a point: (floor(v H), floor(u W))."""
    return math.floor(v * here.height) * here.width + math.floor(u * here.width)


def warped_texels(here, index, share, frame, settings):
    """Return the warped pattern's texels and weights; v chooses the stacked map first."""
    how = settings.source.warp
    importance = importance_of(here, frame, settings).reshape(here.height, here.width)
    points, weights = warp(np.array(points_of(here, index, share, settings)), importance, here.stacked, how.levels,
                           how.name())
    places = [(texel_at(here, u, v), weight) for (u, v), weight in zip(points, weights, strict=True)]
    if how.renormalise_weights:
        total = sum(weight for _, weight in places)
        places = [(texel, weight * share / total) for texel, weight in places]
    return places


def importance_of(here, frame, settings):
    """Return the importance of each texel: Phi, Phi g(P) or Phi g(P) max(floor, 1 - O), and an even part of it."""
    kind, beta = settings.source.warp.importance, settings.source.warp.defensive
    exponent = here.lobe_exponent[:, None]
    peak = 1.0 if kind == "flux" else exponent if "sii_peak" in settings.source.as_published else (exponent + 1) / 2
    found = (here.flux + peak * here.lobe_flux).max(axis=1)
    if kind == "openness":
        reflects = np.flatnonzero(found)
        free = open_shares(here.position[reflects], here.normal[reflects], reflects, frame, settings)
        found[reflects] *= np.maximum(settings.openness.floor, 1 - free)
    return (1 - beta) * found + beta * found.mean()


def in_the_open(lights, frame, settings):
    """Scale by 1 - O, as printed by O, or keep with the chance max(floor, 1 - O) and divide by it (Sec. 3.6)."""
    how = settings.openness
    if how.flux == "none" or not lights:
        return lights
    position, normal = (np.array([getattr(light, name) for light in lights]) for name in ("position", "normal"))
    free = open_shares(position, normal, range(len(lights)), frame, settings)
    hidden = 1 - free
    if how.flux == "scale":
        shares = free if "sii_openness" in how.as_published else hidden
        return [times(light, share) for light, share in zip(lights, shares, strict=True)]
    chances = np.maximum(how.floor, hidden)
    return [times(light, 1 / chance) for k, (light, chance) in enumerate(zip(lights, chances, strict=True))
            if draw(settings.seed, ROULETTE, k) < chance]


def times(light, factor):
    """Return a light of another flux; its footprint stays."""
    return dataclasses.replace(light, flux=factor * light.flux, lobe_flux=factor * light.lobe_flux)


def open_shares(position, normal, index, frame, settings):
    """Return O of points (n, 3), by rays of a tenth of what the lamps light unless a length is set."""
    return open_shares_of(position, normal, index, frame, settings.openness, settings.seed)


def open_shares_of(position, normal, index, frame, how, seed):
    """Return O of points (n, 3) by a radius, a number of rays and a seed."""
    return openness(frame.scene.geometry, position, normal, index, how.radius or illuminated_diagonal(frame) / 10,
                    how.rays, seed)


def illuminated_diagonal(frame):
    """Return the diagonal of the box of all texels that reflect direct light."""
    points = []
    for rsm in frame.rsms:
        lit = rsm.flux.any(axis=0) | (rsm.lobe_flux is not None and rsm.lobe_flux.any(axis=0))
        points.append(rsm.position[:, lit])
    corners = np.concatenate(points, axis=1)
    return float(np.linalg.norm(corners.max(axis=1) - corners.min(axis=1)))
