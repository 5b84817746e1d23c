"""Pictures made of random numbers, of planes and of scenes that tests of the pyramids share."""

import math

import numpy as np

from refgi.rsm.raster.projection import camera_projection
from refgi.scene import Camera
from refgi.sssil.levels import levels

FLOAT32 = 1e-6  # a few roundings of float32
FLOAT64 = 1e-13


def camera(width, height, vfov=60.0):
    """A camera that looks along -z, its picture's left being -x."""
    return Camera((0, 0, 0), (0, 0, -1), vfov=math.radians(vfov), width=width, height=height)


def random_picture(width, height, seed=0, ties=True, behind=0.1):
    """Depths (some equal, some background), normals (a few that look away), albedo and direct light."""
    rng = np.random.default_rng(seed)
    depth = rng.uniform(1, 3, (height, width))
    if ties:
        depth = np.round(depth * 2) / 2
    depth[rng.random((height, width)) < behind] = np.inf
    normal = rng.normal(size=(3, height, width)) + np.array([0, 0, 3.0])[:, None, None]
    normal /= np.linalg.norm(normal, axis=0)
    albedo, direct = rng.random((2, 3, height, width))
    seen = depth < np.inf
    return depth, normal * seen, albedo * seen, direct * seen


def made(picture, view, first, count, mode="closest", dtype=np.float64, **options):
    """The levels of a picture that a camera takes."""
    return levels(*(plane.astype(dtype) for plane in picture), camera_projection(view), first, count, mode, **options)


def same(a, b):
    """Whether two levels are equal to the bit."""
    return all(np.array_equal(x, y) for x, y in zip(a[1:], b[1:], strict=True))
