"""The region where a light is significant, and what an ellipsoid holds of it (SII appendix)."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.splat.sii.reach.bounds import Ellipsoid

Array = npt.NDArray[Any]


def significant_radius(x: npt.ArrayLike, exponent: npt.ArrayLike) -> Array:
    """Return F(x) = x^(n / (n + 2)) sqrt(1 - x^(4 / (n + 2))), the radius of the significant region (SII Eq. 7).

    Parameters
    ----------
    x : (...) array_like
        Place along the axis, 0 to 1, in R_0.
    exponent : (...) array_like
        n > 0.

    Returns
    -------
    (...) ndarray
        Distance of the surface B = I_low from the axis, in R_0.
    """
    x, n = np.asarray(x, np.float64), np.asarray(exponent, np.float64)
    # Eq. (7)
    radius: Array = x ** (n / (n + 2)) * np.sqrt(np.maximum(0, 1 - x ** (4 / (n + 2))))
    return radius


def waste(ellipsoid: Ellipsoid, exponent: npt.ArrayLike) -> Array:
    """Return the volume of an ellipsoid over that of the significant region it encloses.

    Parameters
    ----------
    ellipsoid : Ellipsoid
        The bound.
    exponent : (...) array_like
        n.

    Returns
    -------
    (...) ndarray
        1 or more.

    Examples
    --------
    >>> from refgi.splat.sii.reach.bounds import appendix_ellipsoid
    >>> round(float(waste(appendix_ellipsoid(1.0), 1.0)), 3)
    1.08
    """
    n = np.asarray(exponent, np.float64)
    region = math.pi * ((n + 2) / (3 * n + 2) - 1 / 3)
    share: Array = 4 / 3 * math.pi * ellipsoid.half_width * ellipsoid.height**2 / region
    return share


def in_ellipsoid(ellipsoid: Ellipsoid, x: npt.ArrayLike, rho: npt.ArrayLike) -> Array:
    """Tell which points an ellipsoid holds: ((x - c) / w)^2 + (rho / h)^2 <= 1 (procedure P3).

    Parameters
    ----------
    ellipsoid : Ellipsoid
        The bound.
    x, rho : (...) array_like
        Places along and across the axis, in R_0.

    Returns
    -------
    (...) ndarray of bool
        Whether inside.
    """
    along = (np.asarray(x) - ellipsoid.center) / ellipsoid.half_width
    held: Array = along**2 + (np.asarray(rho) / ellipsoid.height) ** 2 <= 1
    return held
