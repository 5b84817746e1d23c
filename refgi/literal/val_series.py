"""Convolution shadow maps: a depth test as a Fourier series, which can be filtered before comparing (VAL Sec. 4.1).

f_M(d, z) = 1/2 + sum w_k sin(c_k (z - d)) is about 1 for d < z, lit, and 0 for d > z: a sum of products of what the
pixel knows (d) and the map holds (z), so that means of sin(c_k z) and cos(c_k z) over a region give its mean.

Symbols: M terms, c_k = (2k - 1) pi; w_k = 2 / c_k; t depths on the series' scale, 0 to `end`, whose period is 2; b
bias; S, C, SZ, CZ (K, M, h, w) means of sin(c_k t), cos(c_k t), t sin(c_k t), t cos(c_k t), Z of t, in this order; the
rest as in val_visibility.
"""

from typing import Any

import numpy as np

from refgi.literal.val_maps import series_depth
from refgi.literal.val_visibility import disc, light_size, penumbra_angle, square, to_map

LEAST_BLOCKED = 0.02  # share of the search region: less is ripple of the series, no blocker (E-VAL-04)
NEARLY_ALL = 0.95  # of its top: where a damped series that never reaches 1 counts as lit


def series(terms: int, attenuation: float = 0.0, rescale: str = "none", fixed: float | None = None) -> Any:
    """Return w_k (M,), the biases of search and comparison (2,), and the far end of depths (1,) (E-VAL-02, 03, 05)."""
    weight = weights(terms, attenuation)
    if rescale == "plateau":
        weight = weight / min(1.0, 2 * plateau(weight))
    first = first_lit(weight)  # a bias: the least z - d that counts as lit, so that no surface half shadows itself
    search = first if fixed is None else fixed
    own = 0.0 if rescale == "scale2" else first
    final = own if fixed is None else fixed
    end = 1 - first - max(first, search)  # E-VAL-05: f_M(1 - u) = f_M(u), so that no two depths may differ by more
    return weight, np.array([search, final]), np.array([end])


def frequencies(terms: int) -> Any:
    """Return c_k (M,)."""
    k = np.arange(1.0, terms + 1)
    return (2 * k - 1) * np.pi


def weights(terms: int, attenuation: float) -> Any:
    """Return w_k (M,), damped by L_k = exp(-A (k / M)^2)."""
    damping = np.exp(-attenuation * (np.arange(1, terms + 1) / terms) ** 2)
    # Sec. 4.1: f = 1/2 + 2 sum_k 1 / c_k sin(c_k (z - d))
    return 2 * damping / frequencies(terms)


def above_half(gap: Any, weight: Any) -> Any:
    """Return f_M - 1/2 at z - d = gap."""
    return np.sin(np.multiply.outer(gap, frequencies(len(weight)))) @ weight


def first_lit(weight: Any) -> float:
    """Return b*: the least z - d at which the series is 1, or nearly at the top of one that stays below (E-VAL-03)."""
    gap = np.linspace(0, 0.5, 64 * len(weight) + 1)
    value = above_half(gap, weight)
    level = min(0.5, NEARLY_ALL * value.max())
    k = int(np.argmax(value >= level))
    low, high = gap[max(k - 1, 0)], gap[k]
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if above_half(middle, weight) < level else (low, middle)
    return float(high)


def plateau(weight: Any) -> float:
    """Return the mean of f_M - 1/2 from b* to 1 - b*."""
    first, c = first_lit(weight), frequencies(len(weight))
    return float((2 * weight / c * np.cos(c * first)).sum() / (1 - 2 * first))


def shade(means: Any, t: Any, b: Any, weight: Any) -> Any:
    """Return sum w_k (cos(c_k t') S_k - sin(c_k t') C_k), t' = t - b, of means S, C (K, 2 M, h, w): f_M - 1/2."""
    m = len(weight)
    w = weight[:, None, None]
    c = frequencies(m).astype(weight.dtype)[:, None, None]
    angle = c * (t - b)[:, None]
    sine, cosine = np.sin(angle), np.cos(angle)
    # E-VAL-02: sin(c (z - d)) = sin(c z) cos(c d) - cos(c z) sin(c d), each mean over the region
    each = cosine * means[:, :m] - sine * means[:, m:]
    return (w * each).sum(axis=1)


def csm_penumbra(
    position: Any, center: Any, frame: Any, delta: Any, near: Any, origin: Any, slope: Any, end: Any, weight: Any,
    bias: Any, pending: Any, means: Any, logarithmic: bool = True, alpha: bool = False, squares: bool = False,
    foreshortened: bool = False,
) -> Any:
    """Return shaded (K, h, w), z_avg (K, h, w), m, the region of the penumbra, and t of pixels (Sec. 4.1, 4.2).

    `means` (K, 4 M + 1, h, w) are S, C, SZ, CZ, Z over the search region; origin, slope (K,) the scale of depths.
    """
    local, d = to_map(position, center, frame)
    size = light_size(delta, local, d, foreshortened)
    m, b, nearest = len(weight), bias[0], near[:, None, None]
    t = np.where(pending, series_depth(d, origin, slope, end, logarithmic), 0)
    by_depth = means[:, 2 * m : 4 * m]
    z_mean = means[:, 4 * m]
    blocked = 0.5 - shade(means[:, : 2 * m], t, b, weight)
    # E-VAL-02: the mean of z (1 - f_M)
    total = 0.5 * z_mean - shade(by_depth, t, b, weight)
    shaded = pending & (blocked >= LEAST_BLOCKED)
    share = np.where(shaded, blocked, 1)
    # Sec. 4.1: z_avg
    mean = total / share
    z = np.where(shaded, series_distance(mean, origin, slope, logarithmic), d)
    z = np.maximum(z, nearest)  # E-VAL-04
    z = np.minimum(z, d)
    a = penumbra_angle(size, d, z, alpha)
    region = square(local, d, a) if squares else disc(local, d, a)
    return shaded, np.where(shaded, z, 0), np.where(shaded[:, None], region, 0), t


def series_distance(t: Any, origin: Any, slope: Any, logarithmic: bool) -> Any:
    """Return the distance, m, of depths t (K, h, w): the inverse of `series_depth`."""
    start, steep = origin[:, None, None], slope[:, None, None]
    steep = np.where(steep > 0, steep, 1)
    along = t / steep
    return start * np.exp2(along) if logarithmic else start + along


def csm(shaded: Any, t: Any, means: Any, weight: Any, bias: Any, gain: float = 1.0, hard: Any = None) -> Any:
    """Return V (K, h, w) = f_M over the penumbra's region, where shaded; elsewhere 1, or `hard` (Sec. 4.1)."""
    v = gain * (0.5 + shade(means, t, bias[1], weight))
    v = np.clip(v, 0, 1)
    rest = np.ones_like(v) if hard is None else hard
    return np.where(shaded, v, rest)
