"""The Cornell box as measured, and scenes whose one-bounce light is known in closed form.

Vertices are those published by the Cornell University Program of Computer Graphics (mm, here m; walls are not exactly
parallel), without the hole for the luminaire. Albedos are the measured spectra under D65 as linear sRGB.
"""

import math

import numpy as np

from refgi.errors import expect
from refgi.scene.builtin.surfaces import rectangle, sphere
from refgi.scene.model import Camera, DirectionalLight, Material, Mesh, Scene, SpotLight, merge
from refgi.types import Array

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
    """Build the box with its two blocks; 30 faces, 3 materials."""
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
    """Return the five walls of the box; ten faces in all, open towards -z."""
    return [_quads(FLOOR, WHITE, "floor"), _quads(CEILING, WHITE, "ceiling"), _quads(BACK_WALL, WHITE, "back_wall"),
            _quads(RIGHT_WALL, GREEN, "right_wall"), _quads(LEFT_WALL, RED, "left_wall")]


def _quads(corners: list[tuple[float, float, float]], material: Material, name: str) -> Mesh:
    vertices: Array = np.array(corners) / 1000.0
    faces = (np.arange(0, len(corners), 4)[:, None] + np.array([0, 1, 2, 0, 2, 3])).reshape(-1, 3)
    return Mesh(vertices, faces, material=material, name=name)


MOST_FACES = 50_000_000
# How far the light of `parallel_plates` hangs below the receiver that must not block it, as a share of the height.
# E at the middle grows by at most 1.2 times that share.
GAP = 2e-5


def integrating_sphere(faces: int = 20_000, albedo: float = 0.5, radius: float = 1.0) -> Scene:
    """Build the inside of a diffuse sphere with a spot and the camera in it.

    `faces`: triangles, 8 to 50 million. `albedo`: albedo of the wall, 0 to 1. `radius`: radius of the sphere, m.
    Result: about that many faces; vertices lie on the sphere and vertex normals are exact.

    The kernel cos cos / r^2 equals 1 / (4 R^2) between any two points of a sphere, so that one bounce gives the same
    irradiance albedo Phi0 / (4 pi R^2) everywhere, Phi0 being the flux of the light (docs/radiometry).
    """
    expect(8 <= faces <= MOST_FACES, "faces", f"8 to {MOST_FACES}", faces)
    expect(1e-6 <= radius <= 1e6, "radius", "1e-6 to 1e6 m", radius)
    wall = Material("wall", (albedo, albedo, albedo))
    geometry, materials = merge([sphere((0.0, 0.0, 0.0), radius, faces, wall, "sphere")], smooth=True)
    camera = Camera((0.0, -0.1 * radius, 0.75 * radius), (0.0, 0.05 * radius, -radius), vfov=math.radians(75))
    power = 2.0 * radius**2
    light = SpotLight((0.15 * radius, 0.5 * radius, 0.2 * radius), (-0.4, -0.4, -0.85), math.radians(20),
                      math.radians(32), (power, power, power))
    return Scene("integrating_sphere", geometry, materials, camera, (light,),
                 "Inside a diffuse sphere: one bounce lights every point alike.")


def wedge(angle_deg: float = 90.0, albedo: float = 0.5, length: float = 4.0) -> Scene:
    """Build two plates that meet in an edge; parallel light falls on one and grazes the other.

    `angle_deg`: angle between the plates, 5 to 175 degrees. `albedo`: albedo of both, 0 to 1. `length`: length of the
    edge, 0.01 to 10 thousand m. Result: 4 faces, 2 materials. The receiver lies in y = 0 from the edge x = 0 to x = 1,
    the sender leans over it; both are 1 m wide and centred on z = 0.

    The light travels along -x with E_perp = 1 W/m^2: the sender has E = sin(angle) throughout, the receiver none. For
    an endless wedge the receiver at distance s from the edge gets albedo sin(angle) (1 + (cos(angle) - s) / d) / 2
    with d^2 = 1 + s^2 - 2 s cos(angle). At z = 0 the missing ends take up to 9 % of that from a length of 4 m, and
    less than 1e-4 from one of 200 m.
    """
    expect(5 <= angle_deg <= 175, "angle_deg", "5 to 175", angle_deg)
    expect(0.01 <= length <= 1e4, "length", "0.01 to 10000 m", length)
    angle = math.radians(angle_deg)
    lean = (math.cos(angle), math.sin(angle), 0.0)
    sender = Material("sender", (albedo, albedo, albedo))
    receiver = Material("receiver", (albedo, albedo, albedo))
    geometry, materials = merge([
        rectangle((0.0, 0.0, length / 2), (1.0, 0.0, 0.0), (0.0, 0.0, -length), receiver, "receiver"),
        rectangle((0.0, 0.0, -length / 2), lean, (0.0, 0.0, length), sender, "sender"),
    ])
    # The eye looks into the opening, along its bisector.
    half = angle / 2
    target = (0.5 * math.cos(half) ** 2, 0.5 * math.cos(half) * math.sin(half), 0.0)
    eye = (target[0] + 4.2 * math.cos(half), target[1] + 4.2 * math.sin(half), 1.3)
    camera = Camera(eye, target, vfov=math.radians(40), width=640, height=480)
    light = DirectionalLight((-1.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    return Scene("wedge", geometry, materials, camera, (light,),
                 "Two plates that meet in an edge, one of them evenly lit.", exposure=3.0)


def parallel_plates(height: float = 1.0, half_angle_deg: float = 40.0, albedo: float = 0.5) -> Scene:
    """Build a floor lit by a spot straight from above, and a small plate over it that only the floor lights.

    `height`: height of light and receiver over the floor, m. `half_angle_deg`: half-angle of the spot, which has the
    same intensity in all of its cone; 1 to 75 degrees. `albedo`: albedo of both plates, 0 to 1. Result: 4 faces, 2
    materials. The receiver is 0.6 h wide; the camera sees its lower side and the floor.

    At the middle of the receiver E = 2/5 albedo I / h^2 (1 - cos^5 c) for half-angle c and intensity I = 1 W/sr. The
    light hangs 2e-5 h below the receiver so that the receiver cannot block it.
    """
    expect(1e-6 <= height <= 1e6, "height", "1e-6 to 1e6 m", height)
    expect(1 <= half_angle_deg <= 75, "half_angle_deg", "1 to 75", half_angle_deg)
    half_angle = math.radians(half_angle_deg)
    floor, receiver = Material("floor", (albedo,) * 3), Material("receiver", (albedo,) * 3)
    reach = 2 * height * max(math.tan(half_angle), 1.0)
    small = 0.3 * height
    geometry, materials = merge([
        rectangle((-reach, 0.0, reach), (2 * reach, 0.0, 0.0), (0.0, 0.0, -2 * reach), floor, "floor"),
        rectangle((-small, height, -small), (2 * small, 0.0, 0.0), (0.0, 0.0, 2 * small), receiver, "receiver"),
    ])
    camera = Camera((1.1 * height, 0.3 * height, 1.6 * height), (0.0, 0.62 * height, 0.0), vfov=math.radians(55),
                    width=640, height=480)
    light = SpotLight((0.0, height * (1 - GAP), 0.0), (0.0, -1.0, 0.0), half_angle, half_angle, (1.0, 1.0, 1.0))
    return Scene("parallel_plates", geometry, materials, camera, (light,),
                 "A small plate that sees nothing but the lit floor below it.", exposure=6.0)
