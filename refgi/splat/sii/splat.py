"""Splatting: each pixel light adds its irradiance to the pixels where it is significant, and to no others (SII Sec. 3).

The paper draws a bound of each light and lights the pixels it covers. Here the bound lists lights for tiles of pixels,
and the pairs of light and pixel with B < I_low are left out one by one, so that the picture is that of the threshold
alone, the same to the bit for every bound. What the cut loses can be summed as well.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.pairs.irradiance import Receivers, checked, irradiance, over_receivers
from refgi.pairs.lobe_sum import add_lobes
from refgi.pairs.ranged_sum import sum_pairs_in_range, sum_weighed_pairs
from refgi.pairs.sphere_sum import sum_spheres
from refgi.splat.sii.reach.lists import Lists
from refgi.splat.sii.reach.reference_length import with_reference_length
from refgi.splat.sii.settings import SplatSettings
from refgi.stages import skip, stage

if TYPE_CHECKING:
    from refgi.lights import PixelLights
    from refgi.rsm import Projection

Array = npt.NDArray[Any]


def splat(
    receivers: Receivers, lights: "PixelLights", settings: SplatSettings, footprint: Array | None = None,
    projection: "Projection | None" = None,
) -> Array:
    """Sum the irradiance of every pixel light at the receivers where it may be significant (SII Eq. 2, Sec. 3.4).

    Parameters
    ----------
    receivers : Receivers
        Points that are lit; their dtype is that of the result.
    lights : PixelLights
        Lights to sum.
    settings : SplatSettings
        Threshold and bound, and how one light lights one receiver.
    footprint : (N,) ndarray, optional
        Surface area each light stands for, m^2; needed by the clamps "disc" and "sphere" alone.
    projection : Projection, optional
        The map the receivers are seen on; needed by the bounds "quad" and "mesh" alone.

    Returns
    -------
    (3, h, w) ndarray
        Irradiance, W/m^2, linear RGB, as that of `irradiance`, of the pairs with B >= I_low. Without a threshold it
        is that of `irradiance` to the bit.

    Raises
    ------
    InputError
        As `irradiance`; or if the bound lacks its map.
    """
    if not settings.cuts:
        skip("splat.bins", "I_low is 0: every light reaches every pixel")
        return irradiance(receivers, lights, settings.pairs, footprint)
    return _splat(receivers, lights, settings, footprint, projection)


@stage("splat.irradiance")
def _splat(
    receivers: Receivers, lights: "PixelLights", settings: SplatSettings, footprint: Array | None,
    projection: "Projection | None",
) -> Array:
    return _sum_in_range(receivers, lights, settings, footprint, projection, outside=False)


@stage("splat.cut")
def cut_irradiance(
    receivers: Receivers, lights: "PixelLights", settings: SplatSettings, footprint: Array | None = None
) -> Array:
    """Sum the irradiance of the pairs that `splat` leaves out.

    Parameters
    ----------
    receivers : Receivers
        Points that are lit.
    lights : PixelLights
        Lights.
    settings : SplatSettings
        Those of `splat`; the bound does not matter.
    footprint : (N,) ndarray, optional
        As for `splat`.

    Returns
    -------
    (3, h, w) ndarray
        Irradiance, W/m^2, linear RGB: with that of `splat` it makes the full sum, but for rounding. With a random
        range it is the full sum less the weighed one, and may be below 0.
    """
    if not settings.cuts:
        return np.zeros_like(np.asarray(receivers.position))
    return _sum_in_range(receivers, lights, settings, footprint, None, outside=True)


def _sum_in_range(
    receivers: Receivers, lights: "PixelLights", settings: SplatSettings, footprint: Array | None,
    projection: "Projection | None", *, outside: bool,
) -> Array:
    packed = checked(receivers, lights, settings.pairs, footprint)
    settings = with_reference_length(receivers, lights, settings)
    lists = Lists(packed, settings, outside, receivers.covered.shape[1], projection)
    weighed = outside or settings.stochastic_range

    def add(here: Array, facing: Array, places: Array, sums: Array) -> None:
        if lists.diffuse is not None and packed.spheres is not None:
            sum_spheres(here, facing, packed.diffuse, packed.spheres, lists.diffuse, sums)
        elif lists.diffuse is not None:
            run = sum_weighed_pairs if weighed else sum_pairs_in_range
            listed = lists.of_diffuse(here, facing, places)
            run(here, facing, packed.diffuse, packed.clamp, lists.diffuse, listed, sums)
        if packed.lobes is not None:
            add_lobes(here, facing, *packed.lobes, lists.lobes, lists.of_lobes(here, facing, places), sums)

    return over_receivers(receivers, packed, add)
