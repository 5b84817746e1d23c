"""Pixel lights (VPLs) as arrays, and their ranges.

The range says which pairs of light and receiver the threshold I_low keeps (SII Sec. 3.4, appendix). A pair counts where
B >= xi I_low. B = I(w) / r^2 is the irradiance that the light causes at most (the receiver's cosine taken as 1), I_low
one absolute irradiance, and xi is 1, or drawn for each light by the stochastic range.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


class PixelLights(NamedTuple):
    """N' <= N point lights with a surface normal, in the order they were drawn."""

    position: Array  # (3, N') m, world space
    normal: Array  # (3, N') unit vectors
    flux: Array  # (3, N') W, reflected by the diffuse part, T/N included
    lobe_flux: Array | None  # (3, N') W, reflected by the lobe, T/N included; None: no lobes
    lobe_axis: Array | None  # (3, N') unit vectors
    lobe_exponent: Array | None  # (N',)
    drawn: int  # N: those without flux included
    texel: Array | None = None  # (N',) int32: row * W + column on the stacked maps; None: not from a map
    map_index: Array | None = None  # (N',) int32: which of the maps
    half: Array | None = None  # (N',) bool: of the second half of the draw, a sample like the first; None: no draw

    def recorded(self) -> dict[str, Array | None]:
        """Return what sums read of a light, by name, as logs keep it."""
        return {name: getattr(self, name) for name in self._fields[:6]}

    def with_channels(self, channels: Mapping[str, Any], _: np.dtype[Any]) -> "PixelLights":
        """Return lights with other arrays, by name."""
        return self._replace(**channels)


class Range(NamedTuple):
    """The threshold as kernels read it, for each packed light.

    With s(w) = I(w) / I_0 <= 1 the shape of the light's intensity, B / I_low = square s(w) / r^2.
    """

    square: Array  # (N,) R_0^2 = I_0 / I_low, m^2, of the largest channel; a lobe's I_0 is its flux times norm
    scale: Array  # (N,) xi in (0, 1]: pairs are kept where B >= xi I_low, times max(1, I_low / B); 1 is the plain cut
    outside: bool  # sum what the cut removes instead: each term times 1 less its factor
