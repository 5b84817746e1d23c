"""Surfaces given by a grid of points, split into triangles: the one building block of the procedural scenes.

A grid has shape (rows, columns, 3). Its cells become two triangles each, whose normals point along (next row - row) x
(next column - column). A grid can be closed along either axis (the last row meets the first) and can end in a point (a
row whose points coincide, as at a sphere's poles), which is then one vertex with one triangle a column.
"""

import math

import numpy as np

from refgi.scene.model import Material, Mesh
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
