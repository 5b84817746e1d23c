"""A box whose one lit side faces away from the camera (Fig. 9), and the light that it sends, by quadrature."""

import math

import numpy as np

from refgi.scene.builtin.surfaces import rectangle
from refgi.scene.model import Camera, Material, Scene, SpotLight, merge

ALBEDO = np.array((0.8, 0.2, 0.1))
BACK = -0.4  # z of the lit side, m
LIGHT = np.array((0.0, 0.5, -1.5))  # m; shines along +z
HALF_ANGLE = math.radians(20)  # the cone ends within the side
INTENSITY = 3.0  # W/sr
SIDE_VIEW = Camera((2.2, 1.1, -1.2), (0.0, 0.6, -1.2), vfov=math.radians(70))  # in the gap: lit side and wall


def hidden_side(width=96, height=64, shift=(0.0, 0.0, 0.0)):
    """Return a box on a floor before a wall; the camera looks at the box's front, a spot lights its back."""
    pale, red = Material("pale", (0.7, 0.7, 0.7)), Material("red", tuple(ALBEDO))
    move = np.asarray(shift)
    sides = [((-2, 0, 2), (4, 0, 0), (0, 0, -4), pale), ((-2, 0, -2), (4, 0, 0), (0, 2.5, 0), pale),
             ((-0.5, 0, 0.4), (1, 0, 0), (0, 1, 0), red), ((0.5, 0, BACK), (-1, 0, 0), (0, 1, 0), red),
             ((-0.5, 0, BACK), (0, 0, 0.8), (0, 1, 0), red), ((0.5, 0, 0.4), (0, 0, -0.8), (0, 1, 0), red),
             ((-0.5, 1, 0.4), (1, 0, 0), (0, 0, -0.8), red)]
    geometry, materials = merge([rectangle(tuple(move + corner), a, b, material, "side")
                                 for corner, a, b, material in sides])
    camera = Camera(tuple(np.add(move, (0, 1.1, 5))), tuple(np.add(move, (0, 0.8, 0))), vfov=math.radians(40),
                    width=width, height=height)
    light = SpotLight(tuple(move + LIGHT), (0, 0, 1), HALF_ANGLE, HALF_ANGLE, (INTENSITY,) * 3)
    return Scene("hidden_side", geometry, materials, camera, (light,))


def from_the_lit_side(position, normal, rings=24, spokes=48):
    """Return the irradiance (3, ...) that the lit disc sends to points, W/m^2: nothing lies between.

    Midpoint rule in polar coordinates: the disc at distance h has E = I cos^3 / h^2 and reflects albedo E / pi.
    """
    height = BACK - LIGHT[2]
    width = height * math.tan(HALF_ANGLE) / rings
    total = np.zeros(position.shape[1:])
    for ring in range(rings):
        radius = (ring + 0.5) * width
        direct = INTENSITY * height / (height**2 + radius**2) ** 1.5
        for angle in 2 * math.pi * (np.arange(spokes) + 0.5) / spokes:
            at = np.array((LIGHT[0] + radius * math.cos(angle), LIGHT[1] + radius * math.sin(angle), BACK))
            way = np.moveaxis(at - np.moveaxis(position, 0, -1), -1, 0)
            square = (way * way).sum(axis=0)
            cosines = np.maximum((way * normal).sum(axis=0), 0) * np.maximum(way[2], 0)
            area = radius * width * 2 * math.pi / spokes
            total += direct / math.pi * area * np.divide(cosines, square**2, out=np.zeros_like(total), where=square > 0)
    return ALBEDO[:, None, None] * total
