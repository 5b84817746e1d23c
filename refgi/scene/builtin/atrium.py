"""The atrium: a two-storey colonnade around a courtyard, from ten thousand to ten million triangles, plain or textured.

It stands in for the atria that the papers of this field show: long, open to the sky, a spot from above on coloured
cloth and floor, and everything else lit by what these throw back. All shapes are grids, so one density sets the number
of triangles.

Textures lie on the surfaces as a box projection from the world's axes, metres over the size of a picture: each triangle
takes the axis that its normal is nearest to, so that pictures meet at corners as slabs of stone would.
"""

import dataclasses
import math
from itertools import pairwise

import numpy as np

from refgi.errors import expect
from refgi.scene.builtin import atrium_pieces as pieces
from refgi.scene.builtin.atrium_pieces import BAY, Part, swept, turned, with_arguments
from refgi.scene.model import Camera, Material, Scene, SpotLight, merge
from refgi.scene.texture import Image, Texture
from refgi.types import Array

FEWEST_FACES, MOST_FACES = 10_000, 20_000_000
HALF_LENGTH, HALF_WIDTH = 4 * BAY, BAY  # m, of the column line
GALLERY = 3.2  # m from the column line to the outer wall
GROUND_SPRING, GROUND_TOP = 3.0, 4.9  # m, heights of the lower storey's arches and wall
UPPER_FLOOR, UPPER_SPRING, UPPER_TOP = 5.1, 7.4, 9.1  # m

STONE = Material("stone", (0.62, 0.57, 0.48))
COLUMN = Material("column", (0.7, 0.66, 0.58))
PLASTER = Material("plaster", (0.7, 0.56, 0.38))
DADO = Material("dado", (0.42, 0.16, 0.11))
CEILING = Material("ceiling", (0.66, 0.6, 0.5))
PALE_TILE = Material("pale_tile", (0.66, 0.6, 0.5))
DARK_TILE = Material("dark_tile", (0.38, 0.26, 0.18))
TERRACOTTA = Material("terracotta", (0.55, 0.25, 0.13))
LEAF = Material("leaf", (0.11, 0.27, 0.06))
WATER = Material("water", (0.16, 0.33, 0.36))
CLOTHS = (Material("red_cloth", (0.62, 0.05, 0.035)), Material("green_cloth", (0.06, 0.36, 0.07)),
          Material("blue_cloth", (0.05, 0.13, 0.52)), Material("gold_cloth", (0.75, 0.46, 0.05)))

# Radius, height, squareness, depth of flutes.
LOWER_COLUMN = np.array([
    (0.34, 0.0, 1, 0), (0.34, 0.18, 1, 0), (0.33, 0.19, 0, 0), (0.35, 0.25, 0, 0), (0.3, 0.32, 0, 0),
    (0.27, 0.36, 0, 0), (0.27, 0.42, 0, 0.06), (0.268, 1.4, 0, 0.06), (0.23, 2.45, 0, 0.06), (0.23, 2.5, 0, 0),
    (0.26, 2.54, 0, 0), (0.23, 2.58, 0, 0), (0.24, 2.68, 0.1, 0), (0.31, 2.82, 0.5, 0), (0.34, 2.87, 1, 0),
    (0.34, 3.0, 1, 0),
])
UPPER_COLUMN = np.array([
    (0.25, 0.0, 1, 0), (0.25, 0.14, 1, 0), (0.22, 0.16, 0, 0), (0.24, 0.2, 0, 0), (0.19, 0.25, 0, 0),
    (0.185, 0.9, 0, 0), (0.16, 1.85, 0, 0), (0.185, 1.9, 0, 0), (0.16, 1.94, 0, 0), (0.2, 2.08, 0.4, 0),
    (0.26, 2.16, 1, 0), (0.26, 2.3, 1, 0),
])
BALUSTER = np.array([
    (0.055, 0.0, 1, 0), (0.055, 0.06, 1, 0), (0.03, 0.09, 0, 0), (0.065, 0.22, 0, 0), (0.05, 0.35, 0, 0),
    (0.025, 0.52, 0, 0), (0.04, 0.58, 0, 0), (0.055, 0.62, 1, 0), (0.055, 0.7, 1, 0),
])
POT = np.array([(0.22, 0.0, 0, 0), (0.26, 0.03, 0, 0), (0.24, 0.08, 0, 0), (0.36, 0.45, 0, 0), (0.38, 0.52, 0, 0),
                (0.44, 0.55, 0, 0), (0.44, 0.62, 0, 0), (0.38, 0.62, 0, 0), (0.33, 0.56, 0, 0), (0.02, 0.55, 0, 0)])
FOUNTAIN = np.array([(1.35, 0.0, 0, 0), (1.35, 0.12, 0, 0), (1.22, 0.16, 0, 0), (1.2, 0.45, 0, 0), (1.3, 0.5, 0, 0),
                     (1.3, 0.58, 0, 0), (1.1, 0.58, 0, 0), (1.08, 0.3, 0, 0)])
FOUNTAIN_BOWL = np.array([(0.3, 0.2, 0, 0), (0.2, 0.5, 0, 0), (0.12, 0.6, 0, 0), (0.14, 0.95, 0, 0), (0.2, 1.0, 0, 0),
                          (0.52, 1.18, 0, 0), (0.56, 1.26, 0, 0), (0.5, 1.26, 0, 0), (0.15, 1.12, 0, 0),
                          (0.08, 1.4, 0, 0), (0.12, 1.46, 0, 0), (0.01, 1.58, 0, 0)])
POOL = np.array([(1.1, 0.4, 0, 0), (0.01, 0.4, 0, 0)])


def atrium(faces: int = 250_000, seed: int = 1) -> Scene:
    """Build the courtyard.

    `faces`: triangles, 10 thousand to 20 million. `seed`: which curtains are drawn, and the colours of the cloth.
    Result: within 5 % of that many faces, 14 materials.
    """
    expect(FEWEST_FACES <= faces <= MOST_FACES, "faces", f"{FEWEST_FACES} to {MOST_FACES}", faces)
    expect(0 <= seed < 2**32, "seed", "0 to 2^32 - 1", seed)
    pieces = [*_building(), *_floor(), *_furniture(), *_cloth(np.random.default_rng(seed))]
    density = _density(pieces, faces)
    geometry, materials = merge([piece.mesh(density) for piece in pieces])
    camera = Camera((-10.6, 1.9, 1.15), (2.0, 3.15, -0.75), vfov=math.radians(58), width=640, height=360)
    light = SpotLight((-1.0, 22.0, 4.8), (-0.075, -0.945, -0.32), math.radians(16), math.radians(18.5),
                      (5200.0, 4900.0, 4350.0))
    return Scene("atrium", geometry, materials, camera, (light,),
                 "A colonnade of two storeys with curtains; a spot from above on the left side and the floor.",
                 exposure=0.5)


def _density(pieces: list[Part], faces: int) -> float:
    """Return the density whose number of triangles is nearest to `faces`."""
    low, high = 0.01, 100.0
    for _ in range(60):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if sum(p.faces(middle) for p in pieces) < faces else (low, middle)
    return min((low, high), key=lambda density: abs(sum(p.faces(density) for p in pieces) - faces))


def _building() -> list[Part]:
    columns, bays = _columns(), _bays()
    found = [Part("lower_columns", COLUMN, with_arguments(turned, LOWER_COLUMN), (34, 40),
                  _at_height(columns, 0.0), True, (4, 5)),
             Part("upper_columns", COLUMN, with_arguments(turned, UPPER_COLUMN), (22, 28),
                  _at_height(columns, UPPER_FLOOR), True, (3, 5)),
             Part("balusters", COLUMN, with_arguments(turned, BALUSTER), (14, 12), _balusters(bays), True,
                  (2, 3))]
    for storey, spring, top in (("lower", GROUND_SPRING, GROUND_TOP), ("upper", UPPER_SPRING, UPPER_TOP)):
        for name, shape, arguments, cells in (("front", pieces.arch_front, (spring, top), (6, 34)),
                                              ("back", pieces.arch_back, (spring, top), (6, 34)),
                                              ("under", pieces.arch_under, (spring,), (4, 34)),
                                              ("moulding", pieces.archivolt, (spring,), (6, 34))):
            material = COLUMN if name == "moulding" else STONE
            found.append(Part(f"{storey}_arch_{name}", material, with_arguments(shape, *arguments), cells, bays,
                              least=(1, 7)))
    return found + [
        Part(name, material, with_arguments(swept, np.array(profile), HALF_LENGTH, HALF_WIDTH), cells,
             np.zeros((1, 4)), True, (len(profile) - 1, 8))
        for name, material, cells, profile in _courses()
    ]


def _courses() -> list[tuple[str, Material, tuple[int, int], list[tuple[float, float]]]]:
    """Return name, material, cells and profile of everything that runs around the courtyard."""
    wall, rail = -GALLERY, UPPER_FLOOR + 0.8
    return [
        ("string_course", COLUMN, (8, 220), [(0.25, 4.78), (0.3, 4.8), (0.36, 4.88), (0.44, 4.92), (0.44, 5.06),
                                             (0.38, UPPER_FLOOR), (-0.25, UPPER_FLOOR)]),
        ("plinth_rail", COLUMN, (4, 220), [(0.12, UPPER_FLOOR), (0.12, 5.2), (-0.12, 5.2), (-0.12, UPPER_FLOOR)]),
        ("hand_rail", COLUMN, (6, 220), [(0.1, rail), (0.14, rail + 0.03), (0.14, rail + 0.09), (-0.14, rail + 0.09),
                                         (-0.14, rail + 0.03), (-0.1, rail), (0.1, rail)]),
        ("cornice", COLUMN, (9, 220), [(0.25, 8.95), (0.29, 8.97), (0.33, 9.07), (0.46, 9.15), (0.52, 9.25),
                                       (0.52, 9.36), (0.58, 9.42), (0.58, 9.5), (0.3, 9.58)]),
        ("roof", TERRACOTTA, (12, 300), [(0.3, 9.58), (wall, 10.5)]),
        ("upper_ceiling", CEILING, (12, 200), [(wall, UPPER_TOP), (-0.25, UPPER_TOP)]),
        ("upper_floor", PALE_TILE, (12, 200), [(-0.25, UPPER_FLOOR), (wall, UPPER_FLOOR)]),
        ("lower_ceiling", CEILING, (12, 200), [(wall, GROUND_TOP), (-0.25, GROUND_TOP)]),
        ("lower_floor", STONE, (14, 240), [(0.0, 0.0), (wall, 0.0)]),
        ("lower_dado", DADO, (6, 240), [(wall, 0.0), (wall, 1.2), (wall - 0.05, 1.25)]),
        ("lower_wall", PLASTER, (12, 240), [(wall - 0.05, 1.25), (wall - 0.05, GROUND_TOP)]),
        ("upper_wall", PLASTER, (14, 240), [(wall, UPPER_FLOOR), (wall, 10.5)]),
    ]


def _floor() -> list[Part]:
    x, z = np.meshgrid(np.arange(-11.5, 12.0), np.arange(-2.5, 3.0), indexing="ij")
    dark = (np.round(x + z) % 2).astype(bool).ravel()
    places = np.stack([x.ravel(), np.zeros(x.size), z.ravel(), np.zeros(x.size)], axis=1)
    shape = with_arguments(pieces.tile, 1.0)
    return [Part("pale_tiles", PALE_TILE, shape, (10, 10), places[~dark], least=(1, 1)),
            Part("dark_tiles", DARK_TILE, shape, (10, 10), places[dark], least=(1, 1))]


def _furniture() -> list[Part]:
    spots = np.array([(x, 0.0, z, 0.0) for x in (-6.0, 0.0, 6.0, 10.2) for z in (-2.15, 2.15)])
    middle = np.array([(3.0, 0.0, 0.0, 0.0)])
    return [Part("pots", TERRACOTTA, with_arguments(turned, POT), (24, 32), spots, True, (4, 6)),
            Part("shrubs", LEAF, with_arguments(pieces.shrub, 0.46), (40, 60), _at_height(spots, 0.95), True,
                 (4, 6)),
            Part("fountain", COLUMN, with_arguments(turned, FOUNTAIN), (24, 72), middle, True, (5, 8)),
            Part("fountain_bowl", COLUMN, with_arguments(turned, FOUNTAIN_BOWL), (40, 56), middle, True,
                 (5, 6)),
            Part("pool", WATER, with_arguments(turned, POOL), (10, 40), middle, True, (1, 12))]


def _cloth(random: np.random.Generator) -> list[Part]:
    """Return curtains in the lower bays of both long sides and swags in every other upper bay."""
    found = []
    middles = np.array([(a + b) / 2 for a, b in pairwise(np.arange(-HALF_LENGTH, HALF_LENGTH + 0.1, BAY))])
    first = int(random.integers(len(CLOTHS)))
    for side, turn in ((-1.0, 0.0), (1.0, np.pi)):
        for number, x in enumerate(middles):
            material = CLOTHS[(first + number + (2 if side > 0 else 0)) % len(CLOTHS)]
            folds, gathered, phase = int(random.integers(9, 13)), random.choice([0.0, 0.35, 1.0]), random.uniform(0, 6)
            place = np.array([(x, 0.0, side * (HALF_WIDTH + 0.1), turn)])
            shape = with_arguments(pieces.curtain, folds, gathered, phase)
            found.append(Part(f"curtain_{number}", material, shape, (36, 130), place, least=(2, 14)))
            if number % 2 == (0 if side > 0 else 1):
                place = np.array([(x, UPPER_SPRING - 0.15, side * (HALF_WIDTH - 0.05), turn)])
                shape = with_arguments(pieces.swag, float(random.uniform(0.9, 1.3)))
                material = CLOTHS[(first + number // 2 + 1) % len(CLOTHS)]
                found.append(Part(f"swag_{number}", material, shape, (60, 40), place, least=(4, 6)))
    return found


def _columns() -> Array:
    x = np.arange(-HALF_LENGTH, HALF_LENGTH + 0.1, BAY)
    sides = [(a, 0.0, z, 0.0) for z in (-HALF_WIDTH, HALF_WIDTH) for a in x]
    return np.array([*sides, (-HALF_LENGTH, 0.0, 0.0, 0.0), (HALF_LENGTH, 0.0, 0.0, 0.0)])


def _bays() -> Array:
    """Return the middle of each bay, turned so that its local z looks into the courtyard."""
    x = np.arange(-HALF_LENGTH + BAY / 2, HALF_LENGTH, BAY)
    z = np.arange(-HALF_WIDTH + BAY / 2, HALF_WIDTH, BAY)
    return np.array([*((a, 0.0, -HALF_WIDTH, 0.0) for a in x), *((a, 0.0, HALF_WIDTH, np.pi) for a in x),
                     *((-HALF_LENGTH, 0.0, b, np.pi / 2) for b in z), *((HALF_LENGTH, 0.0, b, -np.pi / 2) for b in z)])


def _balusters(bays: Array) -> Array:
    """Return the places of seven balusters in each bay."""
    across = np.linspace(-1.05, 1.05, 7)
    x = bays[:, :1] + np.cos(bays[:, 3:]) * across
    z = bays[:, 2:3] - np.sin(bays[:, 3:]) * across
    height = np.full_like(x, UPPER_FLOOR + 0.1)
    return np.stack([x, height, z, np.broadcast_to(bays[:, 3:], x.shape)], axis=-1).reshape(-1, 4)


def _at_height(places: Array, height: float) -> Array:
    return np.asarray(places + np.array([0.0, height, 0.0, 0.0]))


# of a picture, m
SIZES = {"stone": 2.4, "column": 1.6, "plaster": 3.0, "dado": 1.2, "ceiling": 2.0, "pale_tile": 1.0, "dark_tile": 1.0,
         "terracotta": 0.9, "leaf": 0.5, "red_cloth": 0.6, "green_cloth": 0.6, "blue_cloth": 0.6, "gold_cloth": 0.6}
ACROSS = np.array([2, 0, 0])  # axis of u for normals along x, y, z
DOWN = np.array([1, 2, 1])  # axis of v; heights count downwards
SMALLEST, LARGEST = 16, 8192  # texels along a side


def textured_atrium(faces: int = 250_000, seed: int = 1, texels: int = 512) -> Scene:
    """Build the courtyard of `atrium` with a picture on every surface but the water.

    `faces`, `seed`: as for `atrium`; `seed` also that of the pictures. `texels`: along a side of each picture, 16 to
    8192. Result: the atrium's triangles, with 13 textures.
    """
    expect(SMALLEST <= texels <= LARGEST, "texels", f"{SMALLEST} to {LARGEST}", texels)
    plain = atrium(faces, seed)
    painted = tuple(_painted(one, texels, seed + number) for number, one in enumerate(plain.materials))
    geometry = dataclasses.replace(plain.geometry, uv=_box_projection(plain))
    return dataclasses.replace(plain, name="textured_atrium", geometry=geometry, materials=painted,
                               description="The atrium with masonry, plaster, tiles and woven cloth as textures.")


def _box_projection(scene: Scene) -> Array:
    shape = scene.geometry
    corner = shape.vertices[shape.faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    axis = np.abs(normal).argmax(axis=1)
    size = np.array([SIZES.get(one.name, 1.0) for one in scene.materials])[shape.material_of_face]
    u = np.take_along_axis(corner, ACROSS[axis][:, None, None], axis=2)[..., 0]
    v = np.take_along_axis(corner, DOWN[axis][:, None, None], axis=2)[..., 0]
    v = np.where((axis == 1)[:, None], v, -v)
    return np.asarray(np.stack([u, v], axis=-1) / size[:, None, None])


def _painted(material: Material, texels: int, seed: int) -> Material:
    if material.name not in SIZES:
        return material
    place = (np.arange(texels) + 0.5) / texels
    v, u = np.meshgrid(place, place, indexing="ij")
    value = np.clip(_pattern(material.name, u, v) - 0.25 * _noise(texels, seed), 0.0, 1.0)
    picture = Image(np.repeat(value[..., None].astype(np.float32), 3, axis=2), material.name)
    return dataclasses.replace(material, texture=Texture(picture))


def _pattern(name: str, u: Array, v: Array) -> Array:
    """Return the brightness of a picture's pattern, 0 to 1; it repeats without a seam."""
    if name in ("stone", "dado", "terracotta"):
        row = np.floor(4 * v)
        joint = np.minimum(_from_whole(4 * v), 2 * _from_whole(2 * u + row / 2))
        return np.where(joint < 0.06, 0.45, 1.0 - 0.12 * np.mod(row + 2 * np.floor(2 * u + row / 2), 3))
    if name in ("pale_tile", "dark_tile"):
        return np.where(np.minimum(_from_whole(u), _from_whole(v)) < 0.02, 0.3, 1.0)
    if name.endswith("cloth"):
        stripe = np.where(np.mod(8 * u, 2) < 1, 1.0, 0.55)
        return stripe * (0.85 + 0.15 * np.sin(2 * np.pi * 64 * v))
    if name == "ceiling":
        return np.where(_from_whole(6 * u) < 0.05, 0.4, 1.0)
    return np.ones_like(u)


def _from_whole(x: Array) -> Array:
    """Return the distance from the nearest whole number."""
    return np.asarray(np.abs(x - np.round(x)))


def _noise(texels: int, seed: int) -> Array:
    """Return noise of several scales, 0 to 1, that repeats without a seam."""
    random = np.random.default_rng([seed, texels])
    total, weight = np.zeros((texels, texels)), 0.0
    for cells in (4, 16, 64):
        if cells > texels:
            break
        knots = random.random((cells, cells))
        at = (np.arange(texels) + 0.5) * cells / texels - 0.5
        low, share = np.floor(at).astype(np.int64), at - np.floor(at)
        rows = knots[low % cells] * (1 - share)[:, None] + knots[(low + 1) % cells] * share[:, None]
        total += (rows[:, low % cells] * (1 - share) + rows[:, (low + 1) % cells] * share) / cells**0.5
        weight += 1 / cells**0.5
    return total / weight
