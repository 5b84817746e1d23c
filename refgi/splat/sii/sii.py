"""Splatting Indirect Illumination (Dachsbacher and Stamminger 2006): the method."""

from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from refgi.lights.selection import choose_lights, footprints
from refgi.pairs.irradiance import Receivers
from refgi.pairs.loss import warn_of_clamp
from refgi.splat.sii.half_resolution import half_resolution
from refgi.splat.sii.reach.reference_length import with_reference_length
from refgi.splat.sii.reach.threshold import warn_of_cut
from refgi.splat.sii.settings import SiiSettings
from refgi.splat.sii.splat import splat

if TYPE_CHECKING:
    from refgi.frame import Frame

Array = npt.NDArray[Any]


def sii(frame: "Frame", settings: SiiSettings) -> Array:
    """Light every pixel by pixel lights.

    Parameters
    ----------
    frame : Frame
        The scene, seen and lit.
    settings : SiiSettings
        Which lights, how each lights a receiver and how far it reaches.

    Returns
    -------
    (3, h, w) ndarray
        Indirect irradiance, W/m^2, linear RGB, without visibility.
    """
    lights = choose_lights(frame, settings.lights)  # Sec. 3.1, 3.5 to 3.7
    footprint = footprints(frame, settings.lights, settings.pairs)
    receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))  # Sec. 3.2: deferred shading

    reach = with_reference_length(receivers, lights, settings)

    def lit(some: Receivers) -> Array:
        return splat(some, lights, reach, footprint, frame.gbuffer.projection)  # Eq. (2), Sec. 3.4

    light = half_resolution(receivers, lit) if settings.half_resolution else lit(receivers)
    warn_of_clamp(receivers, lights, settings.pairs, footprint, "sii")
    warn_of_cut(light, receivers, lights, reach, footprint)
    return light
