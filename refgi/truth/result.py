"""TruthResult: irradiance by path tracing, with standard errors of pixels, blocks and picture.

Passes take turns between eight series. Those of a series stratify each other (`refgi.truth.task.Draw`); series are
independent, so the spread of their sums gives the variance of the mean, whatever correlation there is between the
passes of a series, the samples inside a pass or pixels. With S_s the sum of n_s passes of series s, n = sum n_s and m
the mean of all, it is sum (S_s - n_s m)^2 / (n^2 - sum n_s^2): of up to eight passes the spread of the passes
themselves. Pixels share light vertices, so the errors of means over several
pixels do not follow from theirs: means over blocks of 8 x 8 pixels and over the picture are followed as values of their
own. A value that is not a finite number is left out of all of them and counted. How heavy the values' tail is
(`refgi.truth.tails`) says whether that variance can be trusted.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel, prange
from refgi.truth.tails import BINS, TRUSTED, count_tails, doubt_of, share_in_doubt, tail_index
from refgi.types import Array

BLOCK_SIDE = 8  # pixels
SERIES = 8  # that passes take turns between


class Moments(NamedTuple):
    """Running moments of all passes so far; updated in place."""

    passes: Array  # () int64
    mean: Array  # (3, n) float64
    sums: Array  # (SERIES, 3, n) float64, of the finite values of each series
    counts: Array  # (SERIES, n) int32: how many those are
    scale: Array  # () float64, the unit of the tails: median of the first pass with light, W/m^2; 0 before
    tails: Array  # (blocks, BINS) int32: how many values of receivers lie how far above the passes before

    @property
    def lost(self) -> Array:
        """How many passes had a value that is not a finite number, (n,) int64."""
        return np.asarray(self.passes - self.counts.sum(axis=0))

    @property
    def variance_of_mean(self) -> Array:
        """Estimated variance of each mean, (3, n); inf before two series have a pass."""
        counts, squares = self.counts.astype(np.float64), np.zeros_like(self.mean)
        for total, count in zip(self.sums, counts, strict=True):
            squares += (total - count * self.mean) ** 2
        pairs = counts.sum(axis=0) ** 2 - (counts**2).sum(axis=0)
        return np.where(pairs > 0, squares / np.maximum(pairs, 1), np.inf)


def no_passes(values: int, blocks: int = 0) -> Moments:
    """Return the moments of no passes.

    `values`: how many values a pass has. `blocks`: of how many blocks tails are counted.
    """
    return Moments(np.zeros((), np.int64), np.zeros((3, values)), np.zeros((SERIES, 3, values)),
                   np.zeros((SERIES, values), np.int32), np.zeros(()), np.zeros((blocks, BINS), np.int32))


def add_pass(moments: Moments, values: Array, block: Array | None = None) -> None:
    """Add the next pass to the moments.

    `values` (3, n) float64: what the pass found, W/m^2. `block` (r,) int: of each of the first r values, whose tails
    are counted.
    """
    before, series = moments.counts.sum(axis=0), int(moments.passes) % SERIES
    if block is not None:
        r = len(block)
        count_tails(moments.tails, moments.scale, block, values[:, :r], moments.mean[:, :r], before[:r])
    finite = np.asarray(np.isfinite(values).all(axis=0))
    _add(moments.mean, moments.sums[series], values, finite, before + 1)
    moments.counts[series] += finite
    moments.passes[...] += 1


def picture_tail(moments: Moments) -> float:
    """Return the tail index of the whole picture; NaN where too few values are known."""
    return float(tail_index(moments.tails.sum(axis=0, dtype=np.int64)[None])[0])


def is_doubted(moments: Moments, receivers: int) -> bool:
    """Return whether the error of a mean is not to be trusted, by its tails."""
    light = moments.mean[:, receivers:-1].mean(axis=0) * moments.tails.sum(axis=1)
    return bool(doubt_of(picture_tail(moments), share_in_doubt(tail_index(moments.tails), light)))


def blocks_of(pixel: Array, shape: tuple[int, ...]) -> tuple[Array, tuple[int, int]]:
    """Return which block of 8 x 8 pixels each pixel lies in.

    `pixel` (r,): flat indices into the picture. `shape`: rows and columns of the picture. Returns (r,), tuple of 2
    ints: flat index of each pixel's block, and rows and columns of blocks.
    """
    rows, columns = (-(-size // BLOCK_SIDE) for size in shape)
    return pixel // shape[1] // BLOCK_SIDE * columns + pixel % shape[1] // BLOCK_SIDE, (rows, columns)


def with_means(values: Array, block: Array, blocks: int) -> Array:
    """Append the means over blocks and over all receivers.

    `values` (3, r) float64: irradiance of a pass, W/m^2. `block` (r,) int: which block each receiver counts for.
    `blocks`: how many there are. Returns (3, r + blocks + 1): the values, the means of the finite ones over each block
    and over all: 0 without receivers, NaN where none is finite.
    """
    finite = np.isfinite(values).all(axis=0)
    block, doubled = np.append(block, np.full(len(block), blocks)), np.tile(values, 2)  # the picture is one block more
    counts = [np.bincount(block[chosen], minlength=blocks + 1) for chosen in (np.tile(finite, 2), slice(None))]
    sums = np.stack([np.bincount(block, channel, blocks + 1) for channel in np.where(np.tile(finite, 2), doubled, 0)])
    means = sums / np.maximum(counts[0], 1)
    means[:, (counts[0] == 0) & (counts[1] > 0)] = np.nan
    return np.concatenate([values, means], axis=1)


@kernel(parallel=True)
def _add(mean: Array, sums: Array, values: Array, finite: Array, count: Array) -> None:
    for i in prange(values.shape[1]):
        if finite[i]:
            for c in range(3):
                mean[c, i] += (values[c, i] - mean[c, i]) / count[i]
                sums[c, i] += values[c, i]


class TruthResult(NamedTuple):
    """Irradiance by path tracing, and its standard error.

    Variances are estimated from the spread of the passes, or of their eight series where there are more, with
    `degrees_of_freedom`: from two passes they say little more than the order of magnitude. `confidence_factor` turns
    standard errors into intervals that know it.
    """

    mean: Array  # (3, h, w) float64, W/m^2
    variance_of_mean: Array  # (3, h, w) float64, (W/m^2)^2
    samples: Array  # (h, w) int64 samples a pixel; 0 without surface
    picture_mean: Array  # (3,) float64: mean over all pixels that see a surface
    picture_variance: Array  # (3,) float64: variance of that mean, with the correlation between pixels
    passes: int
    block_mean: Array  # (3, ceil(h / 8), ceil(w / 8)) float64: means over the pixels of a block that see a surface
    block_variance: Array  # the same shape: their variances, with the correlation between pixels
    block_pixels: Array  # (ceil(h / 8), ceil(w / 8)) int64: how many pixels of a block see a surface
    lost: int = 0  # values of a pixel in a pass that were not finite numbers and are left out
    tail_index: float = math.nan  # k of the picture's largest values; NaN where too few are known
    block_tail_index: Array = np.full((1, 1), math.nan)  # (ceil(h / 8), ceil(w / 8)) float64: k of each block

    @property
    def standard_error(self) -> Array:
        """Standard error of each pixel and channel, (3, h, w), W/m^2."""
        return np.sqrt(self.variance_of_mean)

    @property
    def degrees_of_freedom(self) -> int:
        """Of the variances, n^2 / sum n_s^2 - 1: passes less one up to 8, then 6 or 7."""
        each, more = divmod(self.passes, SERIES)
        return round(self.passes**2 / (more * (each + 1) ** 2 + (SERIES - more) * each**2)) - 1

    @property
    def pixel_error(self) -> float:
        """Root mean square standard error of a pixel over the picture's mean."""
        return self._relative(self.variance_of_mean, self.samples > 0)

    @property
    def block_error(self) -> float:
        """Root mean square standard error of a mean over 8 x 8 pixels over the picture's mean."""
        return self._relative(self.block_variance, self.block_pixels)

    @property
    def picture_error(self) -> float:
        """Root mean square standard error of the picture's mean over that mean."""
        return self._relative(self.picture_variance, np.ones(()))

    def confidence_factor(self, level: float = 0.95) -> float:
        """Return how many standard errors hold the expectation with a probability in (0, 1), by Student's t.

        At 95 %: 12.7 from two passes, 2.36 from eight.
        """
        from scipy.stats import t

        return float(t.ppf(0.5 + level / 2, self.degrees_of_freedom))

    @property
    def blocks_in_doubt(self) -> float:
        """Share of the picture's light that lies in blocks of 8 x 8 pixels whose tail index is above 0.7."""
        return share_in_doubt(self.block_tail_index, self.block_mean.mean(axis=0) * self.block_pixels)

    @property
    def doubt(self) -> str:
        """Why the stated error is not to be trusted, and what helps; empty where nothing speaks against it.

        Where too few values are known to tell, it is empty too, but `is_trusted` is None.
        """
        return doubt_of(self.tail_index, self.blocks_in_doubt)

    @property
    def is_trusted(self) -> bool | None:
        """Whether the stated error can be trusted; None where too few values are known to tell."""
        return False if self.doubt else None if math.isnan(self.tail_index) else True

    @property
    def error_statement(self) -> str:
        """The confidence intervals, and whether they can be trusted, in a sentence."""
        factor = self.confidence_factor()
        parts = ((self.pixel_error, "a pixel"), (self.block_error, f"a block of {BLOCK_SIDE}x{BLOCK_SIDE} pixels"),
                 (self.picture_error, "the picture's mean"))
        passes = f"{self.passes} passes" + (f" in {SERIES} series" if self.passes > SERIES else "")
        freedom = "1 degree" if self.passes == 2 else f"{self.degrees_of_freedom} degrees"
        known = "not known, of too few values" if math.isnan(self.tail_index) else f"k = {self.tail_index:.2f}"
        return (f"95 % confidence intervals over the picture's mean, by Student's t with {freedom} of freedom "
                f"({passes}): " + ", ".join(f"+-{factor * error:.2%} {what}" for error, what in parts)
                + "; " + (self.doubt or f"tail index {known} (trusted up to {TRUSTED})"))

    @property
    def errors(self) -> dict[str, Any]:
        """The figures of the error by name, for reports."""
        return {"pixel": self.pixel_error, "block": self.block_error, "picture": self.picture_error,
                "passes": self.passes, "degrees_of_freedom": self.degrees_of_freedom,
                "confidence_factor_95": self.confidence_factor(),
                "tail_index": None if math.isnan(self.tail_index) else self.tail_index,
                "blocks_in_doubt": self.blocks_in_doubt, "trusted": self.is_trusted, "statement": self.error_statement}

    def _relative(self, variance: Array, weight: Array) -> float:
        scale, total = float(self.picture_mean.mean()), float(weight.sum())
        if scale == 0 or total == 0:
            return 0.0
        return float(np.sqrt((variance.mean(axis=0) * weight).sum() / total) / scale)


def result_of(moments: Moments, pixel: Array, shape: tuple[int, ...], blocks: tuple[Array, tuple[int, int]],
              per_pass: int) -> TruthResult:
    """Return moments as pictures.

    `moments`: of receivers, blocks and picture. `pixel` (r,): flat index of each receiver into the picture. `shape`:
    rows and columns of the picture. `blocks`: block of each receiver; rows and columns of blocks. `per_pass`: samples
    of each receiver in a pass.
    """
    (block, grid), r = blocks, len(pixel)
    mean, variance = np.zeros((3, *shape)), np.zeros((3, *shape))
    samples = np.zeros(shape, np.int64)
    variance_of_mean, passes = moments.variance_of_mean, int(moments.passes)
    mean.reshape(3, -1)[:, pixel] = moments.mean[:, :r]
    variance.reshape(3, -1)[:, pixel] = variance_of_mean[:, :r]
    samples.reshape(-1)[pixel] = (passes - moments.lost[:r]) * per_pass
    block_mean, block_variance = (table[:, r:-1].reshape(3, *grid).copy() for table in (moments.mean, variance_of_mean))
    counts = np.bincount(block, minlength=grid[0] * grid[1]).reshape(grid)
    return TruthResult(mean, variance, samples, moments.mean[:, -1].copy(), variance_of_mean[:, -1].copy(), passes,
                       block_mean, block_variance, counts, int(moments.lost[:r].sum()), picture_tail(moments),
                       tail_index(moments.tails).reshape(grid))


def doubt_of_both(irradiance: TruthResult, lobes: TruthResult | None) -> str:
    """Return why the error of a truth, that of receivers' lobes included, is not to be trusted; empty where it is."""
    of_lobes = "" if lobes is None or not lobes.doubt else f"lobes of receivers: {lobes.doubt}"
    return "; ".join(said for said in (irradiance.doubt, of_lobes) if said)
