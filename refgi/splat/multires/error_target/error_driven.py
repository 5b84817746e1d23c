"""Refinement until the picture is as near to the full sum as asked for: beyond Nichols and Wyman.

Ranges of depth and normal cannot promise an error: light may vary where geometry does not and the reverse. Here a cell
is split where stopping would cost most (`trial`). The threshold sinks from trial to trial until pixels lit in full
(`estimate`) say that the error, at its upper bound, is below the target.

A trial stops short of the pixels: what would be lit there is exact, whatever it will be, and most of the cost. They are
lit, and the picture put together, once the threshold is found. No pixel is lit twice; a picture that is lit in full,
the last resort, has no error.

What single lights give near points beyond half the mean is summed at every pixel (`near`): its peaks, hundreds of times
the mean, would be found by no sample. So are lobes. Subsplats carry the rest.

How near a picture is to the full sum, from a few pixels that are lit in full: an estimate and its bounds.
"""

import dataclasses
import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.draws import ERROR_SAMPLES, draws
from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.pairs.irradiance import Receivers, checked
from refgi.splat.multires.error_target.interpolate import levels_of
from refgi.splat.multires.error_target.near import near_light
from refgi.splat.multires.error_target.trial import Known, Trials
from refgi.splat.multires.refinement.grid import Subsplats, top_level
from refgi.splat.multires.refinement.refine import refine
from refgi.stages import skip, stage

if TYPE_CHECKING:
    from refgi.lights import PixelLights
    from refgi.rsm import GBuffer
    from refgi.splat.multires.settings import MultiresSettings

Array = npt.NDArray[Any]

DEVIATIONS = 3.0  # standard errors between the estimate and either bound
UNSEEN = 3.0  # samples: what no one of n draws met has, at 95 %, a share below 3 / n
STRATA = 48  # along the shorter side, before their largest size is met
LARGEST = 8  # pixels along a stratum
NEAR = 0.5  # of the mean, what one light may give a subsplat's pixel; with 2, samples missed peaks now and then
BRIGHT = 0.05  # of the samples, left out of the mean that this is a share of
FIRST = 60.0  # first threshold over the target error
SLOPE = 0.7  # power of the threshold that the error goes with, until two trials tell
SLOPES = 0.5, 1.2  # what they may tell
AIM = 0.95  # of the target, where the next trial is to end
STEPS = 0.3, 0.9  # of a threshold, where the next may lie
ENOUGH = 0.75  # of the pixels lit: then the rest are lit as well
LAST = 16  # trial, after which every pixel is lit: cells of which nothing bright is known may never be split


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


class ErrorDriven(NamedTuple):
    """The picture, how near it is and what it took."""

    irradiance: Array  # (3, h, w), W/m^2; excludes albedo/pi
    split: tuple[Array, ...]  # (h_l, w_l) bool for levels 0 (none) to the coarsest: cells that are refined
    covered: Array  # (h, w) bool, whether there is a surface
    settings: "MultiresSettings"  # those by which `split` makes subsplats
    error: float  # estimated RMSE over the mean of the full sum
    low: float  # bounds of it; `high` is at most the target
    high: float
    threshold: float  # of the last trial: root of a cell's sum of squares, over the mean
    trials: int
    pairs: int  # of light and point: all trials, samples and near lights included
    full_pairs: int  # of the full sum

    @property
    def subsplats(self) -> Subsplats:
        """The leaves, listed when asked for."""
        return refine(self.split, self.covered, self.settings)


@stage("splat.error_driven")
def error_driven(
    buffer: "GBuffer", lights: "PixelLights", settings: "MultiresSettings", footprint: Array | None = None
) -> ErrorDriven:
    """Light a picture to a relative error, `settings.target_error`.

    Parameters
    ----------
    buffer : GBuffer
        What the camera sees.
    lights : PixelLights
        Lights to sum.
    settings : MultiresSettings
        The target, how one light lights one receiver, the coarsest level and the seed of the samples.
    footprint : (N,) ndarray, optional
        Surface area each light stands for, m^2; needed by the clamps "disc" and "sphere" alone.

    Returns
    -------
    ErrorDriven
        The picture, its subsplats and their price.

    Raises
    ------
    InputError
        If there is no target, and as `irradiance`.

    Notes
    -----
    The promise is that of a sample of one pixel in 64 (`estimate`). Depths are not looked at: without visibility, light
    changes across them by position and normal alone.
    """
    target = settings.target_error
    expect(target is not None, "target_error", "a share of the mean above 0", target)
    assert target is not None
    receivers = Receivers(*map(np.ascontiguousarray, buffer.resolve("position", "normal", "covered")))
    packed, samples = checked(receivers, lights, settings.effective_pairs, footprint), stratified(
        receivers.covered, settings.lights.seed)
    known = Known(receivers, packed)
    known.light(samples.pixel)
    seen = known.at(samples.pixel)
    typical, mean = _typical(seen), mean_of(samples, seen)
    near = near_light(receivers, packed, NEAR * typical)
    top = max(1, top_level(buffer.height, buffer.width, settings.coarsest))
    trials = Trials(known, near, levels_of(*receivers, top))
    found, threshold, count = _search(trials, samples, mean, typical, target)
    picture = trials.picture()
    as_split = dataclasses.replace(settings, target_error=None, diagonal="off", refinement="single_pass")
    number = lights.flux.shape[1]
    pairs = np.count_nonzero(known.has) * number + near.pairs
    full_pairs = np.count_nonzero(receivers.covered) * number
    skip("splat.full_sum", f"{pairs / max(1, full_pairs):.1%} of its pairs, {count} trials: the error is at most "
                           f"{found.high:.2%} of the mean")
    return ErrorDriven(picture, tuple(trials.split), receivers.covered, as_split, *found, threshold, count, pairs,
                       full_pairs)


def _typical(light: Array) -> float:
    """Return the mean irradiance of the samples without the brightest, W/m^2."""
    light = np.sort(light.mean(axis=0, dtype=np.float64))
    kept = light[: len(light) - int(len(light) * BRIGHT)]
    return float(kept.mean()) if len(kept) else 0.0


def _search(
    trials: Trials, samples: Samples, mean: tuple[float, float], typical: float, target: float
) -> tuple[Estimate, float, int]:
    """Return the estimate, threshold and number of the first trial that meets the target, or light every pixel."""
    threshold, count, before = FIRST * target, 1, (0.0, 0.0)
    while True:
        trials.run(threshold * typical)
        dark = mean[0] <= 0  # no sample saw light: what little there may be is not known from them
        if dark or count == LAST or trials.share_lit() > ENOUGH:
            trials.split_all()
            return Estimate(0.0, 0.0, 0.0), threshold, count
        found = estimate(samples, trials.missed(samples.pixel), mean)
        if found.high <= target:
            return found, threshold, count
        slope, here = SLOPE, (math.log(threshold), math.log(min(found.high, 1e30)))
        if count > 1 and before[1] > here[1]:
            slope = float(np.clip((before[1] - here[1]) / (before[0] - here[0]), *SLOPES))
        threshold *= float(np.clip((AIM * target / found.high) ** (1 / slope), *STEPS))
        count, before = count + 1, here
