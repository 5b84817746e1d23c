"""Refinement until the picture is as near to the full sum as asked for: beyond Nichols and Wyman.

Ranges of depth and normal cannot promise an error: light may vary where geometry does not and the reverse. Here a cell
is split where stopping would cost most, the sum over its pixels of two squares: of the light its normals' interpolation
loses (`interpolate.residuals`, times the light around), and of what light was seen to differ by from the coarser
level's interpolation, at its own pixel or half of that at its neighbours'. The threshold sinks from trial to trial
until pixels lit in full (`samples`) say that the error, at its upper bound, is below the target. No pixel is lit twice;
a picture that is lit in full, the last resort, has no error.

What single lights give near points beyond half the mean is summed at every pixel (`near`): its peaks, hundreds of times
the mean, would be found by no sample. So are lobes. Subsplats carry the rest.
"""

import dataclasses
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.splat.irradiance import Receivers
from refgi.splat.pairs.blocks import block_by_block, taken
from refgi.splat.refinement.evaluate import evaluate
from refgi.splat.refinement.grid import Subsplats, representatives, top_level
from refgi.splat.refinement.interpolate import Blend, blends, descend, residuals
from refgi.splat.refinement.near import near_light
from refgi.splat.refinement.refine import refine
from refgi.splat.refinement.samples import Estimate, Samples, estimate, stratified
from refgi.stages import stage

if TYPE_CHECKING:
    from refgi.rsm import GBuffer, PixelLights
    from refgi.splat.multires import MultiresSettings

Array = npt.NDArray[Any]

NEAR = 0.5  # of the mean, what one light may give a subsplat's pixel; with 2, samples missed peaks now and then
BRIGHT = 0.05  # of the samples, left out of the mean that this is a share of
FIRST = 100.0  # first threshold over the target error
ENOUGH = 0.6  # of the pixels lit: then the rest are lit as well


class ErrorDriven(NamedTuple):
    """The picture, how near it is and what it took."""

    irradiance: Array  # (3, h, w), W/m^2; excludes albedo/pi
    subsplats: Subsplats
    error: float  # estimated RMSE over the mean of the full sum
    low: float  # bounds of it; `high` is at most the target
    high: float
    threshold: float  # of the last trial: root of a cell's sum of squares, over the mean
    trials: int
    pairs: int  # of light and point: all trials, samples and near lights included
    full_pairs: int  # of the full sum


class _Known:
    """Light at pixels, each evaluated when first asked for and never again."""

    def __init__(self, points: tuple[Array, Array], *how: Any) -> None:
        self._points, self._how = points, how
        self.has = np.zeros(points[0][0].size, np.bool_)
        self.exact = np.zeros((3, self.has.size), points[0].dtype)
        self._near, self.smooth = np.zeros_like(self.exact), np.zeros_like(self.exact)

    def ensure(self, pixel: Array) -> None:
        """Light the pixels that were not yet, in the order given."""
        missing = pixel[~self.has[pixel]]
        if len(missing):
            points, normals = (taken(plane, missing) for plane in self._points)
            light = evaluate(points, normals, *self._how)
            self.exact[:, missing], self.has[missing] = light, True
            self.smooth[:, missing] = light - self._near[:, missing]

    def subtract(self, near: Array) -> None:
        """Leave out of `smooth` what is near."""
        self._near = near.reshape(3, -1)
        self.smooth = self.exact - self._near


class _Trial(NamedTuple):
    """What one threshold gave."""

    light: Array  # (3, h, w), W/m^2, without what is near
    lit: Array  # (h, w) bool, pixels that are subsplats
    split: tuple[Array, ...]  # (h_l, w_l) bool for levels 0 (none) to the coarsest


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
    receivers = Receivers(*buffer.resolve("position", "normal", "covered"))
    covered, samples = receivers.covered, stratified(receivers.covered, settings.seed)
    known = _Known((receivers.position, receivers.normal), lights, settings, footprint)
    known.ensure(samples.pixel)
    near, near_pairs = near_light(receivers, lights, settings, footprint, NEAR * _typical(known, samples))
    known.subtract(near)
    places = representatives(covered, top_level(buffer.height, buffer.width, settings.coarsest))
    made = blends(receivers.position, receivers.normal, places)
    rest = residuals(made, places[-1].shape)
    threshold, trials = FIRST * target, 0
    while True:
        trials += 1
        trial = _refined(known, places, made, rest, threshold * _typical(known, samples))
        picture, found = _judged(known, near, trial, samples, covered)
        if found.high <= target:
            break
        threshold *= min(max(0.9 * target / found.high, 0.3), 0.8)
    as_chosen = dataclasses.replace(settings, target_error=None, diagonal="off", refinement="single_pass")
    subsplats = refine(trial.split, covered, as_chosen)
    count = lights.flux.shape[1]
    return ErrorDriven(picture, subsplats, *found, threshold, trials, int(known.has.sum()) * count + near_pairs,
                       int(covered.sum()) * count)


def _typical(known: _Known, samples: Samples) -> float:
    """Return the mean irradiance of the samples without the brightest, W/m^2."""
    light = np.sort(known.exact[:, samples.pixel].mean(axis=0, dtype=np.float64))
    kept = light[: len(light) - int(len(light) * BRIGHT)]
    return float(kept.mean()) if len(kept) else 0.0


def _refined(
    known: _Known, places: tuple[Array, ...], made: tuple[Blend, ...], rest: tuple[Array, ...], worst: float
) -> _Trial:
    """Refine from the coarsest level down wherever stopping would cost more than `worst`^2, W^2/m^4."""
    top = len(places) - 1
    here, split = places[top] >= 0, [np.zeros(places[0].shape, np.bool_)]
    known.ensure(places[top][here])
    light = np.where(here, known.smooth[:, places[top]], known.smooth.dtype.type(0))
    surplus = np.zeros(here.shape, light.dtype)
    for level in range(top - 1, -1, -1):
        parted = here.copy()
        if level + 1 < top:  # nothing is known of the coarsest cells but that they are coarse
            _choose(here, light, surplus, rest[level + 1], 4.0 ** (level + 1), worst**2, parted)
        split.insert(1, parted)
        here = np.zeros(places[level].shape, np.bool_)
        _open(parted, places[level], here)
        known.ensure(places[level].reshape(-1)[block_by_block(here)])
        coarse, light, surplus = light, np.zeros((3, *here.shape), light.dtype), np.zeros(here.shape, light.dtype)
        descend(coarse, made[level].weight, here, places[level], known.smooth, light, surplus)
    return _Trial(light, here, tuple(split))


def _judged(
    known: _Known, near: Array, trial: _Trial, samples: Samples, covered: Array
) -> tuple[Array, Estimate]:
    """Put a trial's picture together and estimate its error; a picture lit almost in full is lit in full."""
    if np.count_nonzero(known.has) > ENOUGH * np.count_nonzero(covered):
        known.ensure(block_by_block(covered))
        for level in trial.split[1:]:
            level[:] = True
        trial = trial._replace(lit=covered)
    picture, sums = np.empty_like(near), np.zeros((len(covered), 2))
    _assemble(trial.light, near, known.exact.reshape(near.shape), trial.lit, covered, picture, sums)
    total, count = sums.sum(axis=0)
    pixel = samples.pixel
    return picture, estimate(samples, picture.reshape(3, -1)[:, pixel], known.exact[:, pixel], total / max(1.0, count))


@kernel(parallel=True)
def _assemble(
    light: Array, near: Array, exact: Array, lit: Array, covered: Array, picture: Array, sums: Array
) -> None:
    """Add what is near to the subsplats' light, keep lit pixels as they are; sum and count what each row shows."""
    for i in prange(covered.shape[0]):
        total, count = 0.0, 0
        for c in range(3):
            for j in range(covered.shape[1]):
                value = exact[c, i, j] if lit[i, j] else light[c, i, j] + near[c, i, j]
                picture[c, i, j] = value
                total += value
                count += covered[i, j]
        sums[i, 0], sums[i, 1] = total, count


@kernel(parallel=True)
def _choose(
    known: Array, light: Array, surplus: Array, rest: Array, pixels: float, most: float, split: Array
) -> None:
    """Split a known cell where normals, or light seen so far, promise more than `most` over its pixels, W^2/m^4."""
    height, width = known.shape
    for i in prange(height):
        for j in range(width):
            if not known[i, j]:
                continue
            bright, seen = 0.0, float(surplus[i, j])
            for y in range(max(i - 1, 0), min(i + 2, height)):
                for x in range(max(j - 1, 0), min(j + 2, width)):
                    red, green, blue = float(light[0, y, x]), float(light[1, y, x]), float(light[2, y, x])
                    bright = max(bright, red * red + green * green + blue * blue)
                    seen = max(seen, 0.25 * float(surplus[y, x]))
            split[i, j] = bright * float(rest[i, j]) + pixels * seen > most


@kernel(parallel=True)
def _open(split: Array, place: Array, known: Array) -> None:
    """Mark the cells of a level whose parents are split."""
    for i in prange(place.shape[0]):
        for j in range(place.shape[1]):
            known[i, j] = split[i // 2, j // 2] and place[i, j] >= 0
