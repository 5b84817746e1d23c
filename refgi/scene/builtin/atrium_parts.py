"""How the atrium is put together: parts, each a shape placed several times, and shapes turned or swept from profiles.

Local frames: x along the wall, y up, z towards the courtyard; a shape stands where a `Part` places it. `cells` are
(rows, columns) of a grid at density 1, and grow with the density but never below `least`, where the shape would no
longer be recognised.
"""

import dataclasses
from collections.abc import Callable
from functools import partial

import numpy as np

from refgi.scene.builtin.surfaces import grid_faces
from refgi.scene.model import Array, Material, Mesh


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
