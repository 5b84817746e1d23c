"""Low-discrepancy points of a crown, who shares them, and their offsets from the receiver (Sec. 3.2, Fig. 2).

A point (u, v) lies at the angle 2 pi v; with uniform density r sqrt(1 + 3 u) from the receiver in the crown, r sqrt(u)
in the disc within; with a density of the inverse distance r (1 + u) and r u away. It takes the texel it falls into, and
stands for as many texels as there are to a point where it lies. Texels of a tile of n x n (Keller and Heidrich 2001),
row by row, take consecutive stretches of one Kronecker sequence, so that any n x n texels have the points of one set.
With the pattern "row" tiles are two columns wide and never repeat, so that rows complement each other. A shift by a
hash of seed and level makes the expected weight of a texel the share of its area within the crown. The crown of level k
ends at 2 r of its texels: r 2^K texels of the first of K levels.
"""

import math
import warnings
from typing import Any, NamedTuple

import numpy as np

from refgi.errors import RefgiWarning, expect
from refgi.jit import kernel
from refgi.sampling import FIRST_STEP, SECOND_STEP, hash_bits
from refgi.sssil.settings import Density, SamplingSettings
from refgi.types import Array

TO_UNIT = 2.0**-32


def sample_points(inner: int, crown: int) -> Array:
    """Return the points that all patterns shift, (inner + crown, 3): u, cos 2 pi v, sin 2 pi v, the disc's first."""
    count = np.concatenate([np.arange(inner), np.arange(crown)])
    u, v = (0.5 + count * FIRST_STEP) % 1.0, (0.5 + count * SECOND_STEP) % 1.0
    return np.stack([u, np.cos(2.0 * math.pi * v), np.sin(2.0 * math.pi * v)], axis=1)


def sample_weight(radius: float, inner: int, crown: int) -> Array:
    """Return how many texels each sample stands for where density is uniform, (inner + crown,): shared areas."""
    disc = math.pi * radius**2
    return np.repeat([disc / max(inner, 1), 3.0 * disc / crown], [inner, crown])


class PixelSamples(NamedTuple):
    """Samples of receivers that have their own."""

    points: Array  # (n, 3) of `sample_points`
    weight: Array  # (n,) texels that each stands for in the mean
    inner: int  # how many lie in the inner disc; they come first
    radius: float  # of the crown, texels
    uniform: bool  # density
    key: Any  # uint32, draws the samples of the level


def pixel_samples(sampling: SamplingSettings, index: int, number: int, radius: float) -> PixelSamples:
    """Return the samples of a level's receivers with their own; arguments as in `shared_offsets`."""
    inner, crown = sampling.counts(index)
    return PixelSamples(sample_points(inner, crown), sample_weight(radius, inner, crown), inner, radius,
                        sampling.density == "uniform", level_key(sampling.seed, number))


def known_radius(sampling: SamplingSettings, radius: float | None) -> float:
    """Return the inner radius of the crowns, texels: `radius`, else the settings'; `InputError` if neither is set."""
    found = sampling.radius if radius is None else radius
    expect(found is not None, "radius", "texels, or the size of the first level to choose it by", found)
    return float(found)  # type: ignore[arg-type]


@kernel
def level_key(seed: Any, number: Any) -> Any:
    """Return the hash of seed and level number, uint32."""
    return hash_bits(np.uint32(seed) ^ hash_bits(np.uint32(number) + np.uint32(0x9E3779B9)))


@kernel
def row_key(key: Any, row: Any) -> Any:
    """Return the hash of a level's key and a row, uint32."""
    return hash_bits(key ^ hash_bits(np.uint32(row) + np.uint32(0x85EBCA6B)))


@kernel
def pixel_key(key: Any, column: Any) -> Any:
    """Return the hash of a row's key and a column, uint32."""
    return hash_bits(key ^ hash_bits(np.uint32(column) + np.uint32(0xC2B2AE35)))


@kernel
def shift_of(key: Any, block: Any) -> Any:
    """Return the shift of the common points by a key, `block` skipped: addend of u, cosine and sine of a turn."""
    u = (hash_bits(key) * TO_UNIT + block * FIRST_STEP) % 1.0
    v = (hash_bits(key ^ np.uint32(0x27D4EB2F)) * TO_UNIT + block * SECOND_STEP) % 1.0
    return u, math.cos(2.0 * math.pi * v), math.sin(2.0 * math.pi * v)


def key_shift(key: Any) -> Array:
    """Return the random shift (u, v) of a key, (2,) float64 in [0, 1)."""
    return np.array([hash_bits(key), hash_bits(key ^ np.uint32(0x27D4EB2F))]) * TO_UNIT


def tile_shifts(start: Array, tile: tuple[int, int], stretch: int) -> Array:
    """Return the shifts of a tile's texels, (rows, columns, 2), each `stretch` points after the last from `start`."""
    points = np.arange(tile[0] * tile[1]).reshape(*tile, 1) * stretch
    shifts: Array = (start + points * np.array([FIRST_STEP, SECOND_STEP])) % 1.0
    return shifts


@kernel
def distance(share: Any, near: float, radius: float, uniform: bool) -> Any:
    """Return how far the point u = `share` is from the receiver, texels; `near` is 0 in the disc, 1 in the crown."""
    if uniform:
        return radius * math.sqrt(near + (1.0 + 2.0 * near) * share)
    return radius * (near + share)


@kernel
def relative_weight(length: Any, near: float, radius: float, uniform: bool) -> Any:
    """Return how many texels a point at a distance l stands for, over the mean of disc (`near` 0) or crown (1).

    2 pi l r / N, the area over the number of points there, against pi r^2 / N in the disc and 3 pi r^2 / N in the
    crown.
    """
    return 1.0 if uniform else 2.0 * length / (radius * (1.0 + 2.0 * near))


@kernel
def shifted(
    points: Array, j: Any, near: float, radius: float, uniform: bool, u: float, cosine: float, sine: float
) -> Any:
    """Return the offset (ox, oy) of shifted point j, texels from the receiver, and its relative weight."""
    share = points[j, 0] + u
    share = share - 1.0 if share >= 1.0 else share
    length = distance(share, near, radius, uniform)
    x = length * (points[j, 1] * cosine - points[j, 2] * sine)
    y = length * (points[j, 1] * sine + points[j, 2] * cosine)
    return (np.int64(math.floor(x + 0.5)), np.int64(math.floor(y + 0.5)),
            relative_weight(length, near, radius, uniform))


@kernel
def pixel_offset(own: PixelSamples, key: Any, j: int) -> Any:
    """Return offset (ox, oy) and relative weight of sample j of a receiver's own; `key` is the receiver's."""
    u, cosine, sine = shift_of(key, 0)
    return shifted(own.points, j, 0.0 if j < own.inner else 1.0, own.radius, own.uniform, u, cosine, sine)


PHASES = 2  # of the pattern "row": even columns share samples, and odd ones


def row_offsets(
    sampling: SamplingSettings, index: int, number: int, rows: int, radius: float | None = None, column: int = 0
) -> tuple[Array, Array]:
    """Return the samples of the receivers of a column: offsets (m, n, 2) int32 and weights (m or 1, n) float64.

    Arguments as in `shared_offsets`. Texels (ox, oy) from the receiver in row y, at [y mod m]: m is `rows` with "row",
    the tile's side with "interleaved", else 1. With "fixed" and "all" a sample is followed by its mirror image (-ox,
    oy); those with ox = 0 come last. A weight is the texels of the level that a sample stands for. `InputError` if
    every pixel has a pattern of its own, or no radius is known.
    """
    expect(sampling.pattern != "pixel", "pattern", "one that receivers share", sampling.pattern)
    offsets, weight = shared_offsets(sampling, index, number, rows, radius)
    return offsets[:, column % offsets.shape[1]], weight[:, column % weight.shape[1]]


def shared_offsets(
    sampling: SamplingSettings, index: int, number: int, rows: int, radius: float | None = None,
    columns: int | None = None,
) -> tuple[Array, Array]:
    """Return the samples that receivers share, by row and column of their tile, for any pattern but "pixel".

    `index` is 0 for the first level, `number` the level's in the pyramid; with `columns`, "all" leaves out what is
    farther away than any texel. Offsets (m, P, n, 2) int32 are texels (ox, oy) from the receiver at (x, y), at [y mod
    m, x mod P]: tiles with "interleaved", (rows, PHASES) with "row", else (1, 1). Weights (m, P, n) or (1, 1, n)
    float64 are the texels of the level that each sample stands for.
    """
    radius = known_radius(sampling, radius)
    inner, crown = sampling.counts(index)
    if sampling.pattern == "all":
        within = (rows, columns) if columns is not None else None
        every = every_texel(0.0 if index == 0 else radius, 2.0 * radius, within)
        return every[None, None], np.ones((1, 1, len(every)))
    if sampling.pattern == "fixed":
        shift = key_shift(level_key(sampling.seed, number))
        mirrored, weight = mirrored_offsets(inner, crown, shift, radius, sampling.density)
        return mirrored[None, None], weight[None, None]
    tile = (rows, PHASES) if sampling.pattern == "row" else (sampling.tile, sampling.tile)
    shifts = tile_shifts(key_shift(level_key(sampling.seed, number)), tile, crown)
    return tile_offsets(sample_points(inner, crown), inner, shifts, radius, sampling.density)


def tile_offsets(points: Array, inner: int, shifts: Array, radius: float, density: Density) -> tuple[Array, Array]:
    """Return the samples of a tile's texels, as `shared_offsets`, of points (n, 3) and shifts (m, P, 2) modulo 1."""
    offsets, uniform = np.empty((*shifts.shape[:2], len(points), 2), np.int32), density == "uniform"
    relative = np.empty((1, 1, 1) if uniform else offsets.shape[:3])
    _fill_tile(points, inner, radius, uniform, shifts, offsets, relative)
    return offsets, relative * sample_weight(radius, inner, len(points) - inner)


def samples_at(
    sampling: SamplingSettings, index: int, number: int, row: int, column: int, radius: float | None = None
) -> tuple[Array, Array]:
    """Return the samples of one receiver and their weights, whatever the pattern: (n, 2) int32 and (n,) float64."""
    if sampling.pattern != "pixel":
        offsets, weight = row_offsets(sampling, index, number, row + 1, radius, column)
        return offsets[row % len(offsets)], weight[row % len(weight)]
    own = pixel_samples(sampling, index, number, known_radius(sampling, radius))
    key = pixel_key(row_key(own.key, row), column)
    found = np.array([pixel_offset(own, key, j) for j in range(len(own.points))]).reshape(-1, 3)
    return found[:, :2].astype(np.int32), found[:, 2] * own.weight


@kernel
def _fill_tile(
    points: Array, inner: int, radius: float, uniform: bool, shifts: Array, offsets: Array, relative: Array
) -> None:
    rows, phases, count, _ = offsets.shape
    for row in range(rows):
        for phase in range(phases):
            u, turn = shifts[row, phase, 0], 2.0 * math.pi * shifts[row, phase, 1]
            cosine, sine = math.cos(turn), math.sin(turn)
            offsets_here, relative_here = offsets[row, phase], relative[row % len(relative), phase % relative.shape[1]]
            for j in range(count):
                near = 0.0 if j < inner else 1.0
                ox, oy, weight = shifted(points, np.uint64(j), near, radius, uniform, u, cosine, sine)
                offsets_here[j, 0], offsets_here[j, 1] = ox, oy
                relative_here[j % relative.shape[2]] = weight


def every_texel(low: float, high: float, within: tuple[int, int] | None = None) -> Array:
    """Return each texel at a distance of [low, high) but the middle: mirror images adjacent, ox = 0 last."""
    reach = math.ceil(high)
    down, right = (reach, reach) if within is None else (min(reach, size - 1) for size in within)
    oy, ox = np.mgrid[-down : down + 1, 0 : right + 1]
    square = ox**2 + oy**2
    inside = (square >= low**2) & (square < high**2) & (square > 0)
    beside, middle = inside & (ox > 0), inside & (ox == 0)
    half = np.stack([ox[beside], oy[beside]], axis=1)
    both = np.stack([half, half * (-1, 1)], axis=1).reshape(-1, 2)
    return np.concatenate([both, np.stack([ox[middle], oy[middle]], axis=1)]).astype(np.int32)


def mirrored_offsets(
    inner: int, crown: int, shift: Array, radius: float, density: Density
) -> tuple[Array, Array]:
    """Return a mirror-symmetric set and its weights: pairs, then odd ones above or below; `shift` (2,) of u and v."""
    weight, uniform = sample_weight(radius, inner, crown), density == "uniform"
    pairs, middles = [], []
    for first, count, near in ((0, inner, 0.0), (inner, crown, 1.0)):
        half = np.arange((count + 1) // 2)
        u, v = (0.5 + half * FIRST_STEP + shift[0]) % 1.0, (0.5 + half * SECOND_STEP + shift[1]) % 1.0
        length = np.array([distance(share, near, radius, uniform) for share in u])
        relative = np.array([relative_weight(far, near, radius, uniform) for far in length])
        x, y = length * np.cos(math.pi * (v - 0.5)), length * np.sin(math.pi * (v - 0.5))
        right, even = np.floor(np.stack([x, y], axis=1) + 0.5), count // 2
        both = np.stack([right, right * (-1, 1)], axis=1)[:even].reshape(-1, 2)
        middle = np.stack([np.zeros(count % 2), np.floor(np.copysign(length, y)[even:] + 0.5)], axis=1)
        pairs.append((both, weight[first : first + 2 * even] * np.repeat(relative[:even], 2)))
        middles.append((middle, weight[first : first + count % 2] * relative[even:]))
    offsets, weights = zip(*pairs, *middles, strict=True)
    return np.concatenate(offsets).astype(np.int32), np.concatenate(weights)


RECEIVERS = 256  # rows of receivers, or receivers, whose samples are counted


def chosen_radius(shape: tuple[int, int], sampling: SamplingSettings) -> float:
    """Return the inner radius of the crowns, texels of the first level: as set, or what covers the picture."""
    return covering_radius(shape, sampling.levels) if sampling.radius is None else float(sampling.radius)


def covering_radius(shape: tuple[int, int], levels: int) -> float:
    """Return the smallest inner radius with which K crowns cover the picture: its diagonal / 2^K, 1 texel or more.

    >>> covering_radius((300, 400), 4)
    31.25
    """
    return max(1.0, math.hypot(*shape) / float(1 << levels))


def reach(sampling: SamplingSettings, radius: float) -> float:
    """Return the outer radius of the last crown: r 2^K, texels of the first level."""
    return radius * float(1 << sampling.levels)


def warn_short_reach(shape: tuple[int, int], sampling: SamplingSettings) -> None:
    """Warn, with the radius that covers it, when light from one corner of the picture does not reach the other."""
    diagonal = math.hypot(*shape)
    far = reach(sampling, chosen_radius(shape, sampling))
    if far < diagonal:
        warnings.warn(RefgiWarning(
            f"radius: samples reach {far:g} of the first level's diagonal of {diagonal:.0f} texels; "
            f"{math.ceil(covering_radius(shape, sampling.levels))} texels cover it, as does none"), stacklevel=2)


def coverage(sampling: SamplingSettings, shape: tuple[int, int], receivers: int = RECEIVERS) -> Array:
    """Count how many texels' worth of samples fall on each texel around a receiver, over all levels.

    (2 h - 1, 2 w - 1) float64: mean weight of offset (row - h + 1, column - w + 1), texels of the first level; 1 where
    an offset is covered once. `receivers` rows are averaged. A receiver is equally likely to lie anywhere in its texel
    of level k, so that a crown's rims are blurred by 2^k.
    """
    radius = chosen_radius(shape, sampling)
    rows, columns = (np.arange(1 - size, size) for size in shape)
    total = np.zeros((len(rows), len(columns)))
    for index in range(sampling.levels):
        weight = texel_weights(sampling, index, sampling.first_level + index, receivers, radius)
        across = _spread(weight.T, columns, index).T
        total += _spread(across, rows, index)
    return total


def texel_weights(
    sampling: SamplingSettings, index: int, number: int, receivers: int = RECEIVERS, radius: float | None = None
) -> Array:
    """Count how many texels' worth of samples fall on each texel of one level around a receiver, (2 n + 1, 2 n + 1)."""
    if sampling.pattern == "pixel":
        found = [samples_at(sampling, index, number, 0, column, radius) for column in range(receivers)]
        offsets, weight = (np.stack(parts) for parts in zip(*found, strict=True))
    else:
        offsets, weight = shared_offsets(sampling, index, number, receivers, radius)
    reach = int(np.abs(offsets).max(initial=0))
    counted = np.zeros((2 * reach + 1, 2 * reach + 1))
    sets = offsets.size // (2 * max(weight.shape[-1], 1))
    np.add.at(counted, (offsets[..., 1] + reach, offsets[..., 0] + reach), weight / max(sets, 1))
    return counted


def _spread(weight: Array, at: Array, index: int) -> Array:
    """Return the weight of each fine offset along the first axis, mean over where in its texel a receiver lies."""
    reach, parts = len(weight) // 2, 1 << index
    padded = np.concatenate([weight, np.zeros((1, weight.shape[1]))])
    texel = (at[:, None] + np.arange(parts)) // parts + reach
    inside = (texel >= 0) & (texel < len(weight))
    spread: Array = padded[np.where(inside, texel, len(weight))].mean(axis=1)
    return spread
