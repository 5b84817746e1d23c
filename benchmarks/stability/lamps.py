"""Ladders of lamps: the edge and falloff of spots, light of a point anywhere, solid angles of texels, frames.

Formulas of solid angles on a perspective map are those of refgi.literal. Others are those of docs/radiometry.md and of
`SpotLight`: t = (cos a - cos outer) / (cos inner - cos outer) in [0, 1], t t (3 - 2 t), E = I / d^2; the literal ones
take one cone at a time, and the sign of a zero from NumPy, which numbers of 50 digits have not.
"""

from functools import cache
from typing import Any

import numpy as np

from benchmarks.stability.ladder import Ladder, each_of
from benchmarks.stability.promise import BLOCK, across, directions, dot, sizes
from refgi.jit import kernel
from refgi.literal.light_flux import corner_angle, solid_angle
from refgi.radiometry import (
    FOR_FLOAT32,
    POINT,
    corner_solid_angle_paraboloid,
    corner_solid_angle_perspective,
    incident_light,
    orthonormal_basis,
    smooth_edge,
    spot_falloff,
)
from refgi.rsm.buffers.solid_angle import texel_solid_angles_at
from refgi.rsm.raster.projection import Projection
from refgi.scene.light import cone_row
from refgi.scene.model import LightTable
from refgi.types import Array

CONES = 32  # distinct ones in a block: each takes 60 digits to make
LARGEST_MAP = 16384  # texels along a side
OUTER, INNER = 6, 7  # rows of the drawn half-angles


@kernel
def _edge(t: Any, span: Any) -> Any:
    return smooth_edge(t, span, 1.0, 0.0)


@kernel
def _shares(x: Array, cones: Array, plain: float, out: Array) -> None:
    for i in range(x.shape[1]):
        out[0, i] = spot_falloff((x[0, i], x[1, i], x[2, i]), (x[3, i], x[4, i], x[5, i]), cones[i], plain)


@kernel
def _light(lights: Any, points: Array, out: Array) -> None:
    for i in range(points.shape[1]):
        (out[0, i], out[1, i], out[2, i], out[3, i], out[4, i], out[5, i],
         out[6, i]) = incident_light(lights, i, points[0, i], points[1, i], points[2, i])


def draw_edges(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    span = sizes(rng, 1e-15, 1.0)
    return np.stack([span * rng.uniform(-0.1, 1.1, BLOCK), np.where(rng.random(BLOCK) < 0.02, 0.0, span)])


def edge(x: Any) -> Any:
    """A span of 0 is a step; what is at its edge counts as inside."""
    wide = np.where(x[1] > 0, x[1], 1)
    t = np.minimum(np.maximum(np.where(x[1] > 0, x[0] / wide, np.where(x[0] >= 0, 1, 0)), 0), 1)
    return [t * t * (3 - 2 * t)]


def draw_falloffs(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    """Return directions near and in the soft edge of spots of 1e-6 rad to 90 degrees, any length, axis of any length.

    The drawn angle between both is exact in none of them; the formula takes the vectors as they are.
    """
    of = np.arange(BLOCK) % CONES
    outer = np.exp(rng.uniform(np.log(1e-6), np.log(1.57), CONES))
    inner = outer * np.where(rng.random(CONES) < 0.7, 1 - np.exp(rng.uniform(np.log(1e-6), 0, CONES)), 0.0)
    axis = directions(rng)
    angle = inner[of] + (outer - inner)[of] * rng.uniform(-0.05, 1.05, BLOCK)
    angle = np.where(rng.random(BLOCK) < 0.3, outer[of] * (1 - np.exp(rng.uniform(-33, 0, BLOCK))), angle)
    d = axis * np.cos(angle) + across(rng, axis) * np.sin(angle)
    return np.concatenate([d * sizes(rng, 1e-6, 1e6), axis * sizes(rng, 1e-3, 1e3), outer[of][None], inner[of][None]])


@cache
def _cone(inner: float, outer: float) -> Array:
    return cone_row(inner, outer)


def falloffs(plain: float) -> Any:
    """Return the kernel for float64 (`plain` inf) or for float32 pictures."""
    def run(x: Array) -> Array:
        out = np.empty((1, x.shape[1]))
        _shares(x, np.array([_cone(float(inner), float(outer)) for outer, inner in x[[OUTER, INNER]].T]), plain, out)
        return out

    return run


def falloff(x: Any) -> Any:
    d, axis = x[:3], x[3:6]
    cosine = dot(d, axis) / np.sqrt(dot(d, d) * dot(axis, axis))
    edge_of = np.cos(x[OUTER])
    return edge(np.stack([cosine - edge_of, np.cos(x[INNER]) - edge_of]))


def draw_lamps(near: Any, rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    """Return places of lamps, which are no float32 numbers, of receivers 1e-9 .. 1e6 m away, and intensities."""
    at = sizes(rng, 1e-3, 1e3) * directions(rng) * (1 + 1e-9 * rng.random(BLOCK))
    place = (at + sizes(rng, 1e-9, 1e6) * directions(rng)).astype(near).astype(np.float64)
    return np.concatenate([at, place, sizes(rng, 1e-9, 1e9, 3 * BLOCK).reshape(3, BLOCK)])


def lit(near: Any, x: Array) -> Array:
    n = x.shape[1]
    lamps = LightTable(np.full(n, POINT, np.int32), np.ascontiguousarray(x[:3].T), np.zeros((n, 3)), np.zeros((n, 6)),
                       np.ascontiguousarray(x[6:].T))
    out = np.empty((7, n))
    _light(lamps, np.ascontiguousarray(x[3:6], near), out)
    return out


def light(x: Any) -> Any:
    d = x[:3] - x[3:6]
    square = dot(d, d)
    away = np.where(square > 0, square, 1 + 0 * square)
    length = np.sqrt(away)
    return np.where(square > 0, np.concatenate([d / length, length[None], x[6:] / away]), 0)


def _lamp(name: str, near: Any, of: str) -> Ladder:
    return Ladder(name, f"lamps at any place of float64, receivers of {of}, 1e-9 .. 1e6 m away",
                  lambda rng, real: draw_lamps(near, rng, real), lambda x: lit(near, x), light, 10.0,
                  source="10 roundings, of which those of r^2 count once more in its square", conditioned=False,
                  reals=("float64",), extended=500_000, brief=BLOCK, lowest=-np.inf)


def draw_corners(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    return sizes(rng, 1e-12, 1e6, 2 * BLOCK).reshape(2, BLOCK) * rng.choice([-1.0, 1.0], (2, BLOCK))


def draw_disc(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    return sizes(rng, 1e-9, 1.0, 2 * BLOCK).reshape(2, BLOCK) * rng.choice([-1.0, 1.0], (2, BLOCK))


def paraboloid_corner(x: Any) -> Any:
    """The integral of 4 / (1 + u^2 + v^2)^2 over the rectangle from 0 to (u, v)."""
    su, sv = (np.sqrt(1 + c * c) for c in x)
    return [2 * (x[1] / sv * np.arctan(x[0] / sv) + x[0] / su * np.arctan(x[1] / su))]


def draw_texels(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    """Return half extents, texels along a side, row and column."""
    n = np.ceil(sizes(rng, 1.0, LARGEST_MAP))
    places = np.minimum(np.floor(rng.random((2, BLOCK)) * n), n - 1)
    return np.stack([sizes(rng, 1e-6, 3.0), n, *places])


def texels(x: Array) -> Array:
    out = np.empty((1, x.shape[1]))
    for i, (half, n, row, column) in enumerate(x.T):
        size = int(n)
        maps = Projection(0, size, size, np.zeros((1, 3)), np.eye(3)[None], np.array([half, half]), np.inf)
        out[0, i] = texel_solid_angles_at(maps, np.array([int(row) * size + int(column)]))[0]
    return out


def texel(x: Any) -> Any:
    y0, y1, x0, x1 = ((2 * (k + end) / x[1] - 1) * x[0] for k in (x[2], x[3]) for end in (0, 1))
    return [solid_angle(x0, x1, y0, y1)]


def draw_normals(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    return directions(rng) + 0.0  # no -0: the seam lies there


def basis(x: Any) -> Any:
    """Duff et al. 2017: the seam lies at z = 0, where the sign is that of the zero."""
    nx, ny, nz = x
    sign = np.where(nz < 0, -1, 1) + 0 * nz
    a = -1 / (sign + nz)
    b = nx * ny * a
    return [1 + sign * nx * nx * a, sign * b, -sign * nx, b, sign + ny * ny * a, -ny]


LADDERS = (
    Ladder("spot.edge", "span 1e-15 .. 1 and 0, t -0.1 .. 1.1", draw_edges, each_of(_edge, 2), edge, 7.0,
           source="7 roundings: t thrice, two products, 3 - 2 t"),
    Ladder("spot.falloff", "half-angles 1e-6 rad .. 90 degrees, to 5e-15 of the edge", draw_falloffs,
           falloffs(np.inf), falloff, 8.0, source="8 ULP, as the kernel promises, without a condition",
           conditioned=False, reals=("float64",), extended=0, fixed=(OUTER, INNER),
           brief_exact=2000),
    Ladder("spot.falloff32", "half-angles 1e-6 rad .. 90 degrees, to 5e-15 of the edge", draw_falloffs,
           falloffs(FOR_FLOAT32), falloff, 8.0, source="8 ULP of float32, as the kernel promises, without a condition",
           unit="float32", conditioned=False, reals=("float64",), extended=0, fixed=(OUTER, INNER),
           brief_exact=2000),
    Ladder("solid_angle.perspective", "corners 1e-12 .. 1e6", draw_corners, each_of(corner_solid_angle_perspective, 2),
           lambda x: [corner_angle(*x)], lowest=-np.inf),
    Ladder("solid_angle.paraboloid", "corners 1e-9 .. 1", draw_disc, each_of(corner_solid_angle_paraboloid, 2),
           paraboloid_corner, 9.0, source="9 roundings, each at most one ULP", lowest=-np.inf),
    Ladder("solid_angle.texel", "1 .. 16384 texels a side, half extents 1e-6 .. 3", draw_texels, texels, texel, 9.0,
           source="four corners off by 2.2e-16 each, over the texel at the rim, 1.6e-9 sr: 5.5e-7", unit="float32",
           conditioned=False, reals=("float64",), extended=0, exact=10_000),
    Ladder("frame.basis", "unit normals, along axes, flat, needles", draw_normals, each_of(orthonormal_basis, 3, 6),
           basis, 4.0, unit="one", lowest=-np.inf),
    _lamp("lamp.light", np.float64, "float64"),
    _lamp("lamp.light32", np.float32, "float32"),
)
