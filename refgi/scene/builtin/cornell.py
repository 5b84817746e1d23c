"""The Cornell box: vertices and reflectances as measured, and the box with a form of any face count in it.

Vertices are those published by the Cornell University Program of Computer Graphics (mm, here m; walls are not exactly
parallel), without the hole for the luminaire. Albedos are the measured spectra under D65 as linear sRGB.
"""

import math

import numpy as np

from refgi.errors import expect
from refgi.scene.builtin.surfaces import sphere
from refgi.scene.model import Array, Camera, Material, Mesh, Scene, SpotLight, merge

WHITE = Material("white", (0.738, 0.736, 0.74))
RED = Material("red", (0.487, 0.05, 0.051))
GREEN = Material("green", (0.071, 0.398, 0.087))

# Quadrilaterals, four corners each, mm.
FLOOR = [(552.8, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 559.2), (549.6, 0.0, 559.2)]
CEILING = [(556.0, 548.8, 0.0), (556.0, 548.8, 559.2), (0.0, 548.8, 559.2), (0.0, 548.8, 0.0)]
BACK_WALL = [(549.6, 0.0, 559.2), (0.0, 0.0, 559.2), (0.0, 548.8, 559.2), (556.0, 548.8, 559.2)]
RIGHT_WALL = [(0.0, 0.0, 559.2), (0.0, 0.0, 0.0), (0.0, 548.8, 0.0), (0.0, 548.8, 559.2)]
LEFT_WALL = [(552.8, 0.0, 0.0), (549.6, 0.0, 559.2), (556.0, 548.8, 559.2), (556.0, 548.8, 0.0)]
SHORT_BLOCK = [
    (130.0, 165.0, 65.0), (82.0, 165.0, 225.0), (240.0, 165.0, 272.0), (290.0, 165.0, 114.0),
    (290.0, 0.0, 114.0), (290.0, 165.0, 114.0), (240.0, 165.0, 272.0), (240.0, 0.0, 272.0),
    (130.0, 0.0, 65.0), (130.0, 165.0, 65.0), (290.0, 165.0, 114.0), (290.0, 0.0, 114.0),
    (82.0, 0.0, 225.0), (82.0, 165.0, 225.0), (130.0, 165.0, 65.0), (130.0, 0.0, 65.0),
    (240.0, 0.0, 272.0), (240.0, 165.0, 272.0), (82.0, 165.0, 225.0), (82.0, 0.0, 225.0),
]
TALL_BLOCK = [
    (423.0, 330.0, 247.0), (265.0, 330.0, 296.0), (314.0, 330.0, 456.0), (472.0, 330.0, 406.0),
    (423.0, 0.0, 247.0), (423.0, 330.0, 247.0), (472.0, 330.0, 406.0), (472.0, 0.0, 406.0),
    (472.0, 0.0, 406.0), (472.0, 330.0, 406.0), (314.0, 330.0, 456.0), (314.0, 0.0, 456.0),
    (314.0, 0.0, 456.0), (314.0, 330.0, 456.0), (265.0, 330.0, 296.0), (265.0, 0.0, 296.0),
    (265.0, 0.0, 296.0), (265.0, 330.0, 296.0), (423.0, 330.0, 247.0), (423.0, 0.0, 247.0),
]

CAMERA = Camera((0.278, 0.273, -0.8), (0.278, 0.273, 0.0), vfov=math.radians(39.3077))
LIGHT = SpotLight((0.278, 0.5475, 0.2), (0.216263, -0.970525, 0.106359), math.radians(34), math.radians(52),
                  (0.6, 0.56, 0.48))


def cornell_box() -> Scene:
    """Build the box with its two blocks.

    Result: 30 faces, 3 materials.
    """
    blocks = [_quads(SHORT_BLOCK, WHITE, "short_block"), _quads(TALL_BLOCK, WHITE, "tall_block")]
    geometry, materials = merge([*shell(), *blocks])
    return Scene("cornell_box", geometry, materials, CAMERA, (LIGHT,),
                 "The Cornell box with a spot under the ceiling tilted at the red wall.", exposure=1.5)


def cornell_sphere(faces: int = 16_990) -> Scene:
    """Build the box with one large sphere instead of the blocks.

    `faces`: triangles in all, 18 to 50 million. Result: about that many faces, 4 materials, exact normals on the
    sphere.
    """
    expect(18 <= faces <= 50_000_000, "faces", "18 to 50000000", faces)
    ball = sphere((0.29, 0.1505, 0.3), 0.15, faces - 10, Material("sphere", (0.62, 0.6, 0.55)), "sphere")
    geometry, materials = merge([*shell(), ball], smooth=True)
    light = SpotLight((0.15, 0.53, 0.06), (0.483223, -0.662194, 0.572708), math.radians(26), math.radians(38),
                      (0.7, 0.66, 0.58))
    return Scene("cornell_sphere", geometry, materials, CAMERA, (light,),
                 "A tessellated sphere in the Cornell box, lit from the front corner.", exposure=1.2)


def shell() -> list[Mesh]:
    """Return the five walls of the box.

    Result: ten faces in all, open towards -z.
    """
    return [_quads(FLOOR, WHITE, "floor"), _quads(CEILING, WHITE, "ceiling"), _quads(BACK_WALL, WHITE, "back_wall"),
            _quads(RIGHT_WALL, GREEN, "right_wall"), _quads(LEFT_WALL, RED, "left_wall")]


def _quads(corners: list[tuple[float, float, float]], material: Material, name: str) -> Mesh:
    vertices: Array = np.array(corners) / 1000.0
    faces = (np.arange(0, len(corners), 4)[:, None] + np.array([0, 1, 2, 0, 2, 3])).reshape(-1, 3)
    return Mesh(vertices, faces, material=material, name=name)
