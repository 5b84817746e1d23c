"""Stand-ins for the paper's scenes, settings, references and counters that the figures share.

Bodies of the paper's face counts and about its visual complexity stand for those that are not published with it: a
scaled serpent with a lumpy ball beside it for dragon and bunny, a carved and glazed vase for the Buddha, six lumpy
balls in the Cornell box for the flying bunnies; the simple teapot's place takes the built-in stage.

The paper always clamps r^2 and never says at what; its pictures show no bright dots. Here the least distance is
`CLAMP` of the scene's diagonal where a figure needs that look, and each such figure gives the figure without it too.
Pictures are of the run's size; counts and times are of twice that, 1024 x 1024 in a full run as in the paper.
"""

import dataclasses
import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from benchmarks.papers.workbench import Subjects, Workbench, seen_by, whole_frame
from refgi.error_target.grid import Subsplats
from refgi.frame import Frame
from refgi.lights.selection import choose_lights, footprints
from refgi.pairs.irradiance import Receivers, irradiance
from refgi.pairs.settings import DistanceClamp
from refgi.scene import Scene, load_scene
from refgi.scene.builtin.cornell import CAMERA, shell
from refgi.scene.builtin.stage import GLAZE, VASE
from refgi.scene.builtin.surfaces import lathe, patch, sphere, walls
from refgi.scene.model import Camera, Material, Mesh, SpotLight, merge
from refgi.scene.repair import mean_face_normals
from refgi.settings import of, replaced
from refgi.splat.multires import ByGeometry, ByIrradiance, MultiresSettings, multires, shared_subsplats
from refgi.types import Array

TEAPOT, BUDDHA, DRAGON, BUNNIES = "simple", "carved", "serpent", "flock"
CLAMP = 0.04  # least distance, share of the diagonal
LARGE = 2  # where counts and times are taken
JADE = Material("jade", (0.33, 0.5, 0.36))
CLAY = Material("clay", (0.6, 0.56, 0.5))
COLOURS = ((0.75, 0.62, 0.3), (0.6, 0.6, 0.6), (0.3, 0.4, 0.62), (0.35, 0.42, 0.6), (0.65, 0.62, 0.58),
           (0.7, 0.55, 0.3))
PLACES = ((0.13, 0.38, 0.25), (0.29, 0.42, 0.4), (0.41, 0.4, 0.22), (0.16, 0.16, 0.4), (0.27, 0.2, 0.2),
          (0.43, 0.15, 0.33))  # m, in the box
STAGE_CAMERA = Camera((0.1, 0.42, 1.15), (0.0, 0.13, 0.0), vfov=math.radians(34))

NEAR_CAMERA = Camera((0.1, 0.4, 1.15), (0.0, 0.15, 0.0), vfov=math.radians(21))


def simple() -> Scene:
    """Build the stand-in for the simple teapot: 6,328 faces."""
    return load_scene("stage")


def serpent() -> Scene:
    """Build the stand-in for dragon and bunny: about 405 thousand faces on the stage, 6 materials."""
    bodies = [_serpent(336_000), _lumpy((0.32, 0.085, -0.02), 0.08, 69_000, CLAY, "ball")]
    light = SpotLight((0.55, 0.9, 0.5), (-0.65, -0.6, -0.48), math.radians(19), math.radians(26), (2.2, 2.1, 1.95))
    geometry, materials = merge([*walls(), *bodies], smooth=True)
    return Scene("serpent", geometry, materials, STAGE_CAMERA, (light,), "A scaled serpent and a ball on a stage.",
                 exposure=1.2)


def carved() -> Scene:
    """Build the stand-in for the spinning Buddha: about 250 thousand faces, 5 materials, one with a Phong lobe."""
    rows, columns = 400, 312
    along, turn = np.linspace(0, 1, rows)[:, None], 2 * np.pi * np.arange(columns) / columns
    folds = 0.07 * np.sin(11 * turn + 2.5 * np.sin(9 * along)) + 0.025 * np.sin(37 * turn) * np.sin(70 * along)
    outside = VASE[:13]  # of the built-in vase, up to its lip
    profile = PchipInterpolator(np.arange(13), outside)(12 * along[:, 0])
    body = lathe(profile, columns, GLAZE, "vase", ribs=folds * np.sin(np.pi * along))
    body = dataclasses.replace(body, normals=mean_face_normals(body.vertices, body.faces))
    light = SpotLight((0.15, 1.05, 0.55), (-0.2, -0.8, -0.56), math.radians(18), math.radians(24), (2.2, 2.1, 1.95))
    geometry, materials = merge([*walls(), body], smooth=True)
    return Scene("carved", geometry, materials, NEAR_CAMERA, (light,), "A carved and glazed vase on a stage.",
                 exposure=1.2)


def flock() -> Scene:
    """Build the stand-in for the flying bunnies: about 417 thousand faces in the Cornell box, 9 materials."""
    bodies = [_lumpy(place, 0.07, 69_450, Material(f"body_{n}", colour), f"body_{n}")
              for n, (place, colour) in enumerate(zip(PLACES, COLOURS, strict=True))]
    light = SpotLight((0.15, 0.53, 0.06), (0.483223, -0.662194, 0.572708), math.radians(30), math.radians(42),
                      (0.7, 0.66, 0.58))
    geometry, materials = merge([*shell(), *bodies], smooth=True)
    return Scene("flock", geometry, materials, CAMERA, (light,), "Six lumpy balls in the Cornell box.", exposure=1.2)


def _serpent(faces: int) -> Mesh:
    columns = 240
    rows = faces // (2 * columns) + 1
    u = np.linspace(0, 1, rows)
    middle = np.stack([0.26 * np.cos(1.1 * np.pi * u) - 0.06, 0.07 + 0.07 * np.sin(5 * np.pi * u) ** 2,
                       0.05 + 0.12 * np.sin(3 * np.pi * u)], axis=1)
    ahead = np.gradient(middle, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    aside = np.cross(ahead, (0.0, 1.0, 0.0))
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    upward = np.cross(aside, ahead)
    turn = 2 * np.pi * np.arange(columns) / columns
    scales = np.abs(np.sin(60 * np.pi * u[:, None])) * np.abs(np.sin(8 * turn + 30 * np.pi * u[:, None]))
    radius = (0.055 * np.sin(np.pi * np.clip(u, 0.02, 0.98)) ** 0.4)[:, None] * (1 + 0.13 * scales)
    ring = np.cos(turn)[:, None] * aside[:, None] + np.sin(turn)[:, None] * upward[:, None]
    body = patch(middle[:, None] + radius[..., None] * ring, JADE, "serpent", closed=True)
    return dataclasses.replace(body, normals=mean_face_normals(body.vertices, body.faces))


def _lumpy(center: tuple[float, float, float], radius: float, faces: int, material: Material, name: str) -> Mesh:
    ball = sphere((0.0, 0.0, 0.0), 1.0, faces, material, name)
    x, y, z = np.asarray(ball.vertices).T
    lumps = 0.18 * np.sin(4 * x + 1) * np.sin(4 * y + 2) + 0.05 * np.sin(17 * x) * np.sin(15 * y) * np.sin(16 * z)
    vertices = np.asarray(center) + radius * (1 + lumps)[:, None] * ball.vertices
    return dataclasses.replace(ball, vertices=vertices, normals=mean_face_normals(vertices, ball.faces))


BUILDERS: dict[str, Callable[[], Scene]] = {"simple": simple, "carved": carved, "serpent": serpent, "flock": flock}
_SUBJECTS = Subjects(BUILDERS)
scene_of, frame_of = _SUBJECTS.scene_of, _SUBJECTS.frame_of


def settings_of(bench: Workbench, scene: str, **changes: Any) -> MultiresSettings:
    """Return the paper's settings, but for `changes`, with a distance clamp that suits a scene's size."""
    return of(MultiresSettings, clamp=DistanceClamp(least_distance(bench, scene)), **changes)


def least_distance(bench: Workbench, scene: str) -> float:
    """Return the distance (m) that pairs count as apart at least."""
    return CLAMP * scene_of(bench, scene).geometry.diagonal


def unclamped(settings: MultiresSettings) -> MultiresSettings:
    """Return settings without a clamp."""
    return replaced(settings, {"clamp": "none"})


def drawing(bench: Workbench, scene: Scene, settings: MultiresSettings) -> Callable[[], Array]:
    """Return what draws a whole frame of twice the run's size."""
    return partial(whole_frame, bench, multires, scene, settings, LARGE)


def without_indirect(bench: Workbench, scene: Scene) -> Callable[[], Array]:
    """Return what draws a frame of twice the run's size and all that indirect light needs, but not that light."""
    def draw() -> Array:
        frame = seen_by(bench, scene, LARGE)
        frame.gbuffer.resolve("depth", "position", "normal", "albedo")
        return frame.radiance() if frame.rsms else np.zeros(0)

    return draw


def subsplats_of(frame: Frame, settings: MultiresSettings) -> Subsplats:
    """Return the subsplats that all lights share: the leaves, which each light may go on to refine for itself."""
    shared = settings.subsplats.start if isinstance(settings.subsplats, ByIrradiance) else settings.subsplats
    assert isinstance(shared, ByGeometry)
    return shared_subsplats(frame.gbuffer, shared)


def count_of(frame: Frame, settings: MultiresSettings) -> int:
    """Return how many subsplats all lights share."""
    return len(subsplats_of(frame, settings).pixel)


def full_sum(frame: Frame, settings: MultiresSettings) -> Array:
    """Return the same lights summed at every pixel: what subsplats converge to."""
    receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
    pairs = settings.effective_pairs
    return irradiance(receivers, choose_lights(frame, settings.lights), pairs,
                      footprints(frame, settings.lights, pairs))


def every_texel(frame: Frame, settings: MultiresSettings) -> Array:
    """Return the sum over every texel of the shadow maps: what lights converge to as their number grows."""
    return full_sum(frame, replaced(settings, {"pattern": "all"}))


def levels_of(frame: Frame, resolutions: tuple[int, ...]) -> dict[int, int]:
    """Return `finest` by indirect resolution (cells along a side); those finer than the picture are left out."""
    size = max(frame.width, frame.height)
    return {n: (size // n).bit_length() - 1 for n in resolutions if n <= size}


def share_of_pixels(subsplats: Subsplats, covered: Array) -> float:
    """Return how many subsplats there are for each pixel with a surface; 1 where nothing is saved."""
    return len(subsplats.pixel) / max(1, int(np.count_nonzero(covered)))
