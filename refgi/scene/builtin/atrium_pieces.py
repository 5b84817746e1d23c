"""Pieces of the atrium, each a shape placed several times, and how shapes are turned or swept from profiles.

Local frames: x along the wall, y up, z towards the courtyard; a shape stands where a `Part` places it. `cells` are
(rows, columns) of a grid at density 1, and grow with the density but never below `least`, where the shape would no
longer be recognised.

In a bay x starts in the middle. A bay has a wall above the arch, its underside and the moulding around it. Soft or
small are curtains, swags, shrubs and floor tiles.
"""

import dataclasses
from collections.abc import Callable
from functools import partial

import numpy as np

from refgi.scene.builtin.surfaces import grid_faces
from refgi.scene.model import Material, Mesh
from refgi.types import Array


@dataclasses.dataclass(frozen=True)
class Part:
    """One shape in one material, placed several times."""

    name: str
    material: Material
    shape: Callable[[int, int], Array]  # (rows, columns) of cells to a grid of points
    cells: tuple[int, int]
    places: Array  # (k, 4): x, y, z in m, and turn around y in rad
    closed: bool = False
    least: tuple[int, int] = (1, 3)

    def size(self, density: float) -> tuple[int, int]:
        """Return the cells of one instance's grid, (rows, columns)."""
        return max(self.least[0], round(self.cells[0] * density)), max(self.least[1], round(self.cells[1] * density))

    def faces(self, density: float) -> int:
        """Return the number of triangles of all instances."""
        rows, columns = self.size(density)
        return 2 * rows * columns * len(self.places)

    def mesh(self, density: float) -> Mesh:
        """Return all instances as one mesh."""
        grid = self.shape(*self.size(density))
        rows, columns = grid.shape[:2]
        points, faces = grid.reshape(-1, 3), grid_faces(rows, columns, closed=self.closed)
        cos, sin = np.cos(self.places[:, 3:4]), np.sin(self.places[:, 3:4])
        x, y, z = points[None, :, 0], points[None, :, 1], points[None, :, 2]
        turned = np.stack([cos * x + sin * z, np.broadcast_to(y, (len(cos), len(points))), cos * z - sin * x], axis=-1)
        turned += self.places[:, None, :3]
        first = np.arange(len(cos), dtype=np.int32)[:, None, None] * np.int32(len(points))
        return Mesh(turned.reshape(-1, 3), (faces + first).reshape(-1, 3), material=self.material, name=self.name)


def turned(profile: Array, rows: int, columns: int) -> Array:
    """Return a body turned around y: profile rows are radius, height, squareness and depth of flutes.

    `profile` (n, 4): radius and height, m; 0 for a circle to 1 for a square of that half width; flute depth as share of
    the radius. Returns (rows + 1, columns, 3): closed around, normals outward.
    """
    radius, height, square, flute = resampled(profile, rows + 1).T[:, :, None]
    turn = 2 * np.pi * (np.arange(columns) + 0.5) / columns
    corner = 1.0 / np.maximum(np.abs(np.cos(turn)), np.abs(np.sin(turn))) - 1.0
    fluted = flute * np.abs(np.cos(8 * turn)) if columns >= 48 else 0.0  # fewer points would alias
    reach = radius * (1.0 + square * corner - fluted)
    return np.stack([reach * np.cos(turn), np.broadcast_to(height, reach.shape), reach * np.sin(turn)], axis=-1)


def resampled(profile: Array, count: int) -> Array:
    """Return `count` points along a polyline: its own corners first, the rest spread over the segments by length.

    `profile` (n, d): corners; the first two values are a position. Returns (count, d): all corners among them where
    count >= n, else a polyline of fewer, evenly picked corners.
    """
    corners = len(profile)
    if count <= corners:
        return np.asarray(profile[np.round(np.linspace(0, corners - 1, count)).astype(np.int64)])
    length = np.linalg.norm(np.diff(profile[:, :2], axis=0), axis=1)
    ideal = np.concatenate([[0.0], np.cumsum(length)]) / length.sum() * (count - corners)
    extra = np.diff(np.round(ideal)).astype(np.int64)
    pieces = [first + (second - first) * (np.arange(1 + more) / (1 + more))[:, None]
              for first, second, more in zip(profile[:-1], profile[1:], extra, strict=True)]
    return np.concatenate([*pieces, profile[-1:]])


def swept(profile: Array, half_length: float, half_width: float, rows: int, columns: int) -> Array:
    """Return a profile swept around the courtyard, mitred at its corners: courses, rails, floors, walls.

    `profile` (n, 2): distance from the column line towards the courtyard, and height, m. `half_length`, `half_width`:
    of the column line, m. `rows`, `columns`: cells; the columns are spread over the four sides so that every corner is
    met. Returns (rows + 1, columns, 3): closed around.
    """
    line = resampled(profile, rows + 1)
    short = max(1, round(columns / 2 * half_width / (half_length + half_width)))
    counts = [columns // 2 - short, short, columns - columns // 2 - short, short]
    ends = np.array([(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)])
    sign = np.concatenate([a + (b - a) * (np.arange(n) / n)[:, None]
                           for a, b, n in zip(ends[:-1], ends[1:], counts, strict=True)])
    reach = np.array([half_length, half_width]) - line[:, None, :1]
    flat = sign * reach
    return np.stack([flat[..., 0], np.broadcast_to(line[:, 1:2], flat.shape[:2]), flat[..., 1]], axis=-1)


def with_arguments(shape: Callable[..., Array], *arguments: float | Array) -> Callable[[int, int], Array]:
    """Return a shape with its leading arguments given.

    `shape`: a function of this module. `*arguments`: all but rows and columns.
    """
    return partial(shape, *arguments)


BAY = 3.0  # m from column to column
ARCH_RADIUS = 1.2  # m
WALL_THICKNESS = 0.5  # m


def arch_front(springing: float, top: float, rows: int, columns: int) -> Array:
    """Return the courtyard side of one bay's wall over its arch, from the arch up to `top`.

    `springing`, `top`: heights where the arch begins and the wall ends, m. Returns (rows + 1, columns + 1, 3): in the
    plane z = half the wall's thickness.
    """
    lower = arch_line(springing, columns)
    up = np.linspace(0.0, 1.0, rows + 1)[:, None]
    x = np.broadcast_to(lower[:, 0], (rows + 1, columns + 1))
    y = lower[:, 1] + up * (top - lower[:, 1])
    return np.stack([x, y, np.full_like(y, WALL_THICKNESS / 2)], axis=-1)[::-1]


def arch_back(springing: float, top: float, rows: int, columns: int) -> Array:
    """Return the gallery side of one bay's wall, with its normal away from the courtyard.

    `springing`, `top`: heights where the arch begins and the wall ends, m. Returns (rows + 1, columns + 1, 3): in the
    plane z = minus half the wall's thickness.
    """
    return arch_front(springing, top, rows, columns)[::-1] * (1.0, 1.0, -1.0)


def arch_under(springing: float, rows: int, columns: int) -> Array:
    """Return the underside of one bay's arch.

    `springing`: height where the arch begins, m. `rows`, `columns`: cells across the wall's thickness and along the
    arch. Returns (rows + 1, columns + 1, 3): normals down and inward.
    """
    lower = arch_line(springing, columns)
    depth = np.linspace(-0.5, 0.5, rows + 1)[:, None] * WALL_THICKNESS
    shape = (rows + 1, columns + 1)
    return np.stack([np.broadcast_to(lower[:, 0], shape), np.broadcast_to(lower[:, 1], shape),
                     np.broadcast_to(depth, shape)], axis=-1)[::-1]


def archivolt(springing: float, rows: int, columns: int) -> Array:
    """Return the moulding around an arch, a half-round band on the courtyard side.

    `springing`: height where the arch begins, m. `rows`, `columns`: cells across and along. Returns (rows + 1, columns
    + 1, 3): standing 9 cm proud of the wall.
    """
    around = np.pi * np.linspace(0.0, 1.0, rows + 1)[:, None]
    along = np.pi * np.linspace(0.0, 1.0, columns + 1)
    radius = ARCH_RADIUS + 0.12 - 0.11 * np.cos(around)
    z = WALL_THICKNESS / 2 + 0.09 * np.sin(around)
    return np.stack([-radius * np.cos(along), springing + radius * np.sin(along),
                     np.broadcast_to(z, (rows + 1, columns + 1))], axis=-1)[::-1]


def arch_line(springing: float, columns: int) -> Array:
    """Return the lower edge of one bay's wall: from a column's middle over the arch to the next column's.

    `springing`: height where the arch begins, m. `columns`: cells, at least 3. Returns (columns + 1, 2): x and y, m.
    """
    turn = np.pi * np.linspace(0.0, 1.0, columns - 1)
    x = np.concatenate([[-BAY / 2], -ARCH_RADIUS * np.cos(turn), [BAY / 2]])
    y = np.concatenate([[0.0], ARCH_RADIUS * np.sin(turn), [0.0]])
    return np.stack([x, springing + y], axis=1)


def curtain(folds: int, gathered: float, phase: float, rows: int, columns: int) -> Array:
    """Return a curtain in one bay, hanging in folds from a rod, drawn together at hip height.

    `gathered`: 0 hangs straight, 1 is drawn wholly to its left side at hip height. `phase`: where the folds begin, rad.
    Returns (rows + 1, columns + 1, 3): 2.5 m wide at the rod, 3 m high.
    """
    down = np.linspace(0.0, 1.0, rows + 1)[:, None]
    across = np.linspace(0.0, 1.0, columns + 1)[None, :]
    pinch = gathered * np.exp(-(((down - 0.62) / 0.3) ** 2)) * 0.8
    x = -1.25 + 2.5 * across * (1.0 - pinch)
    turn = 2 * np.pi * folds * (across + 0.012 * np.sin(5.0 * across + 2.0 * down + phase)) + phase
    depth = (0.05 + 0.05 * down) * np.sin(turn) + 0.02 * np.sin(2.7 * turn + 3.0 * down)
    y = 3.02 - 2.97 * down - 0.02 * np.cos(turn) * down + 0.03 * np.cos(2 * turn) * (1 - down) ** 8
    return np.stack(np.broadcast_arrays(x, y, depth * (1.0 + 0.6 * pinch)), axis=-1)


def swag(sag: float, rows: int, columns: int) -> Array:
    """Return a cloth hung between two columns of the upper storey, sagging in the middle.

    `sag`: how far the lower edge hangs below the upper one, m. Returns (rows + 1, columns + 1, 3): upper corners at y =
    0, 2.5 m apart.
    """
    down = np.linspace(0.0, 1.0, rows + 1)[:, None]
    across = np.linspace(-1.0, 1.0, columns + 1)[None, :]
    hang = 1.0 - across**2
    y = -0.35 * np.abs(across) * down - hang * (0.45 + sag * down)
    folds = np.sin(9.0 * down * np.pi + 1.5 * across) * 0.045 * hang
    z = 0.16 + 0.3 * hang * np.sin(np.pi * (0.15 + 0.75 * down)) + folds
    return np.stack(np.broadcast_arrays(1.25 * across, y, z), axis=-1)


def shrub(radius: float, rows: int, columns: int) -> Array:
    """Return a clipped round shrub, a sphere with bumps.

    `radius`: its mean radius, m. Returns (rows + 1, columns, 3): around the origin, closed around; the poles are a
    hand's breadth wide.
    """
    polar = np.linspace(0.06, np.pi - 0.06, rows + 1)[:, None]
    turn = 2 * np.pi * np.arange(columns)[None, :] / columns
    bumps = np.sin(7 * polar) * np.sin(6 * turn) + 0.6 * np.sin(13 * polar + 2) * np.cos(11 * turn)
    reach = radius * (1.0 + 0.05 * bumps)
    return np.stack(np.broadcast_arrays(reach * np.sin(polar) * np.cos(turn), reach * np.cos(polar),
                                        -reach * np.sin(polar) * np.sin(turn)), axis=-1)


def tile(size: float, rows: int, columns: int) -> Array:
    """Return one floor tile: flat, its edges worn down into the joint.

    `size`: length of its sides, m. Returns (rows + 1, columns + 1, 3): normals up; corners 15 mm below the middle.
    """
    u = np.linspace(-1.0, 1.0, rows + 1)[:, None]
    v = np.linspace(-1.0, 1.0, columns + 1)[None, :]
    worn = 1.0 - (1.0 - u**12) * (1.0 - v**12)
    return np.stack(np.broadcast_arrays(v * size / 2, -0.015 * worn, -u * size / 2), axis=-1)[::-1]
