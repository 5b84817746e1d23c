"""Small scenes made by hand, and receivers without a camera."""

import contextlib
from unittest import mock

import numpy as np

from refgi.rays import Tracer
from refgi.scene import Camera, Material, Mesh, Scene, SpotLight, merge
from refgi.truth import TruthSettings
from refgi.truth.lobe_cells import lobe_cells
from refgi.truth.truth import accumulate

CAMERA = Camera((0.0, 0.0, 9.0), (0.0, 0.0, 0.0))
WHITE = Material("white", (0.6, 0.6, 0.6))
FEW_RAYS = {"light_grid": 12, "interleave": 3}  # of lights in a pass: where receivers are few these take most time


@contextlib.contextmanager
def cells_kept():
    """Cut the lights of a scene into cells once for many runs: these depend on no seed, and take most of a short run.
    """
    kept = {}

    def cells(scene, tracer, surfaces, lights):
        key = id(scene), id(tracer), surfaces.specular.tobytes()  # 0 for lobes left to photons
        if key not in kept:
            kept[key] = scene, tracer, lobe_cells(scene, tracer, surfaces, lights)
        return kept[key][2]

    with mock.patch("refgi.truth.cell_pass.lobe_cells", cells):
        yield


def rectangle(corner, along, across, material=WHITE):
    corner, along, across = (np.asarray(v, float) for v in (corner, along, across))
    return Mesh(np.stack([corner, corner + along, corner + along + across, corner + across]),
                np.array([[0, 1, 2], [0, 2, 3]]), None, material)


def scene(meshes, *lights, smooth=False):
    geometry, materials = merge(meshes, smooth=smooth)
    return Scene("by hand", geometry, materials, CAMERA, lights)


def floor(half=50.0, material=WHITE):
    return rectangle((-half, 0, half), (2 * half, 0, 0), (0, 0, -2 * half), material)


def spot_down(height=1.0, half_angle=0.7, intensity=(1.0, 2.0, 0.5)):
    return SpotLight((0.0, height, 0.0), (0.0, -1.0, 0.0), half_angle, half_angle, intensity)


def at(scene, points, normals, settings=None, *, triangle=0, repeat=1):
    """Return the truth at points in the open: each `repeat` times; faces are only used for the side of a start."""
    position = np.repeat(np.asarray(points, float).T.reshape(3, -1, 1), repeat, axis=2)
    normal = np.repeat(np.asarray(normals, float).T.reshape(3, -1, 1), repeat, axis=2)
    ids = np.full(position.shape[1:], triangle, np.int32)
    return accumulate(scene, Tracer(scene.geometry), position, normal, ids, settings or TruthSettings())


def corner_room(*lights, material=None, blocker=True):
    """A floor and two walls that meet in a corner, with a plate that casts soft indirect shadows."""
    red, green = Material("red", (0.7, 0.1, 0.1)), Material("green", (0.1, 0.6, 0.2))
    meshes = [
        rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2), material or WHITE),
        rectangle((-1, 0, -1), (2, 0, 0), (0, 2, 0), red),
        rectangle((-1, 0, 1), (0, 0, -2), (0, 2, 0), green),
    ]
    if blocker:
        meshes.append(rectangle((-0.4, 0.5, -0.1), (0.6, 0, 0), (0, 0, -0.5)))
    return scene(meshes, *lights)


def receivers_in_corner(count=8):
    """Points of floor and walls, half of them near edges: position, normal (n, 3) and triangles (n,)."""
    random = np.random.default_rng(12)
    u, v = random.uniform(0.02, 1.9, count), random.uniform(0.02, 1.9, count)
    u[::2] *= 0.05
    points, normals, triangles = [], [], []
    for k in range(count):
        wall = k % 3
        points.append(((u[k] - 1, 0, v[k] - 1), (v[k] - 1, u[k], -1), (-1, u[k], v[k] - 1))[wall])
        normals.append(((0, 1, 0), (0, 0, 1), (1, 0, 0))[wall])
        triangles.append(2 * wall)
    return np.array(points, float), np.array(normals, float), np.array(triangles)
