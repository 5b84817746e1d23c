"""Direct light's shadows by rays: the frame's ray structure, or one of its own where a case is recorded."""

from typing import Any

import numpy.typing as npt

from refgi.rays.tracer import Tracer
from refgi.scene import Geometry, Light
from refgi.scene.lamps import Lamp, lamp_of, light_of
from refgi.stages import stage

Array = npt.NDArray[Any]


def _steps(
    tracer: Tracer, geometry: Geometry, position: Array, normal: Array, covered: Array, light: Light  # noqa: ARG001
) -> Array:
    return shadow_rays(geometry, position, normal, covered, lamp_of(light))


@stage("rays.visible_from_light", kept=False, steps=_steps)
def visible_from_light(
    tracer: Tracer, geometry: Geometry, position: Array, normal: Array, covered: Array, light: Light  # noqa: ARG001
) -> Array:
    """Trace a ray from each receiver to a light.

    normal (3, h, w): Unit normals of the pixels' faces.
    -> (h, w) bool: Whether the light reaches the receiver; false without surface.
    """
    return tracer.visible_from_light(position, normal, covered, light)


@stage("rays.shadow_rays", kept=False, each="lamp")
def shadow_rays(geometry: Geometry, position: Array, normal: Array, covered: Array, lamp: Lamp) -> Array:
    """Test whether no triangle lies between each receiver and a lamp (docs/conventions).

    normal (3, h, w): Unit normals of the pixels' faces.
    lamp: The lamp; its cone does not matter here.
    -> (h, w) bool: Whether the lamp reaches the receiver; false without surface.
    """
    return Tracer(geometry).visible_from_light(position, normal, covered, light_of(lamp))
