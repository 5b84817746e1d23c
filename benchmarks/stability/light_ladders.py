"""Ladders of what reaches a receiver: light of a point anywhere, and the mean of two cosines over a sphere's cone.

Formulas are those of docs/radiometry.md, E = I / d^2, and of Hasan et al. 2009: the second moments of a cone of half
angle a, B = 2 pi / 3 (1 - cos^3 a) along its axis and A = pi (2/3 - cos a + cos^3 a / 3) across it, over pi sin^2 a.
"""

from typing import Any

import numpy as np

from benchmarks.stability.inputs import BLOCK, directions, sizes, some
from benchmarks.stability.ladder import Ladder
from benchmarks.stability.maths import dot
from benchmarks.stability.pair_ladders import each_of
from refgi.jit import kernel
from refgi.pairs.sphere_sum import cone_term
from refgi.radiometry import POINT, incident_light
from refgi.scene.model import LightTable
from refgi.types import Array


@kernel
def _light(lights: Any, points: Array, out: Array) -> None:
    for i in range(points.shape[1]):
        (out[0, i], out[1, i], out[2, i], out[3, i], out[4, i], out[5, i],
         out[6, i]) = incident_light(lights, i, points[0, i], points[1, i], points[2, i])


def draw_cones(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    """Return cosines of a cone's axis, l . n_x and sin^2 a of cones above both horizons, a point among them."""
    ratio = some(rng, sizes(rng, 1e-14, 0.999), 0.0, 0.1)
    cl, cx = np.sqrt(ratio) + (1 - np.sqrt(ratio)) * rng.random((2, BLOCK))
    turn = np.cos(2 * np.pi * rng.random(BLOCK))
    return np.stack([cl, cx, cl * cx + np.sqrt((1 - cl * cl) * (1 - cx * cx)) * turn, ratio])


def cone(m: Any, x: Any) -> Any:
    """Over sin^2 a; that of a cone narrower than 1e-9 is that of 1e-9 to 18 digits."""
    ratio = np.where(x[3] > 0, x[3], m.number(np.float64(1e-18)))
    c = m.sqrt(1 - ratio)
    along, across = 2 * (1 - c * c * c) / 3, m.number(np.float64(2)) / 3 - c + c * c * c / 3
    return [(across * x[2] + (along - across) * x[0] * x[1]) / ratio]


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


def light(m: Any, x: Any) -> Any:
    d = [a - b for a, b in zip(x[:3], x[3:6], strict=True)]
    square = dot(d, d)
    away = np.where(square > 0, square, 1)
    length = m.sqrt(away)
    return [*(np.where(square > 0, c / length, 0) for c in d), np.where(square > 0, length, 0),
            *(np.where(square > 0, peak / away, 0) for peak in x[6:])]


def _lamp(name: str, near: Any, of: str) -> Ladder:
    return Ladder(name, f"lamps at any place of float64, receivers of {of}, 1e-9 .. 1e6 m away",
                  lambda rng, real: draw_lamps(near, rng, real), lambda x: lit(near, x), light, 10.0,
                  source="10 roundings, of which those of r^2 count once more in its square", conditioned=False,
                  reals=("float64",), extended=500_000, brief=BLOCK, lowest=-np.inf)


LADDERS = (
    Ladder("sphere.cone", "a 1e-7 rad .. 88 degrees and 0, above both horizons", draw_cones, each_of(cone_term, 4),
           cone, 12.0, source="12 roundings, each at most one ULP", extended=0),
    _lamp("lamp.light", np.float64, "float64"),
    _lamp("lamp.light32", np.float32, "float32"),
)
