"""Splatting Indirect Illumination (Dachsbacher and Stamminger 2006): settings and method."""

import dataclasses
from typing import TYPE_CHECKING, Any, ClassVar

import numpy.typing as npt

from refgi.errors import expect
from refgi.lights.selection import choose_lights, footprints
from refgi.lights.settings import LightSettings
from refgi.pairs.irradiance import Receivers
from refgi.pairs.loss import warn_of_clamp
from refgi.splat.half_resolution import half_resolution
from refgi.splat.reach.loss import warn_of_cut
from refgi.splat.reach.reference_length import with_reference_length
from refgi.splat.settings import SplatSettings
from refgi.splat.splat import splat

if TYPE_CHECKING:
    from refgi.frame import Frame

Array = npt.NDArray[Any]


@dataclasses.dataclass(frozen=True)
class SiiSettings(LightSettings, SplatSettings):
    """What `sii` can be set to; the defaults are the paper's (768 lights, no importance) but for its cut.

    Nothing is cut: the sum of all lights takes at most 1.7 times as long as the paper's cut of 5 % (`i_low=0.05`, Fig.
    12), which takes up to a third of the light.

    Beside which lights and how far each reaches, `half_resolution` lights every second pixel and interpolates
    (Table 3).
    """

    half_resolution: bool = False

    SWITCHES: ClassVar[frozenset[str]] = LightSettings.SWITCHES | SplatSettings.SWITCHES

    def __post_init__(self) -> None:
        super().__post_init__()
        expect(not self.half_resolution or self.bound not in ("quad", "mesh"), "bound",
               "one in space, not on the screen, at half resolution", self.bound)


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
    lights = choose_lights(frame, settings)  # Sec. 3.1, 3.5 to 3.7
    footprint = footprints(frame, settings)
    receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))  # Sec. 3.2: deferred shading

    reach = with_reference_length(receivers, lights, settings)

    def lit(some: Receivers) -> Array:
        return splat(some, lights, reach, footprint, frame.gbuffer.projection)  # Eq. (2), Sec. 3.4

    light = half_resolution(receivers, lit) if settings.half_resolution else lit(receivers)
    warn_of_clamp(receivers, lights, settings, footprint, "sii")
    warn_of_cut(light, receivers, lights, reach, footprint)
    return light
