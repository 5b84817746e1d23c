"""Scenes far from the origin: moved near it, where float32 has steps for them.

At 1e5 m two float32 numbers are 8 mm apart: positions, shadows and rays of a room there would be wrong, though the
scene itself, in float64, knows its places to 1e-11 m. All that is computed depends on differences of places alone, so
the whole scene is moved once, before anything is rounded.
"""

import dataclasses
import math
import warnings
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.errors import RefgiWarning
from refgi.scene.light import DirectionalLight, Light
from refgi.scene.model import Geometry, Scene
from refgi.scene.values import Vector
from refgi.stages import stage

Array = npt.NDArray[Any]

FAR = 16.0  # diagonals off the origin: float32 still has 2^19 steps a diagonal
COARSEST_STEP = 1 / 4096  # of the diagonal between neighbouring coordinates: the light is then off by 1e-3


def near_origin(scene: Scene) -> tuple[Scene, Vector]:
    """Return a scene near the origin, and the place that became its origin.

    Parameters
    ----------
    scene : Scene
        Any scene.

    Returns
    -------
    Scene
        The same object where its box lies within FAR diagonals of the origin; else moved as a whole, camera and
        lights with it.
    tuple of 3 floats
        What was subtracted from every place, m: whole multiples of a power of 2 not below the diagonal, so that the
        subtraction is exact and scenes moved by such a multiple become equal.

    Warns
    -----
    RefgiWarning
        If the scene is so small and so far off that float64 has too few steps for it.
    """
    low, high = scene.geometry.bounds
    diagonal, center = scene.geometry.diagonal, (low + high) / 2
    if diagonal == 0 or np.abs(center).max() <= FAR * diagonal:
        return scene, (0.0, 0.0, 0.0)
    step = float(np.spacing(np.abs(center).max()))
    if step > COARSEST_STEP * diagonal:
        text = (f"scene {scene.name!r}: {diagonal:.3g} m across, but so far from the origin that neighbouring "
                f"coordinates are {step:.3g} m apart: its shape is lost; build it nearer to the origin")
        warnings.warn(RefgiWarning(text), stacklevel=4)
    grid = 2.0 ** math.ceil(math.log2(diagonal))
    x, y, z = (float(value) for value in np.round(center / grid) * grid)
    origin = (x, y, z)
    camera = dataclasses.replace(scene.camera, eye=_moved(scene.camera.eye, origin),
                                 target=_moved(scene.camera.target, origin))
    lights = tuple(_moved_light(light, origin) for light in scene.lights)
    return dataclasses.replace(scene, geometry=_moved_geometry(scene.geometry, origin), camera=camera,
                               lights=lights), origin


@stage("scene.move")
def _moved_geometry(geometry: Geometry, origin: Vector) -> Geometry:
    """Subtract `origin`; a stage, so that frames of an animation go on sharing one geometry."""
    return dataclasses.replace(geometry, vertices=np.asarray(geometry.vertices, np.float64) - origin)


def _moved_light(light: Light, origin: Vector) -> Light:
    if isinstance(light, DirectionalLight):
        return light
    return dataclasses.replace(light, position=_moved(light.position, origin))


def _moved(place: Vector, origin: Vector) -> Vector:
    return place[0] - origin[0], place[1] - origin[1], place[2] - origin[2]
