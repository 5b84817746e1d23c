"""Coarse closed meshes with vertex normals, where those and the faces' differ by tens of degrees."""

import numpy as np

from refgi.scene.builtin.surfaces import Balls, blob
from refgi.scene.mesh import Mesh
from refgi.scene.model import Camera, Material, Scene, SpotLight, merge
from tests.rsm.shapes import sphere

CLAY = Material("clay", (0.6, 0.55, 0.5))
FLOOR = Mesh(np.array([[-3, 0, -3], [3, 0, -3], [3, 0, 3], [-3, 0, 3]], float), np.array([[0, 2, 1], [0, 3, 2]]),
             material=Material("floor", (0.7, 0.7, 0.7)), name="floor")
LAMP = SpotLight((-1.6, 2.6, 1.7), (1.6, -2.0, -1.7), 0.4, 0.6, (20.0, 19.0, 18.0))
CAMERA = Camera((1.0, 1.6, 3.0), (0.0, 0.55, 0.0), vfov=0.7, width=160, height=160)


def icosahedron(radius=0.6, middle=(0.0, 0.7, 0.0)):
    """20 faces, 37 degrees between a face and the normals of its corners."""
    g = (1 + 5**0.5) / 2
    corners = np.array([(0, a, b) for a in (-1, 1) for b in (-g, g)])
    corners = np.concatenate([np.roll(corners, k, axis=1) for k in range(3)])
    near = np.linalg.norm(corners[:, None] - corners, axis=2) < 2.1
    faces = [(i, j, k) for i in range(12) for j in range(i) for k in range(j)
             if near[i, j] and near[j, k] and near[i, k]]
    faces = [face if np.linalg.det(corners[list(face)]) > 0 else face[::-1] for face in faces]
    normals = corners / np.linalg.norm(corners, axis=1, keepdims=True)
    return Mesh(radius * normals + middle, np.array(faces), normals, CLAY, "icosahedron")


def cylinder(sides=12, radius=0.45, low=0.2, high=1.2):
    """A closed cylinder whose rim shares its normals between side and cap."""
    angle = 2 * np.pi * np.arange(sides) / sides
    ring, up = np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1), np.array([0.0, 1.0, 0.0])
    normals = np.concatenate([ring - up, ring + up, [-up, up]])
    vertices = np.concatenate([radius * ring + low * up, radius * ring + high * up, [low * up, high * up]])
    faces = []
    for i in range(sides):
        j = (i + 1) % sides
        faces += [(i, sides + i, j), (j, sides + i, sides + j)]
        faces += [(2 * sides, i, j), (2 * sides + 1, sides + j, sides + i)]
    return Mesh(vertices, np.array(faces), normals / np.linalg.norm(normals, axis=1, keepdims=True), CLAY, "cylinder")


def head():
    """A low-poly head of metaballs, with ears and a nose: creases and all."""
    centers = [[0, 0.24, -0.02], [-0.11, 0.3, -0.02], [0.11, 0.3, -0.02], [0, 0.22, 0.08], [0, 0.16, 0.02]]
    balls = Balls(np.array(centers), np.array([0.085, 0.045, 0.045, 0.04, 0.05]))
    made = blob(balls, 9)
    return Mesh(4 * made.vertices - (0, 0.3, 0), made.faces, made.normals, CLAY, "head")


def ball():
    """A sphere of 48 faces."""
    made = sphere(4, 0.6, (0, 0.7, 0))
    return Mesh(made.vertices, made.faces, made.vertex_normals, CLAY, "ball")


SHAPES = {"icosahedron": icosahedron, "cylinder": cylinder, "head": head, "ball": ball}
CONVEX = "icosahedron", "cylinder", "ball"


def scene(name, floor=True, smooth=True, camera=CAMERA, lights=(LAMP,)):
    """Return one of the shapes, over a floor or alone."""
    geometry, materials = merge([SHAPES[name](), *([FLOOR] if floor else [])], smooth=smooth)
    return Scene(name, geometry, materials, camera, lights)
