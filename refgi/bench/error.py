"""The error of a method's pictures, bias and variance apart, and curves of it over time.

Pictures of several seeds differ by their variance; what all share is bias. With S pictures x_s of a reference R whose
mean has the variance v: MSE = mean |x_s - R|^2, variance = mean of the unbiased variance of x_s over s, and
bias^2 = mean |mean_s x_s - R|^2 - variance / S - mean v: neither few seeds nor the reference's noise counts as bias.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from refgi.errors import expect
from refgi.types import Array

BLOCK = 16  # pixels along a side of the blocks that an interval is drawn from: errors of neighbours go together
CONFIDENCE, RESAMPLES = 0.95, 999


class Error(NamedTuple):
    """Errors over the mean of the reference; nan where one picture alone cannot say it."""

    rmse: float  # root of the mean of squares over all pixels, channels and pictures
    low: float  # 95 % interval of rmse over other parts of such a picture
    high: float
    bias: float  # root of bias^2
    spread: float  # root of the variance over seeds
    noise: float  # rmse of a perfect picture: the reference's own standard error


def without_noise(rmse: float, noise: float) -> float:
    """Return an RMSE without the reference's own standard error; infinite where no RMSE is known."""
    return math.sqrt(max(0.0, rmse**2 - noise**2)) if math.isfinite(rmse) else math.inf


def error_of(pictures: Sequence[Array], reference: Array, variance: Array, covered: Array) -> Error:
    """Judge pictures of several seeds, each (3, h, w), W/m^2, over the reference's mean; infinite where that is 0."""
    expect(len(pictures) > 0, "pictures", "one or more", 0)
    expect(bool(covered.any()), "covered", "some pixel that shows a surface", "none")
    made = np.array([picture[:, covered] for picture in pictures], np.float64)
    right, noise = reference[:, covered].astype(np.float64), float(variance[:, covered].mean(dtype=np.float64))
    squares = ((made - right) ** 2).mean(axis=(0, 1))
    scale = float(right.mean())
    count = len(pictures)
    spread = float((made - made[0]).var(axis=0, ddof=1).mean()) if count > 1 else math.nan
    bias = float(((made.mean(axis=0) - right) ** 2).mean()) - spread / count - noise
    low, high = _interval(squares, covered)
    return Error(*(_over(value, scale) for value in (math.sqrt(squares.mean()), low, high, _root(bias), _root(spread),
                                                     math.sqrt(noise))))


def _interval(squares: Array, covered: Array) -> tuple[float, float]:
    """Return the interval of the root mean square over resampled blocks; nan where there is one block alone."""
    from scipy.stats import bootstrap

    row, column = np.nonzero(covered)
    _, block = np.unique(row // BLOCK * covered.shape[1] + column // BLOCK, return_inverse=True)
    if not np.isfinite(squares).all() or block.max() == 0:
        return math.nan, math.nan
    sums, counts = np.bincount(block, squares), np.bincount(block)
    found = bootstrap((sums, counts), lambda s, n, axis: np.sqrt(s.sum(axis=axis) / n.sum(axis=axis)), paired=True,
                      vectorized=True, n_resamples=RESAMPLES, confidence_level=CONFIDENCE, method="percentile",
                      rng=np.random.default_rng(0))
    return float(found.confidence_interval.low), float(found.confidence_interval.high)


def _root(square: float) -> float:
    return math.nan if math.isnan(square) else math.sqrt(max(0.0, square))


def _over(value: float, scale: float) -> float:
    return value / scale if scale else math.inf if value else 0.0


Point = tuple[float, float]  # s, error


def front(points: Sequence[Point]) -> list[bool]:
    """Return for each point (time, error) whether none is as fast and nearer, or as near and faster (Pareto)."""
    def beaten(seconds: float, error: float) -> bool:
        return any(s <= seconds and e <= error and (s, e) != (seconds, error) for s, e in points)

    return [math.isfinite(s) and math.isfinite(e) and not beaten(s, e) for s, e in points]


def error_in(line: Sequence[Point], seconds: float) -> float:
    """Return the error of an estimate that runs for some time, s, by its measured points (time, error).

    Between points along the straight line of both logarithms; after the last one falling with the root of time;
    infinite before the first, which no shorter run precedes.
    """
    known = sorted((s, e) for s, e in line if s > 0 and e > 0)
    if not known or seconds < known[0][0]:
        return math.inf
    if seconds >= known[-1][0]:
        return known[-1][1] * math.sqrt(known[-1][0] / seconds)
    x, y = np.log([s for s, _ in known]), np.log([e for _, e in known])
    return float(np.exp(np.interp(math.log(seconds), x, y)))


def knee(points: Sequence[Point]) -> int | None:
    """Return which point (time, error) of a method's curve is its knee: the first of the least error^4 x time.

    Where an error is bias and noise, e^2 = b^2 + c / t, this is where the noise has come down to the bias, c / t = b^2:
    from there on more time buys less and less. None where no point is positive and finite.

    >>> knee([(t, (0.1**2 + 0.04 / t) ** 0.5) for t in (1.0, 2.0, 4.0, 8.0)])
    2
    """
    costs = [e**4 * s if 0 < s < math.inf and 0 < e < math.inf else math.inf for s, e in points]
    least = min(costs, default=math.inf)
    return costs.index(least) if math.isfinite(least) else None
