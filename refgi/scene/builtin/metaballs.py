"""Metaballs: a smooth blob whose pieces join and part as time goes by, cut from its field by marching tetrahedra.

The field is f(x) = sum_i exp(1 - |x - c_i|^2 / r_i^2) - 1, so that a ball alone has radius r_i, and the surface is
f = 0. Every cell of a grid is split into the same six tetrahedra around its main diagonal, which fit those of the
neighbours; a vertex belongs to an edge of the grid and is shared by all faces around it, so the surface is watertight
by construction. Normals are -grad f / |grad f|, exact at the vertices.
"""

import math
from itertools import permutations
from typing import NamedTuple

import numpy as np

from refgi.errors import expect
from refgi.scene.builtin.stage import walls
from refgi.scene.model import Camera, Material, Mesh, Scene, SpotLight, merge
from refgi.types import Array

CLAY = Material("metaballs", (0.6, 0.58, 0.52))
MIDDLE = np.array([0.0, 0.24, -0.02])  # m
HALF_SIZE = 0.2  # m; the grid is a cube around MIDDLE
POLISH_STEPS = 10  # leaves |f| at the vertices below 1e-5 at the default resolution


class Balls(NamedTuple):
    """Centres (n, 3) and radii (n,), m."""

    centers: Array
    radii: Array


def metaballs(t: float = 0.0, resolution: int = 24) -> Scene:
    """Build the blob at a time, hovering over the stage.

    `t`: time; the motion repeats after 1. `resolution`: cells along each side of the grid, 4 to 400. Result: 5
    materials; pieces and faces change with `t`, faces grow with the square of `resolution`.
    """
    expect(4 <= resolution <= 400, "resolution", "4 to 400", resolution)
    expect(math.isfinite(t), "t", "a finite number", t)
    camera = Camera((0.0, 0.36, 1.2), (0.0, 0.18, 0.0), vfov=math.radians(31), width=640, height=480)
    light = SpotLight((0.55, 0.9, 0.5), (-0.679252, -0.546203, -0.490182), math.radians(19), math.radians(26),
                      (2.2, 2.1, 1.95))
    geometry, materials = merge([*walls(), blob(balls_at(t), resolution)], smooth=True)
    return Scene("metaballs", geometry, materials, camera, (light,), "A blob whose pieces join and part with time.",
                 exposure=1.2)


def balls_at(t: float) -> Balls:
    """Return six balls on their closed paths.

    `t`: time; the motion repeats after 1. Result: around `MIDDLE`, well inside the grid.
    """
    number = np.arange(6)
    turn = 2 * np.pi * (np.array([1, -1, 2, -1, 1, -2]) * t + number / 6.0)
    rise = 0.06 * np.sin(2 * np.pi * t + 4.4 * number)
    sway = np.stack([0.1 * np.cos(turn), rise, 0.08 * np.sin(turn)], axis=1)
    return Balls(MIDDLE + sway, 0.05 + 0.013 * np.cos(2.5 * number))


def field(balls: Balls, points: Array) -> Array:
    """Return f at points (..., 3).

    `balls`: what makes the field. `points` (..., 3): positions, m. Returns (...) float64: positive inside.
    """
    total = np.full(points.shape[:-1], -1.0)
    for center, radius in zip(*balls, strict=True):
        total += np.exp(1.0 - ((points - center) ** 2).sum(axis=-1) / radius**2)
    return total


def gradient(balls: Balls, points: Array) -> Array:
    """Return grad f at points.

    `balls`: what makes the field. `points` (n, 3): positions, m. Returns (n, 3) float64: in 1/m; points inward.
    """
    total = np.zeros_like(points)
    for center, radius in zip(*balls, strict=True):
        away = points - center
        share = np.exp(1.0 - (away**2).sum(axis=-1, keepdims=True) / radius**2)
        total -= 2.0 / radius**2 * share * away
    return total


def blob(balls: Balls, resolution: int) -> Mesh:
    """Return the surface f = 0 inside the grid.

    `balls`: what makes the field. `resolution`: cells along each side of the grid.
    """
    side = np.linspace(-HALF_SIZE, HALF_SIZE, resolution + 1)
    grid = MIDDLE + np.stack(np.meshgrid(side, side, side, indexing="ij"), axis=-1)
    values = field(balls, grid)
    edges = _cut_edges(values)
    keys, numbered = np.unique(edges[..., 0] * values.size + edges[..., 1], return_inverse=True)
    ends = np.stack(np.divmod(keys, values.size), axis=1)
    vertices = _crossings(balls, grid.reshape(-1, 3), values.ravel(), ends)
    normals = -gradient(balls, vertices)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Mesh(vertices, numbered.reshape(-1, 3).astype(np.int32), normals, CLAY, "metaballs")


def _cut_edges(values: Array) -> Array:
    """Return (m, 3, 2) grid edges (inside point, outside point): three for each triangle, wound outward."""
    count = values.shape[0]
    strides = np.array([count * count, count, 1])
    base = (np.arange(count - 1)[:, None, None] * strides[0] + np.arange(count - 1)[:, None] * strides[1]
            + np.arange(count - 1)).ravel()
    inside = values.ravel() > 0
    corners_inside = sum(inside[base + int(strides @ c)].astype(np.int8) for c in np.ndindex(2, 2, 2))
    base = base[(corners_inside > 0) & (corners_inside < 8)]
    found = []
    for axes in permutations(range(3)):
        steps = np.concatenate([[0], np.cumsum(strides[list(axes)])])
        odd = axes in ((0, 2, 1), (1, 0, 2), (2, 1, 0))
        found += _cut_tetrahedra(base[:, None] + (steps[[0, 1, 3, 2]] if odd else steps), inside)
    return np.concatenate(found)


def _cut_tetrahedra(tetrahedra: Array, inside: Array) -> list[Array]:
    """Return the triangles of positively oriented tetrahedra, (n, 4) grid points each, as edges (m, 3, 2)."""
    pattern = inside[tetrahedra] @ np.array([1, 2, 4, 8])
    found = []
    # Even permutations (a, b, c, d) of the corners keep the orientation: a alone, then a and b together.
    for a, b, c, d in ((0, 1, 2, 3), (1, 0, 3, 2), (2, 3, 0, 1), (3, 2, 1, 0)):
        alone, others = tetrahedra[pattern == 1 << a], tetrahedra[pattern == 15 - (1 << a)]
        found += [_edges(alone, (a, b), (a, c), (a, d)), _edges(others, (b, a), (d, a), (c, a))]
    for a, b, c, d in ((0, 1, 2, 3), (0, 2, 3, 1), (0, 3, 1, 2), (2, 3, 0, 1), (3, 1, 0, 2), (1, 2, 0, 3)):
        pair = tetrahedra[pattern == (1 << a) + (1 << b)]
        found += [_edges(pair, (a, c), (a, d), (b, d)), _edges(pair, (a, c), (b, d), (b, c))]
    return found


def _edges(tetrahedra: Array, *corners: tuple[int, int]) -> Array:
    return tetrahedra[:, np.array(corners)]


def _crossings(balls: Balls, points: Array, values: Array, edges: Array) -> Array:
    """Return where f vanishes along each edge, by the Illinois variant of regula falsi."""
    low, high = points[edges[:, 0]], points[edges[:, 1]]
    f_low, f_high = values[edges[:, 0]], values[edges[:, 1]]
    a, b = np.zeros(len(edges)), np.ones(len(edges))
    side = np.zeros(len(edges), np.int8)  # which end moved last
    t = f_low / (f_low - f_high)
    for _ in range(POLISH_STEPS):
        value = field(balls, low + t[:, None] * (high - low))
        moves_low = value > 0
        # The end that stays twice in a row counts half, or it would stay for ever.
        f_high = np.where(moves_low, np.where(side == 1, f_high / 2, f_high), value)
        f_low = np.where(moves_low, value, np.where(side == -1, f_low / 2, f_low))
        a, b = np.where(moves_low, t, a), np.where(moves_low, b, t)
        side = np.where(moves_low, 1, -1).astype(np.int8)
        t = (a * f_high - b * f_low) / (f_high - f_low)
    return np.asarray(low + t[:, None] * (high - low))
