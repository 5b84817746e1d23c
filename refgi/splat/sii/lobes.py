"""Lobes of glossy receivers by pixel lights: L_s = sum over lights of f_s I cos / r^2, over the pairs that count."""

from typing import TYPE_CHECKING

import numpy as np

from refgi.lights.selection import choose_lights, footprints
from refgi.lights.settings import with_clamp
from refgi.pairs.glossy import as_receivers, glossy_radiance, glossy_summed
from refgi.pairs.irradiance import Receivers, checked
from refgi.rsm.buffers.leaving import GlossyPoints, spread_over_picture
from refgi.settings import replaced
from refgi.splat.sii.reach.lists import LightLists
from refgi.splat.sii.reach.threshold import with_reference_length
from refgi.splat.sii.settings import FullBound, SiiSettings, TangentBound
from refgi.splat.sii.storage import as_stored
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.frame import Frame
    from refgi.lights import PixelLights


def sii_lobes(frame: "Frame", settings: SiiSettings) -> Array:
    """Return the radiance towards the eye that receivers' lobes make of the pixel lights of `sii`.

    (3, h, w), W/m^2/sr, linear RGB, without visibility; 0 where there is no lobe. Every glossy pixel sums all lights,
    one by one, whatever `half_resolution` and `lightcuts` say of irradiance. A cut leaves out the same pairs as from
    the irradiance: its threshold is of the irradiance that a light causes at most, and knows nothing of the receiver's
    lobe. Lights are as `quantisation` stores them; glossy pixels, which the paper has none of, keep their floats.
    """
    settings = with_clamp(settings)
    receivers, lights = as_stored(Receivers(*frame.gbuffer.resolve("position", "normal", "covered")),
                                  choose_lights(frame, settings.lights), settings)
    footprint = footprints(frame, settings.lights, settings.pairs)
    points = frame.glossy_points
    if settings.reach.cut is None:
        radiance = glossy_radiance(points, lights, settings.pairs, footprint, frame.width)
    else:
        resolved = with_reference_length(receivers, lights, settings)
        radiance = glossy_in_range(points, lights, resolved, footprint, frame.width)
    return spread_over_picture(points, radiance, (frame.height, frame.width))


@stage("sii.glossy_sum")
def glossy_in_range(
    points: GlossyPoints, lights: "PixelLights", settings: SiiSettings, footprint: Array | None = None, width: int = 0,
) -> Array:
    """Sum the radiance that lobes make of the pairs with B >= I_low (SII Sec. 3.4).

    settings: The parts `reach`, with its reference length, and `pairs`; the bound does not matter.
    width: As for `glossy_radiance`.
    -> (3, n): W/m^2/sr, linear RGB.
    """
    packed = checked(as_receivers(points), lights, settings.pairs, footprint)
    if settings.reach.on_screen:  # receivers come as a list, not as a picture
        settings = replaced(settings, {"reach.bound": TangentBound()})
    lists = LightLists(packed, settings, False, 1, None)
    ranges = lists.diffuse, lists.lobes
    if isinstance(settings.reach.bound, FullBound):
        return glossy_summed(points, packed, ranges, width)

    def listed(position: Array, normal: Array) -> tuple[Array | None, Array | None]:
        diffuse = lobes = None
        places = np.arange(position.shape[1])
        if lists.diffuse is not None and packed.spheres is None:  # spheres reach over their horizon
            ((_, diffuse),) = lists.of_diffuse(position, normal, places)
        if lists.lobes is not None:
            ((_, lobes),) = lists.of_lobes(position, normal, places)
        return diffuse, lobes

    return glossy_summed(points, packed, ranges, width, listed)
