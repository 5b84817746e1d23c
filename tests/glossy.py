"""Rooms with glossy receivers: a Cornell box of which some surfaces have a Phong lobe."""

import dataclasses

import numpy as np

from refgi.scene import Scene, load_scene
from refgi.scene.material import Material
from tests.literal.whole.pairs import irradiance_of
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
    """Return sum f_s E from the definition of f_s; E of each pair is that of the literal diffuse sum.

    `factor`: what pairs of the diffuse parts (0) and of lobes (1) are multiplied by, (N, n).
    """
    x, normal = points.position.astype(float), points.normal.astype(float)
    away = (lights.position - pairs.offset * lights.normal)[..., None] - x[:, None]
    w_i = np.moveaxis(away / np.linalg.norm(away, axis=0), 0, 2)
    f = brdf(points.exponent.astype(float), normal.T, w_i, w_o.T)
    received = irradiance_of(x, normal, lights, pairs, footprint)
    total = sum(one * f * (1.0 if factor is None else factor(part)) for part, one in enumerate(received))
    return total.sum(axis=1) * points.specular
