"""Promises of places: scenes anywhere come near the origin as they are, thin triangles stay; any unit and origin.

Blend weights between levels are ratios of lengths, so a power of two changes no bit of them. A view's places count
from its own origin, so that the same points by another origin are the same points, to the bit where no place rounds.
"""

from typing import Any

import numpy as np

from benchmarks.stability.ladder import Ladder
from benchmarks.stability.numbers import BLOCK
from benchmarks.stability.promise import Case, Promise
from refgi.error_target.interpolate import blend_weights, surface_levels
from refgi.errors import InputError
from refgi.rsm.raster.projection import PERSPECTIVE, Projection
from refgi.scene import Camera, Geometry, Material, Mesh, PointLight, Scene, SpotLight
from refgi.scene.motion import near_origin
from refgi.scene.repair import repaired
from refgi.splat.sii.bounds import TANGENT_POINT, tangent_ellipsoid
from refgi.sssil.reprojection import SourceView, reproject
from refgi.types import Array

DIAGONALS = 16  # off the origin, at most: docs/conventions.md
POINTS = 48
FARTHEST = 9e8  # m: refgi takes no places beyond 1e9
# of the products that a cross product is made of: what must stay, what must go
THIN, FLAT = 1e-13, 2e-15
SIDE = 16  # pixels, a multiple of 4: no level has cells without pixels
FINENESS = 2.0**-10  # places are whole multiples of it
FAR = "scenes of 1e-6 .. 1e6 m, 0.1 .. 1e6 times that off the origin"


def scene_of(rng: np.random.Generator) -> Scene:
    """Return a scene of any size, up to a million times that off the origin, with eye and lamps in it."""
    size = 10.0 ** rng.uniform(-6, 6)
    away = rng.normal(size=3)
    middle = min(size * 10.0 ** rng.uniform(-1, 6), FARTHEST) * away / np.abs(away).max()
    places = middle + size * rng.uniform(-1, 1, (POINTS, 3))
    eye, target, lamp, spot = (tuple((middle + size * rng.uniform(-1, 1, 3)).tolist()) for _ in range(4))
    camera = Camera(eye, target, (0.0, 1.0, 0.0), 1.0, 8, 8)
    lights = PointLight(lamp, (1.0, 1.0, 1.0)), SpotLight(spot, (0.0, -1.0, 0.0), 0.4, 0.5, (1.0, 1.0, 1.0))
    geometry = Geometry(places, np.arange(POINTS, dtype=np.int32).reshape(-1, 3), np.zeros(POINTS // 3, np.int32))
    return Scene("far", geometry, (Material(),), camera, lights)


def _places(scene: Scene) -> Array:
    """Return all places that a scene knows, (n, 3) longdouble."""
    others = [scene.camera.eye, scene.camera.target, *(light.position for light in scene.lights)]  # type: ignore[union-attr]
    return np.concatenate([scene.geometry.vertices, others]).astype(np.longdouble)


def kept(rng: np.random.Generator) -> Case:
    """Return how far a place is moved against another when a scene is brought near the origin."""
    scene = scene_of(rng)
    moved, origin = near_origin(scene)
    apart = np.abs(_places(moved) + np.array(origin, np.longdouble) - _places(scene)).max()
    figure = float(apart) / scene.geometry.diagonal * 2.0**53
    return Case(figure, f"{scene.geometry.diagonal:.3g} m across, moved by {np.linalg.norm(origin):.3g} m: "
                f"{float(apart):.3g} m off")


def resolved(rng: np.random.Generator) -> Case:
    """Return how coarse float32 is where a scene lies after it was brought near the origin."""
    scene = scene_of(rng)
    moved, origin = near_origin(scene)
    largest = float(np.abs(moved.geometry.vertices).max())
    return Case(float(np.spacing(np.float32(largest))) / scene.geometry.diagonal,
                f"{scene.geometry.diagonal:.3g} m across, moved by {np.linalg.norm(origin):.3g} m: coordinates up to "
                f"{largest:.3g} m")


def slivers(rng: np.random.Generator) -> Case:
    """Return how many thin triangles are dropped from a mesh, and how many flat ones are left in it."""
    size, count = 10.0 ** rng.uniform(-6, 6), 64
    start, along, across = size * rng.uniform(-1, 1, (3, count, 3))
    across -= ((across * along).sum(axis=1) / (along * along).sum(axis=1))[:, None] * along
    height = np.where(rng.random(count) < 0.2, 0.0, 10.0 ** rng.uniform(-13, 0, count))
    third = start + rng.uniform(0.1, 0.9, (count, 1)) * along + height[:, None] * across
    end = start + along
    third = np.where(height[:, None] == 0, (start + end) / 2, third)  # but for its rounding
    third[:4] = start[:4]
    vertices = np.concatenate([start, end, third])
    faces = np.arange(3 * count).reshape(3, count).T
    a, b, c = (vertices[faces[:, k]].astype(np.longdouble) for k in range(3))
    share = np.abs(np.cross(b - a, c - a)).max(axis=1)
    share /= np.maximum(np.abs(b - a).max(axis=1) * np.abs(c - a).max(axis=1), np.longdouble(1e-300))
    try:
        left = repaired(Mesh(vertices, faces), "mesh")[0].faces[:, 0]
    except InputError:
        left = np.zeros(0, int)
    stays = np.isin(np.arange(count), left)
    wrong = (~stays & (share > THIN)) | (stays & (share < FLAT))
    return Case(float(wrong.sum()), f"{int((~stays & (share > THIN)).sum())} of {count} triangles of {size:.3g} m "
                f"dropped, thinnest {float(share[share > THIN].min()):.2g}, "
                f"{int((stays & (share < FLAT)).sum())} flat ones left")


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
    n = np.where(rng.random(BLOCK) < 0.2, rng.uniform(0, 4, BLOCK), 10.0 ** rng.uniform(-3, 20, BLOCK))
    return np.where(rng.random(BLOCK) < 0.05, rng.choice([0.0, 1.0, 2.0, 1e20], BLOCK), n)[None]


def ellipsoid_of(x: Array) -> Array:
    return np.stack(tangent_ellipsoid(x[0]))


def ellipsoid(x: Any) -> Any:
    """SII Eq. 7 and 8 for n < 2; else b = 2n / (n + 2), g = t^(b - 1) - t, k = 1 - (b - 1) t^(b - 2) at t = 0.71.

    x g(t) - k x (x - t) is an ellipse from 0 to t + g(t) / k, as high as its half axis times k^(1/2). The literal text
    has it in float64.
    """
    n, t = x[0], 0 * x[0] + TANGENT_POINT
    share = np.where(n > 0, n / (n + 2), 1)
    center = np.where(n > 0, share ** ((n + 2) / 4), 0 * n)
    height = np.where(n > 0, share ** (n / 4), 1) * np.sqrt(2 / (n + 2))
    old = [center, np.maximum(center, 1 - center), height]
    b = 2 * n / (n + 2)
    k = 1 - (b - 1) * t ** (b - 2)
    half = (t + (t ** (b - 1) - t) / np.where(n < 2, 1, k)) / 2
    new = [half, half, half * np.sqrt(np.where(n < 2, 1 + 0 * k, k))]
    return [np.where(n < 2, one, other) for one, other in zip(old, new, strict=True)]


LADDERS = (
    Ladder("bounds.tangent", "exponents 0 .. 1e20", draw_exponents, ellipsoid_of, ellipsoid, 16.0,
           source="16 roundings, each at most one ULP, of a power with an exponent below 1", reals=("float64",),
           extended=0, conditioned=False),
)


PROMISES = (
    Promise("place.kept", "places of a scene far off stay beside each other", "near_origin", FAR, kept,
            "2^-53 diagonals", 4.0, "derived", "one rounding of a coordinate that is below 4 diagonals", 6000, 200),
    Promise("place.resolved", "float32 steps of a scene far off", "near_origin", FAR, resolved, "diagonals",
            (DIAGONALS + 0.5) * 2.0**-23, "derived", "16 diagonals off the origin at most, and 2^23 steps to there",
            6000, 200),
    Promise("place.slivers", "thin triangles stay, flat ones go", "repaired",
            "1e-6 .. 1e6 m, 1e-13 .. 1 as wide as long, or of no width", slivers, "triangles", 0.0, "exact",
            "an area counts where it is no rounding of float64", 6000, 100, adds=True),
    Promise("blends.unit", "lengths x 2^k, to the bit", "blend_weights", "k -27 .. 27, float32 and float64", blends,
            "weights", 0.0, "exact", "a power of two rounds nothing", 3000, 20, adds=True),
    Promise("reproject.origin", "the same points by another origin, to the bit", "reproject",
            "origins up to 64 m apart, places on a grid of 2^-10 m", fetched, "values", 0.0, "exact",
            "no place is rounded", 2000, 30, adds=True),
)
