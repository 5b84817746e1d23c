"""The stage, a floor with three walls, and what stands on it: a glossy vase, a glass ball, a ring on a plate."""

import dataclasses
import math

import numpy as np

from refgi.errors import expect
from refgi.scene.builtin.surfaces import lathe, rectangle, ring_surface, sphere
from refgi.scene.model import Array, Camera, Material, Mesh, Scene, SpotLight, merge
from refgi.scene.repair import mean_face_normals

MOST_FACES = 50_000_000
FLOOR = Material("stage_floor", (0.75, 0.73, 0.7))
BACK = Material("stage_back", (0.7, 0.66, 0.58))
LEFT = Material("stage_left", (0.62, 0.12, 0.08))
RIGHT = Material("stage_right", (0.1, 0.25, 0.6))
GLAZE = Material("glaze", (0.65, 0.62, 0.58), (0.2, 0.2, 0.2), 40.0)
GLASS = Material("glass", (0.0, 0.0, 0.0), ior=1.5)
WOOD = Material("wood", (0.5, 0.32, 0.17))
METAL = Material("metal", (0.02, 0.02, 0.02), (0.92, 0.78, 0.42), 2000.0)

# Radius and height of the vase, m: up the outside, over the lip and down the inside to the bottom.
VASE = np.array([(0.0, 0.0), (0.055, 0.0), (0.058, 0.012), (0.045, 0.022), (0.075, 0.06), (0.098, 0.11),
                 (0.102, 0.15), (0.086, 0.2), (0.052, 0.24), (0.04, 0.265), (0.044, 0.29), (0.062, 0.31),
                 (0.066, 0.316), (0.06, 0.318), (0.038, 0.29), (0.034, 0.265), (0.046, 0.24), (0.08, 0.2),
                 (0.095, 0.15), (0.09, 0.11), (0.066, 0.06), (0.03, 0.03), (0.0, 0.028)])


def walls() -> list[Mesh]:
    """Return the stage's floor and walls.

    Result: eight faces, 1.2 x 0.7 x 1.0 m, open in front and above; normals point inside.
    """
    return [rectangle((-0.6, 0.0, 0.6), (1.2, 0.0, 0.0), (0.0, 0.0, -1.0), FLOOR, "floor"),
            rectangle((-0.6, 0.0, -0.4), (1.2, 0.0, 0.0), (0.0, 0.7, 0.0), BACK, "back"),
            rectangle((-0.6, 0.0, 0.6), (0.0, 0.0, -1.0), (0.0, 0.7, 0.0), LEFT, "left"),
            rectangle((0.6, 0.0, -0.4), (0.0, 0.0, 1.0), (0.0, 0.7, 0.0), RIGHT, "right")]


def stage(faces: int = 6_328) -> Scene:
    """Build the stage with a slightly glossy vase.

    `faces`: triangles in all, 100 to 50 million. Result: about that many faces, 5 materials, one of them with a Phong
    lobe.
    """
    expect(100 <= faces <= MOST_FACES, "faces", f"100 to {MOST_FACES}", faces)
    camera = Camera((0.1, 0.42, 1.15), (0.0, 0.13, 0.0), vfov=math.radians(30), width=640, height=480)
    light = _spot((0.15, 1.05, 0.55), (-0.387181, -0.730531, -0.562509), 18, 24, (2.2, 2.1, 1.95))
    geometry, materials = merge([*walls(), vase(faces - 8)], smooth=True)
    return Scene("stage", geometry, materials, camera, (light,), "A slightly glossy vase on a stage with three walls.",
                 exposure=1.2)


def vase(faces: int) -> Mesh:
    """Return a thin-walled vase standing on y = 0.

    Result: watertight, with smooth outward normals.
    """
    rows = max(8, round(math.sqrt(faces / 2)))
    columns = max(3, round(faces / (2 * (rows - 1))))
    turned = lathe(_smoothed(VASE, rows + 1), columns, GLAZE, "vase")
    return dataclasses.replace(turned, normals=mean_face_normals(turned.vertices, turned.faces))


def glass_ball(faces: int = 20_488) -> Scene:
    """Build a clear glass ball over the stage's floor, with its caustic in its shadow.

    `faces`: triangles in all, 100 to 50 million. Result: about that many faces, 5 materials, one of them a dielectric.
    """
    expect(100 <= faces <= MOST_FACES, "faces", f"100 to {MOST_FACES}", faces)
    camera = Camera((0.05, 0.36, 1.15), (0.0, 0.12, 0.0), vfov=math.radians(30), width=640, height=480)
    light = _spot((0.35, 0.95, 0.35), (-0.396176, -0.841873, -0.366462), 12, 17, (2.0, 1.95, 1.85))
    ball = sphere((0.02, 0.2, 0.05), 0.12, faces - 8, GLASS, "ball")
    geometry, materials = merge([*walls(), ball], smooth=True)
    return Scene("glass_ball", geometry, materials, camera, (light,),
                 "A clear glass ball; the light it gathers falls inside its shadow.", exposure=1.2)


def ring(faces: int = 20_482) -> Scene:
    """Build a polished metal ring on a wooden plate, with a caustic inside the ring.

    `faces`: triangles in all, 100 to 50 million. Result: about that many faces, 2 materials, one of them a near mirror.
    """
    expect(100 <= faces <= MOST_FACES, "faces", f"100 to {MOST_FACES}", faces)
    columns = max(4, round(math.sqrt(faces / 5)))
    rows = max(5, round((faces - 2) / (2 * columns)))
    plate = rectangle((-0.4, 0.0, 0.4), (0.8, 0.0, 0.0), (0.0, 0.0, -0.8), WOOD, "plate")
    band = ring_surface(0.1, (0.006, 0.022), rows, columns, METAL, "ring")
    camera = Camera((0.0, 0.36, 0.36), (0.0, 0.005, 0.0), vfov=math.radians(36), width=640, height=480)
    light = _spot((-0.45, 0.38, -0.2), (0.730573, -0.600694, 0.324699), 12, 17, (1.3, 1.3, 1.3))
    geometry, materials = merge([plate, band], smooth=True)
    return Scene("ring", geometry, materials, camera, (light,),
                 "A polished metal ring; a nephroid caustic falls inside it. Diffuse bounces carry almost nothing.",
                 exposure=1.6)


def _spot(position: tuple[float, float, float], direction: tuple[float, float, float], inner_deg: float,
          outer_deg: float, intensity: tuple[float, float, float]) -> SpotLight:
    return SpotLight(position, direction, math.radians(inner_deg), math.radians(outer_deg), intensity)


def _smoothed(profile: Array, rows: int) -> Array:
    """Return `rows` points along a profile's Catmull-Rom curve, ends kept."""
    padded = np.concatenate([2 * profile[:1] - profile[1:2], profile, 2 * profile[-1:] - profile[-2:-1]])
    along = np.linspace(0.0, len(profile) - 1.0, rows)
    piece = np.minimum(along.astype(np.int64), len(profile) - 2)
    t = (along - piece)[:, None]
    a, b, c, d = (padded[piece + k] for k in range(4))
    curve = 0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3)
    return np.asarray(np.maximum(curve, 0.0))
