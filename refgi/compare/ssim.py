"""Structural similarity of linear pictures (Wang, Bovik, Sheikh and Simoncelli 2004), with a mask.

Gaussian windows of 11x11 pixels and sigma 1.5 around every covered pixel; weights of pixels outside the picture or
the mask are zero and the rest is normalised again, so border and mask are treated alike. Population variances,
K1 = 0.01, K2 = 0.03. The dynamic range is the reference's maximum, since linear values have no fixed white.
"""

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from refgi.types import Array

RADIUS = 5
SIGMA = 1.5
K1, K2 = 0.01, 0.03


def mean_ssim(image: Array, reference: Array, covered: Array) -> float:
    """Return the mean over covered pixels and channels of the similarity of the windows around them.

    Pictures (3, h, w) are finite where covered. 1 for equal pictures; nan where the reference's maximum is not
    positive.
    """
    c1, c2 = _constants(reference, covered)
    if not c1 > 0:
        return math.nan
    average = _window_average(covered)

    def of_channel(x: Array, r: Array) -> float:
        x, r = x.astype(np.float64), r.astype(np.float64)
        mean_x, mean_r = average(x), average(r)
        variance_x = np.maximum(average(x * x) - mean_x**2, 0)
        variance_r = np.maximum(average(r * r) - mean_r**2, 0)
        covariance = average(x * r) - mean_x * mean_r
        luminance = (2 * mean_x * mean_r + c1) / (mean_x**2 + mean_r**2 + c1)
        similarity = luminance * (2 * covariance + c2) / (variance_x + variance_r + c2)
        return float(similarity[covered].mean())

    with ThreadPoolExecutor(3) as pool:  # SciPy's filters leave Python's lock
        return float(np.mean(list(pool.map(of_channel, image, reference))))


def ssim_of_noise(reference: Array, variance: Array, covered: Array) -> float:
    """Return the similarity a perfect picture would have with a reference, (3, h, w), of this variance a pixel.

    The mean of (2 s + C2) / (2 s + n + C2): n is the window's mean noise variance, s its variance without noise.
    """
    c1, c2 = _constants(reference, covered)
    if not c1 > 0:
        return math.nan
    average = _window_average(covered)

    def of_channel(r: Array, v: Array) -> float:
        r, noise = r.astype(np.float64), average(v.astype(np.float64))
        signal = np.maximum(average(r * r) - average(r) ** 2 - noise, 0)
        return float(((2 * signal + c2) / (2 * signal + noise + c2))[covered].mean())

    with ThreadPoolExecutor(3) as pool:
        return float(np.mean(list(pool.map(of_channel, reference, variance))))


def _constants(reference: Array, covered: Array) -> tuple[float, float]:
    peak = max(float(reference[:, covered].max()), 0.0)
    return (K1 * peak) ** 2, (K2 * peak) ** 2


def _window_average(covered: Array) -> Callable[[Array], Array]:
    from scipy.ndimage import correlate1d  # here, as a picture that is not compared needs none of it

    offsets = np.arange(-RADIUS, RADIUS + 1)
    weights = np.exp(-(offsets**2) / (2 * SIGMA**2))

    def weighted_sum(plane: Array) -> Array:
        masked = np.where(covered, plane, 0.0)
        rows = correlate1d(masked, weights, axis=0, mode="constant")
        return np.asarray(correlate1d(rows, weights, axis=1, mode="constant"))

    total = weighted_sum(np.ones(covered.shape))

    def average(plane: Array) -> Array:
        averaged: Array = np.divide(weighted_sum(plane), total, out=np.zeros(plane.shape), where=total > 0)
        return averaged

    return average
