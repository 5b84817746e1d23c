"""Slow independent estimator of the ground truth: flux that lamps send out, every ray against every triangle.

Written from docs/truth and docs/radiometry alone; it shares no random number, no ray and no weight with the project.
A ray that carries the flux dPhi lands at y; from there dPhi (rho / pi <n v> + lobe) goes on as intensity along v, and
gives every receiver x that sees y the irradiance <n_x w> / r^2 of it. For further bounces the flux goes on along a
direction of density <g v> / pi, by dPhi pi / <g v> times the same pattern.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.special import betainc

from refgi.scene import DirectionalLight, SpotLight
from tests.naive.crossings import LIFT, corners_of, crossings, face_normals, free

LEAST_ABOVE = 1e-12  # of a lobe: with less of it above the shading horizon it sends nothing


class Rules(NamedTuple):
    """What is asked of the truth."""

    visibility: bool = True
    visible: bool = False  # those points alone emit that the camera sees
    bounces: int = 1


class Vertices(NamedTuple):
    """Where rays of the lamps landed."""

    position: np.ndarray  # (m, 3) m
    triangle: np.ndarray  # (m,)
    toward: np.ndarray  # (m, 3) unit vectors to where the light comes from
    flux: np.ndarray  # (m, 3) W
    face: np.ndarray  # (m, 3) normals of the triangles, on the side that the light comes from
    normal: np.ndarray  # (m, 3) interpolated ones


def irradiance(scene, receivers, rules, side, random, view=None):
    """Return one estimate of E at receivers (position, normal, facing), (n, 3), by side x side rays of each lamp."""
    total = np.zeros((len(receivers[0]), 3))
    for lamp in scene.lights:
        vertices = landed(scene, *lamp_rays(lamp, scene, strata(side, random)))
        for bounce in range(rules.bounces):
            vertices = scattered(scene, vertices, random) if bounce else vertices
            shining = only(vertices, seen_by(view, scene, vertices)) if rules.visible else vertices
            total += received(scene, receivers, shining, rules.visibility)
    return total


def strata(side, random):
    """Return a place in each of side x side cells of the unit square, (2, m)."""
    return (np.stack(np.meshgrid(range(side), range(side))).reshape(2, -1) + random.random((2, side * side))) / side


def lamp_rays(lamp, scene, square):
    """Return origins, directions and the flux of rays that stand for all of a lamp's light."""
    turn, count = 2 * math.pi * square[1], square.shape[1]
    if isinstance(lamp, DirectionalLight):  # the disc that the scene's bounding sphere is
        middle = scene.geometry.vertices.mean(axis=0)
        radius = np.linalg.norm(scene.geometry.vertices - middle, axis=1).max()
        axis, across, other = axes(lamp.direction)
        out = radius * np.sqrt(square[0])[:, None]
        origin = middle - 2 * radius * axis + out * (np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * other)
        return origin, np.broadcast_to(axis, origin.shape), np.broadcast_to(
            np.asarray(lamp.irradiance) * math.pi * radius**2 / count, origin.shape)
    spot = isinstance(lamp, SpotLight)
    outer = math.cos(lamp.outer_half_angle) if spot else -1.0
    axis, across, other = axes(lamp.direction if spot else (0.0, 0.0, 1.0))
    z = 1 - square[0] * (1 - outer)
    flat = np.sqrt(1 - z * z)[:, None]
    direction = z[:, None] * axis + flat * (np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * other)
    flux = np.broadcast_to(np.asarray(lamp.intensity) * 2 * math.pi * (1 - outer) / count, direction.shape)
    if spot:
        t = np.clip((z - outer) / (math.cos(lamp.inner_half_angle) - outer), 0, 1)
        flux = flux * (t * t * (3 - 2 * t))[:, None]
    return np.broadcast_to(np.asarray(lamp.position, float), direction.shape), direction, flux


def axes(direction):
    """Return a unit vector and two that are square to it and each other."""
    axis = np.asarray(direction, float) / np.linalg.norm(direction)
    across = np.cross(axis, (0.3, 0.5, 0.8))
    across /= np.linalg.norm(across)
    return axis, across, np.cross(axis, across)


def landed(scene, origin, direction, flux):
    far = crossings(corners_of(scene.geometry), origin, direction)
    hit = np.isfinite(far.min(axis=1))
    triangle, far = far.argmin(axis=1)[hit], far.min(axis=1)[hit]
    y = origin[hit] + far[:, None] * direction[hit]
    face = face_normals(scene.geometry, triangle, -direction[hit])
    return Vertices(y, triangle, -direction[hit], flux[hit], face, shading_normals(scene.geometry, triangle, y, face))


def scattered(scene, vertices, random):
    """Send flux on from where it landed."""
    v = cosine_directions(vertices.face, *random.random((2, len(vertices.flux))))
    flux = vertices.flux * pattern(scene, vertices, v) * (math.pi / (vertices.face * v).sum(axis=1))[:, None]
    return landed(scene, vertices.position + LIFT * vertices.face, v, flux)


def cosine_directions(axis, u, v):
    """Return directions of density cos / pi around axes, sin^2 = u, turned by v."""
    across = np.cross(axis, np.where(np.abs(axis[:, :1]) < 0.7, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    x, y, z = np.sqrt(u) * np.cos(2 * math.pi * v), np.sqrt(u) * np.sin(2 * math.pi * v), np.sqrt(1 - u)
    return x[:, None] * across + y[:, None] * np.cross(axis, across) + z[:, None] * axis


def shading_normals(geometry, triangle, y, face):
    """Return the normals interpolated from the vertices, on the side of the faces' normals."""
    if geometry.vertex_normals is None:
        return face
    corners = corners_of(geometry)[triangle]
    share = np.stack([np.linalg.norm(np.cross(corners[:, (k + 1) % 3] - y, corners[:, (k + 2) % 3] - y), axis=1)
                      for k in range(3)], axis=1)
    n = (share[..., None] * geometry.vertex_normals[geometry.faces[triangle]]).sum(axis=1)
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    return n * np.where((n * face).sum(axis=1) < 0, -1.0, 1.0)[:, None]


def pattern(scene, vertices, v):
    """Return rho / pi <n v> + rho_s (P + 1) / (2 pi K) <r v>^P along v, above faces and shading horizons alone."""
    n, l = vertices.normal, vertices.toward  # noqa: E741
    cosine, lifted = (n * v).sum(axis=1), (n * l).sum(axis=1)
    mirror = 2 * lifted[:, None] * n - l
    above = (cosine > 0) & ((vertices.face * v).sum(axis=1) > 0)
    result = np.zeros((len(cosine), 3))
    for m, material in enumerate(scene.materials):
        of = np.flatnonzero(above & (scene.geometry.material_of_face[vertices.triangle] == m))
        if material.is_dielectric or not len(of):
            continue
        result[of] = cosine[of, None] / math.pi * np.asarray(material.diffuse)
        if any(material.specular):
            p = material.exponent
            share = share_above(lifted[of], p)
            lobe = np.maximum(0, (mirror * v).sum(axis=1)[of]) ** p * (p + 1) / (2 * math.pi)
            lobe = np.divide(lobe, share, out=np.zeros_like(lobe), where=share >= LEAST_ABOVE)
            result[of] += lobe[:, None] * np.asarray(material.specular)
    return result


def received(scene, receivers, vertices, visibility):
    """Return what receivers get of all vertices, (n, 3): every pair, receiver by receiver."""
    count = len(vertices.flux)
    position, normal, facing = (np.repeat(part, count, axis=0) for part in receivers[:3])
    each = Vertices(*(np.tile(part, (len(receivers[0]), *(1,) * (part.ndim - 1))) for part in vertices))
    toward = each.position - position
    r2 = (toward**2).sum(axis=1)
    w = toward / np.sqrt(r2)[:, None]
    counts = ((w * normal).sum(axis=1) > 0) & ((w * facing).sum(axis=1) > 0) & ((w * each.face).sum(axis=1) < 0)
    if visibility:
        starts, ends = position + LIFT * facing, each.position + LIFT * each.face
        counts[counts] = free(corners_of(scene.geometry), starts[counts], ends[counts])
    result = np.zeros((len(w), 3))
    intensity = each.flux[counts] * pattern(scene, only(each, counts), -w[counts])
    result[counts] = intensity * ((w * normal).sum(axis=1) / r2)[counts, None]
    return result.reshape(-1, count, 3).sum(axis=1)


def only(vertices, chosen):
    return Vertices(*(part[chosen] for part in vertices))


def seen_by(view, scene, vertices):
    """Tell which vertices a camera sees: inside its picture, on the side that faces it, nothing between."""
    away = vertices.position - view.origin[0]
    right, down, depth = view.frame[0] @ away.T
    inside = (depth > 0) & (np.abs(right) <= view.half[0] * depth) & (np.abs(down) <= view.half[1] * depth)
    inside &= (away * vertices.face).sum(axis=1) < 0
    starts = vertices.position + LIFT * vertices.face
    inside[inside] = free(corners_of(scene.geometry), starts[inside], view.origin[0])
    return inside


def share_above(cosine, exponent):
    """Return K(theta, P) = 1 - I_{sin^2 theta}((P + 1) / 2, 1 / 2) / 2, for theta > pi / 2 one less K(pi - theta)."""
    half = betainc((exponent + 1) / 2, 0.5, 1 - cosine * cosine) / 2
    return np.where(cosine >= 0, 1 - half, half)
