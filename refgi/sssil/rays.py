"""Visibility of samples by shadow rays: the limit against which every cheaper visibility of samples is measured.

The estimator is that of `crown`, each term times V in {0, 1}. Rays run between the surface points that texels hold,
lifted off their triangles: interpolated normals would send them through the surface.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel, prange
from refgi.pairs.shadow_rays import receivers
from refgi.rays import Tracer, far_offset
from refgi.rsm.buffers.gbuffer import GBuffer
from refgi.scene.model import Geometry
from refgi.sssil.crown import level_factor
from refgi.sssil.form_factor import SampleForm, disc_texels, form_factor, form_of
from refgi.sssil.pattern import (
    PixelSamples,
    chosen_radius,
    pixel_key,
    pixel_offset,
    pixel_samples,
    row_key,
    shared_offsets,
)
from refgi.sssil.settings import HssilSettings, SamplingSettings
from refgi.sssil.view import Level
from refgi.stages import report_progress, stage, tally
from refgi.types import Array

BATCH = 1 << 18  # pairs held at a time


class Surfels(NamedTuple):
    """The texels of a level in a row, in float64; without a surface all is 0."""

    position: Array  # (3, n) from the eye, m
    normal: Array  # (3, n)
    area: Array  # (n,) m^2
    facing: Array  # (3, n): normals of the triangles
    origin: Array  # (3, n) float32: where rays start and end, world space, m


class Traced(NamedTuple):
    """What a view's shadow rays start from and meet."""

    buffer: GBuffer  # the surfaces that its pixels show
    geometry: Geometry
    tracer: Tracer


class SampleOffsets(NamedTuple):
    """Offsets of the samples of a level."""

    offsets: Array  # (1 or h, phases, m, 2) int32 texels, by row and column; no m where each receiver has its own
    weight: Array  # (1 or h, 1 or phases, m) texels that a sample stands for, of receivers with their own in the mean
    own: PixelSamples  # of receivers that have them


@stage("sssil.rays")
def ray_gather(
    level: Level, index: int, settings: HssilSettings, traced: Traced, senders: Level | None = None, *,
    batch: int = BATCH,
) -> Array:
    """Sum the light of the samples around each texel of a level that no surface occludes.

    level: Receivers, and senders unless those are given.
    index: 0 for the first level, whose inner disc is sampled as well.
    traced: Of the view whose level it is.
    senders: The same level with other surface points, as senders.
    batch: Pairs in memory at a time; changes no bit of the result.
    -> (3, h, w): Irradiance, W/m^2, in the dtype of the level. Excludes albedo/pi.
    """
    senders = level if senders is None else senders
    surfels, samples = surfels_of(level, traced), _samples(level, index, settings.sampling)
    sending = surfels if senders is level else surfels_of(senders, traced)
    radiance = senders.radiance.reshape(3, -1)
    total, count = np.zeros(radiance.shape), samples.weight.shape[2]
    tally("pairs", lambda: total.shape[1] * count)
    step = max(1, batch // max(count, 1))
    rays = [np.empty((step * count, 3), np.float32) for _ in range(2)]
    transfer, reach = np.empty(step * count), np.empty(step * count, np.float32)
    sender, blocked = np.empty(step * count, np.int64), np.empty(step * count, np.bool_)
    form = form_of(settings.senders)
    for first in range(0, total.shape[1], step):
        last = min(first + step, total.shape[1])
        size = (last - first) * count
        _write_rays(surfels, sending, samples, level.shape, first, last, form, rays[0], rays[1], reach, transfer,
                    sender)
        traced.tracer.fill_occluded(rays[0][:size], rays[1][:size], reach[:size], blocked[:size])
        add_unoccluded(radiance, first, last, count, blocked, transfer, sender, total)
        report_progress(last / total.shape[1])
    return (total * level_factor(index, settings)).reshape(level.radiance.shape).astype(level.radiance.dtype)


def surfels_of(level: Level, traced: Traced) -> Surfels:
    """Return texels with the triangles that they lie on; rays end where the texel's own pixel shows its surface."""
    covered = np.flatnonzero(level.pixel.reshape(-1) >= 0)
    pixel = level.pixel.reshape(-1)[covered]
    position, normal, triangle = traced.buffer.at(pixel, "position", "normal", "triangle_id")
    starts = receivers(traced.geometry, position, normal, triangle, traced.tracer.grain)
    facing, origin = np.zeros((3, level.pixel.size)), np.zeros((3, level.pixel.size), np.float32)
    facing[:, covered], origin[:, covered] = starts.facing, starts.origin
    position, normal = (plane.reshape(3, -1).astype(np.float64) for plane in (level.position, level.normal))
    return Surfels(position, normal, level.area.reshape(-1).astype(np.float64), facing, origin)


def _samples(level: Level, index: int, sampling: SamplingSettings) -> SampleOffsets:
    rows, columns = level.shape
    radius = chosen_radius((rows << index, columns << index), sampling)
    own = pixel_samples(sampling, index, level.number, radius)
    if sampling.pattern == "pixel":
        return SampleOffsets(np.zeros((1, 1, 0, 2), np.int32), own.weight[None, None], own)
    return SampleOffsets(*shared_offsets(sampling, index, level.number, rows, radius, columns), own)


@kernel(parallel=True)
def _write_rays(
    surfels: Surfels, senders: Surfels, samples: SampleOffsets, shape: tuple[int, int], first: int, last: int,
    form: SampleForm, origins: Array, directions: Array, reach: Array, transfer: Array, sender: Array,
) -> None:
    """Write ray and transfer of each pair of receivers first to last and their samples."""
    count = samples.weight.shape[2]
    for i in prange(last - first):
        ray = np.int64(i) * count
        _write_ray(surfels, senders, samples, shape, first + np.int64(i), ray, form, origins, directions, reach,
                   transfer, sender)


@kernel
def _write_ray(
    surfels: Surfels, senders: Surfels, samples: SampleOffsets, shape: tuple[int, int], receiver: Any, ray: Any,
    form: SampleForm, origins: Array, directions: Array, reach: Array, transfer: Array, sender: Array,
) -> None:
    row, column = receiver // shape[1], receiver % shape[1]
    key = pixel_key(row_key(samples.own.key, row), column)
    own = samples.offsets.shape[2] == 0
    shared, phase = row % samples.offsets.shape[0], column % samples.offsets.shape[1]
    weight = samples.weight[shared % samples.weight.shape[0], phase % samples.weight.shape[1]]
    for j in range(weight.size):
        stands_for = weight[j]
        if own:
            ox, oy, relative = pixel_offset(samples.own, key, j)
            stands_for *= relative
        else:
            ox, oy = np.int64(samples.offsets[shared, phase, j, 0]), np.int64(samples.offsets[shared, phase, j, 1])
        a, b = row + oy, column + ox
        reach[ray + j] = 0.0
        if 0 <= a < shape[0] and 0 <= b < shape[1] and not (ox == 0 and oy == 0):
            other = a * shape[1] + b
            sender[ray + j] = other
            disc = disc_texels(stands_for, form)
            transfer[ray + j] = _transfer(surfels, senders, receiver, other, stands_for, disc)
            reach[ray + j] = 1.0 if transfer[ray + j] > 0.0 else 0.0
            far = far_offset(senders.origin[0, other] - surfels.origin[0, receiver],
                             senders.origin[1, other] - surfels.origin[1, receiver],
                             senders.origin[2, other] - surfels.origin[2, receiver])
            for c in range(3):
                origins[ray + j, c] = surfels.origin[c, receiver]
                directions[ray + j, c] = (senders.origin[c, other] - surfels.origin[c, receiver]
                                          + far * senders.facing[c, other])


@kernel
def _transfer(surfels: Surfels, senders: Surfels, i: int, j: int, weight: float, disc: float) -> Any:
    """Return pi times the form factor of a pair; 0 where either end lies behind the plane of the other's triangle."""
    square, c, s, above, before = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(3):
        d = senders.position[k, j] - surfels.position[k, i]
        square += d * d
        c += surfels.normal[k, i] * d
        s -= senders.normal[k, j] * d
        above += surfels.facing[k, i] * d
        before -= senders.facing[k, j] * d
    if c <= 0.0 or s <= 0.0 or above <= 0.0 or before <= 0.0:
        return 0.0
    every, of_disc = s * (senders.area[j] * weight / math.pi), s * (senders.area[j] * disc / math.pi)
    return form_factor(math.pi * c, every, of_disc, square)


@kernel(parallel=True)
def add_unoccluded(radiance: Array, first: int, last: int, count: int, blocked: Array, transfer: Array, sender: Array,
              total: Array) -> None:
    """Add the light along each receiver's unoccluded rays, `count` each, two by two: mirror images are added first.

    `radiance` and `total` (3, texels); for each ray `blocked`, `transfer` and the texel `sender` at its end.
    """
    for i in prange(last - first):
        starts = np.int64(i)
        end = (starts + 1) * count
        for ray in range(starts * count, end, 2):
            for c in range(3):
                pair = 0.0 if blocked[ray] else transfer[ray] * radiance[c, sender[ray]]
                if ray + 1 < end and not blocked[ray + 1]:
                    pair += transfer[ray + 1] * radiance[c, sender[ray + 1]]
                total[c, first + starts] += pair
