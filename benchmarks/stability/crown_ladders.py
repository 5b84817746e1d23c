"""Ladders of the crown (hssil): the form factors of Eq. 3 and 4, and the surface that a pixel shows (Eq. 2).

Formulas are those of docs/methods/hssil.md: with R^2 the projected area over pi of what a sample stands for,
cos(theta) R^2 / (r^2 + R^2) (Eq. 4), the same with the texel's own R^2 below the bar, and cos(theta) R^2 / r^2 (Eq. 3).
"""

from collections.abc import Iterable
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks.stability.inputs import BLOCK, around, block_of, directions, sizes, some
from benchmarks.stability.ladder import SEED, Ladder
from benchmarks.stability.maths import dot
from benchmarks.stability.pair_ladders import filled
from refgi.jit import kernel
from refgi.sssil.crown.add import DISC, POINT, TEXEL, term
from refgi.sssil.crown.emitters import length_scale
from refgi.sssil.pyramid.view import pixel_surface
from refgi.stress.rows import Row

Array = npt.NDArray[Any]
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


@kernel
def _surfaces(x: Array, out: Array) -> None:
    for i in range(x.shape[1]):
        out[0, i] = pixel_surface(x[0, i], x[1, i], x[2, i])


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
LADDERS = (
    _ladder("point", POINT, _points), _ladder("texel", TEXEL, _texels), _ladder("disc", DISC, _discs),
    Ladder("crown.area", "depth 1e-15 .. 1e9 m, facing 1e-6 .. 1", draw_surfaces, filled(_surfaces),
           surface, reals=("float64",)),
)
