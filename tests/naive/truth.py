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
        share = {"smoothstep": t * t * (3 - 2 * t), "squared_ramp": t * t, "ramp": t}[light.falloff]
        intensity = np.asarray(light.intensity) * share
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


def nearest_hits(vertices, faces, origins, directions):
    """Return triangles and distances of many rays' nearest hits, one triangle after another."""
    best, far = np.full(len(origins), -1), np.full(len(origins), math.inf)
    for k, (i, j, m) in enumerate(faces):
        e1, e2, s = vertices[j] - vertices[i], vertices[m] - vertices[i], origins - vertices[i]
        p, q = np.cross(directions, e2), np.cross(s, e1)
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = 1 / (p @ e1)
            u, v, t = (s * p).sum(1) * inverse, (directions * q).sum(1) * inverse, (q @ e2) * inverse
            nearer = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 1e-9) & (t < far)
        best[nearer], far[nearer] = k, t[nearer]
    return best, far


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
        face, far = nearest_hits(vertices, faces, np.broadcast_to(np.asarray(light.position), d.shape), d)
        hit = face >= 0
        d, power, y, face = d[hit], power[hit], (light.position + far[:, None] * d)[hit], face[hit]
        g, n = _normals(vertices, faces, vertex_normals, face, y, d)
        w = d - 2 * (d * n).sum(1)[:, None] * n
        leaves = ((w * g).sum(1) > 0) & ((w * n).sum(1) > 0)
        w, y, power = w[leaves], y[leaves], power[leaves]
        face, far = nearest_hits(vertices, faces, y, w)
        hit = face >= 0
        w, power, x, face = w[hit], power[hit], (y + far[:, None] * w)[hit], face[hit]
        g, _ = _normals(vertices, faces, None, face, x, w)
        view = camera.eye - x
        depth = -view @ ahead
        u, v = -(view @ right) / depth / half, -(view @ up) / depth / half
        seen = (depth > 0) & (np.abs(u) < 1) & (np.abs(v) < 1) & ((view * g).sum(1) > 0)
        _, blocked = nearest_hits(vertices, faces, x[seen], view[seen])
        seen[np.flatnonzero(seen)[blocked < 1]] = False
        row, column = (((1 - v[seen]) * side) // 2).astype(int), (((1 + u[seen]) * side) // 2).astype(int)
        seen[np.flatnonzero(seen)[~counted[row, column]]] = False
        square = (view[seen] ** 2).sum(1)
        solid_angle = (2 * half / side) ** 2 * (1 + half**2 * (u[seen] ** 2 + v[seen] ** 2)) ** -1.5
        cosine = (view[seen] * g[seen]).sum(1) / np.sqrt(square)
        irradiance = (power[seen] * cosine / (square * solid_angle)).sum() / counted.sum()
        means.append(irradiance * np.asarray(light.intensity))
    return np.mean(means, axis=0), np.std(means, axis=0, ddof=1) / math.sqrt(rounds)
