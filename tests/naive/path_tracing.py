"""Slow independent estimator of the ground truth: hemisphere sampling in NumPy, every ray against every triangle.

Written from docs/truth and docs/radiometry alone. It shares no random number, no ray and no weight with the project: a
direction of density cos / pi that finds the radiance L contributes pi L.
"""

import math
from typing import NamedTuple

import numpy as np

from refgi.scene import DirectionalLight, SpotLight
from tests.naive.crossings import LIFT, corners_of, crossings, face_normals, free
from tests.naive.light_sum import share_above

LEAST_ABOVE = 1e-12  # of a lobe: with less of it above the shading horizon it sends nothing
FAR = 100.0  # m: beyond every surface, towards a directional light


class Rules(NamedTuple):
    """What is asked of the truth."""

    visibility: bool = True
    visible: bool = False  # those points alone emit that the camera sees
    bounces: int = 1


class World(NamedTuple):
    """What there is: a scene, its camera's projection and what is asked."""

    scene: object
    view: object
    rules: Rules


def irradiance(scene, receivers, rules, side, random, view=None):
    """Return one estimate of E at receivers (position, normal, facing), (n, 3), by side x side strata of directions."""
    world = World(scene, view, rules)
    position, normal, facing = receivers
    strata = np.stack(np.meshgrid(range(side), range(side))).reshape(2, -1, 1)
    u, v = (strata + random.random((2, side**2, len(normal)))) / side
    total = np.zeros((len(normal), 3))
    for k in range(side**2):
        w = cosine_direction(normal, u[k], v[k])
        above = np.flatnonzero((w * facing).sum(axis=1) > 0)
        start = position[above] + LIFT * facing[above]
        total[above] += math.pi / side**2 * arriving(world, start, w[above], random)
    return total


def cosine_direction(axis, u, v):
    """Return directions of density cos / pi around axes, sin^2 = u, turned by v."""
    across = np.cross(axis, np.where(np.abs(axis[:, :1]) < 0.7, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    x, y, z = np.sqrt(u) * np.cos(2 * math.pi * v), np.sqrt(u) * np.sin(2 * math.pi * v), np.sqrt(1 - u)
    return x[:, None] * across + y[:, None] * np.cross(axis, across) + z[:, None] * axis


def arriving(world, start, w, random):
    """Return the radiance that arrives along -w, (n, 3): from the nearest surface, without visibility from all."""
    far = crossings(corners_of(world.scene.geometry), start, w)
    if world.rules.visibility:
        nearest = far.argmin(axis=1)
        ray = np.flatnonzero(np.isfinite(far.min(axis=1)))
        triangle = nearest[ray]
    else:
        ray, triangle = np.nonzero(np.isfinite(far))
    y = start[ray] + far[ray, triangle][:, None] * w[ray]
    radiance = leaving(world, y, triangle, -w[ray], random)
    result = np.zeros((len(start), 3))
    np.add.at(result, ray, radiance)
    return result


def leaving(world, y, triangle, v, random):
    """Return the radiance that leaves points of triangles along v, (n, 3)."""
    scene, rules = world.scene, world.rules
    g = face_normals(scene.geometry, triangle, v)
    n = shading_normals(scene.geometry, triangle, y, g)
    start = y + LIFT * g
    radiance = np.zeros(y.shape)
    for lamp in scene.lights:
        toward, light = incident(lamp, y)
        length = np.linalg.norm(toward, axis=1, keepdims=True)
        cosine = (toward * g).sum(axis=1) / length[:, 0]
        lit = np.flatnonzero((cosine > 0) & light.any(axis=1))
        lit = lit[free(corners_of(scene.geometry), start[lit], y[lit] + toward[lit])]
        radiance[lit] += reflected(scene, triangle[lit], g[lit], n[lit], (toward / length)[lit], v[lit]) * (
            light * cosine[:, None])[lit]
    if rules.bounces > 1:
        l = cosine_direction(g, *random.random((2, len(y))))  # noqa: E741
        further = arriving(world._replace(rules=rules._replace(bounces=rules.bounces - 1)), start, l, random)
        radiance += reflected(scene, triangle, g, n, l, v) * math.pi * further
    if rules.visible:
        radiance[~seen_by(world.view, scene, y, g)] = 0
    return radiance


def shading_normals(geometry, triangle, y, g):
    """Return the normals interpolated from the vertices, on the side of the faces' normals g."""
    if geometry.vertex_normals is None:
        return g
    corners = corners_of(geometry)[triangle]
    share = np.stack([np.linalg.norm(np.cross(corners[:, (k + 1) % 3] - y, corners[:, (k + 2) % 3] - y), axis=1)
                      for k in range(3)], axis=1)
    n = (share[..., None] * geometry.vertex_normals[geometry.faces[triangle]]).sum(axis=1)
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    return n * np.where((n * g).sum(axis=1) < 0, -1.0, 1.0)[:, None]


def incident(lamp, y):
    """Return vectors to a lamp, FAR where it is infinitely far, and its irradiance perpendicular to them, (n, 3)."""
    if isinstance(lamp, DirectionalLight):
        along = np.asarray(lamp.direction) / np.linalg.norm(lamp.direction)
        return np.broadcast_to(-FAR * along, y.shape), np.broadcast_to(lamp.irradiance, y.shape)
    toward = np.asarray(lamp.position) - y
    square = (toward**2).sum(axis=1)
    intensity = np.broadcast_to(np.asarray(lamp.intensity, float), y.shape)
    if isinstance(lamp, SpotLight):
        axis = np.asarray(lamp.direction) / np.linalg.norm(lamp.direction)
        inner, outer = math.cos(lamp.inner_half_angle), math.cos(lamp.outer_half_angle)
        t = np.clip((-(toward @ axis) / np.sqrt(square) - outer) / (inner - outer), 0, 1)
        intensity = intensity * (t * t * (3 - 2 * t))[:, None]
    return toward, intensity / square[:, None]


def reflected(scene, triangle, g, n, l, v):  # noqa: E741
    """Return radiance along v over the irradiance that arrives along -l: rho / pi <n v> and the lobe, over <g v>.

    The lobe is rho_s (P + 1) / (2 pi K) <r v>^P above the surface, r the mirror image of l at n.
    """
    result = np.zeros((len(v), 3))
    cos_v, cos_g = (n * v).sum(axis=1), (g * v).sum(axis=1)
    mirror = 2 * (n * l).sum(axis=1)[:, None] * n - l
    for m, material in enumerate(scene.materials):
        of = (scene.geometry.material_of_face[triangle] == m) & (cos_v > 0) & (cos_g > 0)
        if material.is_dielectric or not of.any():
            continue
        pattern = cos_v[of, None] / math.pi * np.asarray(material.diffuse)
        if any(material.specular):
            p = material.exponent
            above = np.array([share_above(c, p) for c in (n * l).sum(axis=1)[of]])
            lobe = np.maximum(0, (mirror * v).sum(axis=1)[of]) ** p * (p + 1) / (2 * math.pi)
            lobe = np.divide(lobe, above, out=np.zeros_like(lobe), where=above >= LEAST_ABOVE)
            pattern = pattern + lobe[:, None] * np.asarray(material.specular)
        result[of] = pattern / cos_g[of, None]
    return result


def seen_by(view, scene, y, g):
    """Tell which points a camera sees: inside its picture, facing it, nothing between."""
    away = y - view.origin[0]
    right, down, depth = view.frame[0] @ away.T
    inside = (depth > 0) & (np.abs(right) <= view.half[0] * depth) & (np.abs(down) <= view.half[1] * depth)
    inside &= (away * g).sum(axis=1) < 0
    inside[inside] = free(corners_of(scene.geometry), y[inside] + LIFT * g[inside], view.origin[0])
    return inside
