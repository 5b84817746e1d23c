"""How near a picture is to the full sum, from a few pixels that are lit in full: an estimate and its bounds."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange

Array = npt.NDArray[Any]

DEVIATIONS = 3.0  # standard errors between the estimate and either bound
UNSEEN = 3.0  # samples: what no one of n draws met has, at 95 %, a share below 3 / n
STRATA = 48  # along the shorter side, before their largest size is met
LARGEST = 8  # pixels along a stratum


class Samples(NamedTuple):
    """One pixel of every stratum that shows a surface."""

    pixel: Array  # (n,) int64, flat indices
    share: Array  # (n,) float64, of the covered pixels that each stands for; they sum to 1


class Estimate(NamedTuple):
    """RMSE over the mean of the full sum, and what it lies between."""

    error: float
    low: float
    high: float


def stratified(covered: Array, seed: int) -> Samples:
    """Draw one covered pixel from every square of pixels that shows a surface.

    Parameters
    ----------
    covered : (h, w) ndarray of bool
        Whether there is a surface.
    seed : int
        Of the random numbers.

    Returns
    -------
    Samples
        Squares of 8 x 8 pixels, smaller ones where the picture is small.
    """
    side = min(max(math.isqrt(covered.size) // STRATA, 1), LARGEST)
    rows, columns = -(-covered.shape[0] // side), -(-covered.shape[1] // side)
    pixel, count = np.full(rows * columns, -1, np.int64), np.zeros(rows * columns)
    _draw(covered, side, np.random.default_rng(seed).random((rows, columns)), pixel, count)
    drawn = pixel >= 0
    return Samples(pixel[drawn], count[drawn] / max(1.0, count.sum()))


def estimate(samples: Samples, light: Array, exact: Array, mean: float) -> Estimate:
    """Estimate the relative RMSE of a picture, with bounds of three standard errors.

    Parameters
    ----------
    samples : Samples
        Where the picture was compared.
    light, exact : (3, n) ndarray
        Irradiance there, of the picture and of the full sum, W/m^2.
    mean : float
        Mean irradiance of the picture over covered pixels and channels, W/m^2.

    Returns
    -------
    Estimate
        0 where all is dark.

    Notes
    -----
    The full sum's mean is the picture's plus that of the difference at the samples, which varies far less than light.
    Strata are taken for independent draws, which overestimates the standard errors. Errors are rare and large along
    edges, so the upper bound also takes as much of what was not drawn as three more of the worst sample.
    """
    difference = exact.astype(np.float64) - light
    square, offset = (difference**2).mean(axis=0), difference.mean(axis=0)
    (mse, mse_error), (shift, shift_error) = (_weighted(samples.share, values) for values in (square, offset))
    if mse == 0:
        return Estimate(0.0, 0.0, 0.0)
    brightest, darkest = mean + shift + shift_error, mean + shift - shift_error
    unseen = UNSEEN * float((samples.share * square).max())
    high = math.sqrt(mse + mse_error + unseen) / darkest if darkest > 0 else math.inf
    return Estimate(math.sqrt(mse) / max(mean + shift, 1e-300), math.sqrt(max(mse - mse_error, 0.0)) / brightest, high)


def _weighted(share: Array, values: Array) -> tuple[float, float]:
    """Return a weighted mean and `DEVIATIONS` of its standard errors."""
    mean = float(share @ values)
    return mean, DEVIATIONS * math.sqrt(float(share**2 @ (values - mean) ** 2))


@kernel(parallel=True)
def _draw(covered: Array, side: int, random: Array, pixel: Array, count: Array) -> None:
    height, width = covered.shape
    for i in prange(random.shape[0]):
        for j in range(random.shape[1]):
            stratum, found = i * random.shape[1] + j, 0
            for y in range(i * side, min(i * side + side, height)):
                for x in range(j * side, min(j * side + side, width)):
                    found += covered[y, x]
            count[stratum], wanted = found, int(random[i, j] * found)
            for y in range(i * side, min(i * side + side, height)):
                for x in range(j * side, min(j * side + side, width)):
                    if covered[y, x]:
                        if wanted == 0:
                            pixel[stratum] = y * width + x
                        wanted -= 1
