"""Smooth interfaces between clear media: Snell's law and Fresnel's, for light without polarisation."""

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


def refract(direction: Array, normal: Array, eta: Array) -> tuple[Array, Array]:
    """Bend rays at smooth interfaces (Snell) and return what passes (Fresnel, unpolarised).

    Parameters
    ----------
    direction : (3, n) ndarray
        Unit vectors of the incoming light.
    normal : (3, n) ndarray
        Unit normals on the side that light goes to.
    eta : (n,) ndarray
        Index of refraction on the near side over that on the far side.

    Returns
    -------
    direction : (3, n) ndarray
        Unit vectors behind the interface; the incoming ones where nothing passes.
    transmittance : (n,) ndarray
        Share of the flux that passes; 0 at total reflection and for light that comes from the normal's side.
    """
    cos_in = (direction * normal).sum(axis=0)
    sin2 = eta**2 * (1 - cos_in**2)
    passes = (sin2 < 1) & (cos_in > 0)
    cos_out = np.sqrt(np.where(passes, 1 - sin2, 1))
    bent = eta * direction + (cos_out - eta * cos_in) * normal
    bent /= np.linalg.norm(bent, axis=0)
    near = np.where(passes, cos_in, 1)
    along = (eta * near - cos_out) / (eta * near + cos_out)  # amplitude reflected, perpendicular polarisation
    across = (near - eta * cos_out) / (near + eta * cos_out)
    return np.where(passes, bent, direction), np.where(passes, 1 - (along**2 + across**2) / 2, 0)
