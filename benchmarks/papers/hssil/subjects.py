"""Scenes, frames, settings and references that the figures share.

The scenes stand for those of the game, which are not published: a hall under two kinds of spot, a plant basket, boxes.
A full run has the paper's sizes: 1280 x 720 pixels where times are taken, 720 x 720 where Figure 5 judges. In a smaller
run the radius of these figures shrinks with the picture, so that as many levels reach the same share of it. What is
traced many times is smaller than that in every run: there levels are left out instead, and the radius stays about what
it is, so that a texel is as small beside its distance as in the paper.
"""

import dataclasses
import math
import warnings
from itertools import pairwise
from typing import Any

import numpy as np

from benchmarks.papers.val.subjects import atrium, horse
from benchmarks.papers.workbench import Subjects, Workbench, mean_of
from refgi.errors import RefgiWarning
from refgi.frame import Frame
from refgi.scene import Camera, Material, Mesh, Scene, SpotLight
from refgi.scene.builtin.atrium import LEAF
from refgi.scene.builtin.atrium_pieces import shrub
from refgi.scene.builtin.cornell import cornell_box
from refgi.scene.builtin.surfaces import patch, rectangle
from refgi.scene.model import merge
from refgi.scene.repair import mean_face_normals
from refgi.settings import replaced
from refgi.sssil import HssilSettings
from refgi.sssil.hssil import hssil
from refgi.sssil.settings import PRESETS
from refgi.truth import TruthResult
from refgi.types import Array

HALL, SPOT, BASKET, HORSE, BOX = "hall", "spot", "basket", "horse", "box"
TITLES = {BOX: "Cornell Box", HORSE: "Cornell Horse", HALL: "hall", SPOT: "hall with a spot", BASKET: "basket"}
CLAY = Material("basket", (0.72, 0.3, 0.1))
WALL = Material("wall", (0.72, 0.7, 0.66))
SOIL = Material("soil", (0.16, 0.11, 0.07))
PAVING = Material("paving", (0.55, 0.54, 0.52))
BASKET_SIZE = (1.5, 0.7, 0.5)  # m: along x, y, z
BASKET_CAMERA = Camera((0.25, 1.3, 3.4), (0.0, 0.62, -0.3), vfov=math.radians(36))
SIDE_EYES = ((2.6, 1.2, -1.0), (-2.6, 1.2, -1.0))  # m: beside the basket, in front of the wall
PAPER_HEIGHT, WIDE = 720, 16 / 9  # the paper's pictures are 1280 x 720
LARGE = PAPER_HEIGHT / 512  # pixels a side in units of a full run's
JUDGED = 1 / 2  # where pictures are traced, or every pixel lights every pixel
RADIUS, RADIUS_FIGURE_5 = 20.0, 40.0  # texels of the first level
FAR_SEED = 1 << 20  # pictures that others are judged by share no random numbers with them


def hall_with_spot() -> Scene:
    """Build Figure 4's scene: the hall under one spot that shines straight down on its floor."""
    light = SpotLight((-3.6, 6.2, 0.0), (0.0, -1.0, 0.0), math.radians(17), math.radians(21), (640.0, 610.0, 560.0))
    scene = atrium().with_lights(light).with_camera(eye=(-9.6, 2.1, 0.9), target=(-3.2, 1.0, -0.2),
                                                    vfov=math.radians(52))
    return dataclasses.replace(scene, name="hall with a spot", description="The atrium under a vertical spot.",
                               exposure=1.0)


def basket() -> Scene:
    """Build Figure 9's scene: a plant basket before a wall, lit on the side that the camera does not see.

    About 21 thousand faces, 4 materials; four sides and the soil have no vertex normals.
    """
    width, height, depth = BASKET_SIZE
    x, z = width / 2, depth / 2
    sides = [rectangle((ax, 0.0, az), (bx - ax, 0.0, bz - az), (0.0, height, 0.0), CLAY, "basket", (6, 4))
             for (ax, az), (bx, bz) in pairwise(((-x, z), (x, z), (x, -z), (-x, -z), (-x, z)))]
    pieces = [rectangle((-4.0, 0.0, 4.0), (8.0, 0.0, 0.0), (0.0, 0.0, -5.7), PAVING, "paving", (8, 8)),
              rectangle((-4.0, 0.0, -1.7), (8.0, 0.0, 0.0), (0.0, 3.0, 0.0), WALL, "wall", (8, 4)), *sides,
              rectangle((-x, height - 0.04, z), (width, 0.0, 0.0), (0.0, 0.0, -depth), SOIL, "soil"),
              *(_bush(x) for x in (-0.47, 0.0, 0.47))]
    geometry, materials = merge(pieces, smooth=True)
    lamp = SpotLight((2.0, 0.8, -1.45), (-1.9, -0.4, 1.2), math.radians(6), math.radians(9), (44.0, 41.0, 36.0))
    street = SpotLight((-2.4, 3.2, 2.4), (2.2, -3.0, -2.2), math.radians(14), math.radians(26), (2.2, 2.3, 2.6))
    return Scene("basket", geometry, materials, BASKET_CAMERA, (lamp, street),
                 "A plant basket before a wall; a spot lights its far side, another one dimly its front.", exposure=2.0)


def _bush(x: float) -> Mesh:
    body = patch(shrub(0.27, 48, 72) + np.array([x, 0.84, 0.0]), LEAF, "bush", closed=True)
    return dataclasses.replace(body, normals=mean_face_normals(body.vertices, body.faces))


def side_views() -> tuple[Camera, ...]:
    """Return two cameras that see the basket's far side from its right and left, as the paper's side views do."""
    return tuple(Camera(eye, (0.0, 0.7, -0.9), vfov=math.radians(62)) for eye in SIDE_EYES)


_SUBJECTS = Subjects({HALL: atrium, SPOT: hall_with_spot, BASKET: basket, HORSE: horse, BOX: cornell_box})
scene_of, frame_of = _SUBJECTS.scene_of, _SUBJECTS.frame_of


def wide_frame(bench: Workbench, name: str, factor: float = LARGE) -> Frame:
    """Return a frame of the paper's shape: 1280 x 720 pixels in a full run if no other height is asked for."""
    return frame_of(bench, name, factor, wide=WIDE)


def settings_of(frame: Frame, **changes: Any) -> HssilSettings:
    """Return the paper's settings with a radius that reaches as much of this picture as the paper's of 1280 x 720."""
    return replaced(PRESETS["paper"], {"radius": scaled_radius(frame, RADIUS)} | changes)


def smaller(frame: Frame, further: int = 0, **changes: Any) -> HssilSettings:
    """Return the paper's settings for a small picture: so many levels that about 20 texels reach as much of it.

    `further` is how many levels more, or fewer. The reach is that of 20 texels and 4 levels of 1280 x 720.
    """
    share = math.hypot(frame.width, frame.height) / math.hypot(WIDE * PAPER_HEIGHT, PAPER_HEIGHT)
    levels = max(1, round(4 + math.log2(share)))
    radius = max(1.0, RADIUS * share * 2.0 ** (4 - levels))
    return replaced(PRESETS["paper"], {"radius": radius, "levels": max(1, levels + further)} | changes)


def scaled_radius(frame: Frame, radius: float) -> float:
    """Return a radius of the paper, in texels of a picture of 720 rows, in those of another picture."""
    return max(1.0, radius * frame.height / PAPER_HEIGHT)


def every_texel(settings: HssilSettings, **changes: Any) -> HssilSettings:
    """Return settings that take each texel of disc and crowns once: the limit of many samples, without noise."""
    return replaced(settings, {"pattern": "all"} | changes)


def light_of(frame: Frame, settings: HssilSettings) -> Array:
    """Return irradiance (3, h, w); that the paper's settings do not reach across the picture is known."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RefgiWarning)
        return hssil(frame, settings)


def ready(frame: Frame) -> Frame:
    """Compute what deferred shading has before indirect light starts: buffers and direct light."""
    frame.gbuffer.resolve("position", "depth", "normal", "albedo")
    assert frame.direct.shape == (3, frame.height, frame.width)
    return frame


def reach_of(frame: Frame, settings: HssilSettings) -> float:
    """Return how far samples reach in diagonals of the picture; from 1 on every pixel can light every other one."""
    if settings.sampling.radius is None:
        return 1.0
    pixels = settings.sampling.radius * 2.0 ** (settings.sampling.levels + settings.sampling.first_level)
    return pixels / math.hypot(frame.width, frame.height)


def noise_of(frame: Frame, settings: HssilSettings, first: Array) -> float:
    """Return the standard deviation (W/m^2) of a picture, by another one with other random numbers."""
    other = light_of(frame, replaced(settings, {"seed": settings.sampling.seed + 1}))
    return math.sqrt(0.5 * np.mean((first.astype(np.float64) - other)[:, frame.gbuffer.covered] ** 2))


def expected_light(frame: Frame, settings: HssilSettings, seeds: int) -> Array:
    """Return the mean of many pictures: what is left when all noise is gone.

    With Eq. 4 it depends on the number of samples: each is a disc as large as its share.
    """
    total = np.zeros((3, frame.height, frame.width))
    for seed in range(seeds):
        total += light_of(frame, replaced(settings, {"seed": FAR_SEED + seed}))
    return total / seeds


def standard_error(truth: TruthResult, covered: Array) -> float:
    """Return how noisy path tracing itself is: root mean square over pixels, in % of the mean irradiance."""
    error = math.sqrt(float(truth.variance_of_mean[:, covered].mean()))
    return 100 * error / max(mean_of(truth.mean, covered), 1e-30)
