"""Glossy receivers of the ground truth: what a pixel's lobe needs, and how its light is shared among the estimators.

L_s = int f_s(w, w_o) L(w) <n.w> dw with f_s = s (P + 2) / (2 pi) <m.w>^P, m the direction to the eye mirrored about n.

Symbols: P the receiver's exponent, Q a sender's, n_a and n_b how many samples of a pass the directions of the receiver
and the rays of a light put on a unit of area at the sender, A = r^2 n_a / n_b.

- Diffuse reflection: multiple importance sampling by the power heuristic, n_a^2 / (n_a^2 + n_b^2) for directions, the
  rest for light vertices. n_b counts rays that are spread evenly.
- Lobes: directions and cells of light, by the balance heuristic (`refgi.truth.cell_densities`); directions alone
  where P is above `WIDE` and Q / `BLURRED`, as they are then no wider than what they are to meet.
- Lobes that are left to photons (the sharpest; with caustics all mirror-like ones): photons, where P is lower than Q by
  `BLURRED` or more; else the receiver's directions alone, which are then no wider than what they are to meet.
"""

import math
from typing import NamedTuple

import numpy as np

from refgi.jit import kernel
from refgi.scene import Scene, material_table
from refgi.truth.surfaces import Surfaces, surfaces
from refgi.types import Array

BLURRED = 4.0  # times the receiver's exponent: senders' lobes as sharp as that, or sharper, come by photons
WIDE = 60.0  # exponent of receivers up to which, or to 1 / BLURRED of the sharpest sender's, they pick cells
SHARPEST_VERTEX = 1e7  # exponent above which a receiver takes nothing from light vertices, whose places are float32


class Lobes(NamedTuple):
    """Lobes of receivers, in their order."""

    mirrored: Array  # (3, r) float64: m
    specular: Array  # (3, r) float64: reflectance of the lobe
    exponent: Array  # (r,) float64: P
    surfaces: Surfaces  # with every lobe, those of photons among them
    photon_exponent: float  # lobes of senders from here on are left to photons; inf: none
    widest: float  # exponent of receivers up to which they pick cells of light


def glossy_triangles(scene: Scene, position: Array, normal: Array, triangle_id: Array) -> Array:
    """Return which triangle each pixel sees, without those that no lobe of reflects towards the eye.

    `position`, `normal` (3, h, w): the G-buffer's. Returns (h, w) int: -1 where there is no lobe, or the normal faces
    away from the eye.
    """
    table = material_table(scene.materials)
    glossy = (table.specular > 0).any(axis=1) & (table.ior == 0)
    seen = triangle_id >= 0
    toward_eye = np.asarray(scene.camera.eye, np.float64)[:, None, None] - position
    seen &= glossy[scene.geometry.material_of_face[np.where(seen, triangle_id, 0)]]
    seen &= (toward_eye * normal).sum(axis=0) > 0
    return np.where(seen, triangle_id, -1).astype(np.int32)


def lobes_of(scene: Scene, pixel: Array, position: Array, normal: Array, triangle_id: Array,
             photon_exponent: float) -> Lobes:
    """Return the lobes of receivers.

    `pixel` (r,): flat indices into the picture. `position`, `normal` (3, h, w), `triangle_id` (h, w): the G-buffer's.
    `photon_exponent`: of the lobes that are left to photons.
    """
    at, n = (plane.reshape(3, -1)[:, pixel].astype(np.float64) for plane in (position, normal))
    w_o = np.asarray(scene.camera.eye, np.float64)[:, None] - at
    w_o /= np.linalg.norm(w_o, axis=0)
    n /= np.linalg.norm(n, axis=0)
    mirrored = 2 * (n * w_o).sum(axis=0) * n - w_o
    material = scene.geometry.material_of_face[triangle_id.reshape(-1)[pixel]]
    table = material_table(scene.materials)
    by_cells = table.specular.any(axis=1) & (table.ior == 0) & (table.exponent < photon_exponent)
    sharpest = table.exponent[by_cells].max(initial=0.0)
    return Lobes(np.ascontiguousarray(mirrored / np.linalg.norm(mirrored, axis=0)),
                 np.ascontiguousarray(table.specular[material].T.astype(np.float64)),
                 np.ascontiguousarray(table.exponent[material], np.float64), surfaces(scene), photon_exponent,
                 min(SHARPEST_VERTEX, max(WIDE, sharpest / BLURRED)))


def subset_of(lobes: Lobes, chosen: Array) -> Lobes:
    """Return some of the receivers' lobes."""
    return lobes._replace(mirrored=np.ascontiguousarray(lobes.mirrored[:, chosen]),
                          specular=np.ascontiguousarray(lobes.specular[:, chosen]), exponent=lobes.exponent[chosen])


@kernel
def density_on_axis(exponent: float, directions: float) -> float:
    """Return D = c N (P + 1) / (2 pi), c = max(1, sqrt(P) / 6): what N directions count on a lobe's axis, 1/sr.

    c = 1 is their density. By trial more for sharp lobes, over which what they see hardly varies: directions then have
    next to no variance, and any light vertex adds to it.
    """
    return max(1.0, math.sqrt(exponent) / 6) * directions * (exponent + 1) / (2 * math.pi)


@kernel
def comes_by_photons(exponent: float, sender: float) -> bool:
    """Return whether what a lobe sends that is left to photons reaches a receiver by them: else by its directions.

    `exponent`: P. `sender`: Q.
    """
    return bool(sender >= BLURRED * exponent)


def meets_photons(lobes: Lobes) -> bool:
    """Return whether some sender's lobe reaches some receiver by photons."""
    sharp = lobes.surfaces.exponent[lobes.surfaces.specular.any(axis=1)].max(initial=0.0)
    least = lobes.exponent.min(initial=np.inf)
    return bool(sharp >= lobes.photon_exponent and sharp >= BLURRED * least)
