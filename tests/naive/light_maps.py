"""Slow literal twins of what pixel lights are taken from: maps with their texels' surfaces, glass, and light paths.

Refraction is texel by texel, from Snell and Fresnel (SII Fig. 4); paths are quasi-random (Sec. 3.7, docs/conventions
"Point sets").
"""

import dataclasses
import math
from functools import cached_property
from typing import Any

import numpy as np

from refgi.literal.light_flux import spot_share
from refgi.rsm import reflective_shadow_map
from tests.naive.draws import draw
from tests.naive.openness import LIFT, basis, cosine_direction
from tests.naive.pixel_lights import mirror, radical_inverse
from tests.naive.raster import face_normal, hit_of, unit
from tests.naive.refraction import bend
from tests.naive.shares import shares_of, shift_of, trial_flux


def exit_of(scene, lamp, front, mode):
    """Return where the light that a lamp sends to a point `front` of glass leaves it, or None where it is lost.

    Result: position, outward normal, direction and the share that passes.
    """
    direction = direction_of(lamp, front)
    hit = hit_of(scene, front - LIFT * direction, direction)
    index = hit.material.ior
    if face_normal(scene.geometry, hit.face) @ direction > 0:  # the lamp is inside
        out, share = bend(direction, hit.outward, index, 1.0)
        return hit.position, hit.outward, out, share
    inside, entered = bend(direction, -hit.outward, 1.0, index)
    if mode == "back_face":  # as published: the front is crossed unbent
        inside, left = direction, behind(scene, lamp, hit, direction)
    else:
        left = hit_of(scene, hit.position + LIFT * inside, inside)
    if left is None or not left.material.ior or face_normal(scene.geometry, left.face) @ inside < 0:
        return None
    out, share = bend(inside, left.outward, index, 1.0)
    return left.position, left.outward, out, entered * share


def behind(scene, lamp, front, direction):
    """Return what lies first behind a front: glass that looks away from the lamp, or something opaque."""
    geometry = scene.geometry
    faces = [face for face in range(len(geometry.faces)) if not scene.materials[geometry.material_of_face[face]].ior
             or looks_away(geometry, face, lamp)]
    return hit_of(scene, front.position + LIFT * direction, direction, faces)


def looks_away(geometry, face, lamp):
    """Whether a triangle's outer side is dark."""
    corner = geometry.vertices[geometry.faces[face, 0]]
    return face_normal(geometry, face) @ direction_of(lamp, corner) > 0


def direction_of(lamp, point):
    """Return the unit vector along which a lamp's light arrives."""
    return unit(point - np.asarray(lamp.position)) if hasattr(lamp, "position") else unit(lamp.direction)


STEEPEST = 1e-3  # least cosine between light and normal of an area


@dataclasses.dataclass
class LightMap:
    """The reflective shadow map of one lamp: a row a texel, square maps stacked below each other."""

    lamp: Any
    width: int
    position: Any  # (T, 3) m
    normal: Any  # (T, 3) unit
    flux: Any  # (T, 3) W, diffuse
    lobe_flux: Any  # (T, 3) W; 0 without a lobe
    lobe_axis: Any  # (T, 3) unit
    lobe_exponent: Any  # (T,)
    solid_angle: Any  # (T,) sr, or m^2 across a directional light

    @property
    def texels(self):
        """T, those without surface included."""
        return len(self.position)

    @property
    def height(self):
        """Rows of all stacked maps."""
        return self.texels // self.width

    @property
    def stacked(self):
        """How many maps: 6 of a point light."""
        return self.height // self.width

    @cached_property
    def area(self):
        """Surface behind each texel that reflects anything: Omega d^2 / cos, directional Omega / cos; (T,) m^2."""
        areas = np.zeros(self.texels)
        for texel in np.flatnonzero(self.flux.any(axis=1) | self.lobe_flux.any(axis=1)):
            cosine = abs(self.normal[texel] @ direction_of(self.lamp, self.position[texel]))
            away = self.position[texel] - getattr(self.lamp, "position", 0.0)
            square = away @ away if hasattr(self.lamp, "position") else 1.0
            areas[texel] = self.solid_angle[texel] * square / max(cosine, STEEPEST)
        return areas


def drawn_maps(frame, shape):
    """Draw the map of each lamp, of a shape that a sun's cannot have."""
    return [reflective_shadow_map(frame.scene.geometry, frame.senders, lamp, frame.rsm_resolution, frame.dtype,
                                  shape if hasattr(lamp, "position") else "auto") for lamp in frame.scene.lights]


def maps_of(frame, arriving, source):
    """Return the maps of a frame as the source of lights has them; `arriving` as (3, H, W) W each."""
    maps = []
    for rsm, incident in zip(drawn_maps(frame, source.projection), (rows(plane) for plane in arriving), strict=True):
        here = raw(rsm)
        if source.refraction is not None:
            send_through_glass(here, frame.scene, rsm.triangle_id.ravel(), incident, source.refraction)
        if "equal_solid_angle" in source.as_published:
            equalise(here, incident)
        maps.append(here)
    return maps


def rows(plane):
    """Return a plane (3, H, W) as a row a texel."""
    return np.array(plane).reshape(3, -1).T


def raw(rsm):
    """Return a map of a frame as it is."""
    dark = np.zeros_like(rsm.flux)
    lobe_flux, lobe_axis, lobe_exponent = (
        (dark, dark, dark[0]) if rsm.lobe_flux is None else (rsm.lobe_flux, rsm.lobe_axis, rsm.lobe_exponent))
    return LightMap(rsm.light, rsm.flux.shape[2], rows(rsm.position), rows(rsm.normal), rows(rsm.flux),
                    rows(lobe_flux), rows(lobe_axis), np.array(lobe_exponent).ravel(), rsm.solid_angle.ravel().copy())


def send_through_glass(here, scene, triangle, incident, refraction):
    """Let glass texels send what arrives on from where it leaves, in a lobe."""
    for texel in np.flatnonzero(triangle >= 0):
        if not scene.materials[scene.geometry.material_of_face[triangle[texel]]].ior:
            continue
        found = exit_of(scene, here.lamp, here.position[texel], refraction.name())
        if found is not None and found[3] > 0:
            here.position[texel], here.normal[texel], here.lobe_axis[texel], share = found
            here.lobe_flux[texel], here.lobe_exponent[texel] = share * incident[texel], refraction.exponent


def equalise(here, incident):
    """As printed: all texels that light falls on subtend the same solid angle, together what they did."""
    reached = incident.any(axis=1)
    mean = here.solid_angle[reached].mean()
    factor = mean / here.solid_angle[reached][:, None]
    here.flux[reached] *= factor
    here.lobe_flux[reached] *= factor
    here.solid_angle[reached] = mean


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
