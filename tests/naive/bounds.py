"""Slow literal twins of range and bounds: membership pair by pair, the appendix's curves by definition, and a bound
drawn as a mesh, by rays of pixels against an ellipsoid's triangles.
"""

import math

import numpy as np

from refgi.literal.pairs import pair
from refgi.literal.sii import ellipsoids
from tests.naive import raster


def peak(flux, norm=1 / math.pi):
    """I_0 of an RGB light: its largest channel times the peak of a lobe of unit flux."""
    return float(np.max(flux)) * norm


def counts(x, p, axis, exponent, intensity, low):
    """Inside iff I_0 <cos alpha>^n >= I_low r^2 (procedure P3)."""
    d = x - p
    r = float(np.linalg.norm(d))
    cosine = max(0.0, float(axis @ d) / r) if r > 0 else 0.0
    return cosine > 0 and intensity * cosine**exponent >= low * r**2


def irradiance(position, normal, lights, low, term=pair):
    """Sum the diffuse pairs inside the range, and those outside; also count those inside at each receiver."""
    inside, outside = (np.zeros((3, position.shape[1])) for _ in range(2))
    overdraw = np.zeros(position.shape[1], int)
    for i in range(position.shape[1]):
        for k in range(lights.position.shape[1]):
            p, n, flux = lights.position[:, k], lights.normal[:, k], lights.flux[:, k]
            value = term(position[:, i], normal[:, i], p, n, flux)
            if counts(position[:, i], p, n, 1, peak(flux), low):
                inside[:, i] += value
                overdraw[i] += 1
            else:
                outside[:, i] += value
    return inside, outside, overdraw


def widened_region(r, cosine, exponent, widening):
    """Tell whether I(w) >= r^2 for a lobe of exponent P min(1, r / a), lengths in R_0, no new norm."""
    return (cosine > 0) & (np.maximum(cosine, 0.0) ** (exponent * np.minimum(1, r / widening)) >= r**2)


def captured_share(distance, radius, exponent):
    """Return the share of a light's flux that a plane across its axis receives from within the range.

    By the midpoint rule over the polar angle: flux goes as (n + 1) cos^n, and the plane lies at r = D / cos.
    """
    cosine = (np.arange(100_000) + 0.5) / 100_000
    kept = cosine**exponent * radius**2 >= (distance / cosine) ** 2
    return float(((exponent + 1) * cosine**exponent * kept).mean())


def drawn(frame, settings, lights, part, squares):
    """Return at which covered pixels the line of sight meets the mesh of each light's part (N, n), R_0^2 (N,)."""
    position = lights.position - settings.pairs.offset * lights.normal
    axis = lights.lobe_axis if part else lights.normal
    exponents = lights.lobe_exponent if part else np.ones(len(squares))
    flux = lights.lobe_flux if part else lights.flux
    found = np.zeros((len(squares), np.count_nonzero(frame.gbuffer.covered)), bool)
    widening = settings.pairs.lobe.widening if part else 0.0
    printed = "sii_widening" in settings.pairs.as_published  # the exponent falls without end; else it is P from a on
    for k in np.flatnonzero(flux.any(axis=0)):
        radius = math.sqrt(squares[k])
        ball = (radius if printed else min(widening, radius)) if widening else 0.0
        count = settings.reach.bound.faces
        found[k] = np.any([met(frame, body, np.arange(3 * count).reshape(-1, 3)) for body in bodies(
            position[:, k], axis[:, k], float(exponents[k]), radius, ball, count)], axis=0)
    return found


def bodies(position, axis, exponent, radius, ball, count):
    """Return the meshes of a light's ellipsoid and of its ball, if any, as corners of triangles (3 count, 3), m."""
    vertices = sphere_mesh(count)
    center, half_width, height = (part[0] for part in ellipsoids(np.array([exponent]))[:3])
    along = np.outer(vertices @ axis, axis)
    solid = position + radius * (center * axis + half_width * along + height * (vertices - along))
    return [solid, position + ball * vertices] if ball else [solid]


def met(frame, vertices, faces):
    """Return at which covered pixels the ray through the pixel's centre meets any triangle."""
    camera, (height, width) = frame.scene.camera, frame.gbuffer.covered.shape
    view = raster.look(np.subtract(camera.target, camera.eye), camera.up)
    half = math.tan(camera.vfov / 2) * np.array([width / height, 1.0])
    rays = (raster.perspective_ray(camera.eye, view, half, height, width, row, column)
            for row, column in np.argwhere(frame.gbuffer.covered))
    return np.array([raster.nearest(*ray, vertices, faces)[0] >= 0 for ray in rays])


def sphere_mesh(count):
    """Return corners (3 count, 3) of the octahedron of 8 faces or the icosahedron of 20, each cut in four until enough.
    """
    if count == 8:
        corners = np.concatenate([np.eye(3), -np.eye(3)])
        return corners[[(a, b, c) for a in (0, 3) for b in (1, 4) for c in (2, 5)]].reshape(-1, 3)
    golden = (1 + math.sqrt(5)) / 2
    corners = [np.roll((0, s, t * golden), turn) for turn in range(3) for s in (-1, 1) for t in (-1, 1)]
    triangles = [(p, q, r) for i, p in enumerate(corners) for j, q in enumerate(corners[:i]) for r in corners[:j]
                 if all(abs(np.linalg.norm(u - v) - 2) < 1e-9 for u, v in ((p, q), (q, r), (r, p)))]
    triangles = [tuple(raster.unit(corner) for corner in triangle) for triangle in triangles]
    while len(triangles) < count:
        triangles = [four for triangle in triangles for four in cut_in_four(*triangle)]
    return np.array(triangles).reshape(-1, 3)


def cut_in_four(p, q, r):
    """Cut a triangle at the middles of its edges, moved out to the ball."""
    pq, qr, rp = raster.unit(p + q), raster.unit(q + r), raster.unit(r + p)
    return (p, pq, rp), (pq, q, qr), (rp, qr, r), (pq, qr, rp)
