"""Promises of places and of rays that are sent: scenes anywhere, in any unit; rays of spots, the hemisphere and faces.

Blend weights between levels are ratios of lengths, so a power of two changes no bit of them. A view's places count
from its own origin, so that the same points by another origin are the same points, to the bit where no place rounds.
A ray of a spot at the share u of its cap, 2 sin^2(outer / 2), has 1 - cos = u cap; a cosine-distributed one sin^2 = u.
A ray starts above its face by the offset of docs/conventions.md, 4 u (|y|_1 + grain), u = 2^-24.
"""

import math
from typing import Any

import numpy as np

from benchmarks.stability.ladder import Ladder, each_of
from benchmarks.stability.promise import BLOCK, Case, Promise, directions, pi_of
from refgi.error_target.interpolate import blend_weights, surface_levels
from refgi.errors import InputError
from refgi.lights.walk import walk_lights
from refgi.rays import Tracer
from refgi.rsm.raster.projection import PERSPECTIVE, Projection
from refgi.scene import Camera, Geometry, Material, Mesh, PointLight, Scene, SpotLight, light_table, material_table
from refgi.scene.motion import near_origin
from refgi.scene.repair import repaired
from refgi.splat.sii.bounds import TANGENT_POINT, tangent_ellipsoid
from refgi.sssil.reprojection import SourceView, reproject
from refgi.truth.hemisphere import cosine_direction
from refgi.truth.light_grid import light_rays
from refgi.truth.surfaces import Surfaces, face_normal, lift
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


NARROW = f"half-angles {NARROWEST:g} .. {WIDEST:g} rad"


LADDERS = (
    Ladder("bounds.tangent", "exponents 0 .. 1e20", draw_exponents, ellipsoid_of, ellipsoid, 16.0,
           source="16 roundings, each at most one ULP, of a power with an exponent below 1", reals=("float64",),
           extended=0, conditioned=False),
    Ladder("hemisphere.cosine", "the unit square, near borders of the eighths of a turn", draw_square,
           each_of(cosine_direction, 2, 3), cosine_weighted, 1.0, source="1e-8, as the kernel promises",
           scale=lambda x, _: 0 * x[0] + GOOD_TO, conditioned=False, reals=("float64",), lowest=-1.0),
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
