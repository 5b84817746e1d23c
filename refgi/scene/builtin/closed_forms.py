"""Scenes whose one-bounce light is known in closed form: the integrating sphere, the wedge, the parallel plates."""

import math

from refgi.errors import expect
from refgi.scene.builtin.surfaces import rectangle, sphere
from refgi.scene.model import Camera, DirectionalLight, Material, Scene, SpotLight, merge

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
