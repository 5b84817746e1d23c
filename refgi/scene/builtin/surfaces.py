"""Surfaces of the procedural scenes: grids of points split into triangles, and metaballs.

A grid has shape (rows, columns, 3). Its cells become two triangles each, whose normals point along (next row - row) x
(next column - column). A grid can be closed along either axis (the last row meets the first) and can end in a point (a
row whose points coincide, as at a sphere's poles), which is then one vertex with one triangle a column.

Metaballs are a smooth blob whose pieces join and part with time: f(x) = sum_i exp(1 - |x - c_i|^2 / r_i^2) - 1 = 0,
so that a ball alone has radius r_i, cut by marching tetrahedra. Every cell of a grid is split into the same six around
its main diagonal, and a vertex belongs to an edge of the grid: watertight. Normals are exact, -grad f / |grad f|.
"""

import math
from itertools import permutations
from typing import NamedTuple

import numpy as np

from refgi.errors import expect
from refgi.scene.model import Camera, Material, Mesh, Scene, SpotLight, merge
from refgi.types import Array


def grid_faces(rows: int, columns: int, *, closed: bool = False) -> Array:
    """Return the triangles of a grid of vertices numbered row by row.

    `closed`: join the last column to the first. Returns (m, 3) int32: 2 (rows - 1) (columns - 1) triangles, or 2 (rows
    - 1) columns where closed.
    """
    row = np.arange(rows - 1, dtype=np.int32)[:, None] * np.int32(columns)
    column = np.arange(columns if closed else columns - 1, dtype=np.int32)
    after = (column + 1) % np.int32(columns)
    a, b, c, d = row + column, row + np.int32(columns) + column, row + np.int32(columns) + after, row + after
    return np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)


def patch(points: Array, material: Material, name: str, *, closed: bool = False) -> Mesh:
    """Return the mesh of a grid of points.

    `points` (rows, columns, 3): positions, m. `closed`: join the last column to the first.
    """
    rows, columns = points.shape[:2]
    return Mesh(points.reshape(-1, 3), grid_faces(rows, columns, closed=closed), material=material, name=name)


def sphere(center: tuple[float, float, float], radius: float, faces: int, material: Material, name: str) -> Mesh:
    """Return a closed sphere of about `faces` triangles with exact outward normals.

    `center`: its centre, m. `radius`: its radius, m. `faces`: wanted triangles, at least 8; a multiple of twice the
    number of meridians is made. Result: vertices on the sphere; watertight.
    """
    bands = max(2, round(math.sqrt(faces) / 2))
    meridians = max(3, round(faces / (2 * (bands - 1))))
    polar = np.pi * np.arange(1, bands)[:, None] / bands
    turn = 2 * np.pi * np.arange(meridians) / meridians
    ring = np.stack([np.sin(polar) * np.sin(turn), np.broadcast_to(np.cos(polar), (bands - 1, meridians)),
                     np.sin(polar) * np.cos(turn)], axis=-1)
    normals = np.concatenate([[[0.0, 1.0, 0.0]], ring.reshape(-1, 3), [[0.0, -1.0, 0.0]]])
    belt = grid_faces(bands - 1, meridians, closed=True) + np.int32(1)
    first = np.arange(meridians, dtype=np.int32)
    after = (first + 1) % np.int32(meridians)
    last, foot = 1 + (bands - 2) * meridians, len(normals) - 1
    top = np.stack([np.zeros_like(first), 1 + first, 1 + after], axis=1)
    bottom = np.stack([np.full_like(first, foot), last + after, last + first], axis=1)
    return Mesh(np.asarray(center) + radius * normals, np.concatenate([top, belt, bottom]), normals, material, name)


def lathe(profile: Array, columns: int, material: Material, name: str, *, ribs: Array | float = 0.0) -> Mesh:
    """Return the surface that a profile sweeps around the y axis.

    `profile` (rows, 2): radius and height, m, from bottom to top on the outside. `ribs` (rows, columns) or float: share
    by which each point's radius is changed. Result: normals outward; closed around; an end of the profile that lies on
    the axis is one vertex, another is open.
    """
    turn = 2 * np.pi * np.arange(columns) / columns
    radius = profile[:, :1] * (1.0 + np.broadcast_to(ribs, (len(profile), columns)))
    height = np.broadcast_to(profile[:, 1:], radius.shape)
    points = np.stack([radius * np.cos(turn), height, radius * np.sin(turn)], axis=-1)
    turned = patch(points, material, name, closed=True)
    return _joined_at_poles(turned, columns, bottom=profile[0, 0] == 0, top=profile[-1, 0] == 0)


def ring_surface(major: float, section: tuple[float, float], rows: int, columns: int, material: Material,
                 name: str) -> Mesh:
    """Return a torus of elliptic section that stands on y = 0, with exact outward normals.

    `major`: radius of the circle that the section's centre follows, m. `section`: half axes of the ellipse, radial and
    vertical, m. `rows`, `columns`: points along the circle and around the section. Result: 2 rows columns triangles;
    watertight.
    """
    along = 2 * np.pi * np.arange(rows)[:, None] / rows
    around = 2 * np.pi * np.arange(columns) / columns
    radial, vertical = section
    distance = major + radial * np.cos(around)
    height = np.broadcast_to(vertical * (1 + np.sin(around)), (rows, columns))
    points = np.stack([distance * np.sin(along), height, distance * np.cos(along)], axis=-1)
    outward, upward = np.cos(around) / radial, np.broadcast_to(np.sin(around) / vertical, (rows, columns))
    normals = np.stack([outward * np.sin(along), upward, outward * np.cos(along)], axis=-1).reshape(-1, 3)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    faces = grid_faces(rows + 1, columns, closed=True) % np.int32(rows * columns)
    return Mesh(points.reshape(-1, 3), faces, normals, material, name)


def rectangle(corner: tuple[float, float, float], first: tuple[float, float, float],
              second: tuple[float, float, float], material: Material, name: str,
              cells: tuple[int, int] = (1, 1)) -> Mesh:
    """Return a parallelogram with normal along `first` x `second`.

    `corner`: one corner, m. `first`, `second`: the sides that leave it, m. `cells`: cells along each side. Result: two
    triangles a cell.
    """
    u = np.linspace(0.0, 1.0, cells[0] + 1)[:, None, None]
    v = np.linspace(0.0, 1.0, cells[1] + 1)[None, :, None]
    return patch(np.asarray(corner) + u * np.asarray(first) + v * np.asarray(second), material, name)


FLOOR = Material("stage_floor", (0.75, 0.73, 0.7))
BACK = Material("stage_back", (0.7, 0.66, 0.58))
LEFT = Material("stage_left", (0.62, 0.12, 0.08))
RIGHT = Material("stage_right", (0.1, 0.25, 0.6))


def walls() -> list[Mesh]:
    """Return a stage's floor and walls: eight faces, 1.2 x 0.7 x 1.0 m, open in front and above, facing inwards."""
    return [rectangle((-0.6, 0.0, 0.6), (1.2, 0.0, 0.0), (0.0, 0.0, -1.0), FLOOR, "floor"),
            rectangle((-0.6, 0.0, -0.4), (1.2, 0.0, 0.0), (0.0, 0.7, 0.0), BACK, "back"),
            rectangle((-0.6, 0.0, 0.6), (0.0, 0.0, -1.0), (0.0, 0.7, 0.0), LEFT, "left"),
            rectangle((0.6, 0.0, -0.4), (0.0, 0.0, 1.0), (0.0, 0.7, 0.0), RIGHT, "right")]


def _joined_at_poles(mesh: Mesh, columns: int, *, bottom: bool, top: bool) -> Mesh:
    """Return the mesh with the points of its first or last row made one, and without the faces that vanish."""
    if not (bottom or top):
        return mesh
    faces, count = mesh.faces.copy(), len(mesh.vertices)
    if bottom:
        faces[faces < columns] = 0
    if top:
        faces[faces >= count - columns] = count - 1
    a, b, c = faces.T
    used, numbered = np.unique(faces[(a != b) & (b != c) & (c != a)], return_inverse=True)
    return Mesh(mesh.vertices[used], numbered.reshape(-1, 3).astype(np.int32), None, mesh.material, mesh.name)


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
