"""Geometry for the rasterizer's tests."""

import numpy as np

from refgi.scene import Geometry


def geometry(vertices, faces, normals=None, materials=None):
    faces = np.ascontiguousarray(faces, np.int32).reshape(-1, 3)
    of_face = np.zeros(len(faces), np.int32) if materials is None else np.asarray(materials, np.int32)
    return Geometry(np.ascontiguousarray(vertices, np.float64).reshape(-1, 3), faces, of_face, normals)


def soup(rng, count, spread=1.0, size=0.5):
    """Unconnected random triangles around the origin."""
    centres = rng.uniform(-spread, spread, (count, 1, 3))
    return geometry(centres + rng.normal(0, size, (count, 3, 3)), np.arange(3 * count))


def sphere(rings=12, radius=1.0, centre=(0, 0, 0)):
    """A closed sphere with its poles, and exact normals."""
    theta = np.linspace(0, np.pi, rings + 1)[1:-1, None]
    phi = 2 * np.pi * np.arange(2 * rings) / (2 * rings)
    body = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta) + 0 * phi, np.sin(theta) * np.sin(phi)], axis=-1)
    normals = np.concatenate([[[0, 1, 0]], body.reshape(-1, 3), [[0, -1, 0]]])
    around, last = 2 * rings, len(normals) - 1
    faces = []
    for j in range(around):
        k = (j + 1) % around
        faces.append([0, 1 + k, 1 + j])
        faces.append([last, last - around + j, last - around + k])
        for i in range(rings - 2):
            a, b, c, d = 1 + i * around + j, 1 + i * around + k, 1 + (i + 1) * around + j, 1 + (i + 1) * around + k
            faces += [[a, b, c], [b, d, c]]
    return geometry(radius * normals + centre, faces, normals)


def sheet(n, rng=None, jitter=0.0):
    """[-1, 1]^2 in the plane z = 0 as n x n cells, inner vertices moved at random, diagonals at random."""
    u = np.linspace(-1, 1, n + 1)
    x, y = np.meshgrid(u, u)
    vertices = np.stack([x, y, 0 * x], axis=-1)
    if rng is not None:
        vertices[1:-1, 1:-1, :2] += rng.uniform(-jitter, jitter, (n - 1, n - 1, 2)) / n
    faces = []
    for i in range(n):
        for j in range(n):
            a, b = i * (n + 1) + j, i * (n + 1) + j + 1
            c, d = a + n + 1, b + n + 1
            flip = rng is not None and rng.random() < 0.5
            faces += [[a, b, c], [b, d, c]] if flip else [[a, b, d], [a, d, c]]
    return geometry(vertices, faces)


def rotation(rng):
    q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return q if np.linalg.det(q) > 0 else -q


def height_field(faces, seed=0):
    """A rough sheet over [-1, 1]^2, about so many faces."""
    n = max(int(np.sqrt(faces / 2)), 1)
    u = np.linspace(-1, 1, n + 1)
    x, z = np.meshgrid(u, u)
    y = 0.15 * np.sin(7 * x + seed) * np.cos(9 * z) + 0.05 * np.sin(31 * x * z)
    corner = np.arange(n * (n + 1)).reshape(n, n + 1)[:, :-1].ravel()
    pairs = np.stack([corner, corner + 1, corner + n + 1, corner + 1, corner + n + 2, corner + n + 1], axis=1)
    return geometry(np.stack([x, y, z], axis=-1), pairs)
