"""Slow literal twin of refraction at glass: texel by texel, from Snell and Fresnel (SII Fig. 4)."""

import numpy as np

from tests.naive.openness import LIFT
from tests.naive.refraction import bend
from tests.naive.surface import face_normal, hit_of, unit


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
