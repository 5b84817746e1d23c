"""Promises of rays beside things of other sizes: a huge plane under a small scene hides no thin gap in it.

Rays start above their face by 4 u (|y|_1 + grain), u = 2^-24, and grain is at most 16 times the largest coordinate of
half of the triangles: a sheet a hundred times as far above a floor is between its ends, whatever lies below.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks.stability.promise import Case, Promise
from refgi.rays import Tracer
from refgi.scene import Geometry

Array = npt.NDArray[Any]
SIDE = 6  # squares along a sheet
GAP = 5e-4  # between floor and sheet, of the size: a hundred offsets
RAYS = 500
FARTHEST = 9e8  # m: refgi takes no places beyond 1e9


def sheet(size: float, height: float) -> tuple[Array, Array]:
    """Return vertices and faces of a square of 2 size a side, cut into small ones."""
    across = size * np.linspace(-1, 1, SIDE + 1)
    x, z = (one.ravel() for one in np.meshgrid(across, across))
    row, column = (one.ravel() for one in np.meshgrid(np.arange(SIDE), np.arange(SIDE), indexing="ij"))
    a = row * (SIDE + 1) + column
    b, c, d = a + 1, a + SIDE + 2, a + SIDE + 1
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return np.stack([x, np.full_like(x, height), z], axis=1), faces


def through(rng: np.random.Generator) -> Case:
    """Return how many segments pass a sheet just above the floor that they start on, beside a huge plane."""
    size, ground = 10.0 ** rng.uniform(-5, 3), 10.0 ** rng.uniform(0, 7)
    floor, faces = sheet(size, 0.0)
    above, _ = sheet(size, GAP * size)
    huge, under = sheet(min(ground * size, FARTHEST), -0.5 * size)
    few = rng.choice(len(under), 8)
    vertices = np.concatenate([floor, above, huge])
    faces = np.concatenate([faces, len(floor) + faces, 2 * len(floor) + under[few]]).astype(np.int32)
    tracer = Tracer(Geometry(vertices, faces, np.zeros(len(faces), np.int32)))
    x, z = rng.uniform(-0.9, 0.9, (2, 2, RAYS))
    start, end = (size * np.stack([x[k], np.full(RAYS, 0.5 * k), z[k]], axis=1) for k in (0, 1))
    up = np.broadcast_to([0.0, 1.0, 0.0], start.shape)
    blocked = tracer.segments_blocked(start, end, up, -up)
    return Case(float((~blocked).sum()), f"a floor of {size:.3g} m, a plane {ground:.3g} times as large: "
                f"{int((~blocked).sum())} of {RAYS} segments pass the sheet")


PROMISES = (
    Promise("ground.sheet", "segments past a sheet above the floor", "Tracer.segments_blocked",
            "1e-5 .. 1e3 m, a sheet 5e-4 of that above, a plane of 1 .. 1e7 times that below", through, "segments", 0.0,
            "exact", "ends of rays keep to their offset, which the sizes of few triangles do not move", 500, 12,
            adds=True),
)
