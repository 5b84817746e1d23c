"""Errors of irradiance as shares of the reference's mean, so that scenes of any brightness can be compared."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.compare.metrics import mae, rmse

Array = npt.NDArray[Any]


class Errors(NamedTuple):
    """How far a picture is off, in per cent of the reference's mean irradiance."""

    rmse: float
    mae: float
    lost: float  # how much darker it is in all; negative: brighter


def errors_of(image: Array, reference: Array, covered: Array) -> Errors:
    """Judge a picture.

    Parameters
    ----------
    image, reference : (3, h, w) ndarray
        Irradiance, W/m^2.
    covered : (h, w) ndarray of bool
        Pixels with a surface.

    Returns
    -------
    Errors
        All nan where the reference is black.
    """
    mean = float(reference[:, covered].mean(dtype=np.float64))
    if mean <= 0:
        return Errors(np.nan, np.nan, np.nan)
    lost = 1 - float(image[:, covered].mean(dtype=np.float64)) / mean
    return Errors(100 * rmse(image, reference, covered) / mean, 100 * mae(image, reference, covered) / mean, 100 * lost)
