"""Radiance that leaves towards the camera, the picture: L = L_e + albedo/pi E.

L_e is a material's emission, times its texture's mean over the pixel.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.rsm.buffers.gbuffer import GBuffer
from refgi.rsm.pool import plane
from refgi.scene.model import MaterialTable
from refgi.stages import stage

Array = npt.NDArray[Any]

NONE = np.zeros((0, 0), np.int32)


def leaving_radiance(irradiance: Array, extra: Array | None, buffer: GBuffer, materials: MaterialTable) -> Array:
    """Return what the camera receives: L = L_e + albedo/pi (E + extra).

    Parameters
    ----------
    irradiance : (3, h, w) ndarray
        Irradiance E, W/m^2.
    extra : (3, h, w) ndarray, optional
        More irradiance, W/m^2.
    buffer : GBuffer
        The camera's.
    materials : MaterialTable
        Their emission.

    Returns
    -------
    (3, h, w) ndarray
        Radiance, W/m^2/sr, linear RGB.
    """
    radiance = plane(irradiance.shape, irradiance.dtype if extra is None else np.result_type(irradiance, extra))
    emits = bool(materials.emission.any())
    material_id = buffer.material_id if emits else NONE
    _reflect(irradiance, irradiance if extra is None else extra, extra is not None, buffer.albedo, radiance)
    if emits and materials.emissive is None:
        _emit(materials.emission, material_id, radiance)
    elif emits:
        radiance += buffer.emission
    return radiance


@stage("rsm.emission", kept=False)
def emission_of(triangle_id: Array, material_of_face: Array, emission: Array) -> Array:
    """Find what each pixel's surface emits (docs/radiometry).

    material_of_face (triangle,) int32: Material of each triangle.
    emission (material, rgb): Radiance of each, W/m^2/sr.
    -> (3, h, w): Radiance, W/m^2/sr; 0 without surface.
    """
    radiance = np.zeros((3, *triangle_id.shape), emission.dtype)
    _emit(emission, np.where(triangle_id >= 0, material_of_face[triangle_id], np.int32(-1)), radiance)
    return radiance


@stage("rsm.leaving_radiance", kept=False)
def radiance_of(irradiance: Array, extra: Array | None, albedo: Array, emission: Array | None) -> Array:
    """Compute what the camera receives of diffuse surfaces: L = L_e + albedo/pi (E + extra) (docs/radiometry).

    irradiance (3, h, w): Direct irradiance E, W/m^2.
    extra (3, h, w): Indirect irradiance, W/m^2.
    emission (3, h, w): Radiance that surfaces emit, W/m^2/sr.
    -> (3, h, w): Radiance, W/m^2/sr, linear RGB; 0 without surface.
    """
    radiance = np.empty_like(irradiance)
    _reflect(irradiance, irradiance if extra is None else extra, extra is not None, albedo, radiance)
    return radiance if emission is None else radiance + emission


def leaving_steps(irradiance: Array, extra: Array | None, buffer: GBuffer, materials: MaterialTable) -> Array:
    """Return what the camera receives, made by steps."""
    emission = None
    if materials.emission.any():
        emission = buffer.emission if materials.emissive is not None else emission_of(
            buffer.triangle_id, buffer._geometry.material_of_face, materials.emission)
    return radiance_of(irradiance, extra, buffer.albedo, emission)


@kernel(parallel=True)
def _reflect(irradiance: Array, extra: Array, both: bool, albedo: Array, radiance: Array) -> None:
    pi = irradiance.dtype.type(np.pi)
    for row in prange(radiance.shape[1]):
        for channel in range(3):
            for x in range(radiance.shape[2]):
                arriving = irradiance[channel, row, x]
                if both:
                    arriving = arriving + extra[channel, row, x]
                # L = albedo/pi E, the BRDF of a diffuse surface
                radiance[channel, row, x] = arriving * albedo[channel, row, x] / pi


@kernel(parallel=True)
def _emit(emission: Array, material_id: Array, radiance: Array) -> None:
    for row in prange(radiance.shape[1]):
        for x in range(radiance.shape[2]):
            material = material_id[row, x]
            if material >= 0:
                for channel in range(3):
                    radiance[channel, row, x] += emission[material, channel]
