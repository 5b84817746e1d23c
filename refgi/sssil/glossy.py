"""Samples of glossy receivers: crowns drawn by importance (Soler 2009, Sec. 5), and their visibility.

Every glossy pixel is a receiver at full resolution on every level, as an upsampled highlight would be a blurred one.
Its samples lie around the azimuth phi at which the mirrored ray leaves the pixel on the picture: from a uniform v ::

    angle = phi + 2 arctan(s tan(pi (v - 1/2))), weight s / (c^2 + s^2 (1 - c^2)) with c = cos(pi (v - 1/2)),

a wrapped Cauchy density. s is the lobe's width, 1 / sqrt(P + 2), over the sine of the angle between mirrored ray and
line of sight. With a bitmask samples are those of slices: what occludes has to be marched past in all directions.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel, prange
from refgi.pairs.shadow_rays import RayReceivers
from refgi.radiometry import receiver_lobe
from refgi.rays import far_offset
from refgi.rsm.buffers.leaving import GlossyPoints
from refgi.rsm.raster.projection import Projection
from refgi.sampling import FIRST_STEP, SECOND_STEP, hash_bits
from refgi.sssil.form_factor import SampleForm, disc_texels, form_factor
from refgi.sssil.pattern import TO_UNIT, distance, level_key, pixel_key, relative_weight, row_key
from refgi.sssil.rays import Surfels
from refgi.sssil.settings import Bitmask, HssilSettings
from refgi.sssil.slices import (
    PLANES,
    SliceCounts,
    direction,
    fill_slices,
    heights,
    pack,
    sector_mask,
    slice_counts,
    turn_of,
    visibility,
)
from refgi.sssil.view import Level
from refgi.types import Array

LEAST_SPREAD = 1.0 / 64  # of s: finer than texels of a crown, and what bounds weights


class GlossyReceivers(NamedTuple):
    """Glossy pixels of a picture, in float64."""

    row: Array  # (n,) int64
    column: Array  # (n,) int64
    position: Array  # (3, n) from the eye of the picture, m
    normal: Array  # (3, n)
    mirrored: Array  # (3, n)
    exponent: Array  # (n,)
    azimuth: Array  # (2, n) cosine and sine of phi, columns right and rows down
    spread: Array  # (n,) s


class Draws(NamedTuple):
    """How the samples of a level are drawn."""

    inner: int  # samples in the disc; the others lie in the crown
    radius: float  # of the crown, texels
    uniform: bool  # density
    weight: Array  # (m,) texels that each sample stands for in the mean
    key: Any  # uint32, of the level
    every: Array  # (m, 2) int32 offsets that all receivers share, each of one texel; (0, 2) where each draws its own


def glossy_receivers(points: GlossyPoints, projection: Projection) -> GlossyReceivers:
    """Return n glossy pixels of a camera's picture as receivers of crowns, with the azimuth of their lobes."""
    row, column = np.divmod(points.pixel, projection.width)
    position, normal, mirrored = (np.asarray(part, np.float64)
                                  for part in (points.position, points.normal, points.mirrored))
    position = position - projection.origin[0][:, None]
    right, down, ahead = projection.frame[0]
    depth, along = ahead @ position, ahead @ mirrored
    x = ((right @ mirrored) * depth - (right @ position) * along) * (projection.width / float(projection.half[0]))
    y = ((down @ mirrored) * depth - (down @ position) * along) * (projection.height / float(projection.half[1]))
    length = np.hypot(x, y)
    azimuth = np.stack([np.divide(x, length, out=np.ones_like(x), where=length > 0),
                        np.divide(y, length, out=np.zeros_like(y), where=length > 0)])
    away = np.cross(position, mirrored, axis=0)
    sine = np.sqrt((away * away).sum(axis=0) / np.maximum((position * position).sum(axis=0), np.finfo(float).tiny))
    exponent = np.asarray(points.exponent, np.float64)
    spread = 1.0 / np.maximum(np.sqrt(exponent + 2.0) * sine, 1.0)
    return GlossyReceivers(row, column, position, normal, mirrored, exponent, azimuth,
                           np.clip(spread, LEAST_SPREAD, 1.0))


@kernel
def warped(v: float, cosine: float, sine: float, spread: float) -> Any:
    """Return cosine and sine of the angle of a point v of [0, 1), and its weight over that of a uniform density."""
    c, s = math.cos(math.pi * (v - 0.5)), math.sin(math.pi * (v - 0.5))
    across = spread * s
    square = c * c + across * across
    turn_cosine, turn_sine = (c * c - across * across) / square, 2.0 * across * c / square
    return (cosine * turn_cosine - sine * turn_sine, sine * turn_cosine + cosine * turn_sine, spread / square)


@kernel(parallel=True)
def draw_samples(
    to: GlossyReceivers, first: int, last: int, level: Level, draws: Draws, form: SampleForm, transfer: Array,
    sender: Array,
) -> None:
    """Fill `sender` (pairs,), row * columns + column, and `transfer` (pairs,) of receivers `first` to `last`.

    Transfer is f_s times pi times the form factor: what of the sender's radiance the lobe reflects, 1.
    """
    count = len(draws.weight)
    for i in prange(last - first):
        _draw(to, first + np.int64(i), level, draws, form, np.int64(i) * count, transfer, sender)


@kernel
def _draw(
    to: GlossyReceivers, i: Any, level: Level, draws: Draws, form: SampleForm, pair: Any, transfer: Array,
    sender: Array,
) -> None:
    rows, columns = level.area.shape
    row, column = to.row[i] >> level.number, to.column[i] >> level.number
    key = pixel_key(row_key(draws.key, to.row[i]), to.column[i])
    shift_u, shift_v = hash_bits(key) * TO_UNIT, hash_bits(key ^ np.uint32(0x27D4EB2F)) * TO_UNIT
    for j in range(len(draws.weight)):
        stands_for = draws.weight[j]
        if len(draws.every) > 0:
            ox, oy = np.int64(draws.every[j, 0]), np.int64(draws.every[j, 1])
        else:
            near = 0.0 if j < draws.inner else 1.0
            n = j if j < draws.inner else j - draws.inner
            u, v = (0.5 + n * FIRST_STEP + shift_u) % 1.0, (0.5 + n * SECOND_STEP + shift_v) % 1.0
            far = distance(u, near, draws.radius, draws.uniform)
            x, y, relative = warped(v, to.azimuth[0, i], to.azimuth[1, i], to.spread[i])
            stands_for *= relative_weight(far, near, draws.radius, draws.uniform) * relative
            ox, oy = np.int64(math.floor(far * x + 0.5)), np.int64(math.floor(far * y + 0.5))
        a, b = row + oy, column + ox
        transfer[pair + j], sender[pair + j] = 0.0, 0
        if 0 <= a < rows and 0 <= b < columns and not (ox == 0 and oy == 0):
            sender[pair + j] = a * columns + b
            transfer[pair + j] = glossy_transfer(to, i, level, a, b, stands_for, disc_texels(stands_for, form))


@kernel
def glossy_transfer(to: GlossyReceivers, i: Any, level: Level, a: Any, b: Any, weight: float, disc: float) -> Any:
    """Return f_s times pi times the form factor of a receiver and a texel, over the receiver's specular reflectance."""
    dx, dy, dz = (level.position[0, a, b] - to.position[0, i], level.position[1, a, b] - to.position[1, i],
                  level.position[2, a, b] - to.position[2, i])
    c = to.normal[0, i] * dx + to.normal[1, i] * dy + to.normal[2, i] * dz
    s = -(level.normal[0, a, b] * dx + level.normal[1, a, b] * dy + level.normal[2, a, b] * dz)
    if c <= 0.0 or s <= 0.0:
        return 0.0
    texel = s * (level.area[a, b] / math.pi)
    lobe = receiver_lobe(to.mirrored[0, i], to.mirrored[1, i], to.mirrored[2, i], dx, dy, dz, to.exponent[i])
    # Eq. (4), or (3), times f_s
    return lobe * form_factor(math.pi * c, texel * weight, texel * disc, dx * dx + dy * dy + dz * dz)


class SliceSamples(NamedTuple):
    """What slices are marched with on a level, in float64."""

    steps: SliceCounts
    receiving: Array  # (1, PLANES, n) receivers
    sending: Array  # (rows, PLANES, columns) texels
    thickness: float  # m
    key: Any  # uint32, of the level

    @property
    def per_receiver(self) -> int:
        """Samples of a receiver, occluders among them."""
        return self.steps.slices * self.steps.per_slice


def slice_samples(
    to: GlossyReceivers, level: Level, index: int, settings: HssilSettings, diagonal: float
) -> SliceSamples:
    """Return what slices are marched with: receivers and a level's texels, packed; `diagonal` is the scene's, m."""
    sampling, bitmask = settings.sampling, settings.visibility
    assert isinstance(bitmask, Bitmask)
    assert sampling.radius is not None
    steps = slice_counts(sampling, bitmask, index, float(sampling.radius))
    receiving, sending = np.zeros((1, PLANES, len(to.row))), np.zeros((level.shape[0], PLANES, level.shape[1]))
    pack(to.position[:, None], to.normal[:, None], np.zeros((3, 1, len(to.row))), np.zeros((1, len(to.row))), 1.0, 1,
         receiving)
    position, normal, radiance, area = (np.asarray(part, np.float64) for part in (
        level.position, level.normal, level.radiance, level.area))
    pack(position, normal, radiance, area, 1.0, 1, sending)
    return SliceSamples(steps, receiving, sending, float(bitmask.thickness * diagonal),
                        level_key(sampling.seed, level.number))


@kernel(parallel=True)
def march_samples(
    to: GlossyReceivers, first: int, last: int, level: Level, slices: SliceSamples, form: SampleForm,
    transfer: Array, sender: Array,
) -> None:
    """Fill transfer, times visibility, and sender of the samples of all slices; arguments as for `draw_samples`."""
    steps = slices.steps
    per_slice = steps.disc + steps.crown + steps.occluders
    for i in prange(last - first):
        offsets, length = np.empty((steps.slices, per_slice, 2), np.int32), np.empty(per_slice)
        weight = np.empty((steps.slices, per_slice))
        receiver = first + np.int64(i)
        turn, shift = turn_of(pixel_key(row_key(slices.key, to.row[receiver]), to.column[receiver]))
        fill_slices(steps, turn, shift, False, length, offsets, weight)
        for k in range(steps.slices):
            pair = (np.int64(i) * steps.slices + k) * per_slice
            _march(to, receiver, level, slices, offsets[k], weight[k], form, pair, transfer, sender)


@kernel
def _march(
    to: GlossyReceivers, i: Any, level: Level, slices: SliceSamples, offsets: Array, weight: Array,
    form: SampleForm, pair: Any, transfer: Array, sender: Array,
) -> None:
    """March one slice of a receiver, nearest samples first."""
    rows, columns = level.area.shape
    row, column = to.row[i] >> level.number, to.column[i] >> level.number
    mask, highest, receiver = np.uint32(0), 0.0, slices.receiving[0]
    for j in range(offsets.shape[0]):
        a, b = row + np.int64(offsets[j, 1]), column + np.int64(offsets[j, 0])
        transfer[pair + j], sender[pair + j] = 0.0, 0
        if 0 <= a < rows and 0 <= b < columns and not (a == row and b == column):
            dx, dy, dz, c = direction(receiver, i, slices.sending[a], b)
            front, back = heights(receiver, i, slices.sending[a], b, dx, dy, dz, c, slices.thickness)
            if weight[j] > 0.0:
                sender[pair + j] = a * columns + b
                transfer[pair + j] = visibility(front, highest, mask) * glossy_transfer(
                    to, i, level, a, b, weight[j], disc_texels(weight[j], form))
            highest = max(highest, front)
            mask = np.uint32(mask | sector_mask(back, front))


@kernel(parallel=True)
def fill_glossy_rays(
    to: RayReceivers, senders: Surfels, first: int, last: int, count: int, sender: Array, transfer: Array,
    origins: Array, directions: Array, reach: Array,
) -> None:
    """Fill the shadow ray of each sample, `count` of each of the receivers `first` to `last`.

    Clears the transfer where either end lies behind the plane of the other's triangle.
    """
    for i in prange(last - first):
        for j in range(count):
            _fill_ray(to, senders, first + np.int64(i), np.int64(i) * count + j, sender, transfer, origins, directions,
                      reach)


@kernel
def _fill_ray(
    to: RayReceivers, senders: Surfels, i: Any, ray: Any, sender: Array, transfer: Array, origins: Array,
    directions: Array, reach: Array,
) -> None:
    j = sender[ray]
    end, start = senders.origin, to.origin
    dx, dy, dz = (np.float64(end[0, j]) - start[0, i], np.float64(end[1, j]) - start[1, i],
                  np.float64(end[2, j]) - start[2, i])
    above = to.facing[0, i] * dx + to.facing[1, i] * dy + to.facing[2, i] * dz
    before = -(senders.facing[0, j] * dx + senders.facing[1, j] * dy + senders.facing[2, j] * dz)
    if above <= 0.0 or before <= 0.0:
        transfer[ray] = 0.0
    reach[ray] = 1.0 if transfer[ray] > 0.0 else 0.0
    far = far_offset(dx, dy, dz)
    for c in range(3):
        origins[ray, c] = to.origin[c, i]
        directions[ray, c] = senders.origin[c, j] - to.origin[c, i] + far * senders.facing[c, j]
