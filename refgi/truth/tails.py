"""The tail of a pass's values: whether the error of their mean can be trusted.

The spread of the passes cannot show what no sample met, but what was met tells how heavy the tail is. A value of a
pixel that lies above the mean of the passes before it counts in bins of its block, eight to an octave, as brightness
cascades do (Zirr, Hanika and Dachsbacher 2018); the picture's counts are the sum over blocks. To the largest
M = min(S / 5, 3 sqrt(S)) of S values a generalised Pareto distribution is fitted (Zhang and Stephens 2009). Its shape k
is the tail index of Pareto-smoothed importance sampling (PSIS; Vehtari, Simpson, Gelman, Yao and Gabry 2024): moments
of order 1 / k and more do not exist, and above 0.7 neither a mean nor its standard error settles in any practical
number of samples.
"""

import math
from typing import Any

import numpy as np

from refgi.jit import kernel, prange
from refgi.types import Array

DOUBTED = 0.2  # share of a picture's light in blocks of heavy tails; diffuse scenes come to 0.08 at most
TRUSTED = 0.7  # largest tail index of an error that can be trusted (Vehtari et al.)
PER_OCTAVE, OCTAVES = 8, (-16, 24)  # bins; of the median of the first pass that has light
BINS = PER_OCTAVE * (OCTAVES[1] - OCTAVES[0]) + 1  # the first holds all that lies below
HELP = "more samples help, estimator=combined in place of one alone, or caustics=true where lobes are sharp"
FEWEST = 5.0  # values in a tail that tell its shape; also the weight of the prior, of k = 0.5, in 10 values (PSIS)


def count_tails(tails: Array, scale: Array, block: Array, values: Array, mean: Array, before: Array) -> None:
    """Count how far values of a pass lie above the means of the passes before.

    `tails` (blocks, BINS) int32: added to. `scale` () float64: the median of lit receivers in the first pass that has
    light, 0 until then. `block` (r,) int: of each receiver. `values`, `mean` (3, r) float64: of the pass, and of all
    before. `before` (r,) int: of how many passes. After one alone, either of two may be the larger.
    """
    grey = values.mean(axis=0)
    lit = np.isfinite(grey) & (grey > 0)
    if scale == 0 and lit.any():
        scale[...] = np.median(grey[lit])  # a burst in this pass moves it little
    usable = np.isfinite(grey) & (before > 0)
    above = grey[usable] - mean.mean(axis=0)[usable]
    above = np.where(before[usable] == 1, np.abs(above), above)
    with np.errstate(over="ignore"):
        mantissa, exponent = np.frexp(np.clip(above / (scale or 1.0), 0.0, 2.0 ** OCTAVES[1]))
    bins = PER_OCTAVE * (exponent - 1 - OCTAVES[0]) + (PER_OCTAVE * (2 * mantissa - 1)).astype(np.int64) + 1
    np.add.at(tails.reshape(-1), block[usable] * BINS + np.where(above > 0, np.clip(bins, 0, BINS - 1), 0), 1)


def tail_index(tails: Array) -> Array:
    """Return the tail index k of each row of counts; NaN where too few values were met to tell.

    `tails` (n, BINS) int. Returns (n,) float64.
    """
    found = np.empty(len(tails))
    _fit(tails, _edges(), found)
    return found


def share_in_doubt(index: Array, light: Array) -> float:
    """Return the share of light that lies in blocks whose tail index is above 0.7; 0 where there is no light.

    `index`, `light`: of each block, in one shape; light in any unit.
    """
    total = float(light.sum())
    return float((light * (index > TRUSTED)).sum()) / total if total > 0 else 0.0


def doubt_of(index: float, share: float) -> str:
    """Return why an error is not to be trusted, and what helps; empty where nothing speaks against it.

    `index`: tail index of the picture; NaN where not known. `share`: of the light that lies in blocks in doubt.
    """
    if not (index > TRUSTED or share > DOUBTED):
        return ""
    heavy = (f"the largest contributions have tail index k = {index:.2f} > {TRUSTED}" if index > TRUSTED else
             f"{share:.0%} of the light lies in blocks whose largest contributions have a tail index above {TRUSTED}")
    return f"the error is not to be trusted: {heavy}; {HELP}"


def _edges() -> Array:
    """Return the lower edges of all bins but the first, and the upper one of the last; (BINS,)."""
    place = np.arange(BINS)
    return np.asarray(2.0 ** (OCTAVES[0] + place // PER_OCTAVE) * (1 + place % PER_OCTAVE / PER_OCTAVE))


@kernel(parallel=True)
def _fit(tails: Array, edges: Array, found: Array) -> None:
    for row in prange(len(tails)):
        total = tails[row].sum()
        wanted = min(total / 5, 3 * math.sqrt(total))
        first, count = len(tails[row]), 0
        while first > 1 and count < wanted:
            first -= 1
            count += tails[row, first]
        found[row] = math.nan
        if wanted >= FEWEST and count >= wanted:
            counts = tails[row, first:]
            found[row] = _shape(counts, 0.5 * (edges[first - 1 : -1] + edges[first:]) - edges[first - 1], count)


@kernel
def _shape(counts: Any, excess: Any, n: Any) -> Any:
    """Return the shape of a generalised Pareto distribution, a mean over its profile likelihood, with PSIS's prior."""
    last = len(counts) - 1
    while counts[last] == 0:
        last -= 1
    quarter, met = 0, counts[0]
    while met < n / 4 + 0.5:
        quarter += 1
        met += counts[quarter]
    size = 30 + int(math.sqrt(n))
    theta, likelihood = np.empty(size), np.empty(size)
    for i in range(size):
        theta[i] = 1 / excess[last] + (1 - math.sqrt(size / (i + 0.5))) / (3 * excess[quarter])
        k = _mean_log(counts, excess, last, n, theta[i])
        likelihood[i] = n * (math.log(-theta[i] / k) - k - 1) if theta[i] != 0 else -math.inf
    weight = np.exp(likelihood - likelihood.max())
    k = _mean_log(counts, excess, last, n, (theta * weight).sum() / weight.sum())
    return (n * k + FEWEST) / (n + 2 * FEWEST)


@kernel
def _mean_log(counts: Any, excess: Any, last: Any, n: Any, theta: Any) -> Any:
    """Return the mean of log(1 - theta x) over excesses."""
    total = 0.0
    for j in range(last + 1):
        if counts[j]:
            total += counts[j] * math.log1p(-theta * excess[j])
    return total / n
