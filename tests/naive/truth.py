"""Slow twins of the ground truth: the series of bounces in a sphere, and light by one perfect mirror reflection."""

import math

import numpy as np

from tests.naive.crossings import nearest


def truncated_series(albedo, bounces):
    """Return rho + rho^2 + ... of as many terms: light of that many bounces in a sphere, over Phi0 / (4 pi R^2)."""
    return sum(albedo**k for k in range(1, bounces + 1))


def _normals(vertices, faces, vertex_normals, face, y, d):
    """Return face and interpolated unit normals against d."""
    a, b, c = (vertices[faces[face, k]] for k in range(3))
    cross = np.cross(b - a, c - a)
    g = cross / np.linalg.norm(cross, axis=1, keepdims=True)
    g *= np.where((g * d).sum(1) > 0, -1.0, 1.0)[:, None]
    if vertex_normals is None:
        return g, g
    shares = [np.linalg.norm(np.cross(p - y, q - y), axis=1)[:, None] for p, q in ((b, c), (c, a), (a, b))]
    n = sum(share * vertex_normals[faces[face, k]] for k, share in enumerate(shares))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    return g, n * np.where((n * g).sum(1) < 0, -1.0, 1.0)[:, None]


def mirror_mean(vertices, faces, vertex_normals, light, camera, counted, share, count, rounds=16):
    """Return the picture's mean irradiance (3,) from a spot by one perfect mirror reflection, and its standard error.

    Light is sent out at random, reflected, and counted where the camera sees it land: dPhi cos / (D^2 pixel's solid
    angle), over the pixels (side, side) that are counted.
    """
    random, means, side = np.random.default_rng(41), [], len(counted)
    corners = vertices[faces]
    axis = np.asarray(light.direction) / np.linalg.norm(light.direction)
    across = np.cross(axis, [0.3, 0.5, 0.8])
    across /= np.linalg.norm(across)
    other = np.cross(axis, across)
    ahead = np.subtract(camera.target, camera.eye) / np.linalg.norm(np.subtract(camera.target, camera.eye))
    right = np.cross(ahead, camera.up)
    right /= np.linalg.norm(right)
    up, half = np.cross(right, ahead), math.tan(camera.vfov / 2)
    cos_outer, cos_inner = math.cos(light.outer_half_angle), math.cos(light.inner_half_angle)
    for _ in range(rounds):
        z, turn = 1 - random.random(count // rounds) * (1 - cos_outer), 2 * math.pi * random.random(count // rounds)
        sine = np.sqrt(1 - z * z)
        d = z[:, None] * axis + (sine * np.cos(turn))[:, None] * across + (sine * np.sin(turn))[:, None] * other
        t = np.clip((z - cos_outer) / (cos_inner - cos_outer), 0, 1)
        power = t * t * (3 - 2 * t) * 2 * math.pi * (1 - cos_outer) / len(z) * share
        face, far = nearest(corners, np.broadcast_to(np.asarray(light.position), d.shape), d)
        hit = face >= 0
        d, power, y, face = d[hit], power[hit], (light.position + far[:, None] * d)[hit], face[hit]
        g, n = _normals(vertices, faces, vertex_normals, face, y, d)
        w = d - 2 * (d * n).sum(1)[:, None] * n
        leaves = ((w * g).sum(1) > 0) & ((w * n).sum(1) > 0)
        w, y, power = w[leaves], y[leaves], power[leaves]
        face, far = nearest(corners, y + 1e-9 * w, w)
        hit = face >= 0
        w, power, x, face = w[hit], power[hit], (y + far[:, None] * w)[hit], face[hit]
        g, _ = _normals(vertices, faces, None, face, x, w)
        view = camera.eye - x
        depth = -view @ ahead
        u, v = -(view @ right) / depth / half, -(view @ up) / depth / half
        seen = (depth > 0) & (np.abs(u) < 1) & (np.abs(v) < 1) & ((view * g).sum(1) > 0)
        _, blocked = nearest(corners, x[seen] + 1e-9 * view[seen], view[seen])
        seen[np.flatnonzero(seen)[blocked < 1]] = False
        row, column = (((1 - v[seen]) * side) // 2).astype(int), (((1 + u[seen]) * side) // 2).astype(int)
        seen[np.flatnonzero(seen)[~counted[row, column]]] = False
        square = (view[seen] ** 2).sum(1)
        solid_angle = (2 * half / side) ** 2 * (1 + half**2 * (u[seen] ** 2 + v[seen] ** 2)) ** -1.5
        cosine = (view[seen] * g[seen]).sum(1) / np.sqrt(square)
        irradiance = (power[seen] * cosine / (square * solid_angle)).sum() / counted.sum()
        means.append(irradiance * np.asarray(light.intensity))
    return np.mean(means, axis=0), np.std(means, axis=0, ddof=1) / math.sqrt(rounds)
