"""The atrium with textures that are made in code: masonry, boards of plaster, tiles, woven stripes.

Textures lie on the surfaces as a box projection from the world's axes, metres over the size of a picture: each triangle
takes the axis that its normal is nearest to, so that pictures meet at corners as slabs of stone would.
"""

import dataclasses

import numpy as np

from refgi.errors import expect
from refgi.scene.builtin.atrium import atrium
from refgi.scene.model import Array, Material, Scene
from refgi.scene.texture import Image, Texture

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
