"""Promises of places: scenes anywhere are brought near the origin as they are, and thin triangles stay in them."""


import numpy as np

from benchmarks.stability.promise import Case, Promise
from refgi.errors import InputError
from refgi.scene import Camera, Geometry, Material, Mesh, PointLight, Scene, SpotLight
from refgi.scene.motion import near_origin
from refgi.scene.repair import repaired
from refgi.types import Array

DIAGONALS = 16  # off the origin, at most: docs/conventions.md
POINTS = 48
FARTHEST = 9e8  # m: refgi takes no places beyond 1e9
# of the products that a cross product is made of: what must stay, what must go
THIN, FLAT = 1e-13, 2e-15


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


FAR = "scenes of 1e-6 .. 1e6 m, 0.1 .. 1e6 times that off the origin"
PROMISES = (
    Promise("place.kept", "places of a scene far off stay beside each other", "near_origin", FAR, kept,
            "2^-53 diagonals", 4.0, "derived", "one rounding of a coordinate that is below 4 diagonals", 6000, 200),
    Promise("place.resolved", "float32 steps of a scene far off", "near_origin", FAR, resolved, "diagonals",
            (DIAGONALS + 0.5) * 2.0**-23, "derived", "16 diagonals off the origin at most, and 2^23 steps to there",
            6000, 200),
    Promise("place.slivers", "thin triangles stay, flat ones go", "repaired",
            "1e-6 .. 1e6 m, 1e-13 .. 1 as wide as long, or of no width", slivers, "triangles", 0.0, "exact",
            "an area counts where it is no rounding of float64", 6000, 100, adds=True),
)
