"""Sample patterns: who shares the points of a crown, and their offsets from the receiver (Sec. 3.2, Fig. 2).

Offsets are whole texels (ox, oy), columns to the right and rows down from the receiver.

Receivers of a row share samples with the pattern "row". Each row takes the stretch of one long Kronecker sequence that
follows that of the row above, so that rows which upsampling mixes complement each other. A shift by a hash of seed and
level makes the expected share of samples of a texel the share of its area within the crown, for every receiver.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.jit import kernel
from refgi.sampling import hash_bits
from refgi.sssil.crown.points import (
    FIRST_STEP,
    SECOND_STEP,
    TO_UNIT,
    level_key,
    pixel_key,
    pixel_offset,
    row_key,
    sample_points,
    sample_weight,
    shift_of,
    shifted,
)
from refgi.sssil.settings import SamplingSettings

Array = npt.NDArray[Any]

PHASES = 2  # even columns of a row share samples, and odd ones: rows that share all would show as streaks


def row_offsets(
    sampling: SamplingSettings, index: int, number: int, rows: int, radius: float | None = None, phase: int = 0
) -> tuple[Array, Array]:
    """Return the samples that receivers of a row share: every second one with the pattern "row".

    Parameters
    ----------
    sampling : SamplingSettings
        Numbers of samples, pattern ("row", "fixed" or "all") and seed.
    index : int
        0 for the first level, whose inner disc is sampled as well.
    number : int
        Number of the level in the pyramid.
    rows : int
        Rows of the level.
    radius : float, optional
        Inner radius of the crown, texels; that of the settings by default.
    phase : int
        Column modulo PHASES; patterns "fixed" and "all" are those of every column.

    Returns
    -------
    offsets : (rows, n, 2) ndarray of int32
        Texels (ox, oy) from the receiver; one row for all with "fixed" and "all". In these two, a sample is followed by
        its mirror image (-ox, oy); those with ox = 0 come last.
    weight : (n,) ndarray of float64
        Texels of the level that each sample stands for.

    Raises
    ------
    InputError
        If every pixel has a pattern of its own, or no radius is known.
    """
    expect(sampling.pattern != "pixel", "pattern", "one that receivers share", sampling.pattern)
    offsets, weight = shared_offsets(sampling, index, number, rows, radius)
    return offsets[:, min(phase, offsets.shape[1] - 1)], weight


def shared_offsets(
    sampling: SamplingSettings, index: int, number: int, rows: int, radius: float | None = None,
    columns: int | None = None,
) -> tuple[Array, Array]:
    """Return the samples that receivers share, by row and by column modulo 2.

    Parameters
    ----------
    sampling : SamplingSettings
        Numbers of samples, pattern ("row", "fixed" or "all") and seed.
    index : int
        0 for the first level, whose inner disc is sampled as well.
    number : int
        Number of the level in the pyramid.
    rows : int
        Rows of the level.
    radius : float, optional
        Inner radius of the crown, texels; that of the settings by default.
    columns : int, optional
        Columns of the level: "all" then leaves out what is farther away than any texel of so small a picture.

    Returns
    -------
    offsets : (rows, PHASES, n, 2) ndarray of int32
        Texels (ox, oy) from the receiver; (1, 1, n, 2) with "fixed" and "all".
    weight : (n,) ndarray of float64
        Texels of the level that each sample stands for.
    """
    radius = known_radius(sampling, radius)
    inner = sampling.inner if index == 0 else 0
    if sampling.pattern == "all":
        within = (rows, columns) if columns is not None else None
        every = _every_texel(0.0 if index == 0 else radius, 2.0 * radius, within)
        return every[None, None], np.ones(len(every))
    if sampling.pattern == "fixed":
        mirrored, weight = _mirrored(sampling, radius, inner, number)
        return mirrored[None, None], weight
    points = sample_points(inner, sampling.samples)
    offsets = np.empty((rows, PHASES, len(points), 2), np.int32)
    _fill_rows(points, inner, radius, level_key(sampling.seed, number), offsets)
    return offsets, sample_weight(radius, inner, sampling.samples)


def offsets_at(
    sampling: SamplingSettings, index: int, number: int, row: int, column: int, radius: float | None = None
) -> Array:
    """Return the samples of one receiver, whatever the pattern.

    Parameters
    ----------
    sampling : SamplingSettings
        Numbers of samples, pattern and seed.
    index : int
        0 for the first level, whose inner disc is sampled as well.
    number : int
        Number of the level in the pyramid.
    row, column : int
        The receiver.
    radius : float, optional
        Inner radius of the crown, texels; that of the settings by default.

    Returns
    -------
    (n, 2) ndarray of int32
        Texels (ox, oy) from the receiver, in the order of `row_offsets` and its weights.
    """
    if sampling.pattern != "pixel":
        offsets, _ = row_offsets(sampling, index, number, row + 1, radius, column % PHASES)
        offsets_here: Array = offsets[min(row, len(offsets) - 1)]
        return offsets_here
    inner = sampling.inner if index == 0 else 0
    points = sample_points(inner, sampling.samples)
    key = pixel_key(row_key(level_key(sampling.seed, number), row), column)
    return np.array([pixel_offset(points, inner, known_radius(sampling, radius), key, j) for j in range(len(points))],
                    np.int32).reshape(-1, 2)


def known_radius(sampling: SamplingSettings, radius: float | None) -> float:
    """Return the inner radius of the crowns.

    Parameters
    ----------
    sampling : SamplingSettings
        Their radius.
    radius : float or None
        Replaces that of the settings.

    Returns
    -------
    float
        Texels.

    Raises
    ------
    InputError
        If neither is set.
    """
    found = sampling.radius if radius is None else radius
    expect(found is not None, "radius", "texels, or the size of the first level to choose it by", found)
    return float(found)  # type: ignore[arg-type]


@kernel
def _fill_rows(points: Array, inner: int, radius: float, key: Any, offsets: Array) -> None:
    rows, phases, count, _ = offsets.shape
    for row in range(rows):
        for phase in range(phases):
            u, cosine, sine = shift_of(key, (row * phases + phase) * (count - inner))
            offsets_here = offsets[row, phase]
            for j in range(np.uint64(inner)):
                offsets_here[j, 0], offsets_here[j, 1] = shifted(points, j, 0.0, radius, u, cosine, sine)
            for j in range(np.uint64(inner), np.uint64(count)):
                offsets_here[j, 0], offsets_here[j, 1] = shifted(points, j, 1.0, radius, u, cosine, sine)


def _every_texel(low: float, high: float, within: tuple[int, int] | None) -> Array:
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


def _mirrored(sampling: SamplingSettings, radius: float, inner: int, number: int) -> tuple[Array, Array]:
    """Return a mirror-symmetric set and its weights: half of the points on the right, an odd one above or below."""
    key = level_key(sampling.seed, number)
    shift = np.array([hash_bits(key), hash_bits(key ^ np.uint32(0x27D4EB2F))]) * TO_UNIT
    weight = sample_weight(radius, inner, sampling.samples)
    pairs, middles = [], []
    for first, count, near in ((0, inner, 0.0), (inner, sampling.samples, 1.0)):
        half = np.arange((count + 1) // 2)
        u, v = (0.5 + half * FIRST_STEP + shift[0]) % 1.0, (0.5 + half * SECOND_STEP + shift[1]) % 1.0
        length = radius * np.sqrt(near + (3.0 if near else 1.0) * u)
        x, y = length * np.cos(math.pi * (v - 0.5)), length * np.sin(math.pi * (v - 0.5))
        right, even = np.floor(np.stack([x, y], axis=1) + 0.5), count // 2
        both = np.stack([right, right * (-1, 1)], axis=1)[:even].reshape(-1, 2)
        middle = np.stack([np.zeros(count % 2), np.floor(np.copysign(length, y)[even:] + 0.5)], axis=1)
        pairs.append((both, weight[first : first + 2 * even]))
        middles.append((middle, weight[first : first + count % 2]))
    offsets, weights = zip(*pairs, *middles, strict=True)
    return np.concatenate(offsets).astype(np.int32), np.concatenate(weights)
