"""Ladders of maps: projection by camera, cube and paraboloid, rays of texels, barycentric coordinates.

Formulas are those of docs/rasterizer.md and docs/conventions.md: a point appears at (x, y) / z in a perspective map and
at (x, y) / (|p| + z) in a paraboloid one, along the frame's right, down and forward; the map spans -half .. half.
refgi.literal has the texel that holds a point alone, and the ray of a paraboloid's.
"""

from functools import partial
from typing import Any

import numpy as np

from benchmarks.stability.ladder import Ladder, each_of
from benchmarks.stability.promise import BLOCK, across, directions, dot, sizes
from refgi.jit import kernel
from refgi.literal.val_maps import direction
from refgi.rsm.buffers.surfaces import barycentric_axes, image_ray
from refgi.rsm.raster.projection import (
    PARABOLOID,
    PERSPECTIVE,
    Projection,
    cube_projection,
    image_point,
    texel_coordinates,
    texel_of,
)
from refgi.types import Array

HEIGHT, WIDTH, HALF, FACE = 600, 800, (0.8, 0.6), 1024
MAP = "4 ULP of one input or of the answer, beyond 4 ULP of the map's size"
# forward and up of the faces of a cube: docs/conventions.md
FACES = (((1, 0, 0), (0, 1, 0)), ((-1, 0, 0), (0, 1, 0)), ((0, 1, 0), (0, 0, 1)), ((0, -1, 0), (0, 0, -1)),
         ((0, 0, 1), (0, 1, 0)), ((0, 0, -1), (0, 1, 0)))


@kernel
def _fill_points(maps: Projection, x: Array, out: Array) -> None:
    for i in range(x.shape[1]):
        u, v, out[2, i] = image_point(maps, i, x[0, i], x[1, i], x[2, i])
        column, row = texel_coordinates((maps.half[0], maps.half[1]), maps.height, maps.width, 0, u, v)
        out[0, i], out[1, i] = column, row


@kernel
def _fill_cube(maps: Projection, x: Array, out: Array) -> None:
    for i in range(x.shape[1]):
        out[0, i], out[1, i], out[2, i] = texel_of(maps, x[0, i], x[1, i], x[2, i])


@kernel
def _ray(s: Any, t: Any) -> Any:
    zero, one = 0.0, 1.0
    frame = (zero, zero, zero, one, zero, zero, zero, one, zero, zero, zero, one)
    return image_ray(PARABOLOID, frame, s, t)[3:]


@kernel
def _volumes(  # origin and direction of a ray, and three corners
    ox: Any, oy: Any, oz: Any, dx: Any, dy: Any, dz: Any, x0: Any, y0: Any, z0: Any, x1: Any, y1: Any, z1: Any,
    x2: Any, y2: Any, z2: Any,
) -> Any:
    first, second = barycentric_axes((x0, y0, z0), (x1, y1, z1), (x2, y2, z2), (ox, oy, oz))
    return (dx * first[0] + dy * first[1] + dz * first[2], dx * second[0] + dy * second[1] + dz * second[2])


def draw_points(kind: int, rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    """Return points, origins and frames (right, down, forward) of maps that see them, 1e-6 .. 1e6 m away.

    Frames are orthogonal to rounding, as the formula takes them; maps lie up to as far off the world's origin.
    """
    ahead = directions(rng)
    right = across(rng, ahead)
    down = np.cross(ahead.T, right.T).T
    u, v = rng.uniform(-1, 1, (2, BLOCK)) * np.where(rng.random(BLOCK) < 0.2, 1e-9, 1.0)
    depth = sizes(rng, 1e-6, 1e6)
    if kind == PARABOLOID:
        rho = u * u + v * v
        u, v = (c / np.sqrt(np.maximum(rho, 1)) * 0.999 for c in (u, v))
        away = 2 * (u * right + v * down) + (1 - u * u - v * v) * ahead
    else:
        away = u * HALF[0] * 0.999 * right + v * HALF[1] * 0.999 * down + ahead
    origin = depth * directions(rng) * rng.choice([0.0, 1.0, 100.0], BLOCK)
    return np.concatenate([origin + depth * away, origin, right, down, ahead])


def points(kind: int, x: Array) -> Array:
    """Return column, row and depth of each point on its own map."""
    n = x.shape[1]
    half = np.array(HALF if kind == PERSPECTIVE else (1.0, 1.0))
    maps = Projection(kind, HEIGHT, WIDTH, np.ascontiguousarray(x[3:6].T),
                      np.ascontiguousarray(x[6:15].T.reshape(n, 3, 3)), half, np.inf)
    out = np.empty((3, n))
    _fill_points(maps, x, out)
    return out


def point(kind: int, x: Any) -> Any:
    p = x[:3] - x[3:6]
    u, v, z = dot(p, x[6:9]), dot(p, x[9:12]), dot(p, x[12:15])
    half, depth, scale = HALF, z, z
    if kind == PARABOLOID:
        half, depth = (1.0, 1.0), np.sqrt(u * u + v * v + z * z)
        scale = depth + z
    return [(u / scale / half[0] + 1) / 2 * WIDTH, (v / scale / half[1] + 1) / 2 * HEIGHT, depth]


def draw_cube(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    """Return points around the cube's centre, 1e-9 off its edges and more, grazing them among them."""
    p = rng.uniform(-1, 1, (3, BLOCK))
    edge = rng.random(BLOCK) < 0.3
    largest = np.abs(p).max(axis=0)
    other = np.argsort(np.abs(p), axis=0)[1]
    p[other, np.arange(BLOCK)] = np.where(
        edge, largest * (1 - np.exp(rng.uniform(np.log(1e-9), 0, BLOCK))), p[other, np.arange(BLOCK)])
    return p * sizes(rng, 1e-6, 1e6)


def cubes(x: Array) -> Array:
    out = np.empty((3, x.shape[1]))
    _fill_cube(cube_projection((0.0, 0.0, 0.0), FACE), x, out)
    return out


def cube(x: Any) -> Any:
    """Row, column and depth on the stacked faces; the face is that of the largest coordinate."""
    row, column, depth = (0 * x[0] for _ in range(3))
    largest = np.maximum(np.maximum(abs(x[0]), abs(x[1])), abs(x[2]))
    for face, (ahead, up) in enumerate(FACES):
        right = np.cross(ahead, up)
        down = np.cross(ahead, right)
        a, b, z = (dot([int(c) for c in axis], x) for axis in (right, down, ahead))
        here = z == largest
        safe = np.where(here, z, 1)
        row = np.where(here, (b / safe + 1) / 2 * FACE + face * FACE, row)
        column, depth = np.where(here, (a / safe + 1) / 2 * FACE, column), np.where(here, z, depth)
    return [row, column, depth]


def draw_image(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    u = sizes(rng, 1e-9, 1.0, 2 * BLOCK).reshape(2, BLOCK) * rng.choice([-1.0, 1.0], (2, BLOCK))
    return np.asarray(u / np.maximum(np.sqrt((u * u).sum(axis=0)), 1))


def draw_edges(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    """Return rays and triangles at any distance of them, needles and small ones far away among them."""
    origin, along = rng.uniform(-1, 1, (3, BLOCK)), directions(rng)
    a = directions(rng) * sizes(rng, 1e-6, 1e6)
    b = np.where(rng.random(BLOCK) < 0.5, a + directions(rng) * sizes(rng, 1e-12, 1.0), directions(rng))
    c = np.where(rng.random(BLOCK) < 0.5, a + directions(rng) * sizes(rng, 1e-9, 1.0), directions(rng))
    return np.concatenate([origin, along, origin + a, origin + b, origin + c])


def _edges(x: Any) -> Any:
    """Return v1 - v0, v2 - v0 and v0 - o."""
    return x[9:12] - x[6:9], x[12:15] - x[6:9], x[6:9] - x[:3]


def volumes(x: Any) -> Any:
    """Return d . ((v2 - v0) x (v0 - o)) and d . ((v0 - o) x (v1 - v0))."""
    one, two, far = _edges(x)
    return [dot(x[3:6], np.cross(two, far, axis=0)), dot(x[3:6], np.cross(far, one, axis=0))]


def products(x: Any, real: Any) -> Any:
    """Return half an ULP of the six products of each volume, all taken as positive."""
    d = abs(x[3:6])
    one, two, far = (abs(edge) for edge in _edges(x))
    totals = [sum(d[i] * (a[j] * far[k] + a[k] * far[j]) for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)))
              for a in (two, one)]  # fmt: skip
    return np.stack([total * float(np.finfo(real).eps / 2) for total in totals])


def of_the_map(x: Any, real: Any) -> Any:
    """Return 4 ULP of the map's size for columns and rows: they count from its edge, images from its middle."""
    eps = 4 * float(np.finfo(real).eps)
    return np.stack([0 * x[0] + size * eps for size in (WIDTH, HEIGHT, 0)])


LADDERS = (
    Ladder("map.perspective", "1e-6 .. 1e6 m away, origins to 100 times as far off", partial(draw_points, PERSPECTIVE),
           partial(points, PERSPECTIVE), partial(point, PERSPECTIVE), source=MAP, floor=of_the_map,
           reals=("float64",), lowest=-1e-3, brief=3 * BLOCK),
    Ladder("map.paraboloid", "1e-6 .. 1e6 m away, to 0.999 of the rim", partial(draw_points, PARABOLOID),
           partial(points, PARABOLOID), partial(point, PARABOLOID), source=MAP, floor=of_the_map,
           reals=("float64",), lowest=-1e-3, brief=3 * BLOCK),
    Ladder("map.cube", "1e-6 .. 1e6 m away, 1e-9 of the edges and farther", draw_cube, cubes, cube,
           reals=("float64",), lowest=-1e-3, brief=3 * BLOCK),
    Ladder("map.paraboloid_ray", "the unit disc, to the rim", draw_image, each_of(_ray, 2, 3), lambda x: direction(*x),
           6.0, source="6 roundings, each at most one ULP", lowest=-1.0),
    Ladder("map.barycentric", "edges 1e-12 .. 1e6 m, needles, small and far", draw_edges, each_of(_volumes, 15, 2),
           volumes, 7.0, source="7 roundings of half an ULP of the six products (the unit)", scale=products,
           conditioned=False, reals=("float64",), lowest=-np.inf, extended=4_000_000),
)
