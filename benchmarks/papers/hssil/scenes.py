"""Scenes for those of the game, which are not published: a hall under two kinds of spot, a plant basket, boxes."""

import dataclasses
import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np

from benchmarks.papers.val.scenes import atrium, horse
from refgi.scene import Camera, Material, Mesh, Scene, SpotLight, load_scene
from refgi.scene.builtin.atrium import LEAF
from refgi.scene.builtin.atrium_cloth import shrub
from refgi.scene.builtin.surfaces import patch, rectangle
from refgi.scene.health import mean_face_normals
from refgi.scene.model import merge

BASKET = Material("basket", (0.72, 0.3, 0.1))
WALL = Material("wall", (0.72, 0.7, 0.66))
SOIL = Material("soil", (0.16, 0.11, 0.07))
PAVING = Material("paving", (0.55, 0.54, 0.52))
BASKET_SIZE = (1.5, 0.7, 0.5)  # m: along x, y, z
BASKET_CAMERA = Camera((0.25, 1.3, 3.4), (0.0, 0.62, -0.3), vfov=math.radians(36))
SIDE_EYES = ((2.6, 1.2, -1.0), (-2.6, 1.2, -1.0))  # m: beside the basket, in front of the wall


def hall_with_spot() -> Scene:
    """Build Figure 4's scene: the hall under one spot that shines straight down on its floor.

    Returns
    -------
    Scene
        As the atrium, lit otherwise.
    """
    light = SpotLight((-3.6, 6.2, 0.0), (0.0, -1.0, 0.0), math.radians(17), math.radians(21), (640.0, 610.0, 560.0))
    scene = atrium().with_lights(light).with_camera(eye=(-9.6, 2.1, 0.9), target=(-3.2, 1.0, -0.2),
                                                    vfov=math.radians(52))
    return dataclasses.replace(scene, name="hall with a spot", description="The atrium under a vertical spot.",
                               exposure=1.0)


def basket() -> Scene:
    """Build Figure 9's scene: a plant basket before a wall, lit on the side that the camera does not see.

    Returns
    -------
    Scene
        About 21 thousand faces, 4 materials.
    """
    pieces = [rectangle((-4.0, 0.0, 4.0), (8.0, 0.0, 0.0), (0.0, 0.0, -5.7), PAVING, "paving", (8, 8)),
              rectangle((-4.0, 0.0, -1.7), (8.0, 0.0, 0.0), (0.0, 3.0, 0.0), WALL, "wall", (8, 4)),
              *_trough(), *(_bush(x) for x in (-0.47, 0.0, 0.47))]
    geometry, materials = merge(pieces, smooth=True)
    lamp = SpotLight((2.0, 0.8, -1.45), (-1.9, -0.4, 1.2), math.radians(6), math.radians(9), (44.0, 41.0, 36.0))
    street = SpotLight((-2.4, 3.2, 2.4), (2.2, -3.0, -2.2), math.radians(14), math.radians(26), (2.2, 2.3, 2.6))
    return Scene("basket", geometry, materials, BASKET_CAMERA, (lamp, street),
                 "A plant basket before a wall; a spot lights its far side, another one dimly its front.", exposure=2.0)


def side_views() -> tuple[Camera, ...]:
    """Return two cameras that see the basket's far side, as the paper's side views do.

    Returns
    -------
    tuple of Camera
        From its right and from its left.
    """
    return tuple(Camera(eye, (0.0, 0.7, -0.9), vfov=math.radians(62)) for eye in SIDE_EYES)


def _trough() -> list[Mesh]:
    """Return the basket: four sides and the soil, without vertex normals."""
    width, height, depth = BASKET_SIZE
    x, z = width / 2, depth / 2
    corners = ((-x, z), (x, z), (x, -z), (-x, -z), (-x, z))
    sides = [rectangle((ax, 0.0, az), (bx - ax, 0.0, bz - az), (0.0, height, 0.0), BASKET, "basket", (6, 4))
             for (ax, az), (bx, bz) in pairwise(corners)]
    return [*sides, rectangle((-x, height - 0.04, z), (width, 0.0, 0.0), (0.0, 0.0, -depth), SOIL, "soil")]


def _bush(x: float) -> Mesh:
    body = patch(shrub(0.27, 48, 72) + np.array([x, 0.84, 0.0]), LEAF, "bush", closed=True)
    return dataclasses.replace(body, normals=mean_face_normals(body.vertices, body.faces))


BUILDERS: dict[str, Callable[[], Scene]] = {
    "hall": atrium, "spot": hall_with_spot, "basket": basket, "horse": horse,
    "box": lambda: load_scene("cornell_box")}
