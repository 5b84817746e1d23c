"""Slow literal twin of pixel lights from quasi-random light paths (SII Sec. 3.7, docs/conventions "Point sets")."""

import math

import numpy as np

from refgi.literal.light_flux import spot_share
from tests.naive.draws import draw
from tests.naive.openness import LIFT, basis, cosine_direction
from tests.naive.pixel_lights import mirror, radical_inverse
from tests.naive.shares import shares_of, shift_of, trial_flux
from tests.naive.surface import hit_of, unit

BASES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53)
TRIAL = 256  # paths of each of several lamps
LIGHT_PATHS = 1  # use 1 of the random streams


def walk(scene, paths, bounces, seed):
    """Yield position, normal, diffuse flux, lobe flux, axis and exponent where paths meet surfaces.

    One lamp after another, of each all first bounces, then all second ones.
    """
    for lamp, share in zip(scene.lights, shares(scene, paths, seed), strict=True):
        followed = [list(path(scene, lamp, share, number, bounces, seed)) for number in range(1, share + 1)]
        for bounce in range(bounces):
            yield from (vertices[bounce] for vertices in followed if bounce < len(vertices))


def shares(scene, paths, seed):
    """Return the paths of each lamp, by the flux that the first vertices of a trial reflect."""
    if len(scene.lights) == 1:
        return [paths]
    shift = shift_of(seed, LIGHT_PATHS, 4, 1)
    flux = []
    for lamp in scene.lights:
        places = ([(radical_inverse(k, BASES[c]) + shift[c]) % 1 for c in range(4)] for k in range(1, TRIAL + 1))
        flux.append(trial_flux(vertex for place in places for vertex in from_place(scene, lamp, TRIAL, place, 1)))
    return [share or 1 for share in shares_of(paths, flux)]


def path(scene, lamp, share, number, bounces, seed):
    """Yield the vertices of one path of `share`: it goes on with what each surface reflects diffusely."""
    yield from from_place(scene, lamp, share, coordinates(number, 2 + 2 * bounces, seed), bounces)


def from_place(scene, lamp, share, place, bounces):
    """Yield the vertices of the path with these coordinates."""
    origin, direction, power = emitted(scene, lamp, *place[:2])
    power = power / share
    for bounce in range(bounces):
        hit = hit_of(scene, origin, direction)
        if hit is None or hit.material.ior:
            return
        diffuse, glossy = (power * np.asarray(share) for share in (hit.material.diffuse, hit.material.specular))
        yield hit.position, hit.normal, diffuse, glossy, mirror(direction, hit.normal), hit.material.exponent
        origin, power = hit.position + LIFT * hit.normal, diffuse
        direction = cosine_direction(hit.normal, *place[2 + 2 * bounce:4 + 2 * bounce])


def coordinates(number, count, seed):
    """Return point `number` of the Halton set, shifted by draws unless the seed is 0."""
    return [(radical_inverse(number, BASES[c]) + (draw(seed, LIGHT_PATHS, c) if seed else 0)) % 1
            for c in range(count)]


def emitted(scene, lamp, s, t):
    """Return origin, direction and I / density of a lamp's ray: even over a spot's cone, the sphere, or a disc."""
    kind = type(lamp).__name__
    if kind == "DirectionalLight":
        return from_disc(scene, lamp, s, t)
    axis = unit(lamp.direction) if kind == "SpotLight" else np.array([0.0, 0.0, 1.0])
    cap = 1 - math.cos(lamp.outer_half_angle) if kind == "SpotLight" else 2.0
    cosine = 1 - s * cap
    direction = around(axis, math.sqrt(1 - cosine**2), t) + cosine * axis
    intensity = np.asarray(lamp.intensity)
    if kind == "SpotLight":
        intensity = intensity * spot_share(cosine, lamp.inner_half_angle, lamp.outer_half_angle, lamp.falloff)
    return np.asarray(lamp.position), direction, intensity * 2 * math.pi * cap


def from_disc(scene, lamp, s, t):
    """Parallel light starts on a disc before the ball around the box of all triangles."""
    corners = scene.geometry.vertices[scene.geometry.faces].reshape(-1, 3)
    low, high = corners.min(axis=0), corners.max(axis=0)
    radius, direction = np.linalg.norm(high - low) / 2, unit(lamp.direction)
    origin = (low + high) / 2 - 2 * radius * direction + around(direction, radius * math.sqrt(s), t)
    return origin, direction, np.asarray(lamp.irradiance) * math.pi * radius**2


def around(axis, radius, turn):
    """Return the vector across an axis of a length and a share of the turn."""
    tangent, bitangent = basis(axis)
    return radius * (math.cos(2 * math.pi * turn) * tangent + math.sin(2 * math.pi * turn) * bitangent)
