"""What turns the irradiance of every picture of one view into its radiance: L = L_0 + k E at each pixel and channel.

All pictures of a view share L_0 (emission and reflected direct light) and k (albedo / pi), so a page holds them once
and each picture's irradiance alone. Both are found from the pictures by least squares, with 0 <= k <= 1 / pi.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.errors import expect

Array = npt.NDArray[Any]

TOLERANCE = 2.0**-10  # of the radiance: two roundings to half floats


class SurfaceFit:
    """Sums over the pictures of a view, (3, h, w), taken one after the other."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self._count: Array = np.zeros(shape, np.int64)
        self._sums = np.zeros((4, *shape))  # of E, L, E^2, E L

    def add(self, irradiance: Array, radiance: Array) -> None:
        """Count a picture: indirect irradiance, W/m^2, and the radiance that the camera receives.

        Pixels that are not finite do not count.
        """
        expect(irradiance.shape == radiance.shape == self._sums.shape[1:], "picture", f"shape {self._sums.shape[1:]}",
               irradiance.shape)
        e, light = irradiance.astype(np.float64), radiance.astype(np.float64)
        finite = np.isfinite(e) & np.isfinite(light)
        e, light = np.where(finite, e, 0.0), np.where(finite, light, 0.0)
        self._count += finite
        self._sums += np.stack([e, light, e * e, e * light])

    def solve(self) -> tuple[Array, Array]:
        """Return L_0, W/m^2/sr, and k, 1/sr, each (3, h, w)."""
        count = np.maximum(self._count, 1)
        e, light, squares, products = self._sums / count
        spread = squares - e * e
        least = 1e-12 * squares  # below it pictures agree, and any k that leaves L_0 >= 0 serves
        slope = np.divide(products - e * light, spread, out=np.zeros_like(e), where=spread > least)
        steepest = np.divide(light, e, out=np.full_like(e, np.inf), where=e > 0)
        slope = np.clip(slope, 0.0, np.minimum(1 / math.pi, np.maximum(steepest, 0.0)))
        return light - slope * e, slope


def follows(irradiance: Array, radiance: Array, surface: tuple[Array, Array]) -> bool:
    """Return whether a picture's radiance is what the surface, L_0 and k, makes of its irradiance.

    True where every finite pixel differs by less than a rounding to half floats.
    """
    emitted, reflectance = surface
    finite = np.isfinite(irradiance) & np.isfinite(radiance)
    made = np.where(finite, emitted + reflectance * np.where(finite, irradiance, 0.0), 0.0)
    right = np.where(finite, radiance, 0.0)
    floor = np.abs(right).max(initial=0.0) * 2.0**-24
    return bool((np.abs(made - right) <= TOLERANCE * np.abs(right) + floor).all())
