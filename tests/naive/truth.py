"""Slow twins of the ground truth: one ray against every triangle, and one-bounce light by a plain sum over the cone.

Written from the radiometry's text alone: a light of intensity I sends I dOmega through a cell of directions; where
that lands, albedo I dOmega / pi <n.w> goes on as intensity.
"""

import math

import numpy as np


def nearest_hit(vertices, faces, origin, direction):
    """Return (triangle, distance) of the nearest hit, by Cramer's rule for each triangle; (-1, inf) for none."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    e1, e2, s = b - a, c - a, origin - a
    with np.errstate(divide="ignore", invalid="ignore"):
        volume = -np.einsum("ij,ij->i", np.cross(e1, e2), np.broadcast_to(direction, e1.shape))
        t = np.einsum("ij,ij->i", np.cross(e1, e2), s) / volume
        u = np.einsum("ij,ij->i", np.cross(s, e2), np.broadcast_to(direction, e1.shape)) / -volume
        v = np.einsum("ij,ij->i", np.cross(e1, s), np.broadcast_to(direction, e1.shape)) / -volume
    hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 1e-9) & np.isfinite(t)
    if not hit.any():
        return -1, math.inf
    best = int(np.argmin(np.where(hit, t, math.inf)))
    return best, float(t[best])


def one_bounce(vertices, faces, albedo_of_face, light, x, n_x, cells, blocked=True):
    """Return E at x by the midpoint rule over a spot's cone: cells in 1 - cos(angle) and in the turn about the axis."""
    axis = np.asarray(light.direction) / np.linalg.norm(light.direction)
    across = np.cross(axis, [0.3, 0.5, 0.8])
    across /= np.linalg.norm(across)
    other = np.cross(axis, across)
    cos_outer, cos_inner = math.cos(light.outer_half_angle), math.cos(light.inner_half_angle)
    measure = 2 * math.pi * (1 - cos_outer) / (cells * cells)
    total = np.zeros(3)
    for i in range(cells):
        cos_angle = 1 - (i + 0.5) / cells * (1 - cos_outer)
        sin_angle = math.sqrt(1 - cos_angle**2)
        t = min(1.0, max(0.0, (cos_angle - cos_outer) / (cos_inner - cos_outer))) if cos_inner > cos_outer else 1.0
        intensity = np.asarray(light.intensity) * t * t * (3 - 2 * t)
        for j in range(cells):
            turn = 2 * math.pi * (j + 0.5) / cells
            d = cos_angle * axis + sin_angle * (math.cos(turn) * across + math.sin(turn) * other)
            face, far = nearest_hit(vertices, faces, np.asarray(light.position), d)
            if face < 0:
                continue
            y = light.position + far * d
            n_y = np.cross(vertices[faces[face, 1]] - vertices[faces[face, 0]],
                           vertices[faces[face, 2]] - vertices[faces[face, 0]])
            n_y /= np.linalg.norm(n_y)
            n_y = -n_y if n_y @ d > 0 else n_y
            w = y - x
            r2 = w @ w
            cos_x, cos_y = n_x @ w / math.sqrt(r2), -n_y @ w / math.sqrt(r2)
            if cos_x <= 0 or cos_y <= 0:
                continue
            if blocked and nearest_hit(vertices, faces, x + 1e-7 * n_x, w)[1] < 1 - 1e-6:
                continue
            total += albedo_of_face[face] * intensity * measure / math.pi * cos_x * cos_y / r2
    return total


def truncated_series(albedo, bounces):
    """Return rho + rho^2 + ... of as many terms: light of that many bounces in a sphere, over Phi0 / (4 pi R^2)."""
    return sum(albedo**k for k in range(1, bounces + 1))
