"""Figures of error between a picture and a reference, each beside what the reference's own noise gives.

Arrays are linear and scene-referred, (3, h, w); sums are float64 over the pixels of `covered`. `x` is the picture, `r`
the reference, `v` the variance of the reference's mean, all per pixel and channel. A perfect picture compared with a
noisy reference does not score zero: its MSE is the mean of v. That expectation stands beside each figure, and a figure
that does not rise above it says nothing about the picture.
"""

import dataclasses
import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.compare.ssim import mean_ssim, ssim_of_noise
from refgi.errors import InputError, expect

Array = npt.NDArray[Any]

RELATIVE_FLOOR = 0.1  # of the reference's mean: keeps relMSE finite where the reference is dark
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


def mse(image: Array, reference: Array, covered: Array | None = None) -> float:
    """Return the mean squared error, mean((x - r)^2).

    Parameters
    ----------
    image, reference : (3, h, w) ndarray
        Linear RGB in one unit.
    covered : (h, w) ndarray of bool, optional
        Pixels to compare; all where absent.

    Returns
    -------
    float
        In the square of the unit.

    Raises
    ------
    InputError
        If shapes differ, no pixel is covered or a compared pixel is not finite. So do all figures here.
    """
    x, r = _samples(image, reference, covered)
    return float(np.mean((x - r) ** 2))


def rmse(image: Array, reference: Array, covered: Array | None = None) -> float:
    """Return the root of the mean squared error, in the unit of the picture.

    Parameters
    ----------
    image, reference : (3, h, w) ndarray
        Linear RGB in one unit.
    covered : (h, w) ndarray of bool, optional
        Pixels to compare; all where absent.

    Returns
    -------
    float
        In the unit of the picture.
    """
    return math.sqrt(mse(image, reference, covered))


def relmse(image: Array, reference: Array, covered: Array | None = None) -> float:
    """Return the relative mean squared error, mean((x - r)^2 / (r^2 + (0.1 mean r)^2)).

    Parameters
    ----------
    image, reference : (3, h, w) ndarray
        Linear RGB in one unit.
    covered : (h, w) ndarray of bool, optional
        Pixels to compare; all where absent.

    Returns
    -------
    float
        Without unit; nan for a wholly black reference.
    """
    x, r = _samples(image, reference, covered)
    scale = _relative_scale(r)
    return float(np.mean((x - r) ** 2 / scale)) if scale.all() else math.nan


def mae(image: Array, reference: Array, covered: Array | None = None) -> float:
    """Return the mean absolute error, mean|x - r|.

    Parameters
    ----------
    image, reference : (3, h, w) ndarray
        Linear RGB in one unit.
    covered : (h, w) ndarray of bool, optional
        Pixels to compare; all where absent.

    Returns
    -------
    float
        In the unit of the picture.
    """
    x, r = _samples(image, reference, covered)
    return float(np.mean(np.abs(x - r)))


def smape(image: Array, reference: Array, covered: Array | None = None) -> float:
    """Return the symmetric mean absolute percentage error, mean(|x - r| / (|x| + |r|)), 0 where both are 0.

    Parameters
    ----------
    image, reference : (3, h, w) ndarray
        Linear RGB in one unit.
    covered : (h, w) ndarray of bool, optional
        Pixels to compare; all where absent.

    Returns
    -------
    float
        From 0 to 1: without the factor 2 of other definitions, and not in percent.
    """
    x, r = _samples(image, reference, covered)
    return float(np.mean(_over_magnitude(np.abs(x - r), x, r)))


def bias(image: Array, reference: Array, covered: Array | None = None) -> float:
    """Return the mean signed error, mean(x - r): positive where the picture is too bright.

    Parameters
    ----------
    image, reference : (3, h, w) ndarray
        Linear RGB in one unit.
    covered : (h, w) ndarray of bool, optional
        Pixels to compare; all where absent.

    Returns
    -------
    float
        In the unit of the picture.
    """
    x, r = _samples(image, reference, covered)
    return float(np.mean(x - r))


def psnr(image: Array, reference: Array, covered: Array | None = None) -> float:
    """Return the peak signal-to-noise ratio, 10 log10(max(r)^2 / MSE).

    Parameters
    ----------
    image, reference : (3, h, w) ndarray
        Linear RGB in one unit.
    covered : (h, w) ndarray of bool, optional
        Pixels to compare; all where absent.

    Returns
    -------
    float
        Decibels; infinite for equal pictures, nan for a wholly black reference.
    """
    x, r = _samples(image, reference, covered)
    return _decibels(float(r.max()), float(np.mean((x - r) ** 2)))


def ssim(image: Array, reference: Array, covered: Array | None = None) -> float:
    """Return the mean structural similarity of linear values, with the dynamic range max(r).

    Parameters
    ----------
    image, reference : (3, h, w) ndarray
        Linear RGB in one unit.
    covered : (h, w) ndarray of bool, optional
        Pixels to compare; all where absent.

    Returns
    -------
    float
        1 for equal pictures; nan for a wholly black reference. See `refgi.compare.ssim`.
    """
    mask = _mask(image, reference, covered)
    _samples(image, reference, mask)
    return mean_ssim(image, reference, mask)


def flicker(images: Sequence[Array], references: Sequence[Array] | None = None, covered: Array | None = None) -> float:
    """Return the root mean square of the error's change from frame to frame, over the references' mean.

    Parameters
    ----------
    images : sequence of (3, h, w) ndarray
        Two or more frames.
    references : sequence of (3, h, w) ndarray, optional
        What each frame should be. Absent: a still scene, where nothing should change; then the mean is the images'.
    covered : (h, w) ndarray of bool, optional
        Pixels to compare; all where absent.

    Returns
    -------
    float
        Without unit; 0 where each frame's error is the same.
    """
    expect(len(images) >= 2, "images", "two or more frames", len(images))
    expect(references is None or len(references) == len(images), "references", f"{len(images)} frames",
           len(references or ()))
    pairs = [_samples(x, r, covered) for x, r in zip(images, references or images, strict=True)]
    errors = [x - r if references else x for x, r in pairs]
    change = [np.mean((b - a) ** 2) for a, b in itertools.pairwise(errors)]
    level = float(np.mean([r.mean() for _, r in pairs]))
    return math.sqrt(float(np.mean(change))) / level if level else math.nan


METRICS: dict[str, Callable[[Array, Array, Array | None], float]] = {
    "mse": mse, "rmse": rmse, "relmse": relmse, "mae": mae, "smape": smape, "bias": bias, "psnr": psnr, "ssim": ssim,
}


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
    mask = _mask(image, reference, covered)
    bad, bad_reference = count_non_finite(image, mask), count_non_finite(reference, mask)
    if bad or bad_reference:
        figures = {name: Figure(math.nan) for name in METRICS}
    else:
        noise = {} if variance is None else noise_figures(image, reference, variance, mask, mean_variance)
        figures = {name: _figure(name, f(image, reference, mask), noise.get(name, math.nan))
                   for name, f in METRICS.items()}
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
    mask = _mask(image, reference, covered)
    expect(variance.shape == reference.shape, "variance", f"shape {reference.shape}", variance.shape)
    x, r = _samples(image, reference, mask)
    v = variance[:, mask].astype(np.float64).ravel()
    expect(bool(np.isfinite(v).all() and (v >= 0).all()), "variance", "finite numbers >= 0", "others")
    absolute = MEAN_ABS_OF_NORMAL * np.sqrt(v)
    scale = _relative_scale(r)
    return {
        "mse": float(v.mean()),
        "rmse": math.sqrt(float(v.mean())),
        "relmse": float(np.mean(v / scale)) if scale.all() else math.nan,
        "mae": float(absolute.mean()),
        "smape": float(np.mean(np.minimum(_over_magnitude(absolute, x, r), 1.0))),
        "bias": math.sqrt(float(v.sum())) / v.size if mean_variance is None else float(np.sqrt(mean_variance).mean()),
        "psnr": _decibels(float(r.max()), float(v.mean())),
        "ssim": ssim_of_noise(reference, variance, mask),
    }


def count_non_finite(image: Array, covered: Array | None = None) -> int:
    """Count the pixels with a channel that is NaN or infinite.

    Parameters
    ----------
    image : (3, h, w) ndarray
        The picture.
    covered : (h, w) ndarray of bool, optional
        Pixels to count; all where absent.

    Returns
    -------
    int
        How many.
    """
    bad = ~np.isfinite(image).all(axis=0)
    return int((bad if covered is None else bad & covered).sum())


def _figure(name: str, value: float, noise: float) -> Figure:
    if name == "psnr":
        is_noise = value >= noise - 10 * math.log10(NOISE_MARGIN)
    elif name == "ssim":
        is_noise = 1 - value <= NOISE_MARGIN * (1 - noise)
    else:
        is_noise = abs(value) <= (BIAS_MARGIN if name == "bias" else NOISE_MARGIN) * noise
    return Figure(value, noise, is_noise)  # every comparison with nan is false


def _relative_scale(r: Array) -> Array:
    scale: Array = r**2 + (RELATIVE_FLOOR * r.mean()) ** 2
    return scale


def _over_magnitude(difference: Array, x: Array, r: Array) -> Array:
    magnitude = np.abs(x) + np.abs(r)
    quotient: Array = np.divide(difference, magnitude, out=np.zeros_like(magnitude), where=magnitude > 0)
    return quotient


def _decibels(peak: float, squared_error: float) -> float:
    if peak <= 0:
        return math.nan
    return math.inf if squared_error == 0 else 10 * math.log10(peak**2 / squared_error)


def _mask(image: Array, reference: Array, covered: Array | None) -> Array:
    expect(reference.ndim == 3 and reference.shape[0] == 3, "reference", "shape (3, h, w)", reference.shape)
    expect(image.shape == reference.shape, "image", f"shape {reference.shape}", image.shape)
    mask = np.ones(reference.shape[1:], bool) if covered is None else covered
    expect(mask.shape == reference.shape[1:] and mask.dtype == bool, "covered",
           f"booleans of shape {reference.shape[1:]}", mask.shape)
    expect(bool(mask.any()), "covered", "at least one pixel", "none")
    return mask


def _samples(image: Array, reference: Array, covered: Array | None) -> tuple[Array, Array]:
    mask = _mask(image, reference, covered)
    for name, pixels in (("image", image), ("reference", reference)):
        if bad := count_non_finite(pixels, mask):
            raise InputError(f"{name}: expected finite pixels, got {bad} that are NaN or infinite")
    return image[:, mask].astype(np.float64).ravel(), reference[:, mask].astype(np.float64).ravel()
