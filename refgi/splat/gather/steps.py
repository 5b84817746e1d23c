"""Gathering one step after the other: discs, places on maps, texels, their sum, interpolation."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from refgi.pairs.irradiance import Receivers
from refgi.rsm.buffers.extent import Extent
from refgi.rsm.raster.projection import Projection, project
from refgi.splat.gather import gather_sum
from refgi.splat.gather.gather_sum import (
    GatherMap,
    SimilarityLimits,
    coarse_pixels,
    disc_offsets,
    disc_points,
    fill_texels,
    gather_discs,
)
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.rsm import Rsm
    from refgi.splat.gather.gather import DiscSettings, Interpolation


@stage("gather.pattern", kept=False)
def pattern(xi: Array, weight_squared: bool) -> tuple[Array, Array]:
    """Spread samples over a disc of radius 1 (RSM 2005, Sec. 4; docs/methods/gather).

    xi (sample, xi1 and xi2): Numbers in [0, 1): radius and angle of samples.
    weight_squared: Weights 3 pi xi1^2, as is often done, not 2 pi xi1; the mean of both is the disc's area, pi.
    -> offset (sample, down and right): Offsets xi1 (cos, sin)(2 pi xi2), radii.
    -> weight (sample): Weights; the density of samples is 1 / (2 pi xi1).
    """
    made = disc_offsets(xi, weight_squared)
    return np.ascontiguousarray(made[:, :2]), np.ascontiguousarray(made[:, 2])


@stage("gather.centers", kept=False, each="lamp")
def centers(position: Array, covered: Array, projection: Projection) -> tuple[Array, Array]:
    """Find where on a map each pixel's surface point lies (RSM 2005, Sec. 4; docs/methods/gather).

    projection: The map: one, or several stacked.
    -> center (row and column, h, w): Place on the stacked maps, texel centres at + 1/2; outside: where the straight way
        to the middle of the first map meets its border, behind the lamp as far out as can be; 0 without surface.
    -> depth (h, w): Depth along the axis of the map it lies on, whose border is part of it, m; inf outside of all and
        without surface.
    """
    shown = covered.reshape(-1)
    points = np.ascontiguousarray(position.reshape(3, -1)[:, shown])
    places, depths = np.zeros((2, shown.size)), np.full(shown.size, np.inf)
    if shown.any():
        found = project(projection, points)[2]
        depths[shown] = np.where(np.isnan(found), np.inf, found)
        places[:, shown] = gather_sum.centers(projection, points)
    return places.reshape(2, *covered.shape), depths.reshape(covered.shape)


@stage("gather.disc_texels", kept=False, each="lamp")
def disc_texels(
    center: Array, offset: Array, covered: Array, radius: float, maps: int, rows: int, columns: int
) -> Array:
    """Find the texel that each sample of each pixel's disc falls on (RSM 2005, Sec. 4; docs/methods/gather).

    center (2, h, w): Row and column of each pixel's place on the stacked maps.
    offset (S, 2): Offsets of samples in a disc of radius 1.
    radius: Of discs, widths of a map.
    maps, rows, columns: How many maps are stacked, and the texels of one.
    -> (sample, h, w) int32: Row * columns + column over the stacked maps; -1 outside and without surface.
    """
    shown, side = covered.reshape(-1), np.array([rows, columns])
    places = np.ascontiguousarray(center.reshape(2, -1)[:, shown])
    found = np.full((len(offset), shown.size), -1, np.int32)
    found[:, shown] = fill_texels(places, offset * np.asarray(radius * side, offset.dtype), maps * rows, columns)
    return found.reshape(len(offset), *covered.shape)


@stage("gather.disc_sum", kept=False, each="lamp")
def disc_sum(
    position: Array, normal: Array, covered: Array, texel: Array, weight: Array, surface: Array, surface_normal: Array,
    flux: Array, radius: float, texels: int, offset: float,
) -> Array:
    """Sum the irradiance of the texels in each pixel's disc (RSM 2005, Sec. 4; docs/methods/gather).

    texel (S, h, w) int32: Texels of the samples.
    weight (S,): Weights of samples.
    surface (3, H, W): The map's surface, m.
    surface_normal (3, H, W): Its unit normals.
    flux (3, H, W): Reflected flux of its diffuse part, W.
    radius: R, widths of a map.
    texels: T, of one map.
    offset: How far the surface is moved back along its normals, m.
    -> (3, h, w): R^2 T / S sum of weight E_t, S samples, E_t the light of one texel by Eq. 2, W/m^2; without albedo/pi.
    """
    real, shown = position.dtype.type, covered.reshape(-1)
    points, normals = (np.ascontiguousarray(one.reshape(3, -1)[:, shown]) for one in (position, normal))
    source = GatherMap(*map(np.ascontiguousarray, (surface - real(offset) * surface_normal, surface_normal, flux)))
    total, scale = np.zeros_like(points), real(radius**2 * texels / (math.pi * len(weight)))
    for chosen, own in zip(texel.reshape(len(weight), -1)[:, shown], weight.astype(np.float64), strict=True):
        middle = np.where(chosen < 0, -1.0, np.stack(np.divmod(chosen, flux.shape[2])) + 0.5)
        gather_discs(points, normals, np.ascontiguousarray(middle), source, np.array([[0.0, 0.0, own]]), scale,
                     None, total)
    light = np.zeros((3, shown.size), real)
    light[:, shown] = total
    return light.reshape(position.shape)


@stage("gather.all_maps", kept=False)
def all_maps(irradiance: tuple[Array, ...]) -> Array:
    """Add the light of all maps (RSM 2005, Sec. 4).

    irradiance tuple of (3, h, w): Light of each map, W/m^2.
    -> (3, h, w): Gathered irradiance where every pixel runs the sum, W/m^2.
    """
    total = np.zeros_like(irradiance[0])
    for one in irradiance:
        total += one
    return total


@stage("gather.interpolate", kept=False)
def interpolate(
    position: Array, normal: Array, covered: Array, irradiance: Array, extent: Extent, grid: int, least_cosine: float,
    reach: float,
) -> tuple[Array, Array]:
    """Interpolate between coarse pixels where three of four around a pixel are similar (RSM 2005, Sec. 4; SII Fig. 12).

    irradiance (3, h, w): Sum of each pixel, W/m^2.
    extent: Box of the visible surfaces, m.
    grid: Coarse pixels along each side: the middles of grid x grid cells.
    least_cosine: Least cosine between normals of similar pixels.
    reach: Largest distance of similar pixels, diagonals of the box.
    -> interpolated (h, w) bool: True where light is interpolated, and at coarse pixels.
    -> irradiance (3, h, w): Indirect irradiance, W/m^2: interpolated, else the pixel's sum.
    """
    limits = SimilarityLimits(least_cosine, reach * extent.diagonal)
    coarse = coarse_pixels(covered.shape[0], covered.shape[1], grid)
    result, chosen = gather_sum.interpolate(Receivers(position, normal, covered), irradiance, coarse, limits)
    return chosen, np.where(chosen, result, irradiance)


def gather_steps(receivers: Receivers, rsms: "Sequence[Rsm]", disc: "DiscSettings", xi: Array | None = None) -> Array:
    """Return the light of all maps, made by steps; `xi`: the samples' random numbers, drawn where absent."""
    points = disc_points(disc.samples, disc.seed) if xi is None else xi
    offset, weight = pattern(points, "rsm_weight_squared" in disc.as_published)
    made = []
    for rsm in rsms:
        maps = rsm.projection
        center, _ = centers(receivers.position, receivers.covered, maps)
        texel = disc_texels(center, offset, receivers.covered, disc.radius, maps.maps, maps.height, maps.width)
        made.append(disc_sum(*receivers, texel, weight, rsm.position, rsm.normal, rsm.flux, disc.radius,
                             maps.height * maps.width, disc.offset))
    return all_maps(tuple(made))


def coarse_steps(
    receivers: Receivers, shown: Array, rsms: "Sequence[Rsm]", disc: "DiscSettings", coarsely: "Interpolation",
    extent: Extent,
) -> tuple[Array, int]:
    """Return the light of all maps, interpolated where coarse pixels are similar, made by steps: all pixels sum."""
    del shown
    total = gather_steps(receivers, rsms, disc)
    chosen, light = interpolate(*receivers, total, extent, coarsely.grid, coarsely.least_cosine, coarsely.reach)
    return light, int(np.count_nonzero(~chosen & receivers.covered))
