"""Pixel lights (VPLs) as arrays, their ranges, and the shape of their lobes (SII Eq. 3, Sec. 3.3).

The range says which pairs of light and receiver the threshold I_low keeps (SII Sec. 3.4, appendix). A pair counts where
B >= xi I_low. B = I(w) / r^2 is the irradiance that the light causes at most (the receiver's cosine taken as 1), I_low
one absolute irradiance, and xi is 1, or drawn for each light by the stochastic range.

Symbols: P exponent, P' the widened one, th angle between lobe axis and surface normal, a the distance from which on the
exponent is whole.

A Phong lobe of the exponent P is as wide as 2 / (P + 1) of the hemisphere, so that of n lights with such lobes
2 n / (P + 1) reach a receiver.
"""

import math
import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from refgi.diagnostics import asked
from refgi.errors import RefgiWarning
from refgi.jit import kernel
from refgi.radiometry import lobe_norm
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.frame import Frame


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


NO_NORM, FULL_LOBE, CLAMPED = 0, 1, 2  # lobe_norm as a kernel sees it
CORRECTED, LITERAL = 0, 1  # slope of the widened exponent: P min(1, r / a), or min(P, P / (r a)) as printed


class Widening(NamedTuple):
    """How exponents fall near the light."""

    distance: Any  # a, m
    slope: int  # CORRECTED or LITERAL
    norm: int  # the lobe_norm that follows P', or -1: the one of P stays
    cos_theta: Array  # (N,) n . r of each light


@kernel
def lobe_norm_factor(cos_theta: Any, exponent: Any, norm: int) -> Any:
    """Return c(P), the peak intensity of a lobe of unit flux, 1/sr; 0 for a lobe of which nothing leaves the surface.

    NO_NORM: 1 as printed in Eq. 3; FULL_LOBE: (P + 1) / 2 pi; CLAMPED: (P + 1) / (2 pi K(th, P)).
    """
    real = type(cos_theta)
    # Eq. (3), normalised
    if norm == NO_NORM:
        return real(1.0)
    if norm == FULL_LOBE:
        return (exponent + real(1.0)) * real(1.0 / (2.0 * math.pi))
    return lobe_norm(cos_theta, exponent)


@kernel
def widened(square: Any, exponent: Any, whole: Any, widening: Widening, k: int, reached: bool) -> tuple[Any, Any]:
    """Return P' and c(P') / c(P) at a receiver of light k, r^2 = `square` (m^2) away, with c(P) = `whole` (Sec. 3.3).

    The ratio is 1 where the light does not reach the receiver, which does not need it.
    """
    real = type(square)
    one = real(1.0)
    r = math.sqrt(square)
    share = r / widening.distance if widening.slope == CORRECTED else one / (r * widening.distance)
    fallen = exponent * (share if share < one else one)
    if widening.norm >= 0 and share < one and reached and whole > real(0.0):
        return fallen, lobe_norm_factor(widening.cos_theta[k], fallen, widening.norm) / whole
    return fallen, one


SHARP = 1e5  # exponent from which on lobes may vanish; wider ones that are missed show as sampling error
LEAST_REACHING = 0.01  # lobes that reach a receiver, in the mean


def vanishing(lights: "PixelLights") -> Array:
    """Return which lights have lobes that reach fewer than `LEAST_REACHING` of the receivers, (N,) bool."""
    if lights.lobe_flux is None or lights.lobe_exponent is None:
        return np.zeros(lights.flux.shape[1], np.bool_)
    sharp: Array = lights.lobe_flux.any(axis=0) & (lights.lobe_exponent >= SHARP)
    for exponent in np.unique(lights.lobe_exponent[sharp]):
        same = sharp & (lights.lobe_exponent == exponent)
        if 2.0 * np.count_nonzero(same) >= LEAST_REACHING * (float(exponent) + 1.0):
            sharp &= ~same
    return sharp


def warn_of_mirrors(frame: "Frame", lights: "PixelLights", method: str) -> None:
    """Warn whoever collects diagnostics of lights whose lobes vanish, with the materials that they lie on."""
    if lights.lobe_flux is None or lights.lobe_exponent is None or asked("pairs.mirrors") is None:
        return
    gone = vanishing(lights)
    if gone.any():
        real, exponents = lights.lobe_exponent.dtype.type, set(lights.lobe_exponent[gone].tolist())
        names = [material.name for material in frame.scene.materials
                 if material.is_glossy and not material.is_dielectric and float(real(material.exponent)) in exponents]
        flux = lights.lobe_flux[:, gone].sum(dtype=np.float64)
        share = flux / (lights.flux.sum(dtype=np.float64) + lights.lobe_flux.sum(dtype=np.float64))
        warnings.warn(RefgiWarning(
            f"{method}: the lobes of {len(names)} material(s), {', '.join(map(repr, names))}, are too sharp (exponent "
            f"{min(exponents):g} or more) for {np.count_nonzero(gone)} pixel lights, which reach fewer than 1 receiver "
            f"in {1 / LEAST_REACHING:.0f}: {100 * share:.0f} % of the flux of {len(gone)} lights vanishes or lights "
            "single pixels"), stacklevel=3)
