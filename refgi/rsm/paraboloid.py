"""Paraboloid maps, exact: a texel is inside a triangle when its direction lies within the triangle's three planes.

Straight edges are arcs on a paraboloid map, so the test is made in direction space. With vertices v_i in the map's
frame, n_i = v_j x v_k, and the texel's direction d = (2s, 2t, 1 - s^2 - t^2) of length 1 + s^2 + t^2:

- e_i = d . n_i = -n_z s^2 + 2 n_x s + (2 t n_y + (1 - t^2) n_z), along a row a quadratic in s,
- inside where all e_i have the sign of det(v); on a plane the sign of n's first component that is not zero decides,
- the hit is tau d with 1/tau = sum(e_i)/det, its distance tau (1 + s^2 + t^2).

Adjacent triangles get exactly negated n, so a texel on a shared edge belongs to exactly one.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.rsm.projection import Projection, view_coordinates
from refgi.rsm.triangle import LANES, SMALLEST, SPAN_CUT, centres_between

Array = npt.NDArray[Any]

NEAREST = 1e-9  # share of a triangle's size under which a hit is rounding: its plane holds the centre


class Scratch(NamedTuple):
    """Room for each worker: vertices of the map that it draws."""

    corners: Array  # (workers, n, 5) float64: x, y, z in the map's frame, s, t
    faces: Array  # (m, 3) int32


class Ignored(NamedTuple):
    """What each map does not see of the geometry near its centre."""

    planes: Array  # (k,) float64, m: triangles whose plane passes nearer than this
    ball: Array  # (k,) float64, m: surfaces nearer than this, as if cut away


def draw_paraboloids(
    projection: Projection, vertices: Array, faces: Array, workers: int, nearness: Array, ids: Array,
    ignored: Ignored | None = None,
) -> Array:
    """Draw triangles on every paraboloid map, inside the hemisphere's disc.

    Parameters
    ----------
    projection : Projection
        The maps.
    vertices : (n, 3) ndarray
        World space, m.
    faces : (m, 3) ndarray
        Vertices of each triangle.
    workers : int
        Threads; maps are dealt to them in turn.
    nearness : (H, max(W, LANES)) ndarray
        Float32, receives 1/tau; 0 where nothing is.
    ids : (H, max(W, LANES)) ndarray
        Int32, receives the triangle's id.
    ignored : Ignored, optional
        What lies too near the centres to count; nothing where absent.

    Returns
    -------
    (k,) ndarray
        Int64: triangles of each map's hemisphere that were ignored for their planes.
    """
    scratch = Scratch(np.empty((workers, len(vertices), 5)), faces)
    none = np.zeros(projection.maps)
    left_out = np.zeros(projection.maps, np.int64)
    _draw_maps(projection, vertices, scratch, ignored or Ignored(none, none), nearness, ids, left_out)
    return left_out


@kernel(parallel=True)
def _draw_maps(
    projection: Projection, vertices: Array, scratch: Scratch, ignored: Ignored, nearness: Array, ids: Array,
    left_out: Array,
) -> None:
    workers, height = len(scratch.corners), projection.height
    for worker in prange(workers):
        corners = scratch.corners[worker]
        for m in range(worker, len(projection.origin), workers):
            for i in range(len(vertices)):
                x, y, z = view_coordinates(projection, m, vertices[i, 0], vertices[i, 1], vertices[i, 2])
                corners[i, 0], corners[i, 1], corners[i, 2] = x, y, z
                scale = 1.0 / max(math.sqrt(x * x + y * y + z * z) + z, SMALLEST)
                corners[i, 3], corners[i, 4] = x * scale, y * scale
            rows = slice(m * height, (m + 1) * height)
            near = 1.0 / (ignored.planes[m] * ignored.planes[m]), 1.0 / ignored.ball[m]
            left_out[m] = _draw(projection, corners, scratch.faces, near, nearness[rows], ids[rows])
            _clear_outside_disc(projection, nearness[rows], ids[rows])


@kernel
def _clear_outside_disc(projection: Projection, nearness: Array, ids: Array) -> None:
    n, half = projection.width, projection.half[0]
    step = 2.0 * half / n
    for row in range(n):
        t = (row + 0.5) * step - half
        for column in range(n):
            s = (column + 0.5) * step - half
            if s * s + t * t > 1.0:
                nearness[row, column] = 0.0
                ids[row, column] = -1


@kernel
def _plane(
    ax: float, ay: float, az: float, bx: float, by: float, bz: float, sign: float
) -> tuple[float, float, float, float]:
    """Return n = a x b times the sign of det, and the value of e from which on a texel is inside."""
    nx, ny, nz = (ay * bz - az * by) * sign, (az * bx - ax * bz) * sign, (ax * by - ay * bx) * sign
    owns = nx > 0.0 or (nx == 0.0 and (ny > 0.0 or (ny == 0.0 and nz > 0.0)))
    return nx, ny, nz, 0.0 if owns else SMALLEST


@kernel
def _draw(
    projection: Projection, corners: Array, faces: Array, near_limits: tuple[float, float], nearness: Array, ids: Array
) -> int:
    """Draw every triangle on one map; the loop is inside because calls with arrays cost atomic reference counts."""
    n, width, half = projection.width, nearness.shape[1], projection.half[0]
    steepest, nearest = near_limits  # 1 / distance^2 of planes, 1 / distance of hits that are ignored
    left_out = 0
    step, texels = 2.0 * half / n, 0.5 * n / half
    for face in range(len(faces)):
        i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
        xi, yi, zi = corners[i, 0], corners[i, 1], corners[i, 2]
        xj, yj, zj = corners[j, 0], corners[j, 1], corners[j, 2]
        xk, yk, zk = corners[k, 0], corners[k, 1], corners[k, 2]
        if zi < 0.0 and zj < 0.0 and zk < 0.0:
            continue
        if zi >= 0.0 and zj >= 0.0 and zk >= 0.0:
            s_low, s_high, t_low, t_high = _box_ahead(
                corners[i, 3], corners[i, 4], corners[j, 3], corners[j, 4], corners[k, 3], corners[k, 4]
            )
        else:
            s_low, s_high, t_low, t_high = _box_across((xi, xj, xk, xi), (yi, yj, yk, yi), (zi, zj, zk, zi))
        first, last = centres_between((s_low + half) * texels, (s_high + half) * texels, n)
        top, bottom = centres_between((t_low + half) * texels, (t_high + half) * texels, n)
        if first > last or top > bottom:
            continue
        det = xi * (yj * zk - zj * yk) + yi * (zj * xk - xj * zk) + zi * (xj * yk - yj * xk)
        if det == 0.0:  # no area, or seen edge-on
            continue
        sign = 1.0 if det > 0.0 else -1.0
        x0, y0, z0, t0 = _plane(xj, yj, zj, xk, yk, zk, sign)
        x1, y1, z1, t1 = _plane(xk, yk, zk, xi, yi, zi, sign)
        x2, y2, z2, t2 = _plane(xi, yi, zi, xj, yj, zj, sign)
        scale = sign / det
        xn, yn, zn = (x0 + x1 + x2) * scale, (y0 + y1 + y2) * scale, (z0 + z1 + z2) * scale
        if xn * xn + yn * yn + zn * zn > steepest:  # its plane lies 1/|n| from the centre
            left_out += 1
            continue
        size = max(_longest(xi, yi, zi), max(_longest(xj, yj, zj), _longest(xk, yk, zk)))
        limit = np.float32(1.0 / (NEAREST * size))
        for row in range(top, bottom + 1):
            t = (row + 0.5) * step - half
            rest = 1.0 - t * t
            r0, r1, r2 = 2.0 * t * y0 + rest * z0, 2.0 * t * y1 + rest * z1, 2.0 * t * y2 + rest * z2
            rn = 2.0 * t * yn + rest * zn
            line, left, right, length = np.uint64(row), first, last, 1.0 + t * t
            if last - first > SPAN_CUT:
                left, right = _cut(left, right, x0, z0, r0, step, 0.5 * (n - 1))
                left, right = _cut(left, right, x1, z1, r1, step, 0.5 * (n - 1))
                left, right = _cut(left, right, x2, z2, r2, step, 0.5 * (n - 1))
            for block in range((right - left + LANES) // LANES):
                start = min(left + block * LANES, width - LANES)
                place_0, centre = np.uint64(start), start + 0.5
                for lane in range(LANES):
                    column = place_0 + np.uint64(lane)
                    s = (centre + lane) * step - half
                    near = np.float32((2.0 * xn - zn * s) * s + rn)
                    inside = (
                        ((2.0 * x0 - z0 * s) * s + r0 >= t0)
                        & ((2.0 * x1 - z1 * s) * s + r1 >= t1)
                        & ((2.0 * x2 - z2 * s) * s + r2 >= t2)
                    )
                    far_enough = (near <= limit) & (near <= (length + s * s) * nearest)
                    if inside & (near > nearness[line, column]) & far_enough:
                        nearness[line, column] = near
                        ids[line, column] = face
    return left_out


@kernel
def _cut(
    first: int, last: int, nx: float, nz: float, rest: float, step: float, middle: float
) -> tuple[int, int]:
    """Shorten a span to where -n_z s^2 + 2 n_x s + rest may be >= 0, with a texel to spare."""
    square = nx * nx + nz * rest
    if square < 0.0:
        return (first, last) if nz < 0.0 else (first, first - 1)
    q = nx + math.copysign(math.sqrt(square), nx)
    if q == 0.0:
        return first, last
    one, other = q / (nz + 0.0) / step + middle, -rest / q / step + middle  # roots, as columns; nz + 0.0 is never -0.0
    low = min(max(min(one, other), first - 2.0), last + 2.0)
    high = min(max(max(one, other), first - 2.0), last + 2.0)
    if nz >= 0.0:  # between the roots
        return max(first, int(low) - 1), min(last, int(high) + 2)
    if low < first - 1.0:  # outside them: to the right
        return max(first, int(high) - 1), last
    if high > last + 1.0:
        return first, min(last, int(low) + 2)
    return first, last


@kernel
def _longest(x: float, y: float, z: float) -> Any:
    return max(abs(x), max(abs(y), abs(z)))


@kernel
def _bulge(square: float) -> Any:
    """Return how far an edge may leave its chord of squared length L^2: 1 - sqrt(1 - L^2/4).

    Each edge is an arc of at most half a circle, of radius R >= 1: R - sqrt(R^2 - L^2/4) is largest for R = 1.
    """
    if square < 0.04:
        return 0.13 * square + 1e-12
    return 1.0 - math.sqrt(max(1.0 - 0.25 * square, 0.0)) + 1e-12


@kernel
def _box_ahead(
    s0: float, t0: float, s1: float, t1: float, s2: float, t2: float
) -> tuple[float, float, float, float]:
    """Return the range of s and of t that a triangle ahead of the plane z = 0 may cover."""
    chord = max((s1 - s0) * (s1 - s0) + (t1 - t0) * (t1 - t0),
                max((s2 - s1) * (s2 - s1) + (t2 - t1) * (t2 - t1),
                    (s0 - s2) * (s0 - s2) + (t0 - t2) * (t0 - t2)))  # fmt: skip
    bulge = _bulge(chord)
    return (min(s0, min(s1, s2)) - bulge, max(s0, max(s1, s2)) + bulge,
            min(t0, min(t1, t2)) - bulge, max(t0, max(t1, t2)) + bulge)  # fmt: skip


@kernel
def _box_across(x: Any, y: Any, z: Any) -> tuple[float, float, float, float]:
    """Return the range of s and of t that the part ahead of z = 0 may cover of a triangle that crosses it."""
    s_low, s_high, t_low, t_high, longest = np.inf, -np.inf, np.inf, -np.inf, 0.0
    s_first, t_first, s_last, t_last = np.nan, np.nan, np.nan, np.nan
    for half_step in range(6):  # each corner, then where its edge meets the plane
        a = half_step // 2
        if half_step % 2 == 0:
            if z[a] < 0.0:
                continue
            scale = 1.0 / max(math.sqrt(x[a] * x[a] + y[a] * y[a] + z[a] * z[a]) + z[a], SMALLEST)
            s, t = x[a] * scale, y[a] * scale
        else:
            if (z[a] < 0.0) == (z[a + 1] < 0.0):
                continue
            share = z[a] / (z[a] - z[a + 1])
            rim_x, rim_y = x[a] + share * (x[a + 1] - x[a]), y[a] + share * (y[a + 1] - y[a])
            length = math.sqrt(rim_x * rim_x + rim_y * rim_y)
            if length == 0.0:  # through the centre itself: no way to tell
                return -1.0, 1.0, -1.0, 1.0
            s, t = rim_x / length, rim_y / length
        s_low, s_high, t_low, t_high = min(s_low, s), max(s_high, s), min(t_low, t), max(t_high, t)
        if s_first == s_first:
            longest = max(longest, (s - s_last) * (s - s_last) + (t - t_last) * (t - t_last))
        else:
            s_first, t_first = s, t
        s_last, t_last = s, t
    longest = max(longest, (s_first - s_last) * (s_first - s_last) + (t_first - t_last) * (t_first - t_last))
    bulge = _bulge(longest)
    return s_low - bulge, s_high + bulge, t_low - bulge, t_high + bulge
