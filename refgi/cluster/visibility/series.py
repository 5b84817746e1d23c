"""The depth comparison as a Fourier series, which can be filtered before it is compared (Sec. 4.1).

step(z - d) becomes f_M(d, z) = 1/2 + 2 sum_k (L_k / c_k) sin(c_k (z - d)), a product of what the receiver
knows (d) and what the map stores (z): its mean over a filter needs the means of sin(c_k z) and cos(c_k z) alone.

Symbols: c_k = (2k - 1) pi, k = 1 .. M; L_k = exp(-A (k / M)^2) the attenuation; w_k = 2 L_k / c_k; b bias; d, z depths
on the series' own scale, whose period is 2 and on which f_M(1 - u) = f_M(u).
"""

import functools
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.cluster.settings import Csm

Array = npt.NDArray[Any]

NEARLY_ALL = 0.95  # of the way from 1/2 to the top: where a series that never reaches 1 counts as lit
SCAN = 64  # samples per term that find the first crossing; the series has at most one per half wave of its last term


class Series(NamedTuple):
    """A series and the scale of depths it is meant for."""

    weight: Array  # (M,) float64: w_k, rescaled where that is asked for
    first: float  # b*: the first z - d at which f_M is 1
    search_bias: float  # b of the blocker search
    bias: float  # b of the final comparison
    range: float  # depth of the farthest point; all depths lie in [0, range]
    gain: float  # V = gain * f_M, cut to [0, 1]


def frequencies(terms: int) -> Array:
    """Return c_k = (2k - 1) pi, (M,), angular frequencies on the series' scale of depths."""
    return (2.0 * np.arange(1, terms + 1) - 1.0) * np.pi


def weights(terms: int, attenuation: float = 0.0) -> Array:
    """Return w_k = 2 L_k / c_k with L_k = exp(-A (k / M)^2), (M,): factors of sin(c_k (z - d)).

    A attenuates; 0 keeps the plain series and its overshoot of 9 %.
    """
    damping = np.exp(-attenuation * (np.arange(1, terms + 1) / terms) ** 2)
    # Sec. 4.1: f(d, z) = 1/2 + 2 sum_k (1 / c_k) sin(c_k (z - d)), c_k = (2k - 1) pi
    return np.asarray(2.0 * damping / frequencies(terms))


def above_half(difference: npt.ArrayLike, weight: Array) -> Array:
    """Return f_M - 1/2 = sum_k w_k sin(c_k (z - d)) of differences z - d on the series' scale (> 0 is lit).

    About 1/2 where lit, about -1/2 where shadowed, 0 at 0.
    """
    return np.asarray(np.sin(np.multiply.outer(difference, frequencies(len(weight)))) @ weight)


def plateau(weight: Array) -> float:
    """Return what a damped series makes of fully lit: its mean from where it is nearly at its top, to its mirror image.

    f_M - 1/2: about 1/2 for a plain series, 0.47 for A = 1 and M = 4.
    """
    c, start = frequencies(len(weight)), first_lit(weight)
    # the integral of w sin(c u) over [b, 1 - b], as cos(c (1 - b)) = -cos(c b)
    return float((2.0 * weight / c * np.cos(c * start)).sum() / (1.0 - 2.0 * start))


def first_lit(weight: Array) -> float:
    """Return b*, the first z - d at which the series is 1: about 0.305 / M; below 0.41.

    For a series that stays below 1: where it has come 95 % of the way to its top, the highest of 64 values for each
    term.
    """
    from scipy.optimize import brentq  # here, as methods that cast no such shadows need none of it

    u = np.linspace(0.0, 0.5, SCAN * len(weight) + 1)
    values = above_half(u, weight)
    level = min(0.5, NEARLY_ALL * float(values.max()))
    k = int(np.argmax(values >= level))
    return float(brentq(lambda x: float(above_half(x, weight)) - level, u[k - 1], u[k], xtol=1e-15, rtol=1e-14))


@functools.lru_cache(maxsize=64)
def _known(terms: int, attenuation: float, rescale: str, bias: float | None) -> Series:
    weight = weights(terms, attenuation)
    if rescale == "plateau":
        weight = weight / min(1.0, 2.0 * plateau(weight))
    first = first_lit(weight)
    gain, own = (2.0, 0.0) if rescale == "scale2" else (1.0, first)
    search, final = (first, own) if bias is None else (bias, bias)
    weight.setflags(write=False)
    return Series(weight, first, search, final, 1.0 - first - max(first, search), gain)


def series(settings: Csm) -> Series:
    """Return the series that settings ask for: weights, biases and the range of depths.

    The range is [0, 1 - 2 b*], so that no difference of two depths, biased, comes nearer to the series' other crossing
    at 1 than b*; a `bias` above b* narrows it. Sec. 4.1 says nothing of a bias; without one, every lit receiver would
    be half shadowed (f_M(0) = 1/2). The default b* is the least that makes it fully lit. "scale2" compares without bias
    and doubles; its search keeps b*, as an unbiased mean of blockers would count the receiver. "plateau" stretches a
    damped series about 1/2 until its plateau is 1.
    """
    return _known(settings.terms, settings.attenuation, settings.rescale, settings.bias)
