"""Emissive surfaces: how many there are, and lamps in their place.

What a material emits is seen by the camera and lights nothing: the papers have no area lights. Where lamps are asked
for, each connected emissive part gets one: a spot with the part's power Phi = pi sum(L A), along its mean normal, whose
intensity falls with the cosine off it, I_0 = Phi / pi, as that of a diffuse emitter does far away. It stands at the
part's middle, just before all of it. This is an approximation: near the part light comes from one point, and where
the part's faces look to several sides only the mean one is lit.
"""

import math
import warnings
from collections.abc import Sequence

import numpy as np

from refgi.errors import RefgiWarning
from refgi.scene.light import SpotLight
from refgi.scene.material import Material
from refgi.scene.model import Geometry
from refgi.scene.reading import wants_lamps
from refgi.scene.values import Array, Vector

LIFT = 1e-3  # of a part's size, before the surface that the lamp stands for
FACING = 1e-6  # of a part's area: what has less of a mean normal looks to all sides


def emissive_parts(geometry: Geometry, materials: Sequence[Material]) -> list[Array]:
    """Return the faces of each connected part of the surfaces that emit, in the order of its first face."""
    glows = np.array([any(material.emission) for material in materials], np.bool_)
    faces = np.flatnonzero(glows[geometry.material_of_face]) if glows.any() else np.zeros(0, np.int64)
    if not len(faces):
        return []
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    corners = geometry.vertices[geometry.faces[faces]].reshape(-1, 3)
    point, number = np.unique(corners, axis=0, return_inverse=True)  # seams of a mesh have a vertex each side
    at = number.reshape(-1)
    owner = np.repeat(np.arange(len(faces)), 3)
    links = coo_array((np.ones(len(at), np.int8), (owner, len(faces) + at)), shape=(len(faces) + len(point),) * 2)
    label = connected_components(links, directed=False)[1][: len(faces)]
    first = np.sort(np.unique(label, return_index=True)[1])
    return [faces[label == label[k]] for k in first]


def emissive_lamps(geometry: Geometry, materials: Sequence[Material]) -> tuple[SpotLight, ...]:
    """Return a lamp for each connected emissive part, as this module says."""
    colour = np.array([_emission(material) for material in materials]).reshape(-1, 3)
    return tuple(_lamp(geometry, faces, colour[geometry.material_of_face[faces]])
                 for faces in emissive_parts(geometry, materials))


APPROXIMATION = "each in place of an emissive part: all of its power comes from one point with a cosine falloff"


def lamps_where_asked(geometry: Geometry, materials: Sequence[Material], where: str) -> tuple[SpotLight, ...]:
    """Return the lamps, none unless they are asked for; warn of them, or that emissive surfaces light nothing."""
    lamps = emissive_lamps(geometry, materials) if wants_lamps() else ()
    count = len(lamps) if wants_lamps() else len(emissive_parts(geometry, materials))
    if wants_lamps():
        text = f"{count:,} lamp(s), {APPROXIMATION} (an approximation)"
    else:
        one = count == 1
        text = (f"{count:,} emissive {'surface lights' if one else 'surfaces light'} nothing here, the camera alone "
                f"sees {'it' if one else 'them'}; --emissive lamps puts a lamp on each")
    if count:
        warnings.warn(RefgiWarning(f"{where}: {text}"), stacklevel=4)
    return lamps


def _emission(material: Material) -> Array:
    """Return the radiance of a material, of an emissive texture the mean."""
    emission = np.asarray(material.emission, np.float64)
    if material.emission_texture is None or not emission.any():
        return emission
    mean: Array = material.emission_texture.image.linear().reshape(-1, 3).mean(axis=0, dtype=np.float64)
    return emission * mean


def _lamp(geometry: Geometry, faces: Array, radiance: Array) -> SpotLight:
    a, b, c = (geometry.vertices[geometry.faces[faces, k]] for k in range(3))
    normal = 0.5 * np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    middle = (area[:, None] * (a + b + c)).sum(axis=0) / (3 * area.sum())
    axis = normal.sum(axis=0)
    if np.linalg.norm(axis) < FACING * area.sum():  # a closed part: towards the middle of the scene, or down
        axis = np.mean(geometry.bounds, axis=0) - middle
        axis = axis if np.linalg.norm(axis) > FACING * geometry.diagonal else np.array([0.0, -1.0, 0.0])
    axis = axis / np.linalg.norm(axis)
    before = max(float(((corner - middle) @ axis).max()) for corner in (a, b, c))
    place = middle + (before + LIFT * math.sqrt(area.sum())) * axis
    red, green, blue = (area[:, None] * radiance).sum(axis=0).tolist()  # Phi / pi
    return SpotLight(_vector(place), _vector(axis), 0.0, math.pi / 2, (red, green, blue), "ramp")


def _vector(values: Array) -> Vector:
    x, y, z = values.tolist()
    return x, y, z
