"""Three lamps of one colour each: a channel of the picture is one lamp's light, and a share taken of another one shows.

They are of three kinds and unequal strength; their maps have 1, 6 and 1 faces.
"""

import dataclasses
import math

import numpy as np

from refgi.frame import Frame
from refgi.scene import DirectionalLight, Material, PointLight, Scene, SpotLight, merge
from tests.truth.scenes import WHITE, rectangle
from tests.wiring.cases import VIEW

RED = SpotLight((0.5, 1.5, 0.6), (-0.6, -0.8, -0.7), 0.4, 0.8, (4.0, 0.0, 0.0))
GREEN = PointLight((0.2, 0.9, 0.3), (0.0, 0.25, 0.0))
BLUE = DirectionalLight((-0.5, -0.9, -0.3), (0.0, 0.0, 0.9))
LAMPS = (RED, GREEN, BLUE)


def corner(*lamps, material=WHITE, extra=(), camera=VIEW, **options):
    """Return a frame, in float64, of a corner with a plate before it, all of one material but for extra meshes."""
    geometry, materials = merge([
        rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2), material),
        rectangle((-1, 0, -1), (2, 0, 0), (0, 2, 0), material),
        rectangle((-1, 0, 1), (0, 0, -2), (0, 2, 0), material),
        rectangle((-0.4, 0.5, -0.1), (0.6, 0, 0), (0, 0, -0.5), material), *extra])
    scene = Scene("corner", geometry, materials, camera, lamps or LAMPS)
    return Frame(scene, **{"width": 17, "height": 13, "rsm_resolution": 16, "dtype": np.float64} | options)


def seen_under(degrees):
    """Return the camera with another vertical field of view."""
    return dataclasses.replace(VIEW, vfov=math.radians(degrees))


def tiles(count):
    """Return count x count tiles just above the floor, each of another albedo."""
    side, rng = 2 / count, np.random.default_rng(3)
    return [rectangle((-1 + i * side, 1e-3, 1 - j * side), (side, 0, 0), (0, 0, -side),
                      Material(f"tile {i} {j}", tuple(rng.uniform(0.1, 0.9, 3))))
            for i in range(count) for j in range(count)]
