"""B = I(w) / r^2 of a pair of light and receiver: what the threshold is held against, in float64."""

import math
from typing import Any

import numpy.typing as npt

from refgi.jit import kernel
from refgi.pairs.lobe_shape import CORRECTED, Widening, lobe_norm_factor

Array = npt.NDArray[Any]


@kernel
def diffuse_strength(position: Array, i: int, lights: Array, k: int) -> float:
    """Return B / I_0 = cos / r^2 of a packed diffuse light at a receiver.

    Parameters
    ----------
    position : (3, n) ndarray
        Receivers, m.
    i : int
        Which receiver.
    lights : (9, N) ndarray
        Packed lights: position, reversed normal, flux / pi.
    k : int
        Which light.

    Returns
    -------
    float
        1/m^2; 0 behind the light.
    """
    above, r2 = 0.0, 0.0
    for axis in range(3):
        d = float(lights[axis, k]) - float(position[axis, i])
        above += d * lights[3 + axis, k]
        r2 += d * d
    return above / (r2 * math.sqrt(r2)) if above > 0.0 else 0.0


@kernel
def lobe_strength(position: Array, i: int, lights: Array, widening: Widening | None, k: int) -> float:
    """Return B / I_0 = cos^P / r^2 of a packed lobe at a receiver.

    Parameters
    ----------
    position : (3, n) ndarray
        Receivers, m.
    i : int
        Which receiver.
    lights : (13, N) ndarray
        Packed lobes: position, reversed normal and axis, exponent, flux times norm.
    widening : Widening or None
        How exponents fall near the light.
    k : int
        Which lobe.

    Returns
    -------
    float
        1/m^2; 0 behind the light's surface and behind the lobe.
    """
    above, along, r2 = 0.0, 0.0, 0.0
    for axis in range(3):
        d = float(lights[axis, k]) - float(position[axis, i])
        above += d * lights[3 + axis, k]
        along += d * lights[6 + axis, k]
        r2 += d * d
    if above <= 0.0 or along <= 0.0:
        return 0.0
    r = math.sqrt(r2)
    return _shape(along / r, r, float(lights[9, k]), widening, k) / r2


@kernel
def _shape(cosine: float, r: float, exponent: float, widening: Widening | None, k: int) -> float:
    """Return I(w) / I_0 of a lobe."""
    if widening is None:
        return float(cosine**exponent)
    share = r / widening.distance if widening.slope == CORRECTED else 1.0 / (r * widening.distance)
    here = exponent * min(share, 1.0)
    theta = float(widening.cos_theta[k])
    norm = 1.0
    if widening.norm >= 0:
        norm = lobe_norm_factor(theta, here, widening.norm) / lobe_norm_factor(theta, exponent, widening.norm)
    return float(cosine**here * norm)
