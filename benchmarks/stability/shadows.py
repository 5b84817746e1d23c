"""Promises of shadow rays between surface points: nothing lies between them, so that no light may be lost.

The sum over pixel lights with shadow rays must have the bits of the sum without, inside a convex room for points that
are off their faces by what float32, half floats or interpolation leave, and between tiles near the coordinates' origin
and receivers far off. Rays of no reach find nothing, whatever was found before them. A huge plane under
a small scene hides no thin gap in it: rays start above their face by 4 u (|y|_1 + grain), u = 2^-24, and grain is at
most 16 times the largest coordinate of half of the triangles.
"""


import numpy as np

from benchmarks.stability.meshes import TURN, Mesh, places_upon
from benchmarks.stability.promise import Case, Promise
from benchmarks.stability.rays import DOORS, door, tracer_of
from refgi.pairs.pixel_lights import PixelLights
from refgi.pairs.shadow_rays import receivers, shadowed_sum
from refgi.rays import MISS, Tracer
from refgi.scene import Geometry
from refgi.types import Array

POINTS, LIGHTS = 200, 40
OFF = 2.0**-15  # half the share of a point's coordinates by which it may be off its face
SIZES = (1e-6, 1e-3, 1.0, 1e4, 1e8)
TILES = 24  # along a side


def _lights(position: Array, normal: Array) -> PixelLights:
    return PixelLights(position, normal, np.ones_like(position), None, None, None, position.shape[1])


def _blocked(tracer: Tracer, geometry: Geometry, place: Array, normal: Array, face: Array, lights: PixelLights) -> int:
    """Return how many receivers lose light to shadows."""
    to = receivers(geometry, place, normal, face, tracer.grain)
    plain = shadowed_sum(tracer, to, lights, visibility=False)
    assert plain.any()
    return int(np.count_nonzero((shadowed_sum(tracer, to, lights) != plain).any(axis=0)))


def off_their_face(rng: np.random.Generator) -> Case:
    """Return how many points of a ball's inner side, off their faces by up to 2^-15 of their size, lose light."""
    size = float(rng.choice(SIZES))
    mesh, tracer = tracer_of("sphere", size, DOORS[0])
    share = OFF * float(rng.choice([0.0, 2.0**-5, 1.0]))
    at, of = places_upon(mesh, rng, POINTS), places_upon(mesh, rng, LIGHTS)
    place = at.points + (share * np.abs(at.points).sum(axis=1) * rng.uniform(-1, 1, POINTS))[:, None] * at.normals
    lost = _blocked(tracer, mesh.geometry, place.T, -at.normals.T, at.face.astype(np.int32),
                    _lights(of.points.T.copy(), -of.normals.T))
    return Case(lost, f"ball of {size:g} m, points off by {share:.2g} of their size: {lost} of {POINTS} lose light")


def floor_of_tiles(size: float) -> tuple[Geometry, Array]:
    """Return tiles around the coordinates' origin, turned so that they lie along no axis, and their normal."""
    place = (np.arange(TILES + 1) / TILES - 0.5) * size
    x, y = (c.ravel() for c in np.meshgrid(place, place))
    vertices = np.stack([x, y, np.zeros_like(x)], axis=1) @ TURN.T
    first = (np.arange(TILES)[:, None] * (TILES + 1) + np.arange(TILES)).ravel()
    faces = np.concatenate([np.stack([first, first + 1, first + TILES + 2], axis=1),
                            np.stack([first, first + TILES + 2, first + TILES + 1], axis=1)]).astype(np.int32)
    return Geometry(vertices, faces, np.zeros(len(faces), np.int32)), TURN[:, 2]


def far_from_tiles(rng: np.random.Generator) -> Case:
    """Return how many far points lose the light of tiles near the origin, 10 to 40,000 times the tiles' extent away."""
    size, away = float(rng.choice(SIZES[:4])), 10 ** rng.uniform(1, 4.6)
    tiles, up = floor_of_tiles(size)
    way = up + rng.uniform(-1, 1) * TURN[:, 0] + rng.uniform(-1, 1) * TURN[:, 1]
    far = size * away * way / np.linalg.norm(way)
    plate = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ TURN.T[:2] * (size * away / 4) + far
    vertices = np.concatenate([tiles.vertices, plate])
    count = len(tiles.vertices)
    faces = np.concatenate([tiles.faces, np.array([[0, 2, 1], [0, 3, 2]], np.int32) + count])
    vertices = vertices.astype(np.float32).astype(float)
    geometry = Geometry(vertices, faces, np.zeros(len(faces), np.int32))
    corners = geometry.vertices[geometry.faces]
    mesh = Mesh(geometry, False, corners)
    lights = places_upon(mesh._replace(corners=corners[:-2]), rng, LIGHTS)
    at = places_upon(mesh._replace(corners=corners[-2:]), rng, POINTS)
    tracer = Tracer(geometry)
    normal = at.normals * np.sign(-(at.normals @ way))[:, None]
    out = lights.normals * np.sign(lights.normals @ way)[:, None]
    lost = _blocked(tracer, geometry, at.points.T.astype(np.float32), normal.T,
                    (at.face + len(faces) - 2).astype(np.int32), _lights(lights.points.T.copy(), out.T))
    return Case(lost, f"tiles over {size:g} m, receivers {away:.3g} times as far: {lost} of {POINTS} lose light")


def without_reach(rng: np.random.Generator) -> Case:
    """Return how many rays of no reach among others find something."""
    way, count = str(rng.choice(DOORS)), 3000
    _, tracer = tracer_of("sphere", 1.0, way)
    with door(way):
        origins = np.zeros((count, 3), np.float32)
        directions = rng.standard_normal((count, 3)).astype(np.float32)
        reach = rng.choice(np.array([np.inf, 10.0, 0.0, -1.0], np.float32), count)
        face, distance = np.empty(count, np.int32), np.empty(count, np.float32)
        blocked = np.empty(count, np.bool_)
        tracer.fill_closest(origins, directions, reach, face, distance)
        tracer.fill_occluded(origins, directions, reach, blocked)
    none = reach <= 0
    bad = int(np.count_nonzero(none & ((face != MISS) | (distance != np.inf) | ~blocked)))
    return Case(bad, f"{way}: {bad} of {int(none.sum())} rays of no reach, {int((~none).sum())} others between them")


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
    Promise("shadows.off_face", "points that shadow themselves", "shadow rays of pixel lights",
            "inside of a ball of 1e-6 .. 1e8 m, points up to 2^-15 of their coordinates off their face", off_their_face,
            "points", 0, "exact", "nothing lies between inner sides of a ball; what rounding moved off is undone", 400,
            15, adds=True),
    Promise("shadows.far", "points that lose light of senders near the origin", "shadow rays of pixel lights",
            "tiles over 1e-6 .. 1e4 m around the origin, receivers 10 to 40,000 times as far", far_from_tiles, "points",
            0, "exact", "nothing lies between; segments end above their sender by 4 U of their length", 400, 15,
            adds=True),
    Promise("rays.no_reach", "rays of no reach that find something", "Embree, both doors",
            "a half of no reach among others, from inside a ball", without_reach, "rays", 0, "exact",
            "they miss, and count as blocked, untraced", 400, 6, adds=True),
    Promise("ground.sheet", "segments past a sheet above the floor", "Tracer.segments_blocked",
            "1e-5 .. 1e3 m, a sheet 5e-4 of that above, a plane of 1 .. 1e7 times that below", through, "segments", 0.0,
            "exact", "ends of rays keep to their offset, which the sizes of few triangles do not move", 500, 12,
            adds=True),
)
