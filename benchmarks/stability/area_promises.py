"""Promises of virtual area lights: rectangles in any unit, maps that nothing hidden moves."""

import numpy as np

from benchmarks.stability.numbers import directions
from benchmarks.stability.promise import Case, Promise
from refgi.cluster.kmeans import Clustering
from refgi.cluster.maps import shadow_maps
from refgi.cluster.occluders import Ends
from refgi.cluster.rectangle import AreaLights, area_lights
from refgi.cluster.settings import AreaLightSettings, ShadowMapSettings
from refgi.pairs.pixel_lights import PixelLights
from refgi.rsm.buffers.extent import Extent
from refgi.scene import Geometry

LIGHTS, CLUSTERS = 60, 8
NUMBERS = ("map_of", "center", "near", "far", "scene_far", "depth")  # of shadow maps


def _lights(rng: np.random.Generator, size: float) -> tuple[PixelLights, Clustering]:
    """Return lights and their clusters: some around a place, some in a row, some in a plane with rounding, some one."""
    of = rng.integers(0, CLUSTERS, LIGHTS).astype(np.int32)
    kind = rng.integers(0, 4, CLUSTERS)
    normal = directions(rng, CLUSTERS)
    middle, along = rng.uniform(-1, 1, (2, 3, CLUSTERS))
    spread = np.where(kind[of] == 0, rng.normal(size=(3, LIGHTS)), along[:, of] * rng.normal(size=LIGHTS))
    spread += np.where(kind[of] == 2, 10.0 ** rng.uniform(-9, -3, LIGHTS), 0) * rng.normal(size=(3, LIGHTS))
    position = size * (middle[:, of] + 0.1 * np.where(kind[of] == 3, 0, spread))
    lights = PixelLights(position, normal[:, of], np.ones((3, LIGHTS)), None, None, None, LIGHTS)
    members = np.bincount(of, minlength=CLUSTERS)
    return lights, Clustering(size * middle, normal, members, of, 1, np.zeros(2))


def rectangles(rng: np.random.Generator) -> Case:
    """Return how many lengths of rectangles do not follow the unit of length."""
    power, seed = int(rng.integers(-60, 61)), int(rng.integers(1 << 30))
    settings = AreaLightSettings(axes=str(rng.choice(["fixed", "pca", "min_area"])),  # type: ignore[arg-type]
                                 extent=str(rng.choice(["root", "longer", "shorter"])))  # type: ignore[arg-type]
    plain, scaled = (area_lights(*_lights(np.random.default_rng(seed), unit), settings)
                     for unit in (1.0, 2.0**power))
    differing = sum(int((2.0**power * one != other).sum()) for one, other in (
        (getattr(plain, name), getattr(scaled, name)) for name in ("side", "offset", "delta", "radius")))
    return Case(differing, f"{settings.axes} axes, {settings.extent} side, lengths x 2^{power}: {differing} differ")


def room(rng: np.random.Generator, ground: float) -> tuple[Geometry, Ends, AreaLights]:
    """Return a box with things in it, where light ends in it, and its area lights; maybe with a plane under it."""
    corners = np.array([[x, y, z] for x in (-1.0, 1) for y in (-1, 1) for z in (-1, 1)])
    walls = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [face for a, b, c, d in walls for face in ((a, b, c), (a, c, d))]
    things = rng.uniform(-0.6, 0.6, (12, 1, 3)) + 0.2 * rng.uniform(-1, 1, (12, 3, 3))
    vertices = np.concatenate([corners, things.reshape(-1, 3)])
    faces += (8 + np.arange(36).reshape(-1, 3)).tolist()
    box = Extent(vertices.min(axis=0), vertices.max(axis=0))
    ends = Ends(vertices, box, box)
    areas = area_lights(*_lights(rng, 0.7), AreaLightSettings())
    if ground:
        far = ground * np.array([[-1.0, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]]) - (0, 1.5, 0)
        faces += [[44, 45, 46], [44, 46, 47]]
        vertices = np.concatenate([vertices, far])
    return Geometry(vertices, np.array(faces, np.int32), np.zeros(len(faces), np.int32)), ends, areas


def unmoved(rng: np.random.Generator) -> Case:
    """Return how many numbers of shadow maps change with a plane under the floor, which no light meets."""
    ground, seed = 10.0 ** rng.uniform(2, 8), int(rng.integers(1 << 30))
    made = []
    for half in (0.0, ground):
        geometry, ends, areas = room(np.random.default_rng(seed), half)
        made.append(shadow_maps(geometry, areas, ShadowMapSettings(resolution=8), np.float32, ends=ends))
    one, other = made
    differing = sum(0 if np.array_equal(a, b) else int((a != b).sum()) if a.shape == b.shape else max(a.size, b.size)
                    for a, b in ((getattr(one, name), getattr(other, name)) for name in NUMBERS))
    return Case(differing, f"a plane of {ground:.3g} m under a room of 2 m: {differing} numbers differ")


PROMISES = (
    Promise("val.rectangles", "lengths x 2^k, to the bit", "area_lights",
            "k -60 .. 60; lights in rows and in one place", rectangles, "lengths", 0.0, "exact",
            "a power of two rounds nothing", 2000, 60, adds=True),
    Promise("val.maps", "what no light meets moves no map", "shadow_maps",
            "a plane of 100 m to 1e8 m under a room of 2 m", unmoved, "numbers", 0.0, "exact",
            "maps are made of what light meets", 200, 6, adds=True),
)
