"""A square light behind a straight edge: the scene, receivers across the penumbra, and the ramp of V in closed form."""

import math

import numpy as np

from refgi.cluster.rectangle import AreaLights, map_frames
from refgi.cluster.settings import ValSettings
from refgi.scene import Camera, Geometry, Material, Scene, SpotLight
from refgi.settings import of

EDGE, RECEIVER = 1.0, 3.0  # distances of the edge and the receivers from the light, m
SETTINGS = of(ValSettings, depth_scale="scene", near_distance=0.5, maps_resolution=256)


def square(x, y, z, half_x, half_y):
    """Return corners of a rectangle at height z."""
    return [(x - half_x, y - half_y, z), (x + half_x, y - half_y, z), (x + half_x, y + half_y, z),
            (x - half_x, y + half_y, z)]


def scene(edge=0.0):
    """A plate with the light, one with an edge above it, and a ceiling of receivers."""
    vertices = [*square(0, 0, 0, 2, 2), *square(edge - 1.5, 0, EDGE, 1.5, 2.5), *square(0, 0, RECEIVER, 3, 3)]
    faces = [f for k in range(3) for f in ((4 * k, 4 * k + 1, 4 * k + 2), (4 * k, 4 * k + 2, 4 * k + 3))]
    geometry = Geometry(np.array(vertices, np.float64), np.array(faces, np.int32), np.zeros(6, np.int32))
    return Scene("edge", geometry, (Material("grey", (0.5, 0.5, 0.5)),), Camera((0, -9, 1), (0, 0, 1), up=(0, 0, 1)),
                 (SpotLight((0, 0, 2), (0, 0, -1), 0.3, 0.4, (1, 1, 1)),))


def square_light(delta):
    """Return one area light around the origin."""
    normal = np.array([[0.0], [0.0], [1.0]])
    frame = map_frames(normal)
    return AreaLights(np.zeros((3, 1)), normal, frame, np.full((2, 1), delta), frame[:, :2], np.zeros((2, 1)),
                      np.array([delta]), np.array([delta / math.sqrt(2)]), np.array([4]), np.zeros(4, np.int32))


def receivers(delta, edge=0.0, count=101):
    """Return points along x over twice the penumbra, which way they face, V in closed form and the penumbra's width."""
    width = delta * (RECEIVER - EDGE) / EDGE
    x = np.linspace(-width, width, count)
    points = np.stack([x + edge * RECEIVER / EDGE, np.zeros(count), np.full(count, RECEIVER)])
    facing = np.repeat([[0.0], [0.0], [-1.0]], count, axis=1)
    return points, facing, np.clip(0.5 + x / width, 0, 1), width


def width_of(x, v):
    """Return the width of a penumbra from where V is 0.1 and 0.9; of a ramp, all of it."""
    rising = np.maximum.accumulate(v)
    return (np.interp(0.9, rising, x) - np.interp(0.1, rising, x)) / 0.8
