"""Promises of maps and of virtual area lights: borders belong to a map that sees them, spots have all of their power.

References are docs/rasterizer.md and docs/radiometry.md taken literally: a texel of a paraboloid map is covered where
its direction lies within the three planes of a triangle; a spot's power over its intensity is 2 pi (1 - (cos inner +
cos outer) / 2); parallel light's map encloses a box. Rectangles follow any unit, and nothing hidden moves a map.
"""

import math

import mpmath
import numpy as np

from benchmarks.stability.promise import Case, Promise, directions
from refgi.cluster.kmeans import Clustering
from refgi.cluster.maps import shadow_maps
from refgi.cluster.occluders import Ends
from refgi.cluster.rectangle import AreaLights, area_lights
from refgi.cluster.settings import AreaLightSettings, ShadowMapSettings
from refgi.pairs.pixel_lights import PixelLights
from refgi.rsm.buffers.extent import Extent
from refgi.rsm.buffers.solid_angle import spot_power
from refgi.rsm.raster.paraboloid import draw_paraboloids
from refgi.rsm.raster.projection import (
    cube_projection,
    directional_projection,
    paraboloid_projection,
    project,
    spot_projection,
)
from refgi.scene import DirectionalLight, Geometry, SpotLight
from refgi.types import Array

POINTS, TRIANGLES = 2000, 16
TEXELS = 96  # of a paraboloid map along a side
UNSURE = 1e-11  # sine of the angle to an edge, within which rounding may decide


def borders(rng: np.random.Generator) -> Case:
    """Return how many points exactly upon the edges of a cube's maps have no texel there.

    Their coordinates and the cube's centre are whole numbers, so that nothing is rounded.
    """
    texels = int(rng.choice([1, 2, 7, 64, 512]))
    centre = rng.integers(-1000, 1000, 3).astype(float)
    size = 2.0 ** rng.integers(0, 30, POINTS)
    p = rng.integers(-8, 9, (3, POINTS)) * size / 8
    on = rng.integers(0, 3, POINTS), np.arange(POINTS)
    p[on] = size * rng.choice([-1.0, 1.0], POINTS)
    other = (on[0] + rng.integers(1, 3, POINTS)) % 3, on[1]
    p[other] = size * rng.choice([-1.0, 1.0], POINTS)
    cube = cube_projection(centre, texels)
    row, column, depth = project(cube, centre[:, None] + p)
    with np.errstate(invalid="ignore"):
        face = np.floor(row / texels)
        inside = (row >= 0) & (row < 6 * texels) & (column >= 0) & (column <= texels)
    ahead = cube.frame[np.where(inside, face, 0).astype(int), 2]
    wrong = ~inside | ((ahead * p.T).sum(axis=1) != size) | (depth != size)
    bad = int(np.count_nonzero(wrong))
    return Case(bad, f"{texels} texels a side: {bad} of {POINTS} points have a texel that does not see them")


def wide_triangles(rng: np.random.Generator) -> Case:
    """Return how many texels differ from the test by planes: triangles with an edge almost through the map's axis."""
    wrong, texels, worst = 0, 0, ""
    for _ in range(TRIANGLES):
        corners = _across_the_axis(rng)
        maps = paraboloid_projection([(0.0, 0.0, 0.0)], [(0.0, 0.0, 1.0)], TEXELS)
        nearness = np.zeros((TEXELS, TEXELS), np.float32)
        ids = np.full(nearness.shape, -1, np.int32)
        draw_paraboloids(maps, corners, np.array([[0, 1, 2]], np.int32), 1, nearness, ids)
        covered, sure = _by_planes(corners @ maps.frame[0].T)
        differ = sure & (covered != (ids[:, :TEXELS] == 0))
        wrong, texels = wrong + int(differ.sum()), texels + int(sure.sum())
        worst = f", as of {corners.tolist()}" if differ.any() and not worst else worst
    return Case(wrong, f"{wrong} of {texels:,} texels differ{worst}")


def _across_the_axis(rng: np.random.Generator) -> Array:
    """Return a triangle in front of the map, an edge of which passes the axis by 1e-17 of its length and more."""
    angle = rng.uniform(0, 2 * np.pi)
    way, side = np.array([np.cos(angle), np.sin(angle), 0]), np.array([-np.sin(angle), np.cos(angle), 0])
    a = way * rng.uniform(0.1, 2) + [0, 0, rng.uniform(0.05, 2)]
    b = way * rng.uniform(-2, 2) + [0, 0, rng.uniform(0.05, 2)] + side * 10 ** rng.uniform(-17, -11)
    c = side * rng.uniform(0.5, 3) * rng.choice([-1, 1]) + way * rng.uniform(-1, 1) + [0, 0, rng.uniform(0.05, 2)]
    return np.stack([a, b, c][:: int(rng.choice([-1, 1]))]) * 10 ** rng.uniform(-3, 3)


def _by_planes(corners: Array) -> tuple[Array, Array]:
    """Return which texels a triangle in the map's frame covers, and which of them are sure."""
    place = (2 * (np.arange(TEXELS) + np.longdouble(0.5)) / TEXELS - 1)
    s, t = np.meshgrid(place, place)
    square = s * s + t * t
    d = np.stack([2 * s, 2 * t, 1 - square]) / (1 + square)
    v = corners.astype(np.longdouble)
    normals = [np.cross(v[i], v[j]) for i, j in ((1, 2), (2, 0), (0, 1))]
    sines = np.stack([np.einsum("c,chw->hw", n / np.sqrt((n * n).sum()), d) for n in normals])
    sines *= np.sign((v[0] * normals[0]).sum())
    return (sines > 0).all(axis=0) & (square <= 1), (np.abs(sines) > UNSURE).all(axis=0) & (np.abs(square - 1) > 1e-9)


def spots(rng: np.random.Generator) -> Case:
    """Return the relative error of the power that a spot's map has in all of its texels."""
    outer = 10 ** rng.uniform(-6.7, 0.1)
    soft = 10 ** rng.uniform(-6, 0) if rng.random() < 0.8 else 1.0  # of the cone
    inner = outer * (1 - soft)
    light = SpotLight((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), inner, outer, (1.0, 1.0, 1.0))
    texels = int(rng.choice([16, 33, 64, 256]))
    power = float(spot_power(spot_projection(light, texels), inner, outer).sum())
    with mpmath.workdps(40):
        exact = 2 * mpmath.pi * (mpmath.sin(mpmath.mpf(inner) / 2) ** 2 + mpmath.sin(mpmath.mpf(outer) / 2) ** 2)
        off = abs(float(power / exact - 1))
    return Case(off, f"half-angles {inner:.6g} and {outer:.6g} rad, {texels} texels: off by {off:.3g} of the power")


def boxes(rng: np.random.Generator) -> Case:
    """Return by how much a directional light's map misses its box or is larger, over the margin that it promises."""
    size = 10 ** rng.uniform(-8, 8)
    low = size * rng.uniform(-4, 4, 3)
    sides = size * np.where(rng.random(3) < 0.15, 0.0, rng.random(3))
    ahead = directions(rng, 1)[:, 0]
    maps = directional_projection(DirectionalLight(tuple(ahead), (1.0, 1.0, 1.0)), (low, low + sides), 8)
    corners = np.array([[low[c] + sides[c] * (k >> c & 1) for c in range(3)] for k in range(8)])
    seen = (corners - maps.origin[0]) @ maps.frame[0].T
    extent = np.ptp(seen, axis=0)
    if not extent.any():
        return Case(0.0, "no box")
    margin = np.concatenate([maps.half + seen.min(axis=0)[:2], maps.half - seen.max(axis=0)[:2], [seen[:, 2].min()]])
    share = margin / float(np.linalg.norm(extent))
    worst = max(float(share.max()) / 1.01e-6, math.inf if share.min() <= 0.5e-6 else 0.0)
    return Case(worst, f"box of {size:.3g} m: {share.min():.6g} to {share.max():.6g} of its size to the map's rim")


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
    Promise("map.borders", "points upon borders without a texel that sees them", "cube map",
            "edges and corners of cubes, 1 to 512 texels a side, whole coordinates", borders, "points", 0, "exact",
            "a border belongs to the first map that sees it", 800, 10, adds=True),
    Promise("map.wide", "texels that differ from the test by planes", "paraboloid map",
            "triangles with an edge 1e-17 .. 1e-11 of its length off the map's axis, 96 x 96 texels",
            wide_triangles, "texels", 0, "exact", "spans are cut where nothing is inside; texels 1e-11 rad off an edge",
            400, 10, adds=True),
    Promise("map.spot_power", "power of a spot's map against its closed form", "spot_power",
            "half-angles 2e-7 .. 1.26 rad, soft edges of 1e-6 of them and more", spots, "of the power", 3.6e-9,
            "observed x 2", "1.77e-9 of 1500: Gauss rules over an edge of 1e-6 of the cone", 2000, 30),
    Promise("map.directional", "margin around the box of a directional light's map", "directional_projection",
            "boxes of 1e-8 .. 1e8 m, flat ones and lines, up to 4 sizes off the origin", boxes, "of the limit", 1.0,
            "derived", "1e-6 of the box's size on every side, within 1 % of that for what is rounded", 5000, 300),
    Promise("val.rectangles", "lengths x 2^k, to the bit", "area_lights",
            "k -60 .. 60; lights in rows and in one place", rectangles, "lengths", 0.0, "exact",
            "a power of two rounds nothing", 2000, 60, adds=True),
    Promise("val.maps", "what no light meets moves no map", "shadow_maps",
            "a plane of 100 m to 1e8 m under a room of 2 m", unmoved, "numbers", 0.0, "exact",
            "maps are made of what light meets", 200, 6, adds=True),
)
