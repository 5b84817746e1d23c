"""Which pixel lights `sii` uses: texels of the maps, or quasi-random paths (SII Sec. 3.1, 3.5 to 3.7)."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from refgi.frame import Frame
    from refgi.rsm import PixelLights, Rsm
    from refgi.splat.sii import SiiSettings

Array = npt.NDArray[Any]


def choose_lights(frame: "Frame", settings: "SiiSettings") -> "PixelLights":
    """Return the pixel lights of a frame.

    Parameters
    ----------
    frame : Frame
        The scene, lit.
    settings : SiiSettings
        Where lights come from, and how many.

    Returns
    -------
    PixelLights
        Lights with their share of the flux.
    """
    if settings.source == "walk":
        return _walked(frame, settings)
    return pixel_lights(frame.rsms, settings)


def _walked(frame: "Frame", settings: "SiiSettings") -> "PixelLights":
    from refgi.scene import light_table, material_table
    from refgi.splat.walk import walk_lights

    scene = frame.scene
    return walk_lights(frame.tracer, scene.geometry, material_table(scene.materials), light_table(scene.lights),
                       settings.lights, settings.bounces, settings.seed)


def pixel_lights(rsms: "Sequence[Rsm]", settings: "SiiSettings") -> "PixelLights":
    """Choose pixel lights as the settings say.

    Parameters
    ----------
    rsms : sequence of Rsm
        Reflective shadow maps, one a light.
    settings : SiiSettings
        Number, pattern, seed and filtering.

    Returns
    -------
    PixelLights
        Lights with their share of the flux.
    """
    from refgi.rsm import choose_pixel_lights

    count = None if settings.pattern == "all" else settings.lights
    return choose_pixel_lights(rsms, count=count, pattern=settings.pattern, seed=settings.seed,
                               filtered=settings.filtered)


def light_footprints(rsms: "Sequence[Rsm]", settings: "SiiSettings") -> Array:
    """Return the surface area that each pixel light stands for: O d^2 / cos, with the same T / N as its flux.

    Parameters
    ----------
    rsms : sequence of Rsm
        Reflective shadow maps, one a light.
    settings : SiiSettings
        The settings that the lights were chosen by.

    Returns
    -------
    (N,) ndarray
        Area, m^2, in the order of the lights.

    Notes
    -----
    The area takes the place of the flux in the map, so that pattern, weights and filtering are those of the lights.
    """
    area: Array = pixel_lights([_with_area_as_flux(rsm) for rsm in rsms], settings).flux[0]
    return area


def _with_area_as_flux(rsm: "Rsm") -> "Rsm":
    from refgi.scene import DirectionalLight

    light = rsm.light
    if isinstance(light, DirectionalLight):
        towards: Array = -np.asarray(light.direction, np.float64)[:, None, None]
        distance: Any = 1.0
    else:
        towards = np.asarray(light.position, np.float64)[:, None, None] - rsm.position
        distance = np.sqrt((towards**2).sum(axis=0))
    length = np.sqrt((towards**2).sum(axis=0))
    cosine = (rsm.normal * towards).sum(axis=0) / np.where(length > 0, length, 1)
    lit = rsm.flux.any(axis=0) if rsm.lobe_flux is None else rsm.flux.any(axis=0) | rsm.lobe_flux.any(axis=0)
    area = np.where(lit, rsm.solid_angle * distance**2 / np.maximum(cosine, 1e-3), 0).astype(rsm.flux.dtype)
    return rsm._replace(flux=np.broadcast_to(area, rsm.flux.shape), lobe_flux=None, lobe_axis=None, lobe_exponent=None)
