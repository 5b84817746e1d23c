"""Scenes with cut-outs for tests: leaves in a random heap, and a plate that is half hole."""

import dataclasses
import math

import numpy as np

from refgi.scene import Camera, Image, Material, Mesh, PointLight, Scene, Texture, merge
from refgi.scene.builtin.cornell import CAMERA, LIGHT, shell
from refgi.scene.builtin.surfaces import rectangle
from tests.textured import laid

CORNERS = [[0, 1], [0, 0], [1, 1], [1, 0]]  # texture coordinates of a rectangle whose second side goes up


def spots(texels: tuple[int, int] = (6, 5), seed: int = 3, kind: str = "uint8") -> Image:
    """Return an image of random alpha."""
    random = np.random.default_rng(seed)
    alpha = random.random(texels)
    if kind == "uint8":
        alpha = np.round(255 * alpha).astype(np.uint8)
        return Image(np.full((*texels, 3), 180, np.uint8), "spots", alpha)
    return Image(np.full((*texels, 3), 0.5, kind), "spots", alpha.astype(kind))


def heap(count: int = 12, seed: int = 1, chosen: str = "trilinear", wrap: tuple[str, str] = ("repeat", "mirror"),
         alpha: float = 1.0, cutoff: float = 0.45) -> Scene:
    """Return triangles in a heap: of three, one is whole, one has holes, one is cut by another cutoff."""
    random = np.random.default_rng(seed)
    texture = Texture(spots(seed=seed), wrap, chosen)
    kinds = (Material("whole"), Material("holes", texture=texture, alpha=alpha, cutoff=cutoff),
             Material("more", texture=texture, alpha=0.9 * alpha, cutoff=1.2 * cutoff))
    meshes = []
    for k in range(count):
        corners = random.uniform(-1, 1, 3) + random.normal(0, 0.8, (3, 3))
        meshes.append(Mesh(corners, np.array([[0, 1, 2]]), material=kinds[k % 3], name=f"{k}",
                           uv=random.uniform(-1.5, 1.5, (1, 3, 2))))
    geometry, materials = merge(meshes)
    camera = Camera((0.3, 0.2, 3.5), (0.0, 0.1, 0.0), vfov=math.radians(60), width=48, height=40)
    return Scene("heap", geometry, materials, camera, (PointLight((0.1, 2.0, 1.5), (3.0, 3.0, 3.0)),))


def half_plate(height: float = 1.0, cutoff: float | None = 0.5, size: float = 40.0) -> Scene:
    """Return a floor under a plate whose part x < 0 is a hole, to the bit: alpha crosses 1/2 along x = 0."""
    picture = Image(np.full((1, 2, 3), 255, np.uint8), "half", np.array([[0, 255]], np.uint8))
    # a cutoff of 1/2 is met half-way between two texels of 0 and 1
    plate = Material("plate", (0.5, 0.5, 0.5), texture=Texture(picture, ("clamp", "clamp")), cutoff=cutoff)
    floor = Material("floor", (0.5, 0.5, 0.5))
    half = size / 2
    above = laid(rectangle((-half, height, half), (size, 0, 0), (0, 0, -size), plate, "plate"), CORNERS)
    below = rectangle((-half, 0, half), (size, 0, 0), (0, 0, -size), floor, "floor")
    geometry, materials = merge([below, above])
    camera = Camera((0.0, 0.5 * height, 2.0), (0.0, 0.2 * height, 0.0), vfov=math.radians(60), width=32, height=32)
    return Scene("half_plate", geometry, materials, camera, (PointLight((0.0, 2 * height, 0.0), (8.0, 8.0, 8.0)),))


def opaque(scene: Scene) -> Scene:
    """Return a scene without its holes."""
    return dataclasses.replace(scene, materials=tuple(dataclasses.replace(one, cutoff=None) for one in scene.materials))


def holed_quad(texels: int = 8) -> tuple[Scene, Scene]:
    """Return a quad whose middle texels alone are there, and the part that is there as a mesh of its own.

    Along an axis alpha is 0 or 1, and 1/2 half-way between neighbours: the edge runs along lines between texels.
    """
    first, last = texels // 4, texels - texels // 4
    alpha = np.zeros((texels, texels), np.uint8)
    alpha[:, first:last] = 255  # columns alone: a blend along both axes would round corners off
    picture = Image(np.full((texels, texels, 3), 128, np.uint8), "strip", alpha)
    strip = Material("strip", (0.5, 0.5, 0.5), texture=Texture(picture, ("clamp", "clamp")), cutoff=0.5)
    behind = rectangle((-2.0, -2.0, -1.5), (4.0, 0.3, -0.2), (0.1, 4.0, 0.3), Material("behind"), "behind")
    corner, across, up = np.array([-1.0, -0.8, 0.1]), np.array([2.0, 0.25, 0.5]), np.array([-0.25, 1.75, 0.125])
    whole = laid(rectangle(tuple(corner), tuple(across), tuple(up), strip, "whole"), CORNERS)
    part = rectangle(tuple(corner + across * first / texels), tuple(across * (last - first) / texels), tuple(up),
                     Material("strip", (0.5, 0.5, 0.5)), "part")
    scenes = []
    for mesh in (whole, part):
        geometry, materials = merge([behind, mesh])
        camera = Camera((0.4, 0.3, 3.0), (0.0, 0.1, 0.0), vfov=math.radians(50), width=96, height=80)
        scenes.append(Scene("quad", geometry, materials, camera, (PointLight((0.3, 0.5, 2.0), (3.0, 3.0, 3.0)),)))
    return scenes[0], scenes[1]


def pierced(part: str) -> Scene:
    """Return the Cornell box with a tilted strip in its light: "cut" out of a quad by alpha, or a "mesh" of its own.

    "hole": a quad in the same place that is one hole; "none": nothing.
    """
    first, last, texels = 2, 6, 8
    alpha = np.zeros((texels, texels), np.uint8)
    alpha[:, first:last] = 255
    colour, kept = (0.6, 0.5, 0.2), dict(cutoff=0.5)
    picture = Texture(Image(np.full((texels, texels, 3), 255, np.uint8), "strip", alpha), ("clamp", "clamp"))
    corner, across, up = np.array([0.125, 0.25, 0.125]), np.array([0.3125, 0.0625, 0.0]), np.array([0.0, 0.03125, 0.25])
    if part == "mesh":
        corner, across = corner + across * first / texels, across * (last - first) / texels
    kind = {"cut": Material("strip", colour, texture=picture, **kept), "mesh": Material("strip", colour),
            "hole": Material("strip", colour, alpha=0.2, **kept), "none": None}[part]
    meshes = shell()
    if kind is not None:
        meshes.append(laid(rectangle(tuple(corner), tuple(across), tuple(up), kind, "strip"), CORNERS))
    geometry, materials = merge(meshes)
    camera = dataclasses.replace(CAMERA, width=40, height=40)
    return Scene("pierced", geometry, materials, camera, (LIGHT,))
