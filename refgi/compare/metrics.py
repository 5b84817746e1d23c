"""Figures of error between a picture and a reference.

Arrays are linear and scene-referred, (3, h, w); sums are float64 over the pixels of `covered`. `x` is the picture, `r`
the reference, per pixel and channel. Every figure refuses pixels that are NaN or infinite, with their count.
"""

import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np

from refgi.compare.ssim import mean_ssim
from refgi.errors import InputError, expect
from refgi.types import Array

RELATIVE_FLOOR = 0.1  # of the reference's mean: keeps relMSE finite where the reference is dark


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
    x, r = samples(image, reference, covered)
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
    x, r = samples(image, reference, covered)
    scale = relative_scale(r)
    return float(np.mean((x - r) ** 2 / scale)) if scale.all() else math.nan


def mae(image: Array, reference: Array, covered: Array | None = None) -> float:
    """Return the mean absolute error, ``mean(|x - r|)``.

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
    x, r = samples(image, reference, covered)
    return float(np.mean(np.abs(x - r)))


def smape(image: Array, reference: Array, covered: Array | None = None) -> float:
    """Return the symmetric mean absolute percentage error, ``mean(|x - r| / (|x| + |r|))``, 0 where both are 0.

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
    x, r = samples(image, reference, covered)
    return float(np.mean(over_magnitude(np.abs(x - r), x, r)))


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
    x, r = samples(image, reference, covered)
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
    x, r = samples(image, reference, covered)
    return decibels(float(r.max()), float(np.mean((x - r) ** 2)))


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
    mask = checked_mask(image, reference, covered)
    samples(image, reference, mask)
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
    pairs = [samples(x, r, covered) for x, r in zip(images, references or images, strict=True)]
    errors = [x - r if references else x for x, r in pairs]
    change = [np.mean((b - a) ** 2) for a, b in itertools.pairwise(errors)]
    level = float(np.mean([r.mean() for _, r in pairs]))
    return math.sqrt(float(np.mean(change))) / level if level else math.nan


METRICS: dict[str, Callable[[Array, Array, Array | None], float]] = {
    "mse": mse, "rmse": rmse, "relmse": relmse, "mae": mae, "smape": smape, "bias": bias, "psnr": psnr, "ssim": ssim,
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


def relative_scale(r: Array) -> Array:
    """Return what squared errors are divided by in relMSE, r^2 + (0.1 mean r)^2, (n,); all 0 for a black reference."""
    scale: Array = r**2 + (RELATIVE_FLOOR * r.mean()) ** 2
    return scale


def over_magnitude(difference: Array, x: Array, r: Array) -> Array:
    """Return ``difference / (|x| + |r|)``, (n,), 0 where both are 0."""
    magnitude = np.abs(x) + np.abs(r)
    quotient: Array = np.divide(difference, magnitude, out=np.zeros_like(magnitude), where=magnitude > 0)
    return quotient


def decibels(peak: float, squared_error: float) -> float:
    """Return 10 log10(peak^2 / squared error): infinite without error, nan without a positive peak."""
    if peak <= 0:
        return math.nan
    return math.inf if squared_error == 0 else 10 * math.log10(peak**2 / squared_error)


def checked_mask(image: Array, reference: Array, covered: Array | None) -> Array:
    """Return the pixels to compare, (h, w), all where `covered` is None.

    InputError if the pictures' shapes differ or no pixel is covered.
    """
    expect(reference.ndim == 3 and reference.shape[0] == 3, "reference", "shape (3, h, w)", reference.shape)
    expect(image.shape == reference.shape, "image", f"shape {reference.shape}", image.shape)
    mask = np.ones(reference.shape[1:], bool) if covered is None else covered
    expect(mask.shape == reference.shape[1:] and mask.dtype == bool, "covered",
           f"booleans of shape {reference.shape[1:]}", mask.shape)
    expect(bool(mask.any()), "covered", "at least one pixel", "none")
    return mask


def samples(image: Array, reference: Array, covered: Array | None) -> tuple[Array, Array]:
    """Return the compared pixels of both pictures, float64 (n,), channel after channel.

    InputError if shapes differ, no pixel is covered or one is not finite.
    """
    mask = checked_mask(image, reference, covered)
    for name, pixels in (("image", image), ("reference", reference)):
        if bad := count_non_finite(pixels, mask):
            raise InputError(f"{name}: expected finite pixels, got {bad} that are NaN or infinite")
    x, r = (pixels if covered is None else pixels[:, mask] for pixels in (image, reference))
    return x.astype(np.float64, copy=False).ravel(), r.astype(np.float64, copy=False).ravel()
