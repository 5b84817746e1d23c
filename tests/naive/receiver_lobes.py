"""Slow literal twin of what glossy receivers send to the eye, from the definitions alone: pair by pair in float64.

    L(x) = sum_i f_s(w_i, w_o) I_i(-w_i) <n.w_i> / r_i^2,   f_s = s (P + 2) / (2 pi) <m.w_i>^P,   m = 2 (n.w_o) n - w_o,

where n.w_i > 0 and n.w_o > 0; w_o points to the eye, w_i to the light or pixel light i.
"""

import math

import numpy as np

from refgi.literal.light_flux import spot_share
from tests.literal.whole.pairs import irradiance_of
from tests.literal.whole.vpl import sender_faces
from tests.naive.crossings import LIFT, corners_of, crossings, face_normals, free, nearest
from tests.naive.radiometry import gauss_legendre, lobe_fraction


def unit(vectors):
    """Return vectors of length 1 along the last axis."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def mirrored(normal, w_o):
    """Return 2 (n.w_o) n - w_o."""
    return 2 * (normal * w_o).sum(axis=-1, keepdims=True) * normal - w_o


def power(axis, w, exponent):
    """Return <a.w>^P of unit vectors, by |a - w|^2 / 2 = 1 - a.w, which keeps its digits near the axis."""
    gap = ((axis - w) ** 2).sum(axis=-1) / 2
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(gap < 1, np.exp(exponent * np.log1p(-np.minimum(gap, 1))), 0.0)


def brdf(exponent, normal, w_i, w_o):
    """Return f_s of unit specular reflectance at unit vectors (..., 3)."""
    counts = ((normal * w_i).sum(axis=-1) > 0) & ((normal * w_o).sum(axis=-1) > 0)
    return np.where(counts, (exponent + 2) / (2 * math.pi) * power(mirrored(normal, w_o), w_i, exponent), 0.0)


def sender_brdf(exponent, normal, w_i, w_o):
    """Return the lobe that pixel lights send as if it were a BRDF: (P + 1) / (2 pi K <n.w_o>) <r.w_o>^P.

    K is the part above the surface of the lobe around the mirrored w_i: all flux leaves, so f cos integrates to 1.
    """
    cos_in, cos_out = (normal * w_i).sum(axis=-1), (normal * w_o).sum(axis=-1)
    shares = np.array([lobe_fraction(math.acos(min(1.0, c)), exponent) for c in np.atleast_1d(cos_in)])
    counts = (cos_in > 0) & (cos_out > 0)
    lobe = (exponent + 1) / (2 * math.pi * shares.reshape(np.shape(cos_in))) * power(mirrored(normal, w_i), w_o,
                                                                                   exponent)
    return np.where(counts, lobe / np.where(counts, cos_out, 1), 0.0)


def tilted_albedo(exponent, theta, nodes=400):
    """Return the integral of <m.w>^P <n.w> over the hemisphere of n, over 2 pi / (P + 2): m is tilted by theta.

    Around m: at the angle a off it a circle lies above the surface for |phi| < phi_0; over these azimuths n.w =
    cos(theta) cos(a) + sin(theta) sin(a) cos(phi) integrates to 2 (cos(theta) cos(a) phi_0 + sin(theta) sin(a)
    sin(phi_0)). What is left, over a, bends where the circle dips below the surface, and its weight cos^P lies within a
    few times 1 / sqrt(P).
    """
    x, weights = gauss_legendre(nodes)
    narrow = min(math.pi / 2, 12 / math.sqrt(exponent + 1))
    edge = math.pi / 2 - theta
    total = 0.0
    for low, high in ((0.0, min(edge, narrow)), (min(edge, narrow), narrow)):
        if high <= low:
            continue
        turn = 0.5 * math.pi * (x + 1)
        a = low + (high - low) * 0.5 * (1 - np.cos(turn))
        da = (high - low) * 0.5 * np.sin(turn) * 0.5 * math.pi * weights
        across = math.sin(theta) * np.sin(a)
        along = math.cos(theta) * np.cos(a)
        phi = np.arccos(np.clip(-along / np.maximum(across, 1e-300), -1, 1))
        total += float((np.exp(exponent * np.log(np.cos(a))) * np.sin(a) * 2 * (along * phi + across * np.sin(phi))
                        * da).sum())
    return total * (exponent + 2) / (2 * math.pi)


def of_point_light(intensity, place, exponent, specular, x, normal, eye):
    """Return L of one light that sends `intensity` W/sr to x, f_s I <n.l> / d^2: from the angles, not from vectors."""
    to_light, to_eye = np.subtract(place, x), np.subtract(eye, x)
    d = math.sqrt(to_light @ to_light)
    cos_in, cos_out = to_light @ normal / d, to_eye @ normal / math.sqrt(to_eye @ to_eye)
    if cos_in <= 0 or cos_out <= 0:
        return np.zeros(3)
    # spherical law of cosines with the normal as pole: the mirrored direction has the eye's angle, half a turn on
    flat_in, flat_out = to_light - d * cos_in * normal, to_eye - to_eye @ normal * normal
    lengths = np.linalg.norm(flat_in) * np.linalg.norm(flat_out)
    turn = -(flat_in @ flat_out) / lengths if lengths > 0 else 1.0
    cos_a = cos_in * cos_out + math.sqrt((1 - min(1, cos_in**2)) * (1 - min(1, cos_out**2))) * turn
    lobe = (exponent + 2) / (2 * math.pi) * max(0.0, cos_a) ** exponent
    return np.asarray(specular, float) * np.asarray(intensity, float) * lobe * cos_in / d**2


def glossy_pixels(frame):
    """Return rows and columns of the pixels whose material has a lobe and is not glass, and their materials."""
    buffer, scene = frame.gbuffer, frame.scene
    at = np.argwhere(buffer.covered)
    of = scene.geometry.material_of_face[buffer.triangle_id[tuple(at.T)]]
    chosen = np.array([any(scene.materials[m].specular) and scene.materials[m].ior == 0 for m in of], bool)
    return tuple(at[chosen].T), [scene.materials[m] for m in of[chosen]]


def of_lights(frame, lights, pairs, visibility=False):
    """Return the radiance, (3, h, w), that lobes of receivers make of all pixel lights, by every pair.

    `visibility`: a ray for each, against every triangle; nothing then arrives from below a face or leaves below one.
    """
    at, materials = glossy_pixels(frame)
    result = np.zeros((3, frame.height, frame.width))
    buffer, geometry = frame.gbuffer, frame.scene.geometry
    x, normal = (plane[:, *at].T.astype(float) for plane in (buffer.position, buffer.normal))
    facing = face_normals(geometry, buffer.triangle_id[at], normal)
    w_o = unit(np.asarray(frame.scene.camera.eye) - x)
    specular, exponent = np.array([m.specular for m in materials]), np.array([m.exponent for m in materials])
    up = sender_faces(frame, lights) if visibility else None
    light = sum(irradiance_of(x.T, normal.T, lights, pairs))
    for k, place in enumerate((lights.position - pairs.offset * lights.normal).T):
        away = place - x
        term = brdf(exponent, unit(normal), unit(away), w_o) * light[:, k]
        if visibility:
            counts = ((away * facing).sum(axis=1) > 0) & (away @ up[k] < 0) & term.any(axis=0)
            counts[counts] = free(corners_of(geometry), x[counts] + LIFT * facing[counts], place + LIFT * up[k])
            term = term * counts
        result[:, *at] += term * specular.T
    return result


def from_mirror_side(scene, x, normal, w_o, material, light, count, random):
    """Return L (n, 3) of points x by `count` directions each of density (P + 1) / (2 pi) <m.w>^P, and its variance.

    A path tracer of one bounce: where a direction meets a diffuse surface, one spot or point light is connected to.
    """
    values = []
    for point, n, back in zip(x, normal, w_o, strict=True):
        m = mirrored(n, back)
        w = _around(m, material.exponent, count, random)
        cosine = np.maximum(0, w @ n) * (n @ back > 0)
        value = cosine[:, None] * (material.exponent + 2) / (material.exponent + 1) * np.asarray(material.specular)
        found = _radiance(scene, point + LIFT * n, w, light)
        values.append(value * found)
    values = np.array(values)
    return values.mean(axis=1), values.var(axis=1, ddof=1) / count


def _around(axis, exponent, count, random):
    """Return directions of density (P + 1) / (2 pi) cos^P around an axis."""
    gap = -np.expm1(np.log(1 - random.random(count)) / (exponent + 1))
    turn = 2 * math.pi * random.random(count)
    across = unit(np.cross(axis, (0.3, 0.5, 0.8)))
    flat = np.sqrt(gap * (2 - gap))
    return ((1 - gap)[:, None] * axis + (flat * np.cos(turn))[:, None] * across
            + (flat * np.sin(turn))[:, None] * np.cross(axis, across))


def _radiance(scene, origin, w, light):
    """Return the radiance (n, 3) of diffuse surfaces along rays: rho / pi I <g.l> / d^2 with the light's shadow."""
    geometry = scene.geometry
    triangle, far = nearest(corners_of(geometry), origin, w)
    result, hit = np.zeros((len(w), 3)), triangle >= 0
    y, triangle = (origin + far[hit, None] * w[hit]), triangle[hit]
    g = face_normals(geometry, triangle, -w[hit])
    to_light = np.asarray(light.position) - y
    d2 = (to_light**2).sum(axis=1)
    cosine = np.maximum(0, (to_light * g).sum(axis=1)) / np.sqrt(d2)
    start = y + LIFT * g
    lit = ~(crossings(corners_of(geometry), start, np.asarray(light.position) - start) < 1).any(axis=1)
    albedo = np.array([scene.materials[m].diffuse for m in geometry.material_of_face[triangle]])
    result[hit] = albedo / math.pi * (lit * cosine / d2 * _falloff(light, -to_light / np.sqrt(d2)[:, None]))[
        :, None] * np.asarray(light.intensity)
    return result


def _falloff(light, w):
    if not hasattr(light, "direction"):
        return np.ones(len(w))
    axis = unit(np.asarray(light.direction))
    return spot_share(w @ axis, light.inner_half_angle, light.outer_half_angle)
