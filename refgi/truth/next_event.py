"""Next-event estimation (NEE): the shadow ray from a point that was found to a light."""

from typing import Any

import numpy as np

from refgi.jit import kernel
from refgi.radiometry import DIRECTIONAL
from refgi.rays import STEPS, ray_offset
from refgi.scene import LightTable
from refgi.truth.paths import Shadows


@kernel
def aim_at_light(
    lights: LightTable, k: int, hit: tuple[Any, Any, Any], far: float, offset: float, grain: float, shadows: Shadows,
    ray: int,
) -> None:
    """Write the shadow ray from a hit point to a light.

    `hit`: the point, its face normal on the light's side, and the vector to the light. `far`: distance of the light, m.
    `offset`: how far above the face the ray starts, m. A lamp may lie in a surface itself: rays end short of it.
    """
    y, g, toward = hit
    directional = lights.kind[k] == DIRECTIONAL
    for c in range(3):
        shadows.origin[ray, c] = y[c] + offset * g[c]
        shadows.direction[ray, c] = toward[c] if directional else toward[c] - offset * g[c]
    short = ray_offset(lights.position[k, 0], lights.position[k, 1], lights.position[k, 2], grain) / far
    shadows.reach[ray] = np.inf if directional else max(0.0, 1.0 - STEPS - short)


@kernel
def toward_light(lights: LightTable, k: int, y: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return the vector from a point to a light, of length 1 if that is infinitely far."""
    if lights.kind[k] == DIRECTIONAL:
        return -lights.direction[k, 0], -lights.direction[k, 1], -lights.direction[k, 2]
    return lights.position[k, 0] - y[0], lights.position[k, 1] - y[1], lights.position[k, 2] - y[2]
