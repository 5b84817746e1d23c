"""Ladders of pairs: SII Eq. 2 with each of its clamps, form factors of HSS Eq. 3 and 4, horizons, cones, ray offsets.

Formulas are those of refgi.literal but for clamps by a distance or a bound, areas, heights, cones and offsets, which it
has not as functions of one pair: docs/methods/sii.md, hssil.md and docs/truth.md.

Heights are those of a sample's front and back above the receiver's plane, for the bitmask of horizons. Of the direction
d from a receiver p to a sample s = p + d, in the plane of the eye (at 0), p and s: x along the way back to the eye,
y >= 0 across it, c = n . d. The height is q(a, b), a = max(c, 0) y and b = (n . e)(x^2 + y^2) - c x with e = -p / |p|:
a / (a + |b|), and 2 less that beyond the normal. The back lies `thickness` behind s, away from the eye.
"""

from collections.abc import Iterable
from typing import Any

import numpy as np

from benchmarks.stability.ladder import SEED, Ladder, each_of, filled, unclamped
from benchmarks.stability.promise import BLOCK, across, around, block_of, directions, dot, sizes, some
from refgi.jit import kernel
from refgi.literal.hssil_crown import LEAST, disc_form_factor, point_form_factor, shared_disc_form_factor
from refgi.literal.pairs import pair
from refgi.pairs.pair_sum import clamped_term, geometry_term
from refgi.pairs.sphere_sum import cone_term
from refgi.rays.watertight import far_offset, ray_offset
from refgi.sssil.form_factor import Facing, length_scale, term
from refgi.sssil.slices import PLANES, direction, heights, pack
from refgi.sssil.view import pixel_surface
from refgi.stress.promises import Row
from refgi.types import Array

NEAREST, FARTHEST = 1.01e-15, 1e9  # m
NEAREST_SAMPLE = 1e-7
ROUNDINGS = "14 roundings, each at most one ULP: 5 of r^2, each of which counts twice, 2 divisions, 2 products"
PAIR = "r 1e-15 .. 1e9 m and 0; normals any way, 1 ULP off, grazing, opposite"
SAMPLE = "r 1e-7 .. 1e9 m, areas 1e-6 .. 10 r^2, 1 .. 10 texels a sample"
LEAST_FACING = 1.01e-6  # less is the rounding of a float32 normal
LEAST_HORIZON = 1e-3  # at 0 the horizon behind the normal is at once that before it: a height of 2 is one of 0
SMALLEST = 1e-15  # of answers that keep every bit: cosines that cancel to less leave float32's range at 2^-12


@kernel
def _clamped(
    dx: Any, dy: Any, dz: Any, lx: Any, ly: Any, lz: Any, nx: Any, ny: Any, nz: Any, least: Any, softness: Any,
    bound: Any,
) -> Any:
    return clamped_term(dx, dy, dz, lx, ly, lz, nx, ny, nz, (least, softness, bound))


@kernel
def _offsets(x: Any, y: Any, z: Any, grain: Any) -> Any:
    return ray_offset(x, y, z, grain), far_offset(x, y, z)


@kernel
def _terms(x: Array, discs: Array, out: Array) -> None:
    for i in range(x.shape[1]):
        out[0, i] = term(Facing(x[0, i], x[1, i], x[2, i], x[3, i], x[4, i], x[5, i]),
                         Facing(x[6, i], x[7, i], x[8, i], x[9, i], x[10, i], x[11, i]), x[12, i], discs[i])


@kernel
def _heights(receiver: Array, sender: Array, thickness: Array, out: Array) -> None:
    for i in range(out.shape[1]):
        dx, dy, dz, c = direction(receiver, i, sender, i)
        out[0, i], out[1, i] = heights(receiver, i, sender, i, dx, dy, dz, c, thickness[i])


def draw_pairs(rng: np.random.Generator, real: Any) -> Array:
    """Return d, reversed normal of the light and normal of the receiver, (9, BLOCK)."""
    w = directions(rng)
    r = some(rng, sizes(rng, NEAREST, FARTHEST), 0.0)
    return np.concatenate([r * w, around(rng, w, real), around(rng, w, real)])


def draw_clamps(rng: np.random.Generator, real: Any) -> Array:
    """Return pairs with a bound, a least distance, a softness, or all of them near the pair's own numbers."""
    pairs = draw_pairs(rng, real)
    square = np.maximum((pairs[:3] ** 2).sum(axis=0), NEAREST**2)
    kind = rng.integers(0, 4, BLOCK)
    near = np.exp(rng.uniform(-6, 6, (3, BLOCK)))
    limits = np.stack([np.where((kind == 0) | (kind == 3), near[0] * square, 0),
                       np.where((kind == 1) | (kind == 3), near[1] * square, 0),
                       np.where((kind == 2) | (kind == 3), near[2] / square, 1e38)])
    return np.concatenate([pairs, limits])


def geometry(x: Any) -> Any:
    return [pair(0 * x[:3], x[6:9], x[:3], -x[3:6], np.pi)]  # a flux of pi: cosines over r^2 alone


def clamped(x: Any) -> Any:
    square = dot(x[:3], x[:3])
    square = np.where(square > 0, square, 1)
    above = np.maximum(dot(x[:3], x[3:6]), 0) * np.maximum(dot(x[:3], x[6:9]), 0)
    return [np.minimum(above / (square * (np.maximum(square, x[9]) + x[10])), x[11])]


def draw_offsets(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    sign = rng.choice([-1.0, 1.0], (3, BLOCK))
    return np.stack([*(some(rng, sizes(rng, 1e-30, 1e30) * s, 0.0) for s in sign), sizes(rng, 1e-30, 1e30)])


def offset(x: Any) -> Any:
    """4 U of the sum of sizes and of the grain, U = 2^-24 (docs/truth.md)."""
    length = abs(x[0]) + abs(x[1]) + abs(x[2])
    return [4 * 2.0**-24 * (length + x[3]), 4 * 2.0**-24 * length]


def draw_samples(rng: np.random.Generator, real: Any) -> Array:
    """Return receiver (position, normal), sample (position, reversed normal times area / pi) and its texels."""
    w, r = directions(rng), sizes(rng, NEAREST_SAMPLE, FARTHEST)
    # places around the origin as far off as the pair is wide; some receivers at the origin, some samples upon them
    start = r * directions(rng) * rng.choice([0.0, 1.0], BLOCK)
    facing, area = around(rng, w, real), r * r * sizes(rng, 1e-6, 10.0)
    end = np.where(rng.random(BLOCK) < 0.02, start, start + r * w)
    return np.concatenate([start, around(rng, w, real), end, facing * area / np.pi,
                           np.ceil(sizes(rng, 1.0, 10.0))[None]])


def sampled(x: Any) -> Any:
    """Return x, n, y, m and texels of samples; those upon their receiver stand beside it, and for nothing."""
    upon = dot(x[6:9] - x[:3], x[6:9] - x[:3]) <= LEAST
    return x[:3], x[3:6], np.where(upon, x[6:9] + 1, x[6:9]), -x[9:12], np.where(upon, 0, x[12])


def point_form(x: Any) -> Any:
    """A texel's area over pi is the length of its normal: a point and a disc have an area of pi a texel."""
    *pair_of, texels = sampled(x)
    return [point_form_factor(*pair_of, np.pi * texels) / np.pi]


def texel_form(x: Any) -> Any:
    *pair_of, texels = sampled(x)
    return [shared_disc_form_factor(*pair_of, np.pi, texels, 0.0) / np.pi]


def disc_form(x: Any) -> Any:
    *pair_of, texels = sampled(x)
    return [disc_form_factor(*pair_of, np.pi * texels) / np.pi]


FORMS = {  # kernel and formula
    "point": (filled(lambda x, out: _terms(x, np.zeros_like(x[12]), out)), point_form),
    "texel": (filled(lambda x, out: _terms(x, np.ones_like(x[12]), out)), texel_form),
    "disc": (filled(lambda x, out: _terms(x, x[12], out)), disc_form)}


def underflow(x: Any, real: Any) -> Any:
    """Return what a product c s below the smallest normal number may lose: its rounding, divided by r^4."""
    square = dot(x[6:9] - x[:3], x[6:9] - x[:3])
    lost = 8 * float(np.finfo(real).smallest_subnormal)
    return np.where(square > 0, lost / np.where(square > 0, square * square, 1), 0)


def draw_surfaces(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    facing = np.maximum(sizes(rng, 1e-9, 1.0), LEAST_FACING)
    return np.stack([sizes(rng, 1e-15, 1e9), some(rng, facing, 1.0), sizes(rng, 1e-12, 10.0)])


def unit_rows(short: bool) -> Iterable[Row]:
    """Yield what makes any scene one of lengths around 1: the unit of a level, and that it changes no bit."""
    changed, off, cases = 0, 0.0, 0
    forms = [run for run, _ in FORMS.values()]
    for block in range(1 if short else 20):
        rng = block_of(SEED, block)
        w, r = directions(rng), sizes(rng, 0.1, 10.0)
        x = np.concatenate([-0.25 * r * w, around(rng, w, np.float32), 0.75 * r * w, around(rng, w, np.float32) * r * r,
                            np.ceil(sizes(rng, 1.0, 10.0))[None]]).astype(np.float32)
        plain = [run(x) for run in forms]
        for power in (-12, -1, 5, 12):
            moved = x.copy()
            moved[:3], moved[6:9], moved[9:12] = (x[a:b] * np.float32(2.0 ** (n * power))
                                                  for a, b, n in ((0, 3, 1), (6, 9, 1), (9, 12, 2)))
            changed += sum(int(((run(moved) != one) & (one > SMALLEST)).sum())
                           for run, one in zip(forms, plain, strict=True))
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


def height(x: Any) -> Any:
    p, n, s, thickness = x[:3], x[3:6], x[6:9], x[9]
    length, far = np.sqrt(dot(p, p)), np.sqrt(dot(s, s))
    shown = []
    for behind in (0 * thickness, thickness):
        d = s - p + behind * s / np.where(far > 0, far, 1)
        along, up = -dot(d, p) / length, dot(n, d)
        aside = np.cross(p, d, axis=0)
        y = np.sqrt(dot(aside, aside)) / length
        a = np.maximum(up, 0) * y
        b = -dot(n, p) / length * (along * along + y * y) - up * along
        below = a + abs(b)
        part = a / np.where(below > 0, below, 1)
        shown.append(np.where(far > 0, np.where((b < 0) & (a > 0), 2 - part, part), 0))
    return shown


def rounding(x: Any, real: Any) -> Any:
    """Return the rounding of a height: of places, |p| + |s|, seen across the line of sight; on that line it is any."""
    aside = np.cross(x[:3], x[6:9], axis=0)
    across_it = np.sqrt(dot(aside, aside) / dot(x[:3], x[:3]))
    lost = float(np.finfo(real).eps) * (np.sqrt(dot(x[:3], x[:3])) + np.sqrt(dot(x[6:9], x[6:9])))
    return np.where(across_it > 8 * lost, lost / np.where(across_it > 0, across_it, 1), 2)


def draw_cones(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    """Return cosines of a cone's axis, l . n_x and sin^2 a of cones above both horizons, a point among them."""
    ratio = some(rng, sizes(rng, 1e-14, 0.999), 0.0, 0.1)
    cl, cx = np.sqrt(ratio) + (1 - np.sqrt(ratio)) * rng.random((2, BLOCK))
    turn = np.cos(2 * np.pi * rng.random(BLOCK))
    return np.stack([cl, cx, cl * cx + np.sqrt((1 - cl * cl) * (1 - cx * cx)) * turn, ratio])


def cone(x: Any) -> Any:
    """Second moments of a cone of half angle a over sin^2 a (Hasan et al. 2009): along its axis and across it.

    B = 2 pi / 3 (1 - cos^3 a), A = pi (2/3 - cos a + cos^3 a / 3); that of a cone narrower than 1e-9 is that of 1e-9 to
    18 digits.
    """
    ratio = np.where(x[3] > 0, x[3], 0 * x[3] + 1e-18)
    c = np.sqrt(1 - ratio)
    along, beside = 2 * (1 - c * c * c) / 3, (2 - 3 * c + c * c * c) / 3
    return [(beside * x[2] + (along - beside) * x[0] * x[1]) / ratio]


LADDERS = (
    Ladder("eq2.term", PAIR, draw_pairs, each_of(geometry_term, 9), geometry, 14.0, source=ROUNDINGS,
           smooth=unclamped(geometry, slice(3, 6), slice(6, 9)), extended=10_000_000),
    Ladder("eq2.clamped", f"{PAIR}; bound, least distance and softness within e^6 of the pair's", draw_clamps,
           each_of(_clamped, 12), clamped, 16.0, source=f"{ROUNDINGS}, 2 more of the clamp",
           smooth=unclamped(clamped, slice(3, 6), slice(6, 9)), extended=4_000_000),
    Ladder("ray.offset", "coordinates 0, 1e-30 .. 1e30 m", draw_offsets, each_of(_offsets, 4, 2), offset),
    *(Ladder(f"crown.{name}", SAMPLE, draw_samples, run, formula, 14.0,
             source="14 roundings, each at most one ULP: r^4 by 6, c and s by 3 each that count once, 2 products",
             smooth=unclamped(formula, slice(3, 6), slice(9, 12)), floor=underflow, extended=2_000_000,
             brief=3 * BLOCK) for name, (run, formula) in FORMS.items()),
    Ladder("crown.area", "depth 1e-15 .. 1e9 m, facing 1e-6 .. 1", draw_surfaces, each_of(pixel_surface, 3),
           lambda x: [x[0] * x[0] * x[2] / x[1]], reals=("float64",)),
    Ladder("hssil.height", "1e-3 .. 1e3 m from the eye, facing 1e-3 .. 1; samples 1e-3 .. 100 of that off, or "
           "1e-7 off the line of sight", draw_heights, run_heights, height, 24.0,
           source="24 roundings, each at most one ULP: b by 14, c and x by 5 of these each, a by 10",
           scale=rounding, extended=400_000, exact=2000, brief=BLOCK),
    Ladder("sphere.cone", "a 1e-7 rad .. 88 degrees and 0, above both horizons", draw_cones, each_of(cone_term, 4),
           cone, 12.0, source="12 roundings, each at most one ULP", extended=0),
)
