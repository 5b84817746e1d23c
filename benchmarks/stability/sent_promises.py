"""Promises of rays that are sent: from narrow spots, over the hemisphere, and off faces that were found from afar.

Closed forms: a ray of a spot at the share u of its cap, 2 sin^2(outer / 2), has 1 - cos = u cap; a cosine-distributed
one sin^2 = u. A ray starts above its face by the offset of docs/conventions.md, 4 u (|y|_1 + grain), u = 2^-24.
"""

import math
from typing import Any

import numpy as np

from benchmarks.stability.ladder import Ladder, each_of
from benchmarks.stability.numbers import BLOCK, directions, pi_of
from benchmarks.stability.promise import Case, Promise
from refgi.lights.walk import walk_lights
from refgi.rays import Tracer
from refgi.scene import Geometry, Material, SpotLight, light_table, material_table
from refgi.truth.hemisphere import cosine_direction
from refgi.truth.light_grid import light_rays
from refgi.truth.surfaces import Surfaces, face_normal, lift
from refgi.types import Array

GOOD_TO = 1e-8  # hemisphere directions, as the kernel promises
CELLS, PATHS = 16, 64
NARROWEST, WIDEST = 1.8e-7, 1.2  # half-angles, rad: refgi takes no narrower ones
THINNEST = 1e-3  # of faces that rays leave, as wide as long


def draw_square(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    """Return points of the unit square, many near borders of the eighths of a turn."""
    u = np.where(rng.random(BLOCK) < 0.1, rng.choice([0.0, 1e-12, 1 - 2.0**-33], BLOCK), rng.random(BLOCK))
    border = rng.integers(0, 9, BLOCK) / 8 + 10.0 ** rng.uniform(-17, -2, BLOCK) * rng.choice([-1, 1], BLOCK)
    v = np.where(rng.random(BLOCK) < 0.5, np.clip(border, 0, 1 - 2.0**-33), rng.random(BLOCK))
    return np.stack([u, v])


def cosine_weighted(x: Any) -> Any:
    radius, turn = np.sqrt(x[0]), 2 * pi_of(x) * x[1]
    return [radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1 - x[0])]


def _spot(rng: np.random.Generator, place: tuple[float, ...], axis: tuple[float, ...]) -> SpotLight:
    outer = math.exp(rng.uniform(math.log(NARROWEST), math.log(WIDEST)))
    return SpotLight(place, axis, 0.5 * outer, outer, (1.0, 1.0, 1.0))  # type: ignore[arg-type]


def _ground(half: float) -> Geometry:
    corners = half * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    return Geometry(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.zeros(2, np.int32))


def spot_rays(rng: np.random.Generator) -> Case:
    """Return how far the rays of a spot's grid are from their places in its cap, and its measure from the cap's."""
    spot = _spot(rng, (0.0, 0.0, 0.0), tuple(directions(rng, 1)[:, 0].tolist()))
    jitter = rng.random((CELLS * CELLS, 2))
    rays = light_rays(spot, _ground(1.0), jitter)
    axis = np.array(spot.direction, np.longdouble)
    axis /= np.sqrt(axis @ axis)
    cap = 2 * np.sin(np.longdouble(spot.outer_half_angle) / 2) ** 2
    across = np.cross(np.asarray(rays.directions, np.longdouble), axis)
    sine = np.sort(np.sqrt((across * across).sum(axis=1)))
    # rays come in any order, one in each cell, and so do the ends of cells
    row, column = np.divmod(np.arange(CELLS * CELLS), CELLS)
    edges = [np.abs(2 * np.stack([row + k, column + n]) / CELLS - 1).max(axis=0) for k in (0, 1) for n in (0, 1)]
    least, most = (np.sort(_sine(one * one * cap)) for one in (np.minimum.reduce(edges), np.maximum.reduce(edges)))
    outside = np.maximum(np.maximum(least - sine, sine - most), 0).max()
    measure = float(abs(rays.measure * CELLS * CELLS / (2 * np.longdouble(math.pi) * cap) - 1))
    figure = max(float(outside), measure) * 2.0**53
    return Case(figure, f"half-angle {spot.outer_half_angle:.3g}: sines off by {float(outside):.3g}, the measure by "
                f"{measure:.3g} of it")


def _sine(height: Array) -> Array:
    return np.asarray(np.sqrt(height * (2 - height)))


def _radical_inverse(count: int) -> Array:
    """Return the first numbers of base 2 after 0."""
    return np.array([int(f"{i:b}"[::-1], 2) / 2.0 ** len(f"{i:b}") for i in range(1, count + 1)])


def walked(rng: np.random.Generator) -> Case:
    """Return how far the lights that a spot's paths leave on a plane are from where its cap puts them."""
    height = 10.0 ** rng.uniform(-3, 3)
    spot = _spot(rng, (0.0, 0.0, height), (0.0, 0.0, -1.0))
    ground = _ground(4 * height * math.tan(spot.outer_half_angle) + 0.1 * height)
    cap = 2 * np.sin(np.longdouble(spot.outer_half_angle) / 2) ** 2
    part = _radical_inverse(PATHS) * cap
    exact = height * _sine(part) / (1 - part)
    lights = walk_lights(Tracer(ground), ground, material_table([Material()]), light_table([spot]), PATHS)
    radius = np.hypot(lights.position[0], lights.position[1])
    if len(radius) != PATHS:
        return Case(math.inf, f"half-angle {spot.outer_half_angle:.3g}: {len(radius)} lights of {PATHS} paths")
    exact = np.sort(exact)
    off = float((np.abs(np.sort(radius) - exact) / exact).max())
    return Case(off, f"half-angle {spot.outer_half_angle:.3g}, {height:.3g} m above: off by {off:.3g}")


def lifted(rng: np.random.Generator) -> Case:
    """Return how far the starts of rays are from the offset above their face, for points found from afar."""
    size = 10.0 ** rng.uniform(-3, 3)
    corner, along = size * rng.uniform(-1, 1, (2, 3))
    across = np.cross(along, rng.normal(size=3))
    across *= np.linalg.norm(along) * 10.0 ** rng.uniform(math.log10(THINNEST), 0) / np.linalg.norm(across)
    vertices = np.stack([corner, corner + along, corner + across + rng.random() * along])
    surfaces = Surfaces(vertices, np.array([[0, 1, 2]], np.int32), np.zeros((0, 3)), np.zeros(1, np.int32),
                        np.ones((1, 3)), np.zeros((1, 3)), np.zeros(1))
    target = rng.dirichlet((1, 1, 1)) @ vertices
    start = target + size * 10.0 ** rng.uniform(-1, 5) * directions(rng, 1)[:, 0]
    way = (target - start) / np.linalg.norm(target - start)
    distance = float(np.float32(np.linalg.norm(target - start)))
    y = tuple(float(c) for c in start + distance * way)
    grain = 8 * 2.0 ** math.ceil(math.log2(size))
    g = face_normal(surfaces, 0, *way)
    offset = lift(surfaces, 0, y, g, grain)
    at = np.array(y, np.longdouble) + np.longdouble(offset) * np.array(g, np.longdouble)
    a, b, c = vertices.astype(np.longdouble)
    normal = np.cross(b - a, c - a)
    above = abs((at - a) @ normal) / np.sqrt(normal @ normal)
    off = float(abs(above / (4 * 2.0**-24 * (sum(abs(c) for c in y) + grain)) - 1))
    return Case(off, f"a face of {size:.3g} m found at {distance:.3g} m: starts off by {off:.3g} of the offset")


LADDERS = (
    Ladder("hemisphere.cosine", "the unit square, near borders of the eighths of a turn", draw_square,
           each_of(cosine_direction, 2, 3), cosine_weighted, 1.0, source="1e-8, as the kernel promises",
           scale=lambda x, _: 0 * x[0] + GOOD_TO, conditioned=False, reals=("float64",), lowest=-1.0),
)
NARROW = f"half-angles {NARROWEST:g} .. {WIDEST:g} rad"
PROMISES = (
    Promise("sent.spot", "rays of a spot keep to their cells of its cap", "light_rays", NARROW, spot_rays, "2^-53",
            16.0, "derived", "roundings of a direction: frame, sine, turn and their products", 4000, 60),
    Promise("sent.walk", "lights that a spot's paths leave on a plane", "walk_lights",
            f"{NARROW}, 1e-3 .. 1e3 m above the plane", walked, "of the distance from the axis", 5.4e-7, "observed x 2",
            "2.7e-7: distances of float32", 2000, 30),
    Promise("sent.lift", "rays start the offset above their face", "truth surfaces",
            f"faces of 1e-3 .. 1e3 m, {THINNEST:g} .. 1 as wide as long, found from up to 1e5 times that away", lifted,
            "of the offset", 1e-5, "derived", "face normals of float64, 1e-12 off, over an offset of 2^-22", 6000,
            200),
)
