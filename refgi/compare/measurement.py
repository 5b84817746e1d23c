"""All figures of a picture at once, each beside what the reference's own noise gives.

A perfect picture compared with a noisy reference does not score zero: its MSE is the mean of v, the variance of the
reference's mean. That expectation stands beside each figure, and a figure that does not rise above it says nothing
about the picture.
"""

import dataclasses
import math

import numpy as np

from refgi.compare.metrics import (
    METRICS,
    Array,
    checked_mask,
    count_non_finite,
    decibels,
    over_magnitude,
    relative_scale,
    samples,
)
from refgi.compare.ssim import ssim_of_noise
from refgi.errors import expect

NOISE_MARGIN = 1.1  # a figure is itself random: within 10 % of the expected noise it is noise
BIAS_MARGIN = 2.0  # standard errors: 95 % of what noise alone gives
MEAN_ABS_OF_NORMAL = math.sqrt(2 / math.pi)  # E|z| for a standard normal z


@dataclasses.dataclass(frozen=True)
class Figure:
    """One figure of error and what a perfect picture would have got; nan where that is not known."""

    value: float
    noise: float = math.nan
    is_noise: bool = False


@dataclasses.dataclass(frozen=True)
class Measurement:
    """All figures of one picture against one reference."""

    figures: dict[str, Figure]
    pixels: int  # compared
    non_finite: int  # pixels of the picture with a NaN or infinite channel; if any, every figure is nan
    non_finite_reference: int


def measure(image: Array, reference: Array, variance: Array | None = None, covered: Array | None = None,
            mean_variance: Array | None = None) -> Measurement:
    """Compute every figure, and beside it what the reference's noise alone would give.

    Parameters
    ----------
    image, reference : (3, h, w) ndarray
        Linear RGB in one unit.
    variance : (3, h, w) ndarray, optional
        Variance of the reference's mean, the unit squared.
    covered : (h, w) ndarray of bool, optional
        Pixels to compare; all where absent.
    mean_variance : (3,) ndarray, optional
        Variance of the mean over covered pixels of each channel, which knows how pixels' errors go together; where
        absent they count as independent.

    Returns
    -------
    Measurement
        The figures by name. If any compared pixel is not finite, all of them are nan and the count says why.

    Raises
    ------
    InputError
        If shapes differ or no pixel is covered.
    """
    mask = checked_mask(image, reference, covered)
    bad, bad_reference = count_non_finite(image, mask), count_non_finite(reference, mask)
    if bad or bad_reference:
        figures = {name: Figure(math.nan) for name in METRICS}
    else:
        noise = {} if variance is None else noise_figures(image, reference, variance, mask, mean_variance)
        x, r = (row.reshape(3, 1, -1) for row in samples(image, reference, mask))  # gathered once for all but SSIM
        values = {name: f(image, reference, mask) if name == "ssim" else f(x, r, None) for name, f in METRICS.items()}
        figures = {name: _figure(name, value, noise.get(name, math.nan)) for name, value in values.items()}
    return Measurement(figures, int(mask.sum()), bad, bad_reference)


def noise_figures(image: Array, reference: Array, variance: Array, covered: Array | None = None,
                  mean_variance: Array | None = None) -> dict[str, float]:
    """Return what each figure would be if the picture were perfect and the reference as noisy as it is.

    Parameters
    ----------
    image, reference : (3, h, w) ndarray
        Linear RGB in one unit.
    variance : (3, h, w) ndarray
        Variance of the reference's mean, the unit squared.
    covered : (h, w) ndarray of bool, optional
        Pixels to compare; all where absent.
    mean_variance : (3,) ndarray, optional
        Variance of the mean over covered pixels of each channel; from independent pixels where absent.

    Returns
    -------
    dict of str to float
        By metric; `bias` is the standard error of the reference's mean. With `mean_variance` the channels count as
        fully correlated, as they are where they share their samples.
    """
    mask = checked_mask(image, reference, covered)
    expect(variance.shape == reference.shape, "variance", f"shape {reference.shape}", variance.shape)
    x, r = samples(image, reference, mask)
    v = variance[:, mask].astype(np.float64).ravel()
    expect(bool(np.isfinite(v).all() and (v >= 0).all()), "variance", "finite numbers >= 0", "others")
    absolute = MEAN_ABS_OF_NORMAL * np.sqrt(v)
    scale = relative_scale(r)
    return {
        "mse": float(v.mean()),
        "rmse": math.sqrt(float(v.mean())),
        "relmse": float(np.mean(v / scale)) if scale.all() else math.nan,
        "mae": float(absolute.mean()),
        "smape": float(np.mean(np.minimum(over_magnitude(absolute, x, r), 1.0))),
        "bias": math.sqrt(float(v.sum())) / v.size if mean_variance is None else float(np.sqrt(mean_variance).mean()),
        "psnr": decibels(float(r.max()), float(v.mean())),
        "ssim": ssim_of_noise(reference, variance, mask),
    }


def _figure(name: str, value: float, noise: float) -> Figure:
    if name == "psnr":
        is_noise = value >= noise - 10 * math.log10(NOISE_MARGIN)
    elif name == "ssim":
        is_noise = 1 - value <= NOISE_MARGIN * (1 - noise)
    else:
        is_noise = abs(value) <= (BIAS_MARGIN if name == "bias" else NOISE_MARGIN) * noise
    return Figure(value, noise, is_noise)  # every comparison with nan is false
