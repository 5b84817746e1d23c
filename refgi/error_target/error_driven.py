"""Refinement until the picture is as near to the full sum as asked for: beyond Nichols and Wyman.

A cell is split where stopping would cost most (`trial`). The threshold sinks from trial to trial until pixels evaluated
in full (`estimate_error`) say that the error, at its upper bound, is below the target. Pixels of the last split cells
are evaluated once the threshold is found, none twice. What single lights give near points beyond half the mean is
summed at every pixel (`near`), and so are lobes: such peaks would be found by no sample.
"""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from refgi.error_target.grid import top_level
from refgi.error_target.interpolate import surface_levels
from refgi.error_target.near import PixelSum, unshadowed
from refgi.error_target.trial import ExactIrradiance, Trials
from refgi.jit import kernel, prange
from refgi.pairs.irradiance import Receivers, checked
from refgi.pairs.settings import AutoLightcuts, Lightcuts
from refgi.sampling import ERROR_SAMPLES, draws
from refgi.stages import skip, stage, tally
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.error_target.grid import ErrorTarget
    from refgi.lights import PixelLights
    from refgi.pairs.settings import PairSettings
    from refgi.rsm import GBuffer

DEVIATIONS = 3.0  # standard errors between the estimate and either bound
RULE_OF_THREE = 3.0  # samples: what no one of n draws met has, at 95 %, a share below 3 / n
STRATA = 48  # along the shorter side, before their largest size is met
LARGEST = 8  # pixels along a stratum
NEAR = 0.5  # of the mean, what one light may give a subsplat's pixel; with 2, samples missed peaks now and then
BRIGHTEST_SHARE = 0.05  # of the samples, left out of the mean that this is a share of
FIRST = 60.0  # first threshold over the target error
SLOPE = 0.7  # power of the threshold that the error goes with, until two trials tell
SLOPES = 0.5, 1.2  # what they may tell
AIM = 0.95  # of the target, where the next trial is to end
STEPS = 0.3, 0.9  # of a threshold, where the next may lie
ENOUGH = 0.75  # of the pixels evaluated: then the rest are as well
CLUSTERED = 0.1  # of the target, the error of sums by clusters that "auto" chooses, at most
LEAST_ERROR = 1e-6  # that lightcuts know
LAST = 16  # trial, after which every pixel is evaluated: cells of which nothing bright is known may never be split


class ErrorSamples(NamedTuple):
    """One pixel of every stratum that shows a surface."""

    pixel: Array  # (n,) int64, flat indices
    share: Array  # (n,) float64, of the covered pixels that each stands for; they sum to 1


class Estimate(NamedTuple):
    """RMSE over the mean of the full sum, and what it lies between."""

    error: float
    low: float
    high: float


def draw_samples(covered: Array, seed: int) -> ErrorSamples:
    """Draw one covered pixel from every stratum: squares of 8 x 8 pixels, smaller ones in small pictures."""
    side = min(max(math.isqrt(covered.size) // STRATA, 1), LARGEST)
    rows, columns = -(-covered.shape[0] // side), -(-covered.shape[1] // side)
    pixel, count = np.full(rows * columns, -1, np.int64), np.zeros(rows * columns)
    _draw(covered, side, draws(seed, ERROR_SAMPLES, rows * columns).reshape(rows, columns), pixel, count)
    drawn = pixel >= 0
    return ErrorSamples(pixel[drawn], count[drawn] / max(1.0, count.sum()))


def estimate_mean(samples: ErrorSamples, exact: Array) -> tuple[float, float]:
    """Return the mean of the full sum over covered pixels and channels, and three standard errors of it, W/m^2.

    exact: (3, n), irradiance at the samples. Neighbouring strata stand in for two draws from one, which overestimates
    the standard error where irradiance changes.
    """
    light = exact.mean(axis=0, dtype=np.float64)
    steps = np.diff(light, append=light[:1])
    return (float((samples.share * light).sum()),
            DEVIATIONS * math.sqrt(float((samples.share**2 * steps**2).sum()) / 2))


def estimate_error(samples: ErrorSamples, residual: Array, mean: tuple[float, float]) -> Estimate:
    """Return the relative RMSE of a picture, with bounds of three standard errors; 0 where no sample differs.

    residual (3, n), W/m^2; mean: of `estimate_mean`. Strata count as independent draws, which overestimates the
    standard error. Errors are rare and large along edges: the upper bound adds three more of the worst sample.
    """
    square = samples.share * (residual.astype(np.float64) ** 2).mean(axis=0)
    mse = float(square.sum())
    if mse == 0:
        return Estimate(0.0, 0.0, 0.0)
    spread = DEVIATIONS * math.sqrt(float(((square - samples.share * mse) ** 2).sum()))
    average, uncertainty = mean
    high = math.inf
    if average > uncertainty:
        high = math.sqrt(mse + spread + RULE_OF_THREE * float(square.max())) / (average - uncertainty)
    low = math.sqrt(max(mse - spread, 0.0)) / (average + uncertainty)
    return Estimate(math.sqrt(mse) / max(average, 1e-300), low, high)


@kernel(parallel=True)
def _draw(covered: Array, side: int, random: Array, pixel: Array, count: Array) -> None:
    height, width = covered.shape
    for i in prange(random.shape[0]):
        for j in range(random.shape[1]):
            stratum, found = i * random.shape[1] + j, 0
            for y in range(i * side, min(i * side + side, height)):
                for x in range(j * side, min(j * side + side, width)):
                    found += covered[y, x]
            count[stratum], drawn_index = found, int(random[i, j] * found)
            for y in range(i * side, min(i * side + side, height)):
                for x in range(j * side, min(j * side + side, width)):
                    if covered[y, x]:
                        if drawn_index == 0:
                            pixel[stratum] = y * width + x
                        drawn_index -= 1


class ErrorDriven(NamedTuple):
    """The picture, its error and its cost."""

    irradiance: Array  # (3, h, w), W/m^2; excludes albedo/pi
    split: tuple[Array, ...]  # (h_l, w_l) bool for levels 0 (none) to the coarsest: cells that are refined
    covered: Array  # (h, w) bool, whether there is a surface
    error: float  # estimated RMSE over the mean of the full sum
    low: float  # bounds of it; `high` is at most the target
    high: float
    threshold: float  # of the last trial: root of a cell's sum of squares, over the mean
    trials: int
    pairs: int  # of light and point: all trials, samples and near lights included
    full_pairs: int  # of the full sum


@stage("error_target.error_driven")
def error_driven(
    buffer: "GBuffer", lights: "PixelLights", settings: "ErrorTarget", pairs: "PairSettings",
    footprint: Array | None = None, seed: int = 0, lightcuts: AutoLightcuts | Lightcuts | None = None,
    shadowed: PixelSum | None = None,
) -> ErrorDriven:
    """Evaluate a picture to a relative error, `settings.target`.

    seed: Of the samples that estimate the error.
    lightcuts: Whether lights may be summed by clusters: "auto" takes a share of the target for it where that pays;
        by name, with an error of its own that counts against the target.
    shadowed: The same lights under their visibility, which are then never clustered.
    -> ErrorDriven: The picture, its subsplats, error and cost.

    Raises `InputError` as `irradiance`.

    The promise is that of a sample of one pixel in 64 (`estimate_error`). Depths are not used: without visibility,
    irradiance changes across them by position and normal alone. Edges of shadows are found as other changes of light
    are, by cells whose irradiance is not what the coarser level says.
    """
    receivers = Receivers(*map(np.ascontiguousarray, buffer.resolve("position", "normal", "covered")))
    samples = draw_samples(receivers.covered, seed)
    if shadowed is None:
        summed, exact, clustered = _evaluated_samples(receivers, lights, pairs, footprint, samples, settings.target,
                                                      lightcuts)
    else:
        summed, exact, clustered = shadowed, _evaluated(receivers, shadowed, samples), 0.0
    sampled = exact.at(samples.pixel)
    typical, mean = _mean_without_brightest(sampled), estimate_mean(samples, sampled)
    near = summed.near(receivers, NEAR * typical)
    tally("pairs", lambda: near.pairs)
    top = max(1, top_level(buffer.height, buffer.width, settings.coarsest))
    trials = Trials(exact, near, surface_levels(*receivers, top))
    found, threshold, count = _search(trials, samples, mean, typical, settings.target - clustered)
    found = Estimate(found.error, max(0.0, found.low - clustered), found.high + clustered)
    picture = trials.picture()
    number = lights.flux.shape[1]
    evaluated = np.count_nonzero(exact.is_known) * number + near.pairs
    full_pairs = np.count_nonzero(receivers.covered) * number
    skip("error_target.full_sum", f"{evaluated / max(1, full_pairs):.1%} of its pairs, {count} trials: the error is at "
                              f"most {found.high:.2%} of the mean")
    return ErrorDriven(picture, tuple(trials.split), receivers.covered, *found, threshold, count, evaluated, full_pairs)


def _evaluated_samples(
    receivers: Receivers, lights: "PixelLights", pairs: "PairSettings", footprint: Array | None, samples: ErrorSamples,
    target: float, lightcuts: AutoLightcuts | Lightcuts | None,
) -> tuple[PixelSum, ExactIrradiance, float]:
    """Return the sum of all lights, the samples' irradiance, and what clusters may take of the error, over the mean.

    Where that is more than half of the target, lights are summed in full.
    """
    if isinstance(lightcuts, AutoLightcuts):
        lightcuts = AutoLightcuts(max(min(lightcuts.error, CLUSTERED * target), LEAST_ERROR))
    packed = checked(receivers, lights, pairs, footprint, lightcuts)
    if packed.tree is not None:
        summed = unshadowed(receivers, packed)
        exact = _evaluated(receivers, summed, samples)
        taken = packed.tree.error * _largest_ratio(samples, exact.at(samples.pixel))
        if taken <= target / 2:
            return summed, exact, taken
        skip("pairs.lightcuts", f"bounds of {taken:.2%} of the mean are too much for the target")
        packed = packed._replace(tree=None)
    summed = unshadowed(receivers, packed)
    return summed, _evaluated(receivers, summed, samples), 0.0


def _evaluated(receivers: Receivers, summed: PixelSum, samples: ErrorSamples) -> ExactIrradiance:
    exact = ExactIrradiance(receivers, summed.at)
    exact.evaluate(samples.pixel)
    return exact


def _largest_ratio(samples: ErrorSamples, sampled: Array) -> float:
    """Return what the RMSE over the mean is at most of an error that each receiver's sum of channels bounds.

    The squares of three channels' errors add up to at most the square of their sum: sqrt(3) times the root mean square
    of light over its mean, at its upper bound from samples; infinite in the dark.
    """
    light = sampled.mean(axis=0, dtype=np.float64)
    average, uncertainty = estimate_mean(samples, sampled)
    square, spread = estimate_mean(samples, sampled.astype(np.float64).mean(axis=0, keepdims=True) ** 2)
    if average <= uncertainty or not light.any():
        return math.inf
    return math.sqrt(3.0 * (square + spread)) / (average - uncertainty)


def _mean_without_brightest(irradiance: Array) -> float:
    """Return the mean irradiance of the samples without the brightest, W/m^2."""
    irradiance = np.sort(irradiance.mean(axis=0, dtype=np.float64))
    darker = irradiance[: len(irradiance) - int(len(irradiance) * BRIGHTEST_SHARE)]
    return float(darker.mean()) if len(darker) else 0.0


def _search(
    trials: Trials, samples: ErrorSamples, mean: tuple[float, float], typical: float, target: float
) -> tuple[Estimate, float, int]:
    """Return estimate, threshold and number of the first trial that meets the target, or evaluate every pixel."""
    threshold, count, before = FIRST * target, 1, (0.0, 0.0)
    while True:
        trials.run(threshold * typical)
        is_dark = mean[0] <= 0  # no sample has any irradiance: what little there may be is not known from them
        if is_dark or count == LAST or trials.share_evaluated() > ENOUGH:
            trials.split_all()
            return Estimate(0.0, 0.0, 0.0), threshold, count
        found = estimate_error(samples, trials.residual(samples.pixel), mean)
        if found.high <= target:
            return found, threshold, count
        slope, here = SLOPE, (math.log(threshold), math.log(min(found.high, 1e30)))
        if count > 1 and before[1] > here[1]:
            slope = float(np.clip((before[1] - here[1]) / (before[0] - here[0]), *SLOPES))
        threshold *= float(np.clip((AIM * target / found.high) ** (1 / slope), *STEPS))
        count, before = count + 1, here
