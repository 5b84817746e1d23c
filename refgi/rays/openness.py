"""Openness: the share of cosine-weighted directions above a surface that nothing blocks within a radius (SII Sec. 3.5).

The paper calls it the ambient occlusion term O, "the ratio of environment light a surface point would be likely to
receive": 1 in the open, 1/2 at the edge of a right angle. Many codes give that name to 1 - O.

Each point sends the same low-discrepancy set of directions, turned about the normal and shifted in sin^2 of the polar
angle (modulo 1) by two random numbers of its own. Every single estimate is unbiased and neighbours' errors differ.
"""

import math

import numpy as np

from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.radiometry import orthonormal_basis
from refgi.rays.tracer import Tracer
from refgi.rays.watertight import ray_offset
from refgi.sampling import hash_bits, sobol_owen
from refgi.stages import report_progress, stage
from refgi.types import Array

SPAN = 1 << 19  # rays at a time: 14 MB
CHUNK = 64  # points that one parallel iteration owns
MOST_RAYS = 1 << 16


@stage("rays.openness")
def openness(
    tracer: Tracer, position: Array, normal: Array, covered: Array | None = None, *, radius: float, rays: int = 64,
    seed: int = 0,
) -> Array:
    """Return how open surface points are: the share of cosine-weighted directions free within a radius.

    tracer: What may block.
    position (3, ...): Points, world space, m.
    normal (3, ...): Their unit normals.
    covered (...) bool: Where there is a surface; everywhere if absent.
    radius: How far blockers count, m; inf for no limit.
    rays: Directions a point.
    seed: Which randomisation.
    -> (...): 0 to 1, dtype of `position`; 1 without surface.

    Raises
    ------
    InputError
        If shapes do not fit or a number is out of range.

    Notes
    -----
    The same point, index and seed give the same value whatever other points are passed, for any number of
    threads. Near a wall at distance d the exact value is 1 - (acos t - t sqrt(1 - t^2)) / pi, t = d / radius.
    """
    expect(position.ndim >= 1 and position.shape[0] == 3, "position", "shape (3, ...)", position.shape)
    expect(normal.shape == position.shape, "normal", f"shape {position.shape} as position", normal.shape)
    expect(covered is None or covered.shape == position.shape[1:], "covered", f"shape {position.shape[1:]}",
           None if covered is None else covered.shape)
    expect(radius > 0, "radius", "a length > 0 m", radius)
    expect(1 <= rays <= MOST_RAYS, "rays", f"1 to {MOST_RAYS} directions a point", rays)
    expect(seed >= 0, "seed", "a whole number >= 0", seed)
    index = np.arange(math.prod(position.shape[1:])) if covered is None else np.flatnonzero(covered)
    at, up = (np.ascontiguousarray(part.reshape(3, -1)[:, index].T, np.float64) for part in (position, normal))
    share = np.ones(math.prod(position.shape[1:]), position.dtype)
    share[index] = _open_shares(tracer, at, up, index, radius, rays, seed)
    return share.reshape(position.shape[1:])


def _open_shares(tracer: Tracer, at: Array, up: Array, index: Array, radius: float, rays: int, seed: int) -> Array:
    """Trace the points span by span and return their shares of free rays."""
    directions = _directions(rays, seed)
    step = max(1, SPAN // rays)
    shares = np.empty(len(at))
    size = min(step, len(at)) * rays
    origin, direction = np.empty((size, 3), np.float32), np.empty((size, 3), np.float32)
    reach, blocked = np.full(size, radius, np.float32), np.empty(size, np.bool_)
    for first in range(0, len(at), step):
        part = slice(first, min(first + step, len(at)))
        count = (part.stop - first) * rays
        _aim(at[part], up[part], index[part], tracer.grain, directions, seed, origin, direction)
        tracer.fill_occluded(origin[:count], direction[:count], reach[:count], blocked[:count])
        shares[part] = 1 - blocked[:count].reshape(-1, rays).sum(axis=1) / rays
        report_progress(part.stop / len(at))
    return shares


@kernel
def _directions(rays: int, seed: int) -> Array:
    """Return sin^2 of the polar angle, and cosine and sine of the turn, of each direction of the set."""
    directions = np.empty((rays, 3))
    for k in range(rays):
        turn = 2 * math.pi * sobol_owen(np.uint32(k), 1, np.uint32(seed))
        directions[k, 0] = sobol_owen(np.uint32(k), 0, np.uint32(seed))
        directions[k, 1], directions[k, 2] = math.cos(turn), math.sin(turn)
    return directions


@kernel(parallel=True)
def _aim(at: Array, up: Array, index: Array, grain: float, directions: Array, seed: int, origin: Array,
         direction: Array) -> None:
    for chunk in prange((len(at) + CHUNK - 1) // CHUNK):
        for i in range(chunk * CHUNK, min(len(at), chunk * CHUNK + CHUNK)):
            _aim_one(at, up, i, index[i], grain, directions, seed, origin, direction)


@kernel
def _aim_one(at: Array, up: Array, i: int, index: int, grain: float, directions: Array, seed: int, origin: Array,
             direction: Array) -> None:
    """Write the rays of point i: its own turn about the normal and shift in sin^2."""
    word = hash_bits(np.uint32(index) ^ hash_bits(np.uint32(seed) + np.uint32(0x9E3779B9)))
    shift, turn = word * 2.0**-32, 2 * math.pi * (hash_bits(word + np.uint32(1)) * 2.0**-32)
    c, s = math.cos(turn), math.sin(turn)
    tx, ty, tz, bx, by, bz = orthonormal_basis(up[i, 0], up[i, 1], up[i, 2])
    ray, offset = i * len(directions), ray_offset(at[i, 0], at[i, 1], at[i, 2], grain)
    for k in range(len(directions)):
        sin2 = directions[k, 0] + shift
        sin2 -= 1.0 if sin2 >= 1 else 0.0
        radius, z = math.sqrt(sin2), math.sqrt(1 - sin2)
        x = radius * (c * directions[k, 1] - s * directions[k, 2])
        y = radius * (s * directions[k, 1] + c * directions[k, 2])
        direction[ray, 0] = tx * x + bx * y + up[i, 0] * z
        direction[ray, 1] = ty * x + by * y + up[i, 1] * z
        direction[ray, 2] = tz * x + bz * y + up[i, 2] * z
        for axis in range(3):
            origin[ray, axis] = at[i, axis] + offset * up[i, axis]
        ray += 1
