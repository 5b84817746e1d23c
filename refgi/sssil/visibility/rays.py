"""A shadow ray for each sample: the limit that every cheaper visibility of samples is measured by.

The estimator is that of `gather`, each term times V in {0, 1}. Rays run between the surface points that texels hold,
lifted off their triangles: interpolated normals would send them through the surface.

Symbols: d vector from receiver to sample (m), c = max(0, n . d), s = max(0, -m . d) with m = n_j ds_j / pi, g what
the radiance of a sample is multiplied by (Eq. 3 and 4).
"""

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.pairs.shadow_rays import receivers
from refgi.rays import far_offset
from refgi.sssil.crown.gather import level_factor
from refgi.sssil.crown.pattern import (
    level_key,
    pixel_key,
    pixel_offset,
    row_key,
    sample_points,
    sample_weight,
    shared_offsets,
)
from refgi.sssil.crown.reach import chosen_radius
from refgi.sssil.level import Level
from refgi.sssil.settings import HssilSettings
from refgi.stages import report_progress, stage

if TYPE_CHECKING:
    from refgi.frame import Frame

Array = npt.NDArray[Any]

BATCH = 1 << 18  # pairs held at a time


class Surfels(NamedTuple):
    """The texels of a level in a row, in float64; without a surface all is 0."""

    position: Array  # (3, n) from the eye, m
    normal: Array  # (3, n)
    area: Array  # (n,) m^2
    facing: Array  # (3, n): normals of the triangles
    origin: Array  # (3, n) float32: where rays start and end, world space, m


class Samples(NamedTuple):
    """Where the samples of a level lie."""

    offsets: Array  # (1 or h, phases, m, 2) int32 texels, by row and column; no m where each receiver has its own
    weight: Array  # (m,) texels that a sample stands for
    points: Array  # (m, 2) of the unit square, for receivers with samples of their own
    inner: int  # how many of them lie in the inner disc
    radius: float  # of the crown, texels
    key: Any  # uint32, draws the samples of the level


@stage("sssil.rays")
def ray_gather(level: Level, index: int, settings: HssilSettings, frame: "Frame", *, batch: int = BATCH) -> Array:
    """Sum what the samples around each texel of a level send to it past all that stands between.

    Parameters
    ----------
    level : Level
        Receivers and senders.
    index : int
        0 for the first level, whose inner disc is sampled as well.
    settings : HssilSettings
        How many samples, which pattern and which form factor.
    frame : Frame
        The scene whose view the level is.
    batch : int
        Pairs held at a time; changes no bit of the result.

    Returns
    -------
    (3, h, w) ndarray
        Irradiance, W/m^2, in the dtype of the level. Excludes albedo/pi.
    """
    surfels, samples = _surfels(level, frame), _samples(level, index, settings)
    radiance = level.radiance.reshape(3, -1)
    total, count = np.zeros(radiance.shape), len(samples.weight)
    step = max(1, batch // max(count, 1))
    rays = [np.empty((step * count, 3), np.float32) for _ in range(2)]
    worth, reach = np.empty(step * count), np.empty(step * count, np.float32)
    sender, blocked = np.empty(step * count, np.int64), np.empty(step * count, np.bool_)
    for first in range(0, total.shape[1], step):
        last = min(first + step, total.shape[1])
        size = (last - first) * count
        _aim(surfels, samples, level.shape, first, last, settings.form_factor == "disc", rays[0], rays[1], reach, worth,
             sender)
        frame.tracer.fill_occluded(rays[0][:size], rays[1][:size], reach[:size], blocked[:size])
        add_free(radiance, first, last, count, blocked, worth, sender, total)
        report_progress(last / total.shape[1])
    return (total * level_factor(index, settings)).reshape(level.radiance.shape).astype(level.radiance.dtype)


def _surfels(level: Level, frame: "Frame") -> Surfels:
    """Return texels with the triangles that they lie on; rays end where the texel's own pixel sees its surface."""
    seen = np.flatnonzero(level.pixel.reshape(-1) >= 0)
    pixel = level.pixel.reshape(-1)[seen]
    position, normal, triangle = frame.gbuffer.at(pixel, "position", "normal", "triangle_id")
    here = receivers(frame.scene.geometry, position, normal, triangle, frame.tracer.grain)
    facing, origin = np.zeros((3, level.pixel.size)), np.zeros((3, level.pixel.size), np.float32)
    facing[:, seen], origin[:, seen] = here.facing, here.origin
    position, normal = (plane.reshape(3, -1).astype(np.float64) for plane in (level.position, level.normal))
    return Surfels(position, normal, level.area.reshape(-1).astype(np.float64), facing, origin)


def _samples(level: Level, index: int, settings: HssilSettings) -> Samples:
    rows, columns = level.shape
    radius = chosen_radius((rows << index, columns << index), settings)
    inner = settings.inner if index == 0 else 0
    if settings.pattern == "pixel":
        offsets, weight = np.zeros((1, 1, 0, 2), np.int32), sample_weight(radius, inner, settings.samples)
    else:
        offsets, weight = shared_offsets(settings, index, level.number, rows, radius, columns)
    points = sample_points(inner, settings.samples)
    return Samples(offsets, weight, points, inner, radius, level_key(settings.seed, level.number))


@kernel(parallel=True)
def _aim(surfels: Surfels, samples: Samples, shape: tuple[int, int], first: int, last: int, disc: bool,
         origins: Array, directions: Array, reach: Array, worth: Array, sender: Array) -> None:
    """Write the ray of each pair of receivers first to last and their samples, and what its radiance is worth."""
    count = samples.weight.size
    for i in prange(last - first):
        ray = np.int64(i) * count
        _aim_one(surfels, samples, shape, first + np.int64(i), ray, disc, origins, directions, reach, worth, sender)


@kernel
def _aim_one(surfels: Surfels, samples: Samples, shape: tuple[int, int], receiver: Any, ray: Any, disc: bool,
             origins: Array, directions: Array, reach: Array, worth: Array, sender: Array) -> None:
    row, column = receiver // shape[1], receiver % shape[1]
    key = pixel_key(row_key(samples.key, row), column)
    own = samples.offsets.shape[2] == 0
    shared, phase = min(row, samples.offsets.shape[0] - 1), column % samples.offsets.shape[1]
    for j in range(samples.weight.size):
        if own:
            ox, oy = pixel_offset(samples.points, samples.inner, samples.radius, key, j)
        else:
            ox, oy = np.int64(samples.offsets[shared, phase, j, 0]), np.int64(samples.offsets[shared, phase, j, 1])
        a, b = row + oy, column + ox
        reach[ray + j] = 0.0
        if 0 <= a < shape[0] and 0 <= b < shape[1]:
            other = a * shape[1] + b
            sender[ray + j] = other
            worth[ray + j] = _pair(surfels, receiver, other, samples.weight[j], disc)
            reach[ray + j] = 1.0 if worth[ray + j] > 0.0 else 0.0
            far = far_offset(surfels.origin[0, other] - surfels.origin[0, receiver],
                             surfels.origin[1, other] - surfels.origin[1, receiver],
                             surfels.origin[2, other] - surfels.origin[2, receiver])
            for c in range(3):
                origins[ray + j, c] = surfels.origin[c, receiver]
                directions[ray + j, c] = (surfels.origin[c, other] - surfels.origin[c, receiver]
                                          + far * surfels.facing[c, other])


@kernel
def _pair(surfels: Surfels, i: int, j: int, weight: float, disc: bool) -> Any:
    """Return g of one pair; 0 where either end lies behind the plane of the other's triangle, which hides it."""
    square, c, s, above, before = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(3):
        d = surfels.position[k, j] - surfels.position[k, i]
        square += d * d
        c += surfels.normal[k, i] * d
        s -= surfels.normal[k, j] * d
        above += surfels.facing[k, i] * d
        before -= surfels.facing[k, j] * d
    if c <= 0.0 or s <= 0.0 or above <= 0.0 or before <= 0.0:
        return 0.0
    s *= surfels.area[j] * weight / math.pi
    below = square * square + (s * math.sqrt(square) if disc else 0.0)
    return math.pi * c * s / below  # Eq. (4), with its pi, or (3)


@kernel(parallel=True)
def add_free(radiance: Array, first: int, last: int, count: int, blocked: Array, worth: Array, sender: Array,
              total: Array) -> None:
    """Add up what comes along each receiver's free rays, two by two: mirror images are added to each other first.

    Parameters
    ----------
    radiance : (3, t) ndarray of float64
        Of every texel, W/m^2/sr.
    first, last : int
        Receivers: these and those up to the last.
    count : int
        Rays of each.
    blocked : (n,) ndarray of bool
        Which rays are blocked, receiver by receiver.
    worth : (n,) ndarray of float64
        What the radiance at a ray's end is multiplied by.
    sender : (n,) ndarray of int64
        Texel at a ray's end.
    total : (3, t) ndarray of float64
        Added to, W/m^2.
    """
    for i in prange(last - first):
        here = np.int64(i)
        end = (here + 1) * count
        for ray in range(here * count, end, 2):
            for c in range(3):
                pair = 0.0 if blocked[ray] else worth[ray] * radiance[c, sender[ray]]
                if ray + 1 < end and not blocked[ray + 1]:
                    pair += worth[ray + 1] * radiance[c, sender[ray + 1]]
                total[c, first + here] += pair
