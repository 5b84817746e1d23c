"""A light's directions as points of the unit square, equal areas for equal measures, and back.

Spots and points get equal-area maps of the square to the cap or the sphere; a directional light gets a rectangle across
the scene's bounds. Symbols: (a, b) a point of the square, d the direction of a ray from the light.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.radiometry import DIRECTIONAL, POINT, SPOT
from refgi.sampling import ONE_ULP_BELOW_1
from refgi.scene import DirectionalLight, Geometry, Light, PointLight, SpotLight

Array = npt.NDArray[Any]

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
