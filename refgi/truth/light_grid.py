"""A light's directions as points of the unit square and back, and stratified ones: one jittered ray in each cell.

Spots and points get equal-area maps of the square to the cap or the sphere; a directional light gets a rectangle across
the scene's bounds. Symbols: (a, b) a point of the square, d the direction of a ray from the light.

Without a density each ray stands for the same solid angle or area, exactly; with one, for that over the density at its
place. The cells are ordered along a Hilbert curve: neighbours in the list are neighbours on the surfaces they reach,
which is what makes systematic picks even.

Densities for importance sampling are piecewise constant over the unit square: uniform points are warped to them. q_ij
is the probability of cell (i, j) of an m x m grid. The first coordinate follows the marginal sum_j q_ij, the second
q_ij / sum_j q_ij within row i; both are linear inside a cell, so a point stands for 1 / (m^2 q_ij) of a uniform one.
"""

import math
from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.radiometry import DIRECTIONAL, POINT, SPOT
from refgi.sampling import FIRST_STEP, ONE_ULP_BELOW_1, SECOND_STEP, hilbert_order
from refgi.scene import DirectionalLight, Geometry, Light, PointLight, SpotLight
from refgi.types import Array

CHUNK = 4096
RIM = 1e-5  # how far outside its square rounding may put a ray of a cone's rim


class LightSquares(NamedTuple):
    """One row a light."""

    kind: Array  # (k,) int32: `refgi.radiometry`'s
    frame: Array  # (k, 3, 3) rows: a right-handed frame, the last one the axis
    origin: Array  # (k, 3) m; of a directional light the rectangle's corner in its frame
    size: Array  # (k, 2) m, sides of a directional light's rectangle
    height: Array  # (k,) 1 - cos of a spot's half-angle
    measure: Array  # (k,) sr, or m^2 of a directional light


def light_squares(lights: Sequence[Light], geometry: Geometry) -> LightSquares:
    """Return the maps of some lights; of `geometry` only the bounds matter, and only to directional lights."""
    rows = [_square_of(light, geometry) for light in lights]
    kind, frame, origin, size, height, measure = zip(*rows, strict=True) if rows else ((),) * 6
    count = len(rows)
    return LightSquares(np.array(kind, np.int32), np.array(frame).reshape(count, 3, 3),
                        np.array(origin, np.float64).reshape(count, 3), np.array(size, np.float64).reshape(count, 2),
                        np.array(height, np.float64), np.array(measure, np.float64))


def _square_of(light: Light, geometry: Geometry) -> tuple[Any, ...]:
    if isinstance(light, DirectionalLight):
        return _parallel(light, geometry)
    if isinstance(light, SpotLight):
        height = 2 * math.sin(light.outer_half_angle / 2) ** 2
        axis = np.asarray(light.direction, np.float64) / np.linalg.norm(light.direction)
        return SPOT, _frame(axis), light.position, (1, 1), height, 2 * math.pi * height
    assert isinstance(light, PointLight)
    return POINT, np.eye(3), light.position, (1, 1), 2, 4 * math.pi


def _parallel(light: DirectionalLight, geometry: Geometry) -> tuple[Any, ...]:
    frame = _frame(np.asarray(light.direction, np.float64) / np.linalg.norm(light.direction))
    corners = np.stack(np.meshgrid(*np.stack(geometry.bounds, axis=1), indexing="ij"), axis=-1).reshape(-1, 3)
    low, high = (corners @ frame.T).min(axis=0), (corners @ frame.T).max(axis=0)
    margin = 1e-3 * (high - low).max()  # rays start before everything, and no edge is missed by rounding
    low, high = low - margin, high + margin
    size = (high - low)[:2]
    return DIRECTIONAL, frame, low, size, 0, float(np.prod(size))


def _frame(axis: Array) -> Array:
    """Return a right-handed frame as rows, the last one the axis."""
    across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    across /= np.linalg.norm(across)
    return np.stack([across, np.cross(axis, across), axis])


@kernel(parallel=True)
def fill_rays(squares: LightSquares, k: int, points: Array, origins: Array, directions: Array) -> None:
    """Fill the rays (n, 3) of one light through points (n, 2) of its square."""
    count = len(points)
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        _fill_span(squares, k, points, origins, directions, chunk * CHUNK, min(count, chunk * CHUNK + CHUNK))


@kernel
def _fill_span(squares: LightSquares, k: int, points: Array, origins: Array, directions: Array, low: int,
               high: int) -> None:
    for i in range(low, high):
        o, d = ray_through(squares, k, points[i, 0], points[i, 1])
        for c in range(3):
            origins[i, c], directions[i, c] = o[c], d[c]


@kernel
def ray_through(squares: LightSquares, k: int, a: float, b: float) -> Any:
    """Return origin and direction of the ray of light k through a point of its square."""
    origin = (squares.origin[k, 0], squares.origin[k, 1], squares.origin[k, 2])
    if squares.kind[k] == DIRECTIONAL:
        start = (origin[0] + a * squares.size[k, 0], origin[1] + b * squares.size[k, 1], origin[2])
        return _to_world(squares, k, start), _to_world(squares, k, (0.0, 0.0, 1.0))
    if squares.kind[k] == SPOT:
        return origin, _to_world(squares, k, _cap(a, b, squares.height[k]))
    return origin, _sphere(a, b)


@kernel
def place_of(squares: LightSquares, k: int, y: tuple[float, float, float]) -> tuple[float, float]:
    """Return the point of light k's square whose ray meets y, both coordinates in [0, 1); (-1, -1) outside a cone."""
    o = (squares.origin[k, 0], squares.origin[k, 1], squares.origin[k, 2])
    if squares.kind[k] == DIRECTIONAL:
        x = _to_local(squares, k, y)
        a, b = (x[0] - o[0]) / squares.size[k, 0], (x[1] - o[1]) / squares.size[k, 1]
    else:
        d = (y[0] - o[0], y[1] - o[1], y[2] - o[2])
        length = math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        if length == 0:
            return -1.0, -1.0
        d = (d[0] / length, d[1] / length, d[2] / length)
        if squares.kind[k] == SPOT:
            a, b = _from_cap(_to_local(squares, k, d), squares.height[k])
            if not -RIM <= a <= 1 + RIM or not -RIM <= b <= 1 + RIM:
                return -1.0, -1.0
        else:
            a, b = _from_sphere(d)
    return min(max(a, 0.0), ONE_ULP_BELOW_1), min(max(b, 0.0), ONE_ULP_BELOW_1)


@kernel
def _to_world(squares: LightSquares, k: int, v: tuple[float, float, float]) -> tuple[float, float, float]:
    f = squares.frame
    return (v[0] * f[k, 0, 0] + v[1] * f[k, 1, 0] + v[2] * f[k, 2, 0],
            v[0] * f[k, 0, 1] + v[1] * f[k, 1, 1] + v[2] * f[k, 2, 1],
            v[0] * f[k, 0, 2] + v[1] * f[k, 1, 2] + v[2] * f[k, 2, 2])


@kernel
def _to_local(squares: LightSquares, k: int, v: tuple[float, float, float]) -> tuple[float, float, float]:
    f = squares.frame
    return (v[0] * f[k, 0, 0] + v[1] * f[k, 0, 1] + v[2] * f[k, 0, 2],
            v[0] * f[k, 1, 0] + v[1] * f[k, 1, 1] + v[2] * f[k, 1, 2],
            v[0] * f[k, 2, 0] + v[1] * f[k, 2, 1] + v[2] * f[k, 2, 2])


@kernel
def _cap(a: float, b: float, most: float) -> tuple[float, float, float]:
    """Map the square to the cap of 1 - cos theta <= most around z: rings of squares to rings (Lambert's map)."""
    a, b = 2 * a - 1, 2 * b - 1
    wide = abs(a) > abs(b)
    radius, other = (a, b) if wide else (b, a)
    ratio = other / radius if radius != 0 else 0.0
    phi = math.pi / 4 * ratio if wide else math.pi / 2 - math.pi / 4 * ratio
    height = radius * radius * most  # 1 - cos theta
    across = math.copysign(math.sqrt(height * (2 - height)), radius)
    return across * math.cos(phi), across * math.sin(phi), 1 - height


@kernel
def _from_cap(d: tuple[float, float, float], most: float) -> tuple[float, float]:
    x, y, z = d
    square = x * x + y * y
    height = square / (1 + z) if z > 0 else 1 - z
    radius = math.sqrt(height / most)
    if square == 0:
        return 0.5, 0.5
    if abs(x) > abs(y):
        a = math.copysign(radius, x)
        return 0.5 + 0.5 * a, 0.5 + 0.5 * a * math.atan(y / x) * (4 / math.pi)
    b = math.copysign(radius, y)
    return 0.5 + 0.5 * b * math.atan(x / y) * (4 / math.pi), 0.5 + 0.5 * b


@kernel
def _sphere(a: float, b: float) -> tuple[float, float, float]:
    """Map the square to all directions: the middle diamond is the upper half."""
    a, b = 2 * a - 1, 2 * b - 1
    inside = 1 - (abs(a) + abs(b))  # > 0 in the diamond
    radius = 1 - abs(inside)
    turn = (abs(b) - abs(a)) / radius if radius > 0 else 0.0
    phi = math.pi / 4 * (turn + 1)
    across = radius * math.sqrt(2 - radius * radius)
    return (math.copysign(across * math.cos(phi), a), math.copysign(across * math.sin(phi), b),
            math.copysign(1 - radius * radius, inside))


@kernel
def _from_sphere(d: tuple[float, float, float]) -> tuple[float, float]:
    x, y, z = d
    radius = math.sqrt((x * x + y * y) / (1 + abs(z)))
    turn = math.atan2(abs(y), abs(x)) * (4 / math.pi) - 1
    total, difference = (radius if z > 0 else 2 - radius), turn * radius
    a, b = 0.5 * (total - difference), 0.5 * (total + difference)
    return 0.5 + 0.5 * math.copysign(a, x), 0.5 + 0.5 * math.copysign(b, y)


class Density(NamedTuple):
    """A density over the unit square."""

    cells: Array  # (m, m) float64 probabilities, all > 0, first coordinate first; their sum is 1
    rows: Array  # (m + 1,) cumulated sums over the first coordinate, from 0 to 1
    columns: Array  # (m, m + 1) cumulated shares along the second coordinate of each row, from 0 to 1


def density_of(contribution: Array, uniform_share: float) -> Density:
    """Make a density of contributions, mixed with a uniform one.

    `contribution` (m, m): what each cell is to be drawn in proportion to, >= 0; all 0 gives a uniform density.
    `uniform_share`: share of the points that are drawn uniformly, in (0, 1]: no cell gets less than that of an even
    share.
    """
    expect(0 < uniform_share <= 1, "uniform_share", "a number in (0, 1]", uniform_share)
    total = contribution.sum()
    guided = 0 if total == 0 else (1 - uniform_share) * contribution / total
    cells = guided + np.full(contribution.shape, (uniform_share if total else 1.0) / contribution.size)
    return Density(cells, _cumulated(cells.sum(axis=1)), _cumulated(cells))


def warp(density: Density, points: Array) -> tuple[Array, Array]:
    """Move uniform points so that they follow a density.

    `points` (n, 2): uniform points in [0, 1). Returns (n, 2), (n,): points in [0, 1), and how much of the unit square
    each stands for relative to a uniform one.
    """
    m = len(density.cells)
    row, first = _invert(density.rows[None], np.zeros(len(points), np.int64), points[:, 0])
    column, second = _invert(density.columns, row, points[:, 1])
    moved = np.stack([(row + first) / m, (column + second) / m], axis=1)
    return np.minimum(moved, ONE_ULP_BELOW_1), 1 / (m * m * density.cells[row, column])


def _cumulated(values: Array) -> Array:
    """Return running sums along the last axis, from exactly 0 to exactly 1."""
    sums = np.cumsum(values, axis=-1)
    return np.concatenate([np.zeros_like(sums[..., :1]), sums / sums[..., -1:]], axis=-1)


def _invert(tables: Array, which: Array, u: Array) -> tuple[Array, Array]:
    """Return cell and place in it, in [0, 1], where the table `which` of each point reaches u."""
    m = tables.shape[1] - 1
    # one search for all tables: table k is lifted to k .. k + 1
    lifted = (tables[:, :-1] + np.arange(len(tables))[:, None]).ravel()
    cell = np.searchsorted(lifted, which + u, side="right") - 1 - which * m
    cell = np.clip(cell, 0, m - 1)
    low, high = tables[which, cell], tables[which, cell + 1]
    return cell, np.clip((u - low) / (high - low), 0, 1)


class LightRays(NamedTuple):
    """Rays of a light: one for each cell of its grid, or several sets of them."""

    origins: Array  # (s, 3) float64, m
    directions: Array  # (s, 3) float64, unit vectors
    measure: float  # solid angle of a cell of even size, sr; for a directional light its perpendicular area, m^2
    weight: Array  # (s,) what a ray stands for, in units of `measure`: 1 over the density at its place


def stratified_sets(n: int, side: int, random: np.random.Generator, turn: int = 0) -> Array:
    """Place side^2 sets of n x n points in the unit square: each set jittered, all of them together jittered finer.

    `n`: cells along one side of the grid of a set. `side`: parts along one side of a cell: the side^2 sets share out
    its parts at random, one each. `random`: shares out the parts and places the points in them. `turn`: steps of low
    discrepancy that all points then go on in their cells, around the edges. Returns (side^2, n * n, 2): each set along
    a Hilbert curve over the grid. Every point is uniform in its cell.
    """
    count = side * side
    part = random.permuted(np.broadcast_to(np.arange(count), (n * n, count)), axis=1).T
    within = np.stack([part % side, part // side], axis=-1) + random.random((count, n * n, 2))
    place = (within / side + turn * np.array([FIRST_STEP, SECOND_STEP])) % 1
    return np.asarray(np.minimum((_cells(n) + place) / n, ONE_ULP_BELOW_1))


def cell_centres(n: int) -> Array:
    """Return the centres (n * n, 2) of n x n cells of the unit square, along a Hilbert curve."""
    return np.asarray((_cells(n) + 0.5) / n)


def light_rays(light: Light, geometry: Geometry, jitter: Array) -> LightRays:
    """Send one ray through each cell of a light's grid.

    `geometry`: what it shines on; only its bounds matter, and only to a directional light. `jitter` (n * n, 2): place
    of each ray in its cell, in [0, 1). Result: along a Hilbert curve over the grid.
    """
    n = math.isqrt(len(jitter))
    return rays_through(light, geometry, (_cells(n) + jitter) / n, n * n)


def rays_through(light: Light, geometry: Geometry, square: Array, cells: int,
                 density: Density | None = None) -> LightRays:
    """Send rays through points of the unit square that stands for a light's directions.

    `geometry`: what it shines on; only its bounds matter, and only to a directional light. `square` (s, 2): points of
    the unit square, uniform. `cells`: how many rays share the light's whole measure. `density`: where rays go more
    often than elsewhere; evenly where absent. Result: in the order of the points.
    """
    square, weight = (square, np.ones(len(square))) if density is None else warp(density, square)
    squares = light_squares((light,), geometry)
    origins, directions = np.empty((len(square), 3)), np.empty((len(square), 3))
    fill_rays(squares, 0, square, origins, directions)
    return LightRays(origins, directions, float(squares.measure[0]) / cells, weight)


def footprint(light: Light, geometry: Geometry, n: int) -> tuple[float, float]:
    """Return the measure of one ray and its largest footprint in the scene.

    `geometry`: what it shines on. `n`: cells along one side of the grid. Result: solid angle (sr) or area (m^2) of a
    ray, and the largest measure x distance^2 (m^2).
    """
    measure = float(light_squares((light,), geometry).measure[0]) / (n * n)
    if isinstance(light, DirectionalLight):
        return measure, measure
    reach = np.maximum(*(np.abs(np.subtract(corner, light.position)) for corner in geometry.bounds))
    return measure, measure * float(reach @ reach)


@cache
def _cells(n: int) -> Array:
    """Return the cells of an n x n grid along a Hilbert curve: (n * n, 2) integers as floats."""
    order = hilbert_order(n, n)
    return np.stack([order % n, order // n], axis=1).astype(np.float64)
