"""Scenes with textures for tests: a checkered floor to the horizon, and a closed room with a wall of two colours."""

import dataclasses
import math

import numpy as np

from refgi.scene import Camera, DirectionalLight, Image, Material, Mesh, Scene, SpotLight, Texture, merge
from refgi.scene.builtin.surfaces import rectangle

EYE, PITCH, VFOV, HALF = (0.3, 1.5, 19.0), 0.18, math.radians(50), 20.0  # m; the floor reaches HALF either way
CHECKS = 2.0  # to a metre along each axis


def laid(mesh: Mesh, uv: object) -> Mesh:
    """Return a mesh of four vertices with coordinates for each."""
    return dataclasses.replace(mesh, uv=np.asarray(uv, np.float64)[mesh.faces])


def checker(cells: int = 8, texels: int = 32) -> Image:
    """Return cells x cells squares of so many texels a side, the first white."""
    row = np.arange(cells * texels) // texels
    code = ((row[:, None] + row + 1) % 2 * 255).astype(np.uint8)
    return Image(np.repeat(code[..., None], 3, axis=2))


def floor(chosen: str = "trilinear", size: tuple[int, int] = (160, 120), image: Image | None = None, **camera) -> Scene:
    """Return the floor y = 0 with `CHECKS` squares to a metre, u along x and v along -z."""
    texture = Texture(checker() if image is None else image, filter=chosen)
    whole = rectangle((-HALF, 0, HALF), (2 * HALF, 0, 0), (0, 0, -2 * HALF), Material("floor", (1, 1, 1),
                      texture=texture), "floor")
    turns = 2 * HALF * CHECKS / 8
    geometry, materials = merge([laid(whole, np.array([[0, 0], [0, 1], [1, 0], [1, 1]]) * turns)])
    target = (EYE[0], EYE[1] - math.sin(PITCH), EYE[2] - math.cos(PITCH))
    view = Camera(EYE, target, vfov=VFOV, width=size[0], height=size[1])
    light = DirectionalLight((0.1, -1.0, 0.2), (3.0, 3.0, 3.0))
    return Scene("floor", geometry, materials, dataclasses.replace(view, **camera), (light,))


def room(chosen: str = "trilinear", image: Image | None = None) -> Scene:
    """Return a white room whose lit back wall is red on the left and blue on the right."""
    two = np.full((4, 8, 3), 0.05, np.float32)
    two[:, :4, 0] = two[:, 4:, 2] = 0.9
    paint = Material("paint", (1, 1, 1), texture=Texture(Image(two) if image is None else image, ("clamp", "clamp"),
                                                         chosen))
    white = Material("white", (0.7, 0.7, 0.7))
    back = rectangle((-1, 0, -1), (2, 0, 0), (0, 2, 0), paint, "back")
    geometry, materials = merge([
        rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2), white, "floor"), laid(back, [[0, 1], [0, 0], [1, 1], [1, 0]]),
        rectangle((-1, 2, 1), (0, 0, -2), (2, 0, 0), white, "ceiling"),
        rectangle((-1, 0, 1), (0, 0, -2), (0, 2, 0), white, "left"),
        rectangle((1, 0, -1), (0, 0, 2), (0, 2, 0), white, "right")])
    camera = Camera((0, 1, 3.4), (0, 1, 0), vfov=math.radians(38), width=40, height=40)
    light = SpotLight((0, 1, 0.9), (0, 0, -1), math.radians(30), math.radians(38), (9.0, 9.0, 9.0))
    return Scene("room", geometry, materials, camera, (light,))
