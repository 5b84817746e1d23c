"""What the samples of a crown send to every texel of a level (Sec. 3.1, Eq. 3 and 4).

Symbols: d vector from receiver to sample (m), n and n_j their normals, m_j = -n_j ds_j / pi with the area ds_j that
the sample stands for, c = max(0, n . d), s = max(0, m_j . d).
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.sssil.crown.pattern import (
    level_key,
    pixel_key,
    pixel_offset,
    row_key,
    row_offsets,
    sample_points,
    sample_weight,
)
from refgi.sssil.crown.reach import chosen_radius
from refgi.sssil.level import Level
from refgi.sssil.settings import HssilSettings
from refgi.stages import stage

Array = npt.NDArray[Any]


@stage("sssil.gather")
def gather(level: Level, index: int, settings: HssilSettings) -> Array:
    """Sum what the samples around each texel of a level send to it.

    Parameters
    ----------
    level : Level
        Receivers and senders.
    index : int
        0 for the first level, whose inner disc is sampled as well.
    settings : HssilSettings
        How many samples, which pattern and which form factor.

    Returns
    -------
    (3, h, w) ndarray
        Irradiance, W/m^2, in the dtype of the level. Excludes albedo/pi and visibility.
    """
    rows, columns = level.shape
    radius = settings.radius
    if radius is None:
        radius = chosen_radius((rows << index, columns << index), settings)
    real = level.position.dtype.type
    result = np.zeros_like(level.radiance)
    factor = real(level_factor(index, settings))
    inner = settings.inner if index == 0 else 0
    own = settings.pattern == "pixel"
    if own:
        offsets, weight = np.zeros((1, 0, 2), np.int32), sample_weight(radius, inner, settings.samples)
    else:
        offsets, weight = row_offsets(settings, index, level.number, rows, radius)
    _gather_plainly(level.position, level.normal, level.radiance, level.area, offsets, weight, own,
                    sample_points(inner, settings.samples), inner, radius,
                    level_key(settings.seed, level.number), settings.form_factor == "disc", factor, result)
    return result


def level_factor(index: int, settings: HssilSettings) -> float:
    """Return what the sum of a level is multiplied by.

    Parameters
    ----------
    index : int
        How many levels finer ones there are.
    settings : HssilSettings
        Say whether forms are used as printed.

    Returns
    -------
    float
        1 unless Eq. 4 lacks its pi or areas are scaled by the level's 4^k a second time.
    """
    factor = 1.0
    if "hss_disc_pi" in settings.as_published and settings.form_factor == "disc":
        factor /= math.pi
    if "hss_level_factor" in settings.as_published:
        factor *= 4.0**index
    return factor


@kernel(parallel=True)
def _gather_plainly(
    position: Array, normal: Array, radiance: Array, area: Array, offsets: Array, weight: Array, own: bool,
    points: Array, inner: int, radius: float, key: Any, disc: bool, factor: Any, result: Array,
) -> None:
    rows, columns = area.shape
    real = position.dtype.type
    pi, zero, least = real(math.pi), real(0.0), real(1e-37)
    for y in prange(rows):
        row = np.int64(y)
        here = row_key(key, row)
        shared = min(row, offsets.shape[0] - 1)
        for column in range(columns):
            mine = pixel_key(here, column)
            red, green, blue = zero, zero, zero
            for j in range(weight.size):
                if own:
                    ox, oy = pixel_offset(points, inner, radius, mine, j)
                else:
                    ox, oy = np.int64(offsets[shared, j, 0]), np.int64(offsets[shared, j, 1])
                a, b = row + oy, column + ox
                if a < 0 or a >= rows or b < 0 or b >= columns or (ox == 0 and oy == 0):
                    continue
                dx = position[0, a, b] - position[0, row, column]
                dy = position[1, a, b] - position[1, row, column]
                dz = position[2, a, b] - position[2, row, column]
                square = dx * dx + dy * dy + dz * dz
                c = normal[0, row, column] * dx + normal[1, row, column] * dy + normal[2, row, column] * dz
                s = -(normal[0, a, b] * dx + normal[1, a, b] * dy + normal[2, a, b] * dz)
                s = max(zero, s) * (area[a, b] * real(weight[j]) / pi)
                below = square * square + (s * math.sqrt(square) if disc else zero)
                g = pi * max(zero, c) * s / max(below, least)
                red += g * radiance[0, a, b]
                green += g * radiance[1, a, b]
                blue += g * radiance[2, a, b]
            result[0, row, column] = factor * red
            result[1, row, column] = factor * green
            result[2, row, column] = factor * blue
