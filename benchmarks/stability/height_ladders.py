"""Ladder of the bitmask of horizons (hssil): the height of a sample's front and back above the receiver's plane.

Of the direction d from a receiver p to a sample s = p + d, in the plane of the eye (at 0), p and s: x along the way
back to the eye, y >= 0 across it, c = n . d. The height is q(a, b), a = max(c, 0) y and b = (n . e)(x^2 + y^2) - c x
with e = -p / |p|: a / (a + |b|), and 2 less that beyond the normal. The back lies `thickness` behind s, away from the
eye.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks.stability.inputs import BLOCK, across, around, directions, sizes
from benchmarks.stability.ladder import Ladder
from benchmarks.stability.maths import cross, dot
from refgi.jit import kernel
from refgi.sssil.visibility.elevation import PLANES, direction, heights, pack

Array = npt.NDArray[Any]
LEAST_FACING = 1e-3  # at 0 the horizon behind the normal is at once that before it: a height of 2 is one of 0


@kernel
def _heights(receiver: Array, sender: Array, thickness: Array, out: Array) -> None:
    for i in range(out.shape[1]):
        dx, dy, dz, c = direction(receiver, i, sender, i)
        out[0, i], out[1, i] = heights(receiver, i, sender, i, dx, dy, dz, c, thickness[i])


def run(x: Array) -> Array:
    n, real = x.shape[1], x.dtype
    packed = [np.zeros((1, PLANES, n), real) for _ in range(2)]
    dark, area = np.zeros((3, 1, n), real), np.zeros((1, n), real)
    for place, one in zip((x[:3], x[6:9]), packed, strict=True):
        pack(np.ascontiguousarray(place[:, None]), np.ascontiguousarray(x[3:6, None]), dark, area, real.type(1), 1, one)
    out = np.empty((2, n), real)
    _heights(packed[0][0], packed[1][0], np.ascontiguousarray(x[9]), out)
    return out


def draw(rng: np.random.Generator, real: Any) -> Array:
    """Return receiver (position, normal), sample and thickness; a third of the samples near the line of sight."""
    w = directions(rng)
    p = w * sizes(rng, 1e-3, 1e3)
    away = around(rng, w, real) * sizes(rng, 1e-3, 1e2)
    on_line = w * rng.uniform(-0.9, 3, BLOCK) + across(rng, w) * 10.0 ** rng.uniform(-7, -1, BLOCK)
    d = np.where(rng.random(BLOCK) < 0.33, on_line, away) * np.sqrt((p * p).sum(axis=0))
    n = directions(rng)
    n *= np.where((n * w).sum(axis=0) > 0, -1, 1)  # receivers are seen
    n = np.where((n * w).sum(axis=0) > -LEAST_FACING, -w, n)
    return np.concatenate([p, n, p + d, sizes(rng, 1e-4, 10.0)[None]])


def height(m: Any, x: Any) -> Any:
    p, n, s, thickness = x[:3], x[3:6], x[6:9], x[9]
    length, far = m.sqrt(dot(p, p)), m.sqrt(dot(s, s))
    shown = []
    for behind in (0 * thickness, thickness):
        d = [b - a + behind * b / np.where(far > 0, far, 1) for a, b in zip(p, s, strict=True)]
        along, up = -dot(d, p) / length, dot(n, d)
        aside = cross(p, d)
        y = m.sqrt(dot(aside, aside)) / length
        a = np.maximum(up, 0) * y
        b = -dot(n, p) / length * (along * along + y * y) - up * along
        below = a + abs(b)
        part = a / np.where(below > 0, below, 1)
        shown.append(np.where(far > 0, np.where((b < 0) & (a > 0), 2 - part, part), 0))
    return shown


def rounding(m: Any, x: Any, real: Any) -> Any:
    """Return the rounding of a height: of places, |p| + |s|, seen across the line of sight; on that line it is any."""
    aside = cross(x[:3], x[6:9])
    across_it = m.sqrt(dot(aside, aside) / dot(x[:3], x[:3]))
    places = m.sqrt(dot(x[:3], x[:3])) + m.sqrt(dot(x[6:9], x[6:9]))
    lost = m.number(np.float64(np.finfo(real).eps)) * places
    return np.where(across_it > 8 * lost, lost / np.where(across_it > 0, across_it, 1), 2)


LADDERS = (
    Ladder("hssil.height", "1e-3 .. 1e3 m from the eye, facing 1e-3 .. 1; samples 1e-3 .. 100 of that off, or "
           "1e-7 off the line of sight", draw, run, height, 24.0,
           source="24 roundings, each at most one ULP: b by 14, c and x by 5 of these each, a by 10",
           scale=rounding, extended=400_000, exact=2000, brief=BLOCK),
)
