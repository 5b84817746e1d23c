"""How near a picture is to the full sum, from a few pixels that are lit in full: an estimate and its bounds."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.draws import ERROR_SAMPLES, draws
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
    _draw(covered, side, draws(seed, ERROR_SAMPLES, rows * columns).reshape(rows, columns), pixel, count)
    drawn = pixel >= 0
    return Samples(pixel[drawn], count[drawn] / max(1.0, count.sum()))


def mean_of(samples: Samples, exact: Array) -> tuple[float, float]:
    """Estimate the mean of the full sum.

    Parameters
    ----------
    samples : Samples
        Where it is known.
    exact : (3, n) ndarray
        Irradiance there, W/m^2.

    Returns
    -------
    mean, error : float
        Over covered pixels and channels, and three standard errors of it, W/m^2.

    Notes
    -----
    Neighbouring strata stand in for two draws from one, which overestimates the standard error where light changes.
    """
    light = exact.mean(axis=0, dtype=np.float64)
    steps = np.diff(light, append=light[:1])
    return (float((samples.share * light).sum()),
            DEVIATIONS * math.sqrt(float((samples.share**2 * steps**2).sum()) / 2))


def estimate(samples: Samples, missed: Array, mean: tuple[float, float]) -> Estimate:
    """Estimate the relative RMSE of a picture, with bounds of three standard errors.

    Parameters
    ----------
    samples : Samples
        Where the picture was compared.
    missed : (3, n) ndarray
        What it differs by from the full sum there, W/m^2.
    mean : tuple of 2 floats
        Of `mean_of`.

    Returns
    -------
    Estimate
        0 where nothing differs.

    Notes
    -----
    Strata are taken for independent draws, which overestimates the standard error. Errors are rare and large along
    edges, so the upper bound also takes as much of what was not drawn as three more of the worst sample.
    """
    square = samples.share * (missed.astype(np.float64) ** 2).mean(axis=0)
    mse = float(square.sum())
    if mse == 0:
        return Estimate(0.0, 0.0, 0.0)
    spread = DEVIATIONS * math.sqrt(float(((square - samples.share * mse) ** 2).sum()))
    light, doubt = mean
    high = math.sqrt(mse + spread + UNSEEN * float(square.max())) / (light - doubt) if light > doubt else math.inf
    return Estimate(math.sqrt(mse) / max(light, 1e-300), math.sqrt(max(mse - spread, 0.0)) / (light + doubt), high)


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
