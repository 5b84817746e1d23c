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

import numba
import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.rsm.attributes import Planes, Surface, Wanted, resolve
from refgi.rsm.projection import Projection, paraboloid_projection, view_coordinates
from refgi.rsm.triangle import LANES, SMALLEST, centres_between
from refgi.scene.model import Geometry
from refgi.stages import stage

Array = npt.NDArray[Any]

NEAREST = 1e-9  # share of a triangle's size under which a hit is rounding: its plane holds the centre


class Scratch(NamedTuple):
    """Room for each worker: vertices of the map that it draws."""

    corners: Array  # (workers, n, 5) float64: x, y, z in the map's frame, s, t
    faces: Array  # (m, 3) int32


def draw_paraboloids(
    projection: Projection, vertices: Array, faces: Array, workers: int, nearness: Array, ids: Array
) -> None:
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
    """
    scratch = Scratch(np.empty((workers, len(vertices), 5)), faces)
    _draw_maps(projection, vertices, scratch, nearness, ids)


@kernel(parallel=True)
def _draw_maps(projection: Projection, vertices: Array, scratch: Scratch, nearness: Array, ids: Array) -> None:
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
            _draw(projection, corners, scratch.faces, nearness[rows], ids[rows])


@kernel
def _plane(corners: Array, j: int, k: int, sign: float) -> tuple[float, float, float, float]:
    """Return n = v_j x v_k times the sign of det, and the value of e from which on a texel is inside."""
    ax, ay, az = corners[j, 0], corners[j, 1], corners[j, 2]
    bx, by, bz = corners[k, 0], corners[k, 1], corners[k, 2]
    nx, ny, nz = (ay * bz - az * by) * sign, (az * bx - ax * bz) * sign, (ax * by - ay * bx) * sign
    owns = nx > 0.0 or (nx == 0.0 and (ny > 0.0 or (ny == 0.0 and nz > 0.0)))
    return nx, ny, nz, 0.0 if owns else SMALLEST


@kernel
def _draw(projection: Projection, corners: Array, faces: Array, nearness: Array, ids: Array) -> None:
    """Draw every triangle on one map; the loop is inside because calls with arrays cost atomic reference counts."""
    n, width, half = projection.width, nearness.shape[1], projection.half[0]
    step = 2.0 * half / n
    for face in range(len(faces)):
        i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
        s_low, s_high, t_low, t_high = _disc_box(corners, i, j, k)
        first, last = centres_between((s_low + half) / step, (s_high + half) / step, n)
        top, bottom = centres_between((t_low + half) / step, (t_high + half) / step, n)
        if first > last or top > bottom:
            continue
        px, py, pz, _ = _plane(corners, j, k, 1.0)
        det = corners[i, 0] * px + corners[i, 1] * py + corners[i, 2] * pz
        if det == 0.0:
            continue
        sign = 1.0 if det > 0.0 else -1.0
        x0, y0, z0, t0 = _plane(corners, j, k, sign)
        x1, y1, z1, t1 = _plane(corners, k, i, sign)
        x2, y2, z2, t2 = _plane(corners, i, j, sign)
        scale = sign / det
        xn, yn, zn = (x0 + x1 + x2) * scale, (y0 + y1 + y2) * scale, (z0 + z1 + z2) * scale
        limit = np.float32(1.0 / (NEAREST * _size(corners, i, j, k)))
        for row in range(top, bottom + 1):
            t = (row + 0.5) * step - half
            rest = 1.0 - t * t
            r0, r1, r2 = 2.0 * t * y0 + rest * z0, 2.0 * t * y1 + rest * z1, 2.0 * t * y2 + rest * z2
            rn = 2.0 * t * yn + rest * zn
            line = np.uint64(row)
            for block in range((last - first + LANES) // LANES):
                start = min(first + block * LANES, width - LANES)
                place_0, centre = np.uint64(start), start + 0.5
                for lane in range(LANES):
                    column = place_0 + np.uint64(lane)
                    s = (centre + lane) * step - half
                    near = np.float32((2.0 * xn - zn * s) * s + rn)
                    inside = (
                        ((2.0 * x0 - z0 * s) * s + r0 >= t0)
                        & ((2.0 * x1 - z1 * s) * s + r1 >= t1)
                        & ((2.0 * x2 - z2 * s) * s + r2 >= t2)
                        & (s * s <= rest)
                    )
                    if inside & (near > nearness[line, column]) & (near <= limit):
                        nearness[line, column] = near
                        ids[line, column] = face


@kernel
def _size(corners: Array, i: int, j: int, k: int) -> float:
    """Return the largest coordinate of a triangle, m."""
    size = 0.0
    for axis in range(3):
        size = max(size, max(abs(corners[i, axis]), max(abs(corners[j, axis]), abs(corners[k, axis]))))
    return size


@kernel
def _disc_box(corners: Array, i: int, j: int, k: int) -> tuple[float, float, float, float]:
    """Return the range of s and of t that the part of a triangle before the plane z = 0 may cover.

    The corners of that part span a box; each of its edges is an arc of at most half a circle of radius R >= 1, which
    leaves its chord L by no more than R - sqrt(R^2 - L^2/4) <= 1 - sqrt(1 - L^2/4).
    """
    if corners[i, 2] < 0.0 and corners[j, 2] < 0.0 and corners[k, 2] < 0.0:
        return 1.0, 0.0, 1.0, 0.0
    s_low, s_high, t_low, t_high = np.inf, -np.inf, np.inf, -np.inf
    s_last, t_last, chord = np.nan, np.nan, 0.0
    s_first, t_first = np.nan, np.nan
    ends = (i, j, k, i)
    for side in range(3):
        a, b = ends[side], ends[side + 1]
        for step in range(2):
            if step == 0:
                if corners[a, 2] < 0.0:
                    continue
                s, t = corners[a, 3], corners[a, 4]
            else:
                if (corners[a, 2] < 0.0) == (corners[b, 2] < 0.0):
                    continue
                share = corners[a, 2] / (corners[a, 2] - corners[b, 2])
                x = corners[a, 0] + share * (corners[b, 0] - corners[a, 0])
                y = corners[a, 1] + share * (corners[b, 1] - corners[a, 1])
                length = math.sqrt(x * x + y * y)
                if length == 0.0:  # through the centre itself: no way to tell
                    return -1.0, 1.0, -1.0, 1.0
                s, t = x / length, y / length
            s_low, s_high, t_low, t_high = min(s_low, s), max(s_high, s), min(t_low, t), max(t_high, t)
            if s_first != s_first:
                s_first, t_first = s, t
            else:
                chord = max(chord, (s - s_last) * (s - s_last) + (t - t_last) * (t - t_last))
            s_last, t_last = s, t
    chord = max(chord, (s_first - s_last) * (s_first - s_last) + (t_first - t_last) * (t_first - t_last))
    bulge = 1.0 - math.sqrt(max(1.0 - 0.25 * chord, 0.0)) + 1e-12
    return s_low - bulge, s_high + bulge, t_low - bulge, t_high + bulge


@stage("rsm.paraboloid_depth_maps")
def paraboloid_depth_maps(
    geometry: Geometry, centers: Array, axes: Array, size: int, dtype: npt.DTypeLike = np.float32
) -> Array:
    """Measure the distance to the nearest surface from many points, on a hemisphere each.

    Parameters
    ----------
    geometry : Geometry
        The triangles.
    centers, axes : (k, 3) ndarray
        Where each map looks from (m) and to (any length).
    size : int
        Texels along a side.
    dtype : dtype
        Float32 or float64.

    Returns
    -------
    (k, n, n) ndarray
        Distance, m; inf where nothing is seen and outside the disc. Map m's frame is
        ``refgi.rsm.projection.paraboloid_projection(centers, axes, size).frame[m]``.

    Raises
    ------
    InputError
        If centres and axes do not match or are not finite, an axis is zero, or the size cannot be used.
    """
    centers = np.reshape(np.asarray(centers, np.float64), (-1, 3))
    axes = np.reshape(np.asarray(axes, np.float64), (-1, 3))
    expect(np.dtype(dtype) in (np.float32, np.float64), "dtype", "float32 or float64", np.dtype(dtype).name)
    expect(len(centers) == len(axes), "axes", f"{len(centers)} as many as centres", len(axes))
    expect(bool(np.isfinite(centers).all()), "centers", "finite coordinates", centers)
    expect(bool(np.isfinite(axes).all() and axes.any(axis=1).all()), "axes", "finite vectors, not zero", axes)
    projection = paraboloid_projection(centers, axes, size)
    height, width = projection.shape
    nearness = np.full((height, max(width, LANES)), 0.0, np.float32)
    ids = np.full(nearness.shape, -1, np.int32)
    if len(geometry.faces):
        draw_paraboloids(projection, geometry.vertices, geometry.faces, numba.get_num_threads(), nearness, ids)
    if np.dtype(dtype) == np.float64:
        return _exact_distances(geometry, projection, ids[:, :width]).reshape(-1, size, size)
    distance = np.full((len(centers), size, size), np.inf, np.float32)
    _distances(projection, nearness, distance)
    return distance


def _exact_distances(geometry: Geometry, projection: Projection, ids: Array) -> Array:
    """Return the distance to the plane of each texel's triangle, float64."""
    distance, none, no_vectors = np.zeros(ids.shape), np.zeros((0, 0)), np.zeros((3, 0, 0))
    surface = Surface(geometry.vertices, geometry.faces, np.zeros((0, 3)), geometry.material_of_face, np.zeros((1, 3)))
    planes = Planes(distance, none, no_vectors, no_vectors, no_vectors, np.zeros((0, 0), np.int32))
    wanted = Wanted(True, False, False, False, False, False)
    resolve(surface, projection, np.ascontiguousarray(ids), wanted, planes, numba.get_num_threads())
    return distance


@kernel(parallel=True)
def _distances(projection: Projection, nearness: Array, distance: Array) -> None:
    n, half = projection.width, projection.half[0]
    step = 2.0 * half / n
    for row in prange(distance.shape[0] * n):
        t = (row % n + 0.5) * step - half
        for column in range(n):
            near = nearness[row, column]
            if near > 0.0:
                s = (column + 0.5) * step - half
                distance[row // n, row % n, column] = (1.0 + s * s + t * t) / near
