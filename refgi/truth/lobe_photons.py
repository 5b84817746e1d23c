"""Photons on glossy receivers: what sharp lobes and glass send, reflected by the lobe of the pixel it lands in.

As `refgi.truth.caustics`, a photon of flux dPhi that lands in a pixel of solid angle W, the camera at distance D, gives
the irradiance E = dPhi <g.v> / (D^2 W) across the face; the pixel's lobe makes f_s(w, w_o) E <n.w> / <g.w> of it, with
normal and lobe at the pixel's centre. Photons of a single lobe that the receivers' own directions meet do not count.

Symbols: v towards the camera, g face normal where the photon lands, n the pixel's normal, w against the photon's way.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel
from refgi.lobes import lobe_gap, lobe_power, receiver_norm
from refgi.rays import MISS
from refgi.scene import DirectionalLight
from refgi.truth.caustics import Film, photons_of, power_of, reflect, seen
from refgi.truth.light_grid import light_rays
from refgi.truth.lobe_receivers import Lobes, comes_by_photons
from refgi.truth.task import Task

Array = npt.NDArray[Any]


def lobe_photon_pass(film: Film, task: Task, random: np.random.Generator) -> Array:
    """Trace one pass of photons and reflect them by the lobes of the pixels they land in.

    `task`: with lobes. Returns (3, r) float64: radiance, W/m^2/sr.
    """
    assert task.lobes is not None
    radiance = np.zeros((3, len(task.receivers.pixel)))
    receiver_of = np.full(film.solid_angle.size, -1, np.int64)
    receiver_of[task.receivers.pixel] = np.arange(len(task.receivers.pixel))
    side, tracer, normals = math.isqrt(task.settings.photons), task.tracer, task.receivers.normal
    material_of_face = film.mirrors.material_of_face
    for k, light in enumerate(film.scene.lights):
        rays = light_rays(light, film.scene.geometry, random.random((side * side, 2)))
        batch = photons_of(rays.origins + tracer.offsets(rays.origins)[:, None] * rays.directions, rays.directions)
        power_of(task.lights, k, isinstance(light, DirectionalLight), rays.measure, rays.directions, batch.flux)
        lobe = np.zeros(len(batch.reach))  # exponent of the one lobe that a photon has met; inf after anything else
        for bounce in range(film.longest):
            tracer.fill_closest(batch.origin, batch.direction, batch.reach, batch.triangle_id, batch.distance)
            words = random.integers(2**32, size=len(batch.reach), dtype=np.uint32)
            found = batch.triangle_id != MISS
            landing = found & (bounce > 0)
            arriving, way = batch.flux[landing], -batch.direction[landing].astype(np.float64)
            reflect(film.mirrors, film.ior, tracer.grain, words, batch)
            if bounce:
                at, density, visible = seen(film, tracer, batch.landed[landing], batch.towards[landing])
                _reflect_to_eye(task.lobes, normals, receiver_of[at], arriving[visible] * density[:, None],
                                way[visible], batch.towards[landing][visible], lobe[landing][visible], radiance)
            material = material_of_face[np.where(found, batch.triangle_id, 0)]
            lobe[:] = film.mirrors.exponent[material] if bounce == 0 else np.inf
            lobe[film.ior[material] > 0] = np.inf
            if not (batch.reach > 0).any():
                break
    return radiance


@kernel
def _reflect_to_eye(lobes: Lobes, normals: Array, receiver: Array, irradiance: Array, way: Array, facing: Array,
                    sender: Array, radiance: Array) -> None:
    """Add what lobes make of photons, in their order; -1: no receiver. `irradiance` (n, 3): across the faces, W/m^2."""
    for i in range(len(receiver)):
        r = receiver[i]
        if r < 0 or not comes_by_photons(lobes.exponent[r], sender[i]):
            continue
        length = math.sqrt(way[i, 0] ** 2 + way[i, 1] ** 2 + way[i, 2] ** 2)
        x, y, z = way[i, 0] / length, way[i, 1] / length, way[i, 2] / length
        cosine = normals[0, r] * x + normals[1, r] * y + normals[2, r] * z
        across = facing[i, 0] * x + facing[i, 1] * y + facing[i, 2] * z
        if cosine <= 0 or across <= 0:
            continue
        gap = lobe_gap(lobes.mirrored[0, r], lobes.mirrored[1, r], lobes.mirrored[2, r], x, y, z)
        factor = receiver_norm(lobes.exponent[r]) * lobe_power(gap, lobes.exponent[r]) * cosine / across
        for c in range(3):
            radiance[c, r] += lobes.specular[c, r] * factor * irradiance[i, c]
