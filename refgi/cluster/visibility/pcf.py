"""Filter sizes, hard shadows and percentage closer filtering (PCF): binary depth tests of the texels around a receiver.

A cone of half-angle a around a direction at polar angle theta is a disc on a stereographic map: centre sin(theta) /
(cos(theta) + cos(a)) and radius sin(a) / (cos(theta) + cos(a)), exactly. PCF compares a square of fixed width (Reeves,
Salesin and Cook 1987). A texel holds the distance along its own centre's direction, so the receiver is moved there as
well, on its tangent plane: sloping surfaces need no bias. The least depth of each block of texels tells exactly which
regions cannot hide a receiver. d, z: distances of receiver and blockers, m.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.cluster.maps import BACKWARD, ShadowMaps
from refgi.jit import kernel
from refgi.skips import left_out
from refgi.types import Array

SIDE = 8  # texels of a block


def casters_of(depth: Array) -> Array:
    """Return the least depth, m, of each block of a map (n, n), inf where it holds nothing; without the skip -inf."""
    blocks = -(-len(depth) // SIDE)
    least = np.full((blocks, blocks), np.inf, depth.dtype)
    _fill_least(depth, least)
    if left_out("cluster.casters", lambda: (np.isinf(least).sum(), least.size)):
        return least
    return np.full_like(least, -np.inf)


@kernel
def _fill_least(depth: Array, least: Array) -> None:
    for i in range(len(depth)):
        for j in range(len(depth)):
            least[i // SIDE, j // SIDE] = min(least[i // SIDE, j // SIDE], depth[i, j])


@kernel
def least_depth(least: Array, first: int, last: int, top: int, bottom: int) -> Any:
    """Return a lower bound, m, of the depths of the texels of some columns and rows, of which some may lie outside."""
    found = least.dtype.type(math.inf)
    blocks = len(least)
    for i in range(max(top, 0) // SIDE, min(max(bottom, 0) // SIDE, blocks - 1) + 1):
        for j in range(max(first, 0) // SIDE, min(max(last, 0) // SIDE, blocks - 1) + 1):
            found = min(found, least[i, j])
    return found


STEEPEST = math.tan(math.radians(80.0))  # of a cone; nearer blockers would ask for more than the hemisphere


@kernel
def cone_tangent(delta: Any, d: Any, z: Any) -> Any:
    """Return tan(a) = Delta (d - z) / (2 d z), 0 for z >= d, <= tan(80 deg): the light seen through z > 0.

    The search takes the nearest depth for z, the final filter z_avg: 2 tan(a) = p cos(beta) / d of Sec. 4.2, centred.
    """
    zero, cap = type(d)(0.0), type(d)(STEEPEST)
    # Sec. 4.2: p cos(beta) = (d - z_avg) Delta / z_avg, Fig. 3
    tangent = delta * (d - z) / (type(d)(2.0) * d * z)
    return (tangent if tangent < cap else cap) if d > z else zero


@kernel
def published_tangent(delta: Any, d: Any, z: Any) -> Any:
    """Return tan(alpha / 2), alpha = arctan(p cos(beta) / d) as printed in Sec. 4.2, from the axis on; at most 1."""
    ratio = type(d)(2.0) * cone_tangent(delta, d, z)
    return ratio / (type(d)(1.0) + math.sqrt(type(d)(1.0) + ratio * ratio))


@kernel
def solid_angle_tangent(delta: Any, d: Any) -> Any:
    """Return tan(a) = Delta / (2 d), <= tan(80 deg): the published search, which misses blockers near the light."""
    tangent = delta / (type(d)(2.0) * d)
    return tangent if tangent < type(d)(STEEPEST) else type(d)(STEEPEST)


@kernel
def farthest_tangent(delta: Any, d: Any, r: Any) -> Any:
    """Return tan(theta) of the directions in which a point at the distance r may lie before the light, <= tan(80 deg).

    r sin(theta) <= (Delta / 2)(1 - r cos(theta) / d), so theta <= arcsin(Delta cos(phi) / 2 r) - phi, tan(phi) = Delta
    / 2 d.
    """
    zero, one, cap = type(d)(0.0), type(d)(1.0), type(d)(STEEPEST)
    phi = delta / (type(d)(2.0) * d)
    sine = delta / (type(d)(2.0) * r * math.sqrt(one + phi * phi))
    if r >= d or sine >= one:
        return zero if r >= d else cap
    outer = sine / math.sqrt(one - sine * sine)
    below = one + outer * phi
    tangent = (outer - phi) / below
    return tangent if tangent < cap else cap


@kernel
def disc(x: Any, y: Any, z: Any, d: Any, tangent: Any) -> tuple[Any, Any, Any]:
    """Return centre s, t and radius, [-1, 1] units, of the disc of a cone around a receiver in the map's frame, m."""
    one = type(d)(1.0)
    cosine = one / math.sqrt(one + tangent * tangent)
    scale = one / (z + d * cosine)
    return x * scale, y * scale, d * tangent * cosine * scale


@kernel
def published_square(x: Any, y: Any, z: Any, d: Any, tangent: Any) -> tuple[Any, Any, Any]:
    """Return s, t and half the side, [-1, 1] units, of the square of side alpha / pi around the receiver (Sec. 4.2).

    (2 / pi)(1 + cos(theta)) times the width of the exact disc: 1.27 on the axis, 0.64 at the rim.
    """
    scale = type(d)(1.0) / (z + d)
    return x * scale, y * scale, math.atan(tangent) * type(d)(2.0 / math.pi)


SLACK = 1e-3  # share of its distance that a surface must lie before the receiver to hide it


class PcfShadow(NamedTuple):
    """One map and the width of the kernel."""

    depth: Array  # (n, n) m; inf where the map is empty
    center: Array  # (3,) float64, m
    frame: Array  # (3, 3) float64: rows right, down, forward
    reach: Any  # texels on each side of the receiver's own; 0: the hard test
    casters: Array  # of `casters_of`; not read by the hard test


def pcf_shadow(maps: ShadowMaps, k: int, texels: int, behind: bool = False) -> PcfShadow:
    """Return map k, ahead or behind, with a kernel of texels x texels (odd)."""
    depth, frame = (maps.behind, BACKWARD @ maps.frame[k]) if behind else (maps.depth, maps.frame[k])
    assert depth is not None
    casters = casters_of(depth[k]) if texels > 1 else depth[k]
    return PcfShadow(depth[k], maps.center[k], frame, np.int64(texels // 2), casters)


@kernel
def pcf_tile(
    shadow: PcfShadow, points: Array, facing: Array, size: int, active: Array, visible: Array, scratch: Any  # noqa: ARG001
) -> None:
    """Fill V = 1 - blocked / tested for the active ones of `size` receivers, m; 1 behind the map's plane."""
    depth, center, frame, reach = shadow.depth, shadow.center, shadow.frame, shadow.reach
    real = points.dtype.type
    one, half = real(1), real(0.5)
    cx, cy, cz = real(center[0]), real(center[1]), real(center[2])
    rx, ry, rz = real(frame[0, 0]), real(frame[0, 1]), real(frame[0, 2])
    dx, dy, dz = real(frame[1, 0]), real(frame[1, 1]), real(frame[1, 2])
    fx, fy, fz = real(frame[2, 0]), real(frame[2, 1]), real(frame[2, 2])
    n = depth.shape[0]
    side = real(n)
    for i in range(size):
        visible[i] = one
        vx, vy, vz = points[0, i] - cx, points[1, i] - cy, points[2, i] - cz
        x, y, z = rx * vx + ry * vy + rz * vz, dx * vx + dy * vy + dz * vz, fx * vx + fy * vy + fz * vz
        if not (active[i] and z > real(0)):
            continue
        distance = math.sqrt(x * x + y * y + z * z)
        scale = one / (distance + z)
        column = min(int((x * scale + one) * half * side), n - 1)
        row = min(int((y * scale + one) * half * side), n - 1)
        if reach > 0 and least_depth(
                shadow.casters, column - reach, column + reach, row - reach, row + reach) >= distance:
            continue
        nx, ny, nz = facing[0, i], facing[1, i], facing[2, i]
        # along right, down, forward
        a, b, c = rx * nx + ry * ny + rz * nz, dx * nx + dy * ny + dz * nz, fx * nx + fy * ny + fz * nz
        height = a * x + b * y + c * z
        tested, blocked = 0, 0
        for v in range(max(row - reach, 0), min(row + reach, n - 1) + 1):
            t = (real(v) + half) / side * real(2) - one
            for u in range(max(column - reach, 0), min(column + reach, n - 1) + 1):
                s = (real(u) + half) / side * real(2) - one
                if s * s + t * t > one and (u != column or v != row):
                    continue
                tested += 1
                blocked += _hides(depth[v, u], s, t, a, b, c, height, distance)
        visible[i] = one - real(blocked) / real(tested)


@kernel
def _hides(depth: Any, s: Any, t: Any, a: Any, b: Any, c: Any, height: Any, distance: Any) -> bool:
    """Return whether a depth lies before the tangent plane along its texel's direction, and before the receiver."""
    real = type(s)
    one = real(1)
    length = one + s * s + t * t
    slope = (real(2) * (a * s + b * t) + c * (real(2) - length)) / length
    limit = distance
    if height * slope > real(0):
        limit = min(distance, height / slope)
    return bool(depth < limit * real(1 - SLACK))
