"""Figures of error between a picture x and a reference r, of indirect irradiance or radiance in one unit.

Both are linear RGB, (3, h, w); only pixels of `covered`, (h, w) bool, count, all where it is absent; sums are float64.
InputError if shapes differ, no pixel is covered, or a compared pixel is NaN or infinite (with their count).

SSIM (Wang, Bovik, Sheikh and Simoncelli 2004) is of linear values, so the dynamic range is the reference's maximum;
border and mask are treated alike: weights of pixels outside are zero and the rest is normalised again. FLIP (Andersson
et al. 2020, 2021) is by the optional flip-evaluator, in a child process, because it ends its process on input it
dislikes; left to itself it derives dozens of absurd exposures from dark references.
"""

import importlib.util
import itertools
import json
import math
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np

from refgi.errors import InputError, RefgiError, expect
from refgi.types import Array

RELATIVE_FLOOR = 0.1  # of the reference's mean: keeps relMSE finite where the reference is dark
RADIUS, SIGMA = 5, 1.5  # of SSIM's windows, pixels
K1, K2 = 0.01, 0.03


def mse(image: Array, reference: Array, covered: Array | None = None) -> float:
    """Return the mean squared error, mean((x - r)^2), in the square of the unit."""
    x, r = samples(image, reference, covered)
    return float(np.mean((x - r) ** 2))


def rmse(image: Array, reference: Array, covered: Array | None = None) -> float:
    """Return the root of the mean squared error, in the unit of the picture."""
    return math.sqrt(mse(image, reference, covered))


def relmse(image: Array, reference: Array, covered: Array | None = None) -> float:
    """Return the relative mean squared error, mean((x - r)^2 / (r^2 + (0.1 mean r)^2)); nan for a black reference."""
    x, r = samples(image, reference, covered)
    scale = relative_scale(r)
    return float(np.mean((x - r) ** 2 / scale)) if scale.all() else math.nan


def mae(image: Array, reference: Array, covered: Array | None = None) -> float:
    """Return the mean absolute error, ``mean(|x - r|)``, in the unit of the picture."""
    x, r = samples(image, reference, covered)
    return float(np.mean(np.abs(x - r)))


def smape(image: Array, reference: Array, covered: Array | None = None) -> float:
    """Return the symmetric mean absolute percentage error, ``mean(|x - r| / (|x| + |r|))``, 0 where both are 0.

    From 0 to 1: without the factor 2 of other definitions, and not in percent.
    """
    x, r = samples(image, reference, covered)
    return float(np.mean(over_magnitude(np.abs(x - r), x, r)))


def bias(image: Array, reference: Array, covered: Array | None = None) -> float:
    """Return the mean signed error, mean(x - r), in the unit of the picture: positive where it is too bright."""
    x, r = samples(image, reference, covered)
    return float(np.mean(x - r))


def psnr(image: Array, reference: Array, covered: Array | None = None) -> float:
    """Return the peak signal-to-noise ratio, 10 log10(max(r)^2 / MSE), dB: infinite if equal, nan for a black r."""
    x, r = samples(image, reference, covered)
    return decibels(float(r.max()), float(np.mean((x - r) ** 2)))


def ssim(image: Array, reference: Array, covered: Array | None = None) -> float:
    """Return the mean structural similarity over covered pixels and channels, 1 for equal pictures; nan if r <= 0."""
    mask = checked_mask(image, reference, covered)
    samples(image, reference, mask)
    c1, c2 = _constants(reference, mask)
    if not c1 > 0:
        return math.nan
    average = _window_average(mask)

    def of_channel(x: Array, r: Array) -> float:
        x, r = x.astype(np.float64), r.astype(np.float64)
        mean_x, mean_r = average(x), average(r)
        variance_x = np.maximum(average(x * x) - mean_x**2, 0)
        variance_r = np.maximum(average(r * r) - mean_r**2, 0)
        covariance = average(x * r) - mean_x * mean_r
        luminance = (2 * mean_x * mean_r + c1) / (mean_x**2 + mean_r**2 + c1)
        similarity = luminance * (2 * covariance + c2) / (variance_x + variance_r + c2)
        return float(similarity[mask].mean())

    return _over_channels(of_channel, image, reference)


def ssim_of_noise(reference: Array, variance: Array, covered: Array) -> float:
    """Return the similarity that a perfect picture would have with a reference, (3, h, w), of this variance a pixel.

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

    return _over_channels(of_channel, reference, variance)


def flicker(images: Sequence[Array], references: Sequence[Array] | None = None, covered: Array | None = None) -> float:
    """Return the root mean square of the error's change from frame to frame, over the references' mean.

    Of two or more frames; without references a still scene, where nothing should change, over the images' mean.
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
    one.__name__: one for one in (mse, rmse, relmse, mae, smape, bias, psnr, ssim)}


def count_non_finite(image: Array, covered: Array | None = None) -> int:
    """Count the pixels of a picture, (3, h, w), with a channel that is NaN or infinite; of `covered` where given."""
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
    """Return the pixels to compare, (h, w), all where `covered` is None; InputError if shapes differ or it is empty."""
    expect(reference.ndim == 3 and reference.shape[0] == 3, "reference", "shape (3, h, w)", reference.shape)
    expect(image.shape == reference.shape, "image", f"shape {reference.shape}", image.shape)
    mask = np.ones(reference.shape[1:], bool) if covered is None else covered
    expect(mask.shape == reference.shape[1:] and mask.dtype == bool, "covered",
           f"booleans of shape {reference.shape[1:]}", mask.shape)
    expect(bool(mask.any()), "covered", "at least one pixel", "none")
    return mask


def samples(image: Array, reference: Array, covered: Array | None) -> tuple[Array, Array]:
    """Return the compared pixels of both pictures, float64 (n,), channel after channel; InputError as of a figure."""
    mask = checked_mask(image, reference, covered)
    for name, pixels in (("image", image), ("reference", reference)):
        if bad := count_non_finite(pixels, mask):
            raise InputError(f"{name}: expected finite pixels, got {bad} that are NaN or infinite")
    x, r = (pixels if covered is None else pixels[:, mask] for pixels in (image, reference))
    return x.astype(np.float64, copy=False).ravel(), r.astype(np.float64, copy=False).ravel()


def _over_channels(of_channel: Callable[[Array, Array], float], *pictures: Array) -> float:
    with ThreadPoolExecutor(3) as pool:  # SciPy's filters leave Python's lock
        return float(np.mean(list(pool.map(of_channel, *pictures))))


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


EXPOSURES = 3
MOST_STOPS = 8.0  # between the first and the last exposure
SECONDS = 300.0  # a megapixel takes four
LUMINANCE = (0.2126, 0.7152, 0.0722)  # of linear sRGB primaries


class Flip(NamedTuple):
    """What FLIP said, or why it said nothing."""

    mean: float = math.nan  # over covered pixels: 0 equal, 1 as different as can be
    error: Array | None = None  # (h, w) float32
    exposures: tuple[float, float, int] = (0.0, 0.0, 0)  # first and last in stops, and how many
    skipped: str = ""  # the reason, where it did not run


def flip(image: Array, reference: Array, covered: Array) -> Flip:
    """Compare two pictures, (3, h, w), linear radiance, as a viewer would; the mean is over covered pixels."""
    if importlib.util.find_spec("flip_evaluator") is None:
        return Flip(skipped="flip-evaluator is not installed: pip install 'refgi[flip]'")
    if bad := count_non_finite(image, covered) + count_non_finite(reference, covered):
        return Flip(skipped=f"{bad} pixels are NaN or infinite")
    exposures = choose_exposures(reference, covered)
    if exposures is None:
        return Flip(skipped="the reference is black")
    try:
        error = _in_child(image * covered, reference * covered, exposures)
    except RefgiError as problem:
        return Flip(exposures=exposures, skipped=str(problem))
    return Flip(float(error[covered].mean(dtype=np.float64)), error, exposures)


def choose_exposures(reference: Array, covered: Array) -> tuple[float, float, int] | None:
    """Choose exposures, first and last in stops and how many: from the brightest 1 % at white to the median there."""
    luminance = np.tensordot(LUMINANCE, reference[:, covered].astype(np.float64), 1)
    lit = luminance[luminance > 0]
    if not lit.size:
        return None
    first = -math.log2(float(np.percentile(lit, 99)))
    last = min(-math.log2(float(np.median(lit))), first + MOST_STOPS)
    return (first, last, EXPOSURES) if last > first else (first, first, 1)


def _in_child(image: Array, reference: Array, exposures: tuple[float, float, int]) -> Array:
    with tempfile.TemporaryDirectory(prefix="refgi-flip-") as folder:
        for name, picture in (("image", image), ("reference", reference)):
            interleaved = np.moveaxis(np.maximum(np.nan_to_num(picture), 0), 0, -1)
            np.save(Path(folder, f"{name}.npy"), np.ascontiguousarray(interleaved, np.float32))
        Path(folder, "exposures.json").write_text(json.dumps(exposures))
        try:
            done = subprocess.run([sys.executable, "-m", "refgi.compare.metrics", folder], capture_output=True,
                                  text=True, timeout=SECONDS, check=False)
        except subprocess.TimeoutExpired as late:
            raise RefgiError(f"flip-evaluator took more than {SECONDS:g} s") from late
        if done.returncode != 0 or not Path(folder, "error.npy").exists():
            said = (done.stderr or done.stdout).strip().splitlines()
            raise RefgiError(f"flip-evaluator ended with {done.returncode}: {said[-1] if said else 'no message'}")
        error: Array = np.load(Path(folder, "error.npy"))
        return error


def _evaluate(folder: Path) -> None:
    import flip_evaluator

    first, last, count = json.loads((folder / "exposures.json").read_text())
    parameters = {"startExposure": first, "stopExposure": last, "numExposures": count}
    error, _, _ = flip_evaluator.evaluate(np.load(folder / "reference.npy"), np.load(folder / "image.npy"), "HDR",
                                          applyMagma=False, computeMeanError=False, parameters=parameters)
    np.save(folder / "error.npy", np.asarray(error, np.float32)[..., 0])


if __name__ == "__main__":
    _evaluate(Path(sys.argv[1]))
