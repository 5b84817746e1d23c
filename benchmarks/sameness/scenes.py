"""The scenes of the cases, and the short sequences of the temporal filter."""

import functools

import numpy as np

from refgi import load_scene
from refgi.scene import Scene
from refgi.scene.builtin import SCENES as BUILTIN
from refgi.scene.model import PointLight
from refgi.scene.motion import faces_of, moved, rotation_about, with_own_vertices

SMALLER = {"atrium": "atrium:faces=20000"}
MOVING = {"cornell_box": "green", "stage": "glaze"}  # material of what moves


def scene_names() -> list[str]:
    """Return every built-in scene, and the stage with a second, weaker lamp."""
    return [*BUILTIN, "two_lamps"]


@functools.lru_cache(maxsize=4)
def scene_of(name: str) -> Scene:
    if name != "two_lamps":
        return load_scene(SMALLER.get(name, name))
    stage = load_scene("stage")
    return stage.with_lights(*stage.lights, PointLight((-0.35, 0.45, 0.3), (0.04, 0.03, 0.05)))


def sequence_of(name: str) -> list[Scene]:
    """Return three frames of a scene in which the camera moves, and from the second on an object."""
    scene = scene_of(name)
    selected = faces_of(scene, MOVING[name])
    own = with_own_vertices(scene.geometry, selected)
    x, y, z = scene.camera.eye
    frames = []
    for number in range(3):
        turn = rotation_about((0.0, 1.0, 0.0), 0.1 * max(0, number - 1))
        geometry = moved(own, selected, np.asarray(turn), (0.0, 0.0, 0.0), (0.01 * max(0, number - 1), 0.0, 0.0))
        frames.append(Scene(scene.name, geometry, scene.materials, scene.camera, scene.lights)
                      .with_camera(eye=(x + 0.01 * number, y, z)))
    return frames
