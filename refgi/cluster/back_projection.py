"""Visibility of an area light's rectangle by projecting its map back onto it (Guennebaud, Barthe and Paulin 2006).

Each texel nearer than the receiver's surface is a patch at its depth that hides a quadrilateral of the light's plane. V
is the share of the rectangle that none hides, kept as a grid in coordinates of its sides and normal.
"""

import math
from functools import lru_cache
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from refgi.cluster.maps import BACKWARD, ShadowMaps
from refgi.cluster.rectangle import AreaLights, VisibilityFunction
from refgi.cluster.visibility.pcf import SLACK
from refgi.cluster.visibility.steps import Places, maps_of, planes
from refgi.jit import kernel, prange
from refgi.stages import stage
from refgi.types import Array

CELLS = 32  # of the grid along each side of the rectangle
AT_ONCE = 32  # receivers that share scratch
LEAST_SIDE = 1e-9  # of a rectangle, as a share of the farthest place: a point light has none


class Patches(NamedTuple):
    """Texels of one map that hold something."""

    corner: Array  # (k, 4, 3) float64, m
    direction: Array  # (k, 3) unit vectors through texel centres
    depth: Array  # (k,) float64, m


def back_projection_visibility(
    areas: AreaLights, maps: ShadowMaps, rays: VisibilityFunction | None = None
) -> VisibilityFunction:
    """Return V of an area light from its map, projected back onto its rectangle.

    `rays` gives V of receivers behind an area light; without, the maps of the hemispheres behind do, or it is 1. As
    published, patches of neighbouring texels at unlike depths leave gaps or overlap: V is too large behind slanted
    surfaces. Without a map V = 1, as for a receiver with no part of the rectangle above its horizon. What lies above
    that of an interpolated normal and below the face counts as hidden.
    """
    @lru_cache(maxsize=2)
    def patches_of(m: int, sign: float) -> Patches:
        k, turned = maps.map_of[m], np.array([1.0, 1.0, sign])[:, None]
        depth, frame = (maps.depth, maps.frame[k]) if sign > 0 else (maps.behind, BACKWARD @ maps.frame[k])
        return _patches(np.asarray(depth)[k], frame, _axes(areas, m) * turned)

    def visibility_of(m: int, points: Array, facing: Array, shading: Array | None = None) -> Array:
        k, visible = maps.map_of[m], np.ones(points.shape[1])
        center = maps.center[k] if k >= 0 else areas.center[:, m]
        x = _axes(areas, m) @ (points.astype(np.float64) - center[:, None])
        up = _axes(areas, m) @ facing.astype(np.float64)
        horizon = up if shading is None else _axes(areas, m) @ shading.astype(np.float64)
        for sign in () if k < 0 else (1.0,) if maps.behind is None else (1.0, -1.0):
            turned = np.array([1.0, 1.0, sign])[:, None]  # behind: mirrored, so that it lies ahead
            low, cell = _grid(areas, maps, m, k)
            low[2] *= sign
            on = x[2] * sign > 0
            visible[on] = _visible(patches_of(m, sign), turned * x[:, on], turned * up[:, on],
                                   turned * horizon[:, on], low, cell)
        if rays is not None:
            back = x[2] <= 0
            beside = {} if shading is None else {"shading": shading[:, back]}
            visible[back] = rays(m, points[:, back], facing[:, back], **beside)
        return visible.astype(points.dtype)

    return visibility_of


def _axes(areas: AreaLights, m: int) -> Array:
    """Return the rectangle's sides and its normal, (3, 3)."""
    return np.vstack([areas.axes[m], areas.normal[:, m]])


def _patches(depth: Array, own: Array, axes: Array) -> Patches:
    """Return the patches of a map (n, n) with its `own` axes, in the coordinates of `axes`."""
    n = len(depth)
    row, column = np.nonzero(np.isfinite(depth))
    turn = own @ axes.T
    z = depth[row, column].astype(np.float64)
    corners = [_direction(row + i, column + j, n) @ turn * z[:, None] for i, j in ((0, 0), (0, 1), (1, 1), (1, 0))]
    return Patches(np.ascontiguousarray(np.stack(corners, axis=1)), _direction(row + 0.5, column + 0.5, n) @ turn, z)


def _direction(row: Array, column: Array, n: int) -> Array:
    """Return the unit vectors of places on a map of n texels, (k, 3), in its frame."""
    s, t = column * 2.0 / n - 1.0, row * 2.0 / n - 1.0
    square = s * s + t * t
    return np.stack([2.0 * s, 2.0 * t, 1.0 - square], axis=1) / (1.0 + square)[:, None]


def _grid(areas: AreaLights, maps: ShadowMaps, m: int, k: int) -> tuple[Array, Array]:
    """Return where the rectangle begins and how large its cells are, (3,) and (2,), m."""
    side = np.maximum(areas.side[:, m], LEAST_SIDE * maps.scene_far[k])
    lift = float(areas.normal[:, m] @ (areas.center[:, m] - maps.center[k]))
    return np.array([*(areas.offset[:, m] - side / 2), lift]), side / CELLS


def _visible(patches: Patches, x: Array, up: Array, horizon: Array, low: Array, cell: Array) -> Array:
    visible = np.ones(x.shape[1])
    _project(patches.corner, patches.direction, patches.depth, np.ascontiguousarray(x), np.ascontiguousarray(up),
             np.ascontiguousarray(horizon), low, cell, visible)
    return visible


@kernel(parallel=True)
def _project(corner: Array, direction: Array, depth: Array, x: Array, up: Array, horizon: Array, low: Array,
             cell: Array, visible: Array) -> None:
    """Fill V of receivers (3, n) ahead of the rectangle; `up` normals of their faces, `horizon` those of cosines."""
    blocks = (x.shape[1] + AT_ONCE - 1) // AT_ONCE
    for block in prange(blocks):
        hidden, quad = np.zeros((CELLS, CELLS), np.bool_), np.empty((4, 2))
        for i in range(np.int64(block) * AT_ONCE, min(np.int64(block) * AT_ONCE + AT_ONCE, x.shape[1])):
            for cells in range(CELLS * CELLS):
                hidden[cells // CELLS, cells % CELLS] = False
            height = x[0, i] * up[0, i] + x[1, i] * up[1, i] + x[2, i] * up[2, i]
            for k in range(len(depth)):
                approach = direction[k, 0] * up[0, i] + direction[k, 1] * up[1, i] + direction[k, 2] * up[2, i]
                limit = height / approach if approach * height > 0.0 else np.inf
                if depth[k] < limit * (1.0 - SLACK) and _project_patch(corner, k, x, i, low, cell, quad):
                    _hide(quad, hidden)
            visible[i] = _share(hidden, x, up, horizon, i, low, cell)


@kernel
def _project_patch(corner: Array, k: int, x: Array, i: int, low: Array, cell: Array, quad: Array) -> bool:
    """Project a patch from a receiver onto the grid; False where it misses it or is not before the receiver."""
    least_u, most_u, least_v, most_v = np.inf, -np.inf, np.inf, -np.inf
    for c in range(4):
        fall = x[2, i] - corner[k, c, 2]
        if fall <= 0.0:
            return False
        way = (x[2, i] - low[2]) / fall
        u = (x[0, i] + way * (corner[k, c, 0] - x[0, i]) - low[0]) / cell[0]
        v = (x[1, i] + way * (corner[k, c, 1] - x[1, i]) - low[1]) / cell[1]
        quad[c, 0], quad[c, 1] = u, v
        least_u, most_u, least_v, most_v = min(least_u, u), max(most_u, u), min(least_v, v), max(most_v, v)
    return bool(most_u > 0.5 and least_u < CELLS - 0.5 and most_v > 0.5 and least_v < CELLS - 0.5)


@kernel
def _hide(quad: Array, hidden: Array) -> None:
    """Mark the cells whose centres lie in a convex quadrilateral."""
    least, most = min(min(quad[0, 1], quad[1, 1]), min(quad[2, 1], quad[3, 1])), max(
        max(quad[0, 1], quad[1, 1]), max(quad[2, 1], quad[3, 1]))
    for row in range(math.ceil(max(least - 0.5, 0.0)), int(min(most + 0.5, float(CELLS)))):
        v, left, right = row + 0.5, np.inf, -np.inf
        for c in range(4):
            u0, v0, u1, v1 = quad[c - 1, 0], quad[c - 1, 1], quad[c, 0], quad[c, 1]
            if (v0 <= v) != (v1 <= v):
                u = u0 + (v - v0) * (u1 - u0) / (v1 - v0)
                left, right = min(left, u), max(right, u)
        if left <= right:
            for column in range(math.ceil(max(left - 0.5, 0.0)), int(min(right + 0.5, float(CELLS)))):
                hidden[row, column] = True


@kernel
def _share(hidden: Array, x: Array, up: Array, horizon: Array, i: int, low: Array, cell: Array) -> float:
    """Return the share of the cells above the receiver's horizon that nothing hides, its face among that."""
    free, whole = 0, 0
    for row in range(CELLS):
        v = low[1] + (row + 0.5) * cell[1] - x[1, i]
        for column in range(CELLS):
            u, w = low[0] + (column + 0.5) * cell[0] - x[0, i], low[2] - x[2, i]
            if u * horizon[0, i] + v * horizon[1, i] + w * horizon[2, i] > 0.0:
                whole += 1
                above = u * up[0, i] + v * up[1, i] + w * up[2, i] > 0.0
                free += 1 if above and not hidden[row, column] else 0
    return free / whole if whole > 0 else 1.0


@stage("cluster.back_projection", kept=False)
def back_projection(
    places: Places, facing: Array, depth: Array, axes: Array, side: Array, offset: Array, center: Array, normal: Array,
    scene_far: Array, shading: Array | None = None,
) -> Array:
    """Project texels back onto the rectangle: V is the share of cells that none hides (docs/methods/val_visibility).

    depth (area light, row, column): Distances to the nearest blocker, m.
    axes (area light, side, 3): Axes of the rectangles, unit vectors.
    side (side, area light): How long they are, m.
    offset (side, area light): Their middles from the centres, m.
    center (3, area light): Centres of clusters, m.
    normal (3, area light): Their unit normals.
    scene_far (area light,): To the farthest place there is, m.
    shading (3, h, w): Normals that cosines are taken with, where they are not the faces': unit vectors.
    -> (area light, h, w): V of the cells above the plane of cosines, 0 hidden to 1 seen, the face hides what is below
        it; 1 behind the light's plane, on empty maps, without surface.
    """
    areas: Any = SimpleNamespace(**{name: np.asarray(one, np.float64) for name, one in (
        ("axes", axes), ("side", side), ("offset", offset), ("center", center), ("normal", normal))})
    maps = maps_of(places, np.asarray(depth, np.float64))._replace(scene_far=np.asarray(scene_far, np.float64))
    visible = back_projection_visibility(areas, maps)
    covered, made = places.covered.reshape(-1), planes(places, fill=1)
    points, faces, normals = (np.ascontiguousarray(one.reshape(3, -1)[:, covered], np.float64)
                              for one in (places.position, facing, facing if shading is None else shading))
    for k in range(len(made)):
        made[k].reshape(-1)[covered] = visible(k, points, faces, normals)
    return made
