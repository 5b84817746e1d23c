"""The stage, a floor with three walls, what stands on it, and leaves that are cut out of quads by alpha.

The leaves' quads hang on a grid, each turned and tilted at random; most of a quad is hole. A spot shines through them
from above, so that light and shadow on the floor and the walls are those of leaves.
"""

import dataclasses
import math

import numpy as np

from refgi.errors import expect
from refgi.scene.builtin.surfaces import lathe, rectangle, ring_surface, sphere, walls
from refgi.scene.model import Camera, Material, Mesh, Scene, SpotLight, merge
from refgi.scene.repair import mean_face_normals
from refgi.scene.texture import Image, Texture
from refgi.types import Array

MOST_FACES = 50_000_000
GLAZE = Material("glaze", (0.65, 0.62, 0.58), (0.2, 0.2, 0.2), 40.0)
GLASS = Material("glass", (0.0, 0.0, 0.0), ior=1.5)
WOOD = Material("wood", (0.5, 0.32, 0.17))
METAL = Material("metal", (0.02, 0.02, 0.02), (0.92, 0.78, 0.42), 2000.0)

# Radius and height of the vase, m: up the outside, over the lip and down the inside to the bottom.
VASE = np.array([(0.0, 0.0), (0.055, 0.0), (0.058, 0.012), (0.045, 0.022), (0.075, 0.06), (0.098, 0.11),
                 (0.102, 0.15), (0.086, 0.2), (0.052, 0.24), (0.04, 0.265), (0.044, 0.29), (0.062, 0.31),
                 (0.066, 0.316), (0.06, 0.318), (0.038, 0.29), (0.034, 0.265), (0.046, 0.24), (0.08, 0.2),
                 (0.095, 0.15), (0.09, 0.11), (0.066, 0.06), (0.03, 0.03), (0.0, 0.028)])


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
    """Return a thin-walled vase standing on y = 0; watertight, with smooth outward normals."""
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


SMALLEST, LARGEST = 16, 4096  # texels along a side
MOST_LEAVES = 1_000_000
LOW, HIGH = np.array([-0.8, 0.55, -0.7]), np.array([0.8, 1.45, 0.7])  # of the leaves' middles, m
BITES = ((0.60, 0.36, 0.05), (0.40, 0.62, 0.06), (0.57, 0.74, 0.035))  # holes within a leaf: u, v, radius


def leaf_grid(leaves: int = 360, seed: int = 1, texels: int = 128) -> Scene:
    """Build a room with leaves.

    `leaves`: quads, 1 to a million. `seed`: of places and turns. `texels`: along a side of the picture, 16 to 4096.
    Result: 2 triangles a leaf and 8 of the room; 5 materials, two of them with the picture of a leaf and its alpha.
    """
    expect(1 <= leaves <= MOST_LEAVES, "leaves", f"1 to {MOST_LEAVES}", leaves)
    expect(SMALLEST <= texels <= LARGEST, "texels", f"{SMALLEST} to {LARGEST}", texels)
    white = Material("white", (0.72, 0.72, 0.72))
    walls = [
        rectangle((-1.0, 0.0, 1.0), (2.0, 0.0, 0.0), (0.0, 0.0, -2.0), white, "floor"),
        rectangle((-1.0, 0.0, -1.0), (2.0, 0.0, 0.0), (0.0, 2.0, 0.0), white, "back"),
        rectangle((-1.0, 0.0, 1.0), (0.0, 0.0, -2.0), (0.0, 2.0, 0.0), Material("warm", (0.63, 0.30, 0.16)), "left"),
        rectangle((1.0, 0.0, -1.0), (0.0, 0.0, 2.0), (0.0, 2.0, 0.0), Material("cool", (0.18, 0.32, 0.58)), "right"),
    ]
    picture = Texture(leaf(texels), ("clamp", "clamp"))
    kinds = [Material(name, colour, texture=picture, cutoff=0.5)
             for name, colour in (("green_leaf", (0.30, 0.62, 0.14)), ("dry_leaf", (0.72, 0.46, 0.12)))]
    corners, kind = _quads(leaves, seed)
    parts = [_mesh(corners[kind == k], material) for k, material in enumerate(kinds) if (kind == k).any()]
    geometry, materials = merge([*walls, *parts])
    camera = Camera((0.15, 1.0, 3.3), (0.0, 0.86, 0.0), vfov=math.radians(38))
    light = SpotLight((0.35, 2.6, 0.45), (-0.17, -1.0, -0.24), math.radians(28), math.radians(36), (26.0, 25.0, 23.0))
    return Scene("leaf_grid", geometry, materials, camera, (light,),
                 "Leaves cut out of quads by alpha, lit from above.")


def leaf(texels: int) -> Image:
    """Return the picture of a leaf on its stem, sRGB codes with alpha: its tip is at v = 0, its stem at v = 1."""
    place = (np.arange(texels) + 0.5) / texels
    v, u = np.meshgrid(place, place, indexing="ij")
    blade = np.clip((v - 0.04) / 0.80, 0.0, 1.0)
    width = 0.40 * np.sin(math.pi * blade**1.35) ** 0.85 * (1.0 + 0.06 * np.cos(math.pi * 26 * blade))
    across = np.abs(u - 0.5)
    inside = np.maximum(width - across, 0.022 - np.maximum(across, np.maximum(0.7 - v, v - 0.98)))
    for x, y, radius in BITES:
        inside = np.minimum(inside, np.hypot(u - x, v - y) - radius)
    alpha = np.clip(0.5 + inside * texels / 3, 0.0, 1.0)  # a ramp of three texels
    vein = np.minimum(across, np.abs(np.mod(9 * (v + across), 1.0) - 0.5) / 9)
    bright = 1.0 - 0.35 * np.exp(-((vein / 0.012) ** 2))
    grey = np.round(255 * bright).astype(np.uint8)
    return Image(np.repeat(grey[..., None], 3, axis=2), "leaf", np.round(255 * alpha).astype(np.uint8))


def _quads(count: int, seed: int) -> tuple[Array, Array]:
    """Return corners (n, 4, 3) of quads, tip first, row by row, and which kind each is, 0 or 1."""
    random = np.random.default_rng([seed, count])
    side = math.ceil(count ** (1 / 3))
    rows = max(1, math.ceil(count / side**2))
    cell = np.stack(np.unravel_index(np.arange(count), (side, rows, side)), axis=1)
    share = (cell + 0.5 + random.uniform(-0.35, 0.35, (count, 3))) / (side, rows, side)
    middle = LOW + share * (HIGH - LOW)
    turn, tilt = random.uniform(0.0, 2 * math.pi, count), random.uniform(-0.9, 0.9, count)
    size = np.cbrt(8 * np.prod(HIGH - LOW) / count) * random.uniform(0.17, 0.27, count)  # half a side, m
    along = np.stack([np.cos(turn) * np.cos(tilt), np.sin(tilt), np.sin(turn) * np.cos(tilt)], axis=1)
    across = np.stack([-np.sin(turn), np.zeros(count), np.cos(turn)], axis=1)
    roll = random.uniform(-0.6, 0.6, count)[:, None]
    across = np.cos(roll) * across + np.sin(roll) * np.cross(along, across)
    sides = [along - across, along + across, -along - across, across - along]
    return middle[:, None] + size[:, None, None] * np.stack(sides, axis=1), (random.random(count) < 0.25).astype(int)


def _mesh(corners: Array, material: Material) -> Mesh:
    faces = (4 * np.arange(len(corners))[:, None] + [0, 2, 3, 0, 3, 1]).reshape(-1, 3)
    uv = np.tile([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)], (len(corners), 1))[faces]
    return Mesh(corners.reshape(-1, 3), faces, material=material, name=material.name, uv=uv)
