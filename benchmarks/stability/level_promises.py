"""Promises of pyramids and of pictures of other moments: any unit of length, any origin of places, any exponent.

Blend weights between levels are ratios of lengths, so a power of two changes no bit of them. A view's places count
from its own origin, so that the same points by another origin are the same points, to the bit where no place rounds.
"""

from typing import Any

import numpy as np

from benchmarks.stability.ladder import Ladder
from benchmarks.stability.promise import Case, Promise
from refgi.rsm.raster.projection import PERSPECTIVE, Projection
from refgi.splat.multires.error_target.interpolate import blend_weights, surface_levels
from refgi.splat.sii.reach.bounds import TANGENT_POINT, tangent_ellipsoid
from refgi.sssil.reprojection import SourceView, reproject
from refgi.types import Array

SIDE = 16  # pixels, a multiple of 4: no level has cells without pixels
FINENESS = 2.0**-10  # places are whole multiples of it


def _terrain(rng: np.random.Generator) -> tuple[Array, Array]:
    """Return places, with steps in depth among them, and unit normals, (3, SIDE, SIDE)."""
    across = np.stack(np.meshgrid(*[np.arange(SIDE) / SIDE] * 2))
    depth = 0.1 * rng.random((SIDE, SIDE)) + np.where(rng.random((SIDE, SIDE)) < 0.3, rng.random(), 0.0)
    normal = np.stack([*(0.2 * rng.normal(size=(2, SIDE, SIDE))), np.ones((SIDE, SIDE))])
    return np.concatenate([across, depth[None]]), normal / np.linalg.norm(normal, axis=0)


def blends(rng: np.random.Generator) -> Case:
    """Return how many blend weights change with the unit of length."""
    real, power = rng.choice([np.float32, np.float64]), int(rng.integers(-27, 28))
    position, normal = (one.astype(real) for one in _terrain(rng))
    covered = rng.random((SIDE, SIDE)) < 0.9
    plain, scaled = (blend_weights(surface_levels(real(unit) * position, normal, covered, 2))
                     for unit in (1.0, 2.0**power))
    differing = 0
    for one, other in zip(plain, scaled, strict=True):
        for child, corner in np.ndindex(4, 4):
            share = [one.across[k] if beside else 1 - one.across[k]
                     for k, beside in ((child >> 1, corner >> 1), (child & 1, corner & 1))]
            if min(share) > 0:  # else they are not filled
                cells = SIDE >> (1 if one is plain[0] else 2)
                first, second = (made.weight[4 * child + corner, :cells, :cells] for made in (one, other))
                differing += int((first != second).sum())
    return Case(differing, f"{np.dtype(real).name}, lengths x 2^{power}: {differing} weights differ")


def fetched(rng: np.random.Generator) -> Case:
    """Return how many values that are fetched from another view change with the origin of places."""
    real = rng.choice([np.float32, np.float64])
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    frame = turn * np.sign(np.linalg.det(turn))
    eye = np.round(rng.uniform(-4, 4, 3) / FINENESS) * FINENESS
    view = Projection(PERSPECTIVE, SIDE, SIDE, eye[None], frame[None], np.array([0.7, 0.6]), np.inf)
    depth = np.full((SIDE, SIDE), 2.0, real)
    facing = np.broadcast_to(-frame[2][:, None, None], (3, SIDE, SIDE)).astype(real)
    at = eye[:, None, None] + np.einsum("kc,kij->cij", frame, np.concatenate([
        rng.uniform(-1.2, 1.2, (2, SIDE, SIDE)), np.full((1, SIDE, SIDE), 2.0)]))
    at = np.round(at / FINENESS) * FINENESS
    values, covered = rng.random((3, SIDE, SIDE)).astype(real), np.ones((SIDE, SIDE), np.bool_)
    shift = rng.integers(-64, 65, 3).astype(float)
    first, second = rng.integers(-10**6, 10**6, (2, 3)).astype(float)
    second = first + shift  # of the points; `first` of the view

    def picture(places: Array, origin: Any) -> Array:
        source = SourceView(view, depth, facing, tuple(first.tolist()))
        mean, weight = reproject(values, source, np.ascontiguousarray(places, real), facing, covered,
                                 depth_tolerance=0.05, normal_cosine=0.9, origin=origin)
        return np.concatenate([mean, weight[None]])

    here = picture(at, None)
    there = picture(at - shift[:, None, None], tuple(second.tolist()))
    differing = int((here != there).any(axis=0).sum())
    return Case(differing, f"{np.dtype(real).name}, origins {shift.tolist()} m apart: {differing} of "
                f"{int((here[3] > 0).sum())} values differ")


def draw_exponents(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    count = 1 << 14
    n = np.where(rng.random(count) < 0.2, rng.uniform(0, 4, count), 10.0 ** rng.uniform(-3, 20, count))
    return np.where(rng.random(count) < 0.05, rng.choice([0.0, 1.0, 2.0, 1e20], count), n)[None]


def ellipsoid_of(x: Array) -> Array:
    return np.stack(tangent_ellipsoid(x[0]))


def ellipsoid(m: Any, x: Any) -> Any:
    """SII Eq. 7 and 8 for n < 2; else b = 2n / (n + 2), g = t^(b - 1) - t, k = 1 - (b - 1) t^(b - 2) at t = 0.71.

    x g(t) - k x (x - t) is an ellipse from 0 to t + g(t) / k, as high as its half axis times k^(1/2).
    """
    n, t = x[0], m.number(np.array([TANGENT_POINT]))
    some = np.where(n > 0, n, 1)
    share = some / (some + 2)
    center = np.where(n > 0, m.exp((n + 2) / 4 * m.log(share)), 0 * n)
    height = np.where(n > 0, m.exp(n / 4 * m.log(share)), 1) * m.sqrt(2 / (n + 2))
    old = [center, np.maximum(center, 1 - center), height]
    b = 2 * n / (n + 2)
    k = 1 - (b - 1) * m.exp((b - 2) * m.log(t))
    half = (t + (m.exp((b - 1) * m.log(t)) - t) / np.where(n < 2, 1, k)) / 2
    new = [half, half, half * m.sqrt(np.where(n < 2, 1, k))]
    return [np.where(n < 2, one, other) for one, other in zip(old, new, strict=True)]


LADDERS = (
    Ladder("bounds.tangent", "exponents 0 .. 1e20", draw_exponents, ellipsoid_of, ellipsoid, 16.0,
           source="16 roundings, each at most one ULP, of a power with an exponent below 1", reals=("float64",),
           extended=0, conditioned=False),
)
PROMISES = (
    Promise("blends.unit", "lengths x 2^k, to the bit", "blend_weights", "k -27 .. 27, float32 and float64", blends,
            "weights", 0.0, "exact", "a power of two rounds nothing", 3000, 20, adds=True),
    Promise("reproject.origin", "the same points by another origin, to the bit", "reproject",
            "origins up to 64 m apart, places on a grid of 2^-10 m", fetched, "values", 0.0, "exact",
            "no place is rounded", 2000, 30, adds=True),
)
