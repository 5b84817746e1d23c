"""Ladders of hssil: the form factors of Eq. 3 and 4, and the surface that a pixel shows (Eq. 2).

Formulas are those of docs/methods/hssil.md: with R^2 the projected area over pi of what a sample stands for,
cos(theta) R^2 / (r^2 + R^2) (Eq. 4), the same with the texel's own R^2 below the bar, and cos(theta) R^2 / r^2 (Eq. 3).

Heights are those of a sample's front and back above the receiver's plane, for the bitmask of horizons. Of the direction
d from a receiver p to a sample s = p + d, in the plane of the eye (at 0), p and s: x along the way back to the eye,
y >= 0 across it, c = n . d. The height is q(a, b), a = max(c, 0) y and b = (n . e)(x^2 + y^2) - c x with e = -p / |p|:
a / (a + |b|), and 2 less that beyond the normal. The back lies `thickness` behind s, away from the eye.
"""

from collections.abc import Iterable
from functools import partial
from typing import Any

import numpy as np

from benchmarks.stability.inputs import BLOCK, across, around, block_of, directions, sizes, some
from benchmarks.stability.ladder import SEED, Ladder
from benchmarks.stability.maths import cross, dot
from benchmarks.stability.pair_ladders import each_of, filled
from refgi.jit import kernel
from refgi.sssil.crown.form_factor import DISC, POINT, TEXEL, length_scale, term
from refgi.sssil.pyramid.view import pixel_surface
from refgi.sssil.visibility.slices import PLANES, direction, heights, pack
from refgi.stress.promises import Row
from refgi.types import Array

NEAREST, FARTHEST = 1e-7, 1e9  # m
LEAST_FACING = 1.01e-6  # less is the rounding of a float32 normal
DOMAIN = "r 1e-7 .. 1e9 m, areas 1e-6 .. 10 r^2, 1 .. 10 texels a sample"


@kernel
def _terms(x: Array, discs: Array, out: Array) -> None:
    for i in range(x.shape[1]):
        out[0, i] = term(x[0, i], x[1, i], x[2, i], x[3, i], x[4, i], x[5, i], x[6, i], x[7, i], x[8, i], x[9, i],
                         x[10, i], x[11, i], x[12, i], discs[i])


def _points(x: Array, out: Array) -> None:
    _terms(x, np.zeros_like(x[12]), out)


def _texels(x: Array, out: Array) -> None:
    _terms(x, np.ones_like(x[12]), out)


def _discs(x: Array, out: Array) -> None:
    _terms(x, x[12], out)


def draw(rng: np.random.Generator, real: Any) -> Array:
    """Return receiver (position, normal), sample (position, reversed normal times area / pi) and its texels."""
    w, r = directions(rng), sizes(rng, NEAREST, FARTHEST)
    # places around the origin as far off as the pair is wide; some receivers at the origin, some samples upon them
    start = r * directions(rng) * rng.choice([0.0, 1.0], BLOCK)
    facing, area = around(rng, w, real), r * r * sizes(rng, 1e-6, 10.0)
    end = np.where(rng.random(BLOCK) < 0.02, start, start + r * w)
    return np.concatenate([start, around(rng, w, real), end, facing * area / np.pi,
                           np.ceil(sizes(rng, 1.0, 10.0))[None]])


def form(which: int, clamps: bool, m: Any, x: Any) -> Any:
    d = [b - a for a, b in zip(x[:3], x[6:9], strict=True)]
    square = dot(d, d)
    square = np.where(square > 0, square, 1)
    r = m.sqrt(square)
    cosine, radius = dot(x[3:6], d) / r, dot(x[9:12], d) / r  # cos(theta), R^2 of one texel
    if clamps:
        cosine, radius = np.maximum(cosine, 0), np.maximum(radius, 0)
    shown = radius * x[12]
    spread = np.maximum({POINT: 0 * shown, TEXEL: radius, DISC: shown}[which], 0)
    return [cosine * shown / (square + spread)]


def underflow(m: Any, x: Any, real: Any) -> Any:
    """Return what a product c s below the smallest normal number may lose: its rounding, divided by r^4."""
    d = [b - a for a, b in zip(x[:3], x[6:9], strict=True)]
    square = dot(d, d)
    lost = 8 * m.number(np.float64(np.finfo(real).smallest_subnormal))
    return np.where(square > 0, lost / np.where(square > 0, square * square, 1), 0)


def draw_surfaces(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    facing = np.maximum(sizes(rng, 1e-9, 1.0), LEAST_FACING)
    return np.stack([sizes(rng, 1e-15, 1e9), some(rng, facing, 1.0), sizes(rng, 1e-12, 10.0)])


def surface(m: Any, x: Any) -> Any:  # noqa: ARG001
    return [x[0] * x[0] * x[2] / x[1]]


def _ladder(name: str, which: int, run: Any) -> Ladder:
    return Ladder(f"crown.{name}", DOMAIN, draw, filled(run), partial(form, which, True), 14.0,
                  source="14 roundings, each at most one ULP: r^4 by 6, c and s by 3 each that count once, 2 products",
                  smooth=partial(form, which, False), floor=underflow, extended=2_000_000, brief=3 * BLOCK)


# of answers that keep every bit: cosines that cancel to less leave float32's range where lengths are 2^-12
SMALLEST = 1e-15


def unit_rows(short: bool) -> Iterable[Row]:
    """Yield what makes any scene one of lengths around 1: the unit of a level, and that it changes no bit."""
    changed, off, cases = 0, 0.0, 0
    for block in range(1 if short else 20):
        rng = block_of(SEED, block)
        w, r = directions(rng), sizes(rng, 0.1, 10.0)
        x = np.concatenate([-0.25 * r * w, around(rng, w, np.float32), 0.75 * r * w, around(rng, w, np.float32) * r * r,
                            np.ceil(sizes(rng, 1.0, 10.0))[None]]).astype(np.float32)
        plain = [run(x) for run in FORMS]
        for power in (-12, -1, 5, 12):
            moved = x.copy()
            moved[:3], moved[6:9], moved[9:12] = (x[a:b] * np.float32(2.0 ** (n * power))
                                                  for a, b, n in ((0, 3, 1), (6, 9, 1), (9, 12, 2)))
            changed += sum(int(((run(moved) != one) & (one > SMALLEST)).sum())
                           for run, one in zip(FORMS, plain, strict=True))
            cases += 3 * BLOCK
        for depth in np.exp(rng.uniform(np.log(1e-30), np.log(1e30), (200, 2))):
            off = max(off, abs(np.log2(length_scale(depth[None])) + np.log2(depth).mean()))
    line = f"python -m benchmarks stability --part kernels{' --short' if short else ''} --out out"
    yield Row(part="kernels", property="lengths x 2^k, areas x 4^k, to the bit", subject="crown.unit",
              domain=f"r 0.1 .. 10 m, k -12 .. 12, answers above {SMALLEST:g}", figure=changed,
              unit="answers", limit=0, kind="exact",
              source="powers of 2 are exact where nothing leaves the range", cases=cases, seed=SEED, reproduce=line)
    yield Row(part="kernels", property="middle of the depths in the level's unit", subject="crown.unit",
              domain="depths 1e-30 .. 1e30 m", figure=off, unit="octaves off 1", limit=0.5 + 1e-9, kind="derived",
              source="the unit is the nearest power of 2", cases=200 * cases // (12 * BLOCK), seed=SEED, reproduce=line)


FORMS = tuple(filled(fill) for fill in (_points, _texels, _discs))


LEAST_HORIZON = 1e-3  # at 0 the horizon behind the normal is at once that before it: a height of 2 is one of 0


@kernel
def _heights(receiver: Array, sender: Array, thickness: Array, out: Array) -> None:
    for i in range(out.shape[1]):
        dx, dy, dz, c = direction(receiver, i, sender, i)
        out[0, i], out[1, i] = heights(receiver, i, sender, i, dx, dy, dz, c, thickness[i])


def run_heights(x: Array) -> Array:
    n, real = x.shape[1], x.dtype
    packed = [np.zeros((1, PLANES, n), real) for _ in range(2)]
    dark, area = np.zeros((3, 1, n), real), np.zeros((1, n), real)
    for place, one in zip((x[:3], x[6:9]), packed, strict=True):
        pack(np.ascontiguousarray(place[:, None]), np.ascontiguousarray(x[3:6, None]), dark, area, real.type(1), 1, one)
    out = np.empty((2, n), real)
    _heights(packed[0][0], packed[1][0], np.ascontiguousarray(x[9]), out)
    return out


def draw_heights(rng: np.random.Generator, real: Any) -> Array:
    """Return receiver (position, normal), sample and thickness; a third of the samples near the line of sight."""
    w = directions(rng)
    p = w * sizes(rng, 1e-3, 1e3)
    away = around(rng, w, real) * sizes(rng, 1e-3, 1e2)
    on_line = w * rng.uniform(-0.9, 3, BLOCK) + across(rng, w) * 10.0 ** rng.uniform(-7, -1, BLOCK)
    d = np.where(rng.random(BLOCK) < 0.33, on_line, away) * np.sqrt((p * p).sum(axis=0))
    n = directions(rng)
    n *= np.where((n * w).sum(axis=0) > 0, -1, 1)  # receivers are seen
    n = np.where((n * w).sum(axis=0) > -LEAST_HORIZON, -w, n)
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
    _ladder("point", POINT, _points), _ladder("texel", TEXEL, _texels), _ladder("disc", DISC, _discs),
    Ladder("crown.area", "depth 1e-15 .. 1e9 m, facing 1e-6 .. 1", draw_surfaces, each_of(pixel_surface, 3),
           surface, reals=("float64",)),
    Ladder("hssil.height", "1e-3 .. 1e3 m from the eye, facing 1e-3 .. 1; samples 1e-3 .. 100 of that off, or "
           "1e-7 off the line of sight", draw_heights, run_heights, height, 24.0,
           source="24 roundings, each at most one ULP: b by 14, c and x by 5 of these each, a by 10",
           scale=rounding, extended=400_000, exact=2000, brief=BLOCK),
)
