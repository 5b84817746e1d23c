"""What a picture's error looks like: streaks, spikes, blocks, one constant factor. Each has a figure and a threshold.

All look at e, the luminance of the picture less that of its reference, over covered pixels; where e is no more than the
reference's own noise nothing is found.
"""

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from refgi.compare.outcome import NOISE_MARGIN
from refgi.compare.pictures import luminance
from refgi.types import Array

STREAKS, SPIKES, BLOCKS, FACTOR = 0.12, 3.0, 1.3, 0.5  # thresholds of the figures
TILE, LEAST_TILES = 32, 16  # pixels: the median over tiles leaves out edges of objects, which lie in few of them
LAG = 3  # pixels along which streaks go on and noise does not
LEAST_DETAIL = 0.05  # of the error's deviation in a tile: the rest is curvature of a smooth error
SPIKE_RATIO = 4.0  # times the second largest error around it
PERIODS = (2, 4, 8, 16)  # pixels along a side of blocks
CLIP = 3.0  # times the median: edges and spikes count no more than this


class Finding(NamedTuple):
    """Something that stands out in a picture's error."""

    name: str
    figure: float
    threshold: float  # the figure is at least this
    said: str  # what the figure is


class Seen(NamedTuple):
    """Luminance of a picture's error and what belongs to it."""

    error: Array  # (h, w); 0 where not covered
    reference: Array
    deviation: Array  # standard error of the reference
    covered: Array  # finite pixels that show a surface


def findings(irradiance: Array, mean: Array, variance: Array, covered: Array) -> tuple[Finding, ...]:
    """Return what stands out in irradiance, (3, h, w), W/m^2, against a reference's mean and its variance."""
    error = luminance(irradiance) - luminance(mean)
    counted = covered & np.isfinite(error)
    seen = Seen(np.where(counted, error, 0.0), np.where(counted, luminance(mean), 0.0),
                np.where(counted, luminance(np.sqrt(variance)), 0.0), counted)
    if (seen.error**2).sum() <= NOISE_MARGIN**2 * (seen.deviation**2).sum():
        return ()
    return tuple(found for detect in DETECTORS for found in detect(seen) if found.figure >= found.threshold)


def streaks(seen: Seen) -> Iterator[Finding]:
    """Yield how much further the error's detail goes on along rows than along columns, and the other way round.

    Detail across rows is e less the mean of the pixels above and below; where it goes on along x there are streaks. The
    median over tiles of its autocorrelation, less that of columns; in a picture of few tiles objects have edges in too
    many of them.
    """
    height, width = (side // TILE for side in seen.error.shape)
    places = [(slice(TILE * y, TILE * y + TILE), slice(TILE * x, TILE * x + TILE))
              for y in range(height) for x in range(width)]
    tiles = [seen.error[place] for place in places if seen.covered[place].all()]
    if len(tiles) < LEAST_TILES:
        return
    figure = float(np.median([_run_along(tile) - _run_along(tile.T) for tile in tiles]))
    name = "row streaks" if figure > 0 else "column streaks"
    along = "along x less along y" if figure > 0 else "along y less along x"
    yield Finding(name, abs(figure), STREAKS, f"autocorrelation of the error's detail over {LAG} pixels, {along}")


def spikes(seen: Seen) -> Iterator[Finding]:
    """Yield how many pixels in 10,000 are far too bright and alone: several times the errors around them."""
    height, width = seen.error.shape
    wide = np.pad(np.abs(seen.error), 1)
    around = [wide[1 + y:1 + y + height, 1 + x:1 + x + width] for y in (-1, 0, 1) for x in (-1, 0, 1) if x or y]
    second = np.partition(np.stack(around), -2, axis=0)[-2]
    alone = (seen.error > SPIKE_RATIO * second) & (seen.error > seen.reference) & (seen.error > 5 * seen.deviation)
    count = int((alone & seen.covered).sum())
    share = 1e4 * count / max(1, int(seen.covered.sum()))
    yield Finding("spikes", share, SPIKES, f"pixels in 10,000 with {SPIKE_RATIO:g} times the error around them")


def blocks(seen: Seen) -> Iterator[Finding]:
    """Yield how much larger the error's steps are between blocks than inside, of the size where they are largest."""
    size, figure = max(((period, min(_step_ratio(seen, period), _step_ratio(_turned(seen), period)))
                        for period in PERIODS), key=lambda pair: pair[1])
    yield Finding(f"blocks of {size} x {size}", figure, BLOCKS, "steps of the error between blocks over those inside")


def factor(seen: Seen) -> Iterator[Finding]:
    """Yield which share of the squared error one constant factor on the picture would leave out."""
    noise = float((seen.deviation**2).sum())
    whole, scale = float((seen.error**2).sum()) - noise, float((seen.reference**2).sum()) - noise
    product = float((seen.error * seen.reference).sum()) + noise  # the noise of both is one, of opposite sign
    if whole <= 0 or scale <= 0:
        return
    bias = product / scale
    name = f"too {'bright' if bias > 0 else 'dark'} by {abs(bias):.0%} all over"
    yield Finding(name, min(1.0, product * product / (scale * whole)), FACTOR,
                  "share of the squared error that one factor explains")


DETECTORS: tuple[Callable[[Seen], Iterator[Finding]], ...] = (streaks, spikes, blocks, factor)


def _run_along(tile: Array) -> float:
    """Return the autocorrelation along x of the detail across rows, large values clipped; 0 where it is a trifle."""
    detail = tile[1:-1] - 0.5 * (tile[2:] + tile[:-2])
    if detail.std() < LEAST_DETAIL * tile.std():
        return 0.0
    limit = CLIP * float(np.median(np.abs(detail)))
    detail = np.clip(detail, -limit, limit)
    power = float((detail * detail).mean())
    return float((detail[:, LAG:] * detail[:, :-LAG]).mean()) / power if power > 0 else 0.0


def _step_ratio(seen: Seen, period: int) -> float:
    both = seen.covered[:, 1:] & seen.covered[:, :-1]
    steps = np.abs(np.diff(seen.error, axis=1))
    typical = float(np.median(steps[both])) if both.any() else 0.0
    if typical <= 0:
        typical = float(steps[both].mean()) if both.any() else 0.0
    steps = np.minimum(steps, CLIP * typical)
    between = np.broadcast_to((np.arange(1, steps.shape[1] + 1) % period) == 0, both.shape)
    if not (both & between).any() or not (both & ~between).any():
        return 0.0
    inside = float(steps[both & ~between].mean())
    outside = float(steps[both & between].mean())
    return outside / inside if inside > 0 else math.inf if outside > 0 else 0.0


def _turned(seen: Seen) -> Seen:
    return Seen(*(plane.T for plane in seen))


PLACES = 3
SHARE_OF_SIDE = 8  # a square is an eighth of the shorter side
LEAST_SIDE = 8  # pixels
NEGLIGIBLE = 1e-9  # of the whole: what rounding leaves in sums over windows without error


class Crop(NamedTuple):
    """A square of a picture, in pixels from the upper left corner."""

    x: int
    y: int
    side: int
    share: float  # of the squared error of the whole picture


def worst_crops(error: Array, covered: Array) -> tuple[Crop, ...]:
    """Return up to `PLACES` squares with the most squared error, worst first, none over another; NaN counts most."""
    squares = _squares(error, covered)
    side = min(*error.shape, max(LEAST_SIDE, min(error.shape) // SHARE_OF_SIDE))
    sums, whole = _window_sums(squares, side), float(squares.sum())
    found: list[Crop] = []
    while len(found) < PLACES and sums.max() > NEGLIGIBLE * whole:
        y, x = (int(i) for i in np.unravel_index(np.argmax(sums), sums.shape))
        found.append(Crop(x, y, side, float(sums[y, x]) / whole))
        sums[max(0, y - side + 1):y + side, max(0, x - side + 1):x + side] = 0  # windows over this one
    return tuple(found)


def _squares(error: Array, covered: Array) -> Array:
    finite = np.isfinite(error) & covered
    squares = np.where(finite, np.where(finite, error, 0.0).astype(np.float64) ** 2, 0.0)
    squares[covered & ~finite] = squares.max(initial=0.0) or 1.0
    return squares


def _window_sums(values: Array, side: int) -> Array:
    sums = np.pad(values, ((1, 0), (1, 0))).cumsum(0).cumsum(1)
    windows: Array = sums[side:, side:] - sums[:-side, side:] - sums[side:, :-side] + sums[:-side, :-side]
    return windows
