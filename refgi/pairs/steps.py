"""One pixel light and one receiver at a time, as kits hold them."""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.pairs.irradiance import Receivers, summed
from refgi.pairs.pixel_lights import PixelLights
from refgi.pairs.settings import PairSettings
from refgi.stages import stage

Array = npt.NDArray[Any]


@stage("pairs.pairs", kept=False)
def pairs(
    position: Array, normal: Array, light_position: Array, light_normal: Array, flux: Array,
    lobe_flux: Array | None = None, lobe_axis: Array | None = None, lobe_exponent: Array | None = None,
) -> Array:
    """Compute the irradiance of light k at receiver k alone (SII Eq. 2 and 3).

    position (3, row, receiver): Receivers, m.
    normal (3, row, receiver): Their unit normals.
    -> (3, row, pair): Irradiance, W/m^2; 0 where light and receiver coincide.
    """
    made, bare = np.zeros_like(position), PairSettings(clamp=None)
    for k in range(flux.shape[1]):
        one = slice(k, k + 1)
        lobe, axis, exponent = (None if part is None else part[..., one]
                                for part in (lobe_flux, lobe_axis, lobe_exponent))
        light = PixelLights(light_position[:, one], light_normal[:, one], flux[:, one], lobe, axis, exponent, 1)
        at = Receivers(position[..., one], normal[..., one], np.ones((1, 1), np.bool_))
        made[..., one] = summed(at, light, bare)
    return made
