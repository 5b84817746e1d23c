"""Lobes of pixel lights so sharp that hardly a receiver lies in any: their light vanishes from sums of pixel lights.

A Phong lobe of the exponent P is as wide as 2 / (P + 1) of the hemisphere, so that of n lights with such lobes
2 n / (P + 1) reach a receiver.
"""

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.diagnostics import asked
from refgi.errors import RefgiWarning

if TYPE_CHECKING:
    from refgi.frame import Frame
    from refgi.pairs.pixel_lights import PixelLights

Array = npt.NDArray[Any]

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
