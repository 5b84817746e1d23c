"""Splatting Indirect Illumination (Dachsbacher and Stamminger 2006), without bounds: every light at every pixel."""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.splat.irradiance import Receivers, irradiance
from refgi.splat.settings import FOOTPRINT_CLAMPS, PairSettings

if TYPE_CHECKING:
    from refgi.frame import Frame
    from refgi.rsm import PixelLights, Rsm

Array = npt.NDArray[Any]
Pattern = Literal["grid", "halton", "all", "random"]

MOST_LIGHTS = 1 << 24  # a map: every texel of one of 4096 x 4096


@dataclasses.dataclass(frozen=True)
class SiiSettings(PairSettings):
    """What `sii` can be set to; the defaults are the paper's (768 lights as in Fig. 8 and 12, no importance).

    `lights` pixel lights a shadow map are taken from a `pattern` ("all": every texel, `lights` is not used) with
    `seed`; `filtered` averages the flux over each light's cell (Sec. 4). The rest is that of `PairSettings`.
    """

    lights: int = 768
    pattern: Pattern = "halton"
    seed: int = 0
    filtered: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        expect(1 <= self.lights <= MOST_LIGHTS, "lights", f"1 to {MOST_LIGHTS:,} pixel lights", self.lights)
        expect(self.pattern in ("grid", "halton", "all", "random"), "pattern",
               "'grid', 'halton', 'all' or 'random'", self.pattern)
        expect(self.seed >= 0, "seed", "a whole number >= 0", self.seed)


def sii(frame: "Frame", settings: SiiSettings) -> Array:
    """Light every pixel by pixel lights of the reflective shadow maps.

    Parameters
    ----------
    frame : Frame
        The scene, seen and lit.
    settings : SiiSettings
        Which lights, and how each lights a receiver.

    Returns
    -------
    (3, h, w) ndarray
        Indirect irradiance, W/m^2, linear RGB, without visibility.
    """
    lights = pixel_lights(frame.rsms, settings)  # Sec. 3.1
    footprint = light_footprints(frame.rsms, settings) if settings.clamp in FOOTPRINT_CLAMPS else None
    buffer = frame.gbuffer
    receivers = Receivers(buffer.position, buffer.normal, buffer.covered)  # Sec. 3.2: deferred shading
    return irradiance(receivers, lights, settings, footprint)  # Eq. (2)


def pixel_lights(rsms: "Sequence[Rsm]", settings: SiiSettings) -> "PixelLights":
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


def light_footprints(rsms: "Sequence[Rsm]", settings: SiiSettings) -> Array:
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
