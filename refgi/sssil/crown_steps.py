"""Samples of a level and the sum of their light one after the other: points, shifts, offsets and weights, sum.

The points of a level are one Kronecker sequence (u, v): u says how far from the receiver, 2 pi v in which direction.
Each texel of a tile adds its own shift modulo 1.
"""

import math

import numpy as np

from refgi.sssil.crown import level_factor, sum_of_samples
from refgi.sssil.form_factor import form_of
from refgi.sssil.pattern import (
    PHASES,
    chosen_radius,
    every_texel,
    key_shift,
    level_key,
    mirrored_offsets,
    pixel_key,
    row_key,
    tile_offsets,
    tile_shifts,
)
from refgi.sssil.pattern import sample_points as points_of
from refgi.sssil.settings import Density, FormFactor, HssilSettings, SenderSettings
from refgi.sssil.view import Level
from refgi.stages import stage
from refgi.types import Array

BELOW_1 = 1.0 - 2.0**-24  # largest number below 1 that float32 holds


@stage("sssil.points_and_shifts", kept=False, each="level")
def points_and_shifts(start: Array, inner: int, crown: int, rows: int, columns: int) -> tuple[Array, Array]:
    """Shift the points of the sequence for each texel of a tile, in double precision (HSS Sec. 3.2).

    start (uv,): Random numbers: shift of the tile's first texel.
    inner: Points of the disc, which come first.
    crown: Points of the crown.
    rows: Rows of the tile.
    columns: Columns of the tile.
    -> points (n, 3): Points that all texels share, (u, cos 2 pi v, sin 2 pi v): j steps from 1/2, the disc's, then the
        crown's, each from j = 0; modulo 1.
    -> shifts (rows, columns, 2): What each texel of a tile adds to u and v, modulo 1: texel n, row by row, n times the
        crown's number of steps more than the first.
    """
    return points_of(inner, crown), np.minimum(tile_shifts(start.astype(np.float64), (rows, columns), crown), BELOW_1)


@stage("sssil.sample_points", kept=False, each="level")
def sample_points(inner: int, crown: int) -> Array:
    """List the points of the sequence, in double precision (HSS Sec. 3.2).

    inner: Points of the disc, which come first.
    crown: Points of the crown.
    -> (n, 3): Points that all texels share, (u, cos 2 pi v, sin 2 pi v): j steps from 1/2, the disc's, then the
        crown's, each from j = 0; modulo 1.
    """
    return points_of(inner, crown)


@stage("sssil.crown_samples", kept=False, each="level")
def crown_samples(points: Array, shifts: Array, inner: int, radius: float, density: Density) -> tuple[Array, Array]:
    """Place samples: from r to 2 r around a receiver, at the first level in the disc as well (HSS Sec. 3.2, E-HSS-06).

    points (n, 3): Points that all texels share.
    shifts (row, column, uv): Random numbers: what each texel adds to u and v, modulo 1.
    inner: How many points lie in the disc; they come first.
    radius: r, texels.
    density: Samples per texel, by the distance from the receiver.
    -> offsets (rows, columns, n, 2) int32: Texels (right, down) from the receiver to the sample, the disc's first.
    -> weight (rows, columns, n): Texels of this level that a sample stands for; (1, 1, n) of density "uniform", whose
        samples stand for as many at each texel.
    """
    return tile_offsets(points, inner, shifts, radius, density)


@stage("sssil.mirrored_samples", kept=False, each="level")
def mirrored_samples(start: Array, inner: int, crown: int, radius: float, density: Density) -> tuple[Array, Array]:
    """Place samples that all receivers share, each followed by its mirror image to the left (HSS Sec. 3.2).

    Half of the points, shifted, lie at angles pi (v - 1/2), to the right of the receiver.

    start (uv,): Random numbers: shift of all points.
    inner: Samples of the disc.
    crown: Samples of the crown.
    radius: r, texels.
    density: Samples per texel, by the distance from the receiver.
    -> offsets (rows, columns, n, 2) int32: Texels from the receiver to the sample: pairs of the disc, of the crown,
        then the odd point of each, straight above or below.
    -> weight (rows, columns, n): Texels of this level that a sample stands for.
    """
    offsets, weight = mirrored_offsets(inner, crown, start.astype(np.float64), radius, density)
    return offsets[None, None], weight[None, None]


@stage("sssil.every_texel", kept=False, each="level")
def all_texels(low: float, high: float) -> tuple[Array, Array]:
    """List every texel at a distance of `low` to less than `high` texels as a sample, once (HSS Sec. 3.2).

    low: Least distance, texels.
    high: Largest distance, texels; not reached.
    -> offsets (rows, columns, n, 2) int32: Row by row those to the right, nearest first, each followed by its mirror
        image to the left; then those straight above and below.
    -> weight (rows, columns, n): Texels of this level that a sample stands for: 1.
    """
    offsets = every_texel(low, high)
    return offsets[None, None], np.ones((1, 1, len(offsets)))


@stage("sssil.gather_samples", kept=False, each="level")
def gather_samples(
    position: Array, normal: Array, sender_position: Array, sender_normal: Array, radiance: Array, area: Array,
    offsets: Array, weight: Array, form_factor: FormFactor, share: float, factor: float, inner: int, index: int,  # noqa: ARG001
) -> Array:
    """Sum the light of the samples of each texel of a level (HSS Eq. 1, Eq. 4 with its pi: E-HSS-04).

    Samples outside the picture, on nothing or on the texel itself send none.

    position (3, h, w): Receivers: surface points of the level's texels, from the eye, m.
    sender_position (3, h, w): Senders: surface points of the same texels, m.
    sender_normal (3, h, w): Their unit normals.
    radiance (3, h, w): Their radiance, W/m^2/sr.
    area (h, w): Surface that a texel stands for, m^2.
    offsets (rows, columns, n, 2) int32: Texels from the receiver to the sample.
    weight (rows, columns, n): Texels that a sample stands for.
    form_factor {"disc", "texel", "point"}: Form factor of a sample.
    share: Share of what a sample stands for that its disc covers, at least one texel.
    factor: Factor of the sum: 1 but for forms used as printed.
    inner: How many samples lie in the disc; they come first.
    index: Position of the level, 0 for the first; areas are its own.
    -> (3, h, w): Irradiance by this level, W/m^2; 0 without surface.
    """
    none = np.zeros_like(area)
    to, by = (Level(0, at, none, up, radiance, area, none) for at, up in (
        (position, normal), (sender_position, sender_normal)))
    more = (1 << (offsets.shape[1] - 1).bit_length()) - offsets.shape[1]  # the kernel takes columns by powers of two
    by_column, texels = (np.pad(one, [(0, 0), (0, more if one.shape[1] > 1 else 0), *[(0, 0)] * (one.ndim - 2)])
                         for one in (offsets, weight))
    return sum_of_samples(to, by, by_column, texels, int(np.abs(offsets).max(initial=0)),
                          form_of(SenderSettings(form_factor=form_factor, disc_share=share)), math.pi * factor)


def gather_steps(level: Level, index: int, settings: HssilSettings, senders: Level | None = None) -> Array:
    """Return the irradiance of a level, made by steps."""
    by = level if senders is None else senders
    offsets, weight = samples_of(level, index, settings)
    return gather_samples(level.position, level.normal, by.position, by.normal, by.radiance, by.area, offsets, weight,
                          settings.senders.form_factor, settings.senders.disc_share, level_factor(index, settings),
                          settings.sampling.counts(index)[0], index)


def samples_of(level: Level, index: int, settings: HssilSettings) -> tuple[Array, Array]:
    """Return the samples of a level, made by steps."""
    sampling, (rows, columns) = settings.sampling, level.shape
    radius, (inner, crown) = chosen_radius((rows << index, columns << index), sampling), sampling.counts(index)
    if sampling.pattern == "all":
        return all_texels(0.0 if index == 0 else radius, 2.0 * radius)
    key = level_key(sampling.seed, level.number)
    if sampling.pattern == "pixel":
        own = np.array([[key_shift(pixel_key(row_key(key, row), column)) for column in range(columns)]
                        for row in range(rows)])
        return crown_samples(sample_points(inner, crown), np.minimum(own, BELOW_1), inner, radius, sampling.density)
    start = np.minimum(key_shift(key), BELOW_1)
    if sampling.pattern == "fixed":
        return mirrored_samples(start, inner, crown, radius, sampling.density)
    tile = (rows, PHASES) if sampling.pattern == "row" else (sampling.tile, sampling.tile)
    points, shifts = points_and_shifts(start, inner, crown, *tile)
    return crown_samples(points, shifts, inner, radius, sampling.density)
