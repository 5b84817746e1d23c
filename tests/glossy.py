"""Rooms with glossy receivers: a Cornell box of which some surfaces have a Phong lobe."""

import dataclasses

import numpy as np

from refgi.scene import Scene, load_scene
from refgi.scene.material import Material
from tests.naive.pair_term import parts, received
from tests.naive.receiver_lobes import brdf

SIZE = 48  # pixels


def glossy_box(
    exponent: float = 60.0, specular: float = 0.5, *, name: str = "cornell_box", blocks: float = 8.0
) -> Scene:
    """Return the box with a floor of one lobe and blocks of another, beside walls that have none.

    Parameters
    ----------
    exponent, specular : float
        Of the floor.
    name : str
        A built-in scene of the box.
    blocks : float
        Exponent of the blocks.
    """
    scene = load_scene(name)
    geometry = scene.geometry
    low, high = geometry.bounds
    corners = geometry.vertices[geometry.faces]
    span = (high - low)[0]
    on_floor = (corners[..., 1] < low[1] + 1e-3 * span).all(axis=1)
    inside = ((corners > low + 0.02 * span) & (corners < high - 0.02 * span))[..., [0, 2]].all(axis=(1, 2)) & ~on_floor
    inside &= (corners[..., 1] < high[1] - 0.02 * span).all(axis=1)
    floor = Material("floor", diffuse=(0.3, 0.3, 0.3), specular=(specular,) * 3, exponent=exponent)
    metal = Material("metal", diffuse=(0.1, 0.08, 0.05), specular=(0.8, 0.7, 0.4), exponent=blocks)
    count = len(scene.materials)
    material = geometry.material_of_face.copy()
    material[on_floor], material[inside] = count, count + 1
    return dataclasses.replace(scene, materials=(*scene.materials, floor, metal), source=None,
                               geometry=dataclasses.replace(geometry, material_of_face=np.asarray(material, np.int32)))


def defined(points, lights, w_o, pairs, footprint=None, factor=None):
    """Return sum f_s E from the definition of f_s; E of each pair is that of the diffuse sum's twin."""
    x, normal = points.position.T.astype(float), points.normal.T.astype(float)
    result = np.zeros((3, len(x)))
    for part in parts(lights, pairs, footprint):
        w_i = part.position - x
        w_i = w_i / np.linalg.norm(w_i, axis=1)[:, None]
        f = brdf(points.exponent.astype(float), normal, w_i, w_o.T)
        e = received(part, x.T, normal.T, pairs)
        result += np.outer(part.flux, f * e * (1.0 if factor is None else factor(part, x)))
    return result * points.specular
