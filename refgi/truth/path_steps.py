"""The ground truth as a step: paths of a scene whose materials and lamps are arrays."""

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from refgi.rays import Tracer
from refgi.scene import Scene
from refgi.scene.material import MaterialTable, material_table
from refgi.scene.model import Light
from refgi.stages import stage
from refgi.truth.settings import TruthSettings
from refgi.truth.truth import averaged, without_pilot
from refgi.types import Array


class Lamps(NamedTuple):
    """Numbers of a scene's lamps, one row each, 0 where a lamp has none; falloffs are the scene's."""

    position: Array  # (lamp, 3) place, m
    direction: Array  # (lamp, 3) along which light travels
    intensity: Array  # (lamp, 3) W/sr on the axis; of a directional lamp perpendicular irradiance, W/m^2
    half_angles: Array  # (lamp, 2) rad, inner and outer half-angle of a spot's cone


def lamps_of(lights: Sequence[Light]) -> Lamps:
    """Return the numbers of lamps."""
    none = (0.0, 0.0, 0.0)
    rows = [(getattr(one, "position", none), getattr(one, "direction", none),
             getattr(one, "intensity", None) or getattr(one, "irradiance", none),
             (getattr(one, "inner_half_angle", 0.0), getattr(one, "outer_half_angle", 0.0))) for one in lights]
    return Lamps(*(np.array(column, np.float64) for column in zip(*rows, strict=True)))


@stage("truth.path_traced", kept=False)
def path_traced(
    scene: Scene, materials: MaterialTable, lights: Lamps, position: Array, normal: Array, triangle_id: Array,
    settings: TruthSettings,
) -> tuple[Array, Array, Array]:
    """Trace irradiance by light of so many bounces before the pixel, and its estimated variance (docs/radiometry).

    E is the integral of L cos over the hemisphere, L = albedo/pi of the direct irradiance there; without direct light
    and the receiver's albedo/pi.

    lights: The scene's lamps, (lamp, number) each.
    -> mean (3, h, w): Mean of all samples, W/m^2.
    -> variance_of_mean (3, h, w): Estimated variance of that mean, in units of its square; 0 without surface.
    -> samples (h, w) int32: Samples of each pixel; 0 without surface.
    """
    given = dataclasses.replace(scene, materials=tuple(
        dataclasses.replace(one, diffuse=tuple(diffuse), specular=tuple(specular), exponent=exponent)
        for one, diffuse, specular, exponent in zip(scene.materials, *(
            np.asarray(array, np.float64).tolist() for array in materials[:3]), strict=True)),
        lights=tuple(_with_row(light, lights, k) for k, light in enumerate(scene.lights)))
    found = averaged(without_pilot, given, Tracer(given.geometry), (position, normal, triangle_id), settings)
    return found.mean, found.variance_of_mean, found.samples


def _with_row(light: Light, lamps: Lamps, row: int) -> Light:
    """Return a lamp with its numbers."""
    position, direction, intensity, angles = (np.asarray(one[row], np.float64).tolist() for one in lamps)
    values = {"position": tuple(position), "direction": tuple(direction), "intensity": tuple(intensity),
              "irradiance": tuple(intensity), "inner_half_angle": angles[0], "outer_half_angle": angles[1]}
    return dataclasses.replace(light, **{name: value for name, value in values.items() if hasattr(light, name)})


def truth_steps(
    scene: Scene, tracer: Any, position: Array, normal: Array, triangle_id: Array,  # noqa: ARG001
    settings: TruthSettings,
) -> dict[str, Array]:
    """Return the path-traced irradiance, made by a step that has a tracer of its own."""
    mean, variance, samples = path_traced(scene, material_table(scene.materials), lamps_of(scene.lights), position,
                                          normal, triangle_id, settings)
    return {"mean": mean, "variance_of_mean": variance, "samples": samples}
