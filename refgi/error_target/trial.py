"""One trial of a threshold: cells that it splits, irradiance carried from level to level, the residual.

A cell is split where stopping would cost more than the threshold, as a sum over its pixels of two squares: the error of
its interpolated normals (`interpolate`) times the irradiance around, and the surplus of known irradiance over the
coarser level's interpolation, at its own pixel or half of that at its neighbours'. Irradiance is in W/m^2.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from refgi.error_target.interpolate import SurfaceLevel, blend_weights, tent_of
from refgi.error_target.near import SIDE, NearLight, near_irradiance_at
from refgi.jit import kernel, prange, threads
from refgi.pairs.irradiance import Receivers
from refgi.pairs.tiles import put, taken
from refgi.rsm.pool import plane
from refgi.stages import stage
from refgi.types import Array


@kernel
def fill_coarsest(representative: Array, exact: Array, near: Array, has_near: Array, irradiance: Array) -> None:
    """Fill the coarsest level's irradiance, (3, h_l, w_l), all of which is known."""
    irradiance[:] = 0
    for i in range(representative.shape[0]):
        for j in range(representative.shape[1]):
            if representative[i, j] >= 0:
                _write_exact(exact, near, has_near, representative[i, j], i, j, irradiance)


@kernel(parallel=True)
def fill_level(
    coarse: Array, weight: Array, across: Array, split: Array, representative: Array, exact: Array, near: Array,
    has_near: Array, fine: Array, known: Array, surplus: Array,
) -> None:
    """Fill a level other than the picture itself with irradiance, (3, h_l, w_l), without the near part; 0 where empty.

    weight, across: of the level's `BlendWeights`; split: coarser cells whose children are known; exact (3, h, w): where
    known; near, has_near: of `NearLight`. Fills known and surplus, (h_l, w_l): the squared difference of known cells to
    their interpolation over all channels (the hierarchical surplus); 0 elsewhere.
    """
    for i in prange(split.shape[0]):
        _blend_row(coarse, weight, across, i, fine)
        last = min(2 * i + 2, representative.shape[0])
        known[2 * i : last], surplus[2 * i : last] = False, 0
        for j in range(split.shape[1]):
            if not split[i, j]:
                continue
            for y in range(2 * i, last):
                for x in range(2 * j, min(2 * j + 2, representative.shape[1])):
                    p = representative[y, x]
                    if p >= 0:
                        known[y, x] = True
                        surplus[y, x] = _write_exact(exact, near, has_near, p, y, x, fine)


@kernel
def _write_exact(exact: Array, near: Array, has_near: Array, p: int, y: int, x: int, fine: Array) -> Any:
    """Replace the interpolation of a cell by its known irradiance; return the square of their difference."""
    square = fine.dtype.type(0.0)
    row, column = p // exact.shape[2], p % exact.shape[2]
    for c in range(3):
        value = exact[c, row, column] - near_irradiance_at(near, has_near, c, row, column)
        square += (value - fine[c, y, x]) * (value - fine[c, y, x])
        fine[c, y, x] = value
    return square


@kernel(parallel=True)
def fill_picture(
    coarse: Array, weight: Array, across: Array, split: Array, covered: Array, exact: Array, near: Array,
    has_near: Array, picture: Array,
) -> None:
    """Fill the picture, (3, h, w): known pixels as they are, others with their interpolation and the near part.

    covered: (h, w) bool; the others are those of `fill_level`, for level 0.
    """
    height, width = picture.shape[1:]
    for i in prange(split.shape[0]):
        _blend_row(coarse, weight, across, i, picture)
        last = min(2 * i + 2, height)
        for k in range(has_near.shape[1]):
            if has_near[2 * i // SIDE, k]:
                for c in range(3):
                    for y in range(2 * i, last):
                        for x in range(k * SIDE, min(k * SIDE + SIDE, width)):
                            picture[c, y, x] += near[c, y, x]
        for j in range(split.shape[1]):
            if split[i, j]:
                for c in range(3):
                    for y in range(2 * i, last):
                        for x in range(2 * j, min(2 * j + 2, width)):
                            picture[c, y, x] = exact[c, y, x] if covered[y, x] else picture[c, y, x]


@kernel(parallel=True)
def residuals(
    pixel: Array, coarse: Array, weight: Array, across: Array, split: Array, exact: Array, near: Array, has_near: Array,
    residual: Array,
) -> None:
    """Fill residual, (3, n), with exact less `fill_picture` at the pixels (n flat indices) where exact is known."""
    width, zero = exact.shape[2], residual.dtype.type(0.0)
    for k in prange(len(pixel)):
        y, x = pixel[k] // width, pixel[k] % width
        i, j, child = y >> 1, x >> 1, 2 * (y & 1) + (x & 1)
        for c in range(3):
            blended = zero
            for corner in range(4):
                if tent_of(across, child, corner) > zero:
                    row, column = i + (corner >> 1) * (2 * (y & 1) - 1), j + (corner & 1) * (2 * (x & 1) - 1)
                    if 0 <= row < coarse.shape[1] and 0 <= column < coarse.shape[2]:
                        blended += weight[4 * child + corner, i, j] * coarse[c, row, column]
            picture = blended + near_irradiance_at(near, has_near, c, y, x)
            residual[c, k] = zero if split[i, j] else exact[c, y, x] - picture


@kernel
def _blend_row(coarse: Array, weight: Array, across: Array, i: int, fine: Array) -> None:
    """Blend the two finer rows within row i of coarser cells."""
    height, width = coarse.shape[1:]
    blended = np.empty((2, width), coarse.dtype)
    for v in range(min(2, fine.shape[1] - 2 * i)):
        for c in range(3):
            blended[:] = 0
            for u in range(2):
                for corner in range(4):
                    row, right = i + (corner >> 1) * (2 * v - 1), (corner & 1) * (2 * u - 1)
                    if tent_of(across, 2 * v + u, corner) > 0 and 0 <= row < height:
                        first, last = max(0, -right), width - max(0, right)
                        _add(weight[8 * v + 4 * u + corner, i, first:last], coarse[c, row, first + right :],
                             blended[u, first:last])
            _interleave(blended[0], blended[1], fine[c, 2 * i + v])


@kernel
def _add(weight: Array, irradiance: Array, blended: Array) -> None:
    for j in range(len(blended)):
        blended[j] += weight[j] * irradiance[j]


@kernel
def _interleave(even: Array, odd: Array, row: Array) -> None:
    for j in range(len(row) // 2):
        row[2 * j] = even[j]
        row[2 * j + 1] = odd[j]
    if len(row) % 2:
        row[len(row) - 1] = even[len(row) // 2]


SQUARE = 32  # cells along a square within which listed pixels keep together


class ExactIrradiance:
    """Irradiance of pixels in full, each evaluated at most once; `sum_at` is that of `PixelSum`."""

    def __init__(self, receivers: Receivers, sum_at: Callable[[Array], Array]) -> None:
        self._sum_at = sum_at
        self.is_known = np.zeros(receivers.covered.size, np.bool_)
        self.irradiance = plane(receivers.position.shape, receivers.position.dtype)  # (3, h, w), W/m^2
        self._unlit_pixels, self._path = plane((self.is_known.size,), np.int64), _morton_path()

    def evaluate(self, pixel: Array) -> None:
        """Evaluate pixels that are not known; neighbours should follow each other."""
        if len(pixel):
            put(self.irradiance, pixel, self._sum_at(pixel))
            self.is_known[pixel] = True

    def unlit(self, split: Array, level: SurfaceLevel) -> Array:
        """Return the representatives of split cells' children that are not known; valid until the next call."""
        count = _list_unlit(split, level.covered, level.representative_pixel, self.is_known, self._path,
                            self._unlit_pixels)
        return self._unlit_pixels[:count]

    def at(self, pixel: Array) -> Array:
        """Return the irradiance of known pixels, (3, n), W/m^2."""
        return taken(self.irradiance, pixel)


class Trials:
    """Refinement of a picture by one threshold after the other.

    `near` is the part of near pairs that no interpolation carries; `levels` are two or more, from level 0.
    """

    def __init__(self, exact: ExactIrradiance, near: NearLight, levels: tuple[SurfaceLevel, ...]) -> None:
        self._exact, self._levels, self._blends = exact, levels, blend_weights(levels)
        self._values = exact.irradiance, near.irradiance, near.has_near
        self._irradiance = [plane((3, *level.covered.shape), exact.irradiance.dtype) for level in levels[1:]]
        self.split = [np.zeros(levels[0].covered.shape, np.bool_), *(level.covered.copy() for level in levels[1:])]
        top = levels[-1]
        pixel = top.representative_pixel[top.covered].astype(np.int64)
        exact.evaluate(pixel[~exact.is_known[pixel]])
        fill_coarsest(top.representative_pixel, *self._values, self._irradiance[-1])

    @stage("error_target.trial")
    def run(self, threshold: float) -> None:
        """Refine from the coarsest level down wherever stopping would cost more than a threshold.

        threshold: Root of the squared error that a cell may leave, W/m^2.
        -> None: `split` says which cells are refined.
        """
        for level in range(len(self._levels) - 2, 0, -1):
            here, blend, split = self._levels[level], self._blends[level], self.split[level + 1]
            coarse, irradiance = self._irradiance[level], self._irradiance[level - 1]
            self._exact.evaluate(self._exact.unlit(split, here))
            known, surplus = plane(here.covered.shape, np.bool_), plane(here.covered.shape, irradiance.dtype)
            with threads(here.thread_count):
                fill_level(coarse, blend.weight, blend.across, split, here.representative_pixel, *self._values,
                           irradiance, known, surplus)
                _mark_split(known, irradiance, surplus, self._blends[level - 1].normal_error, 4.0**level,
                            threshold**2, self.split[level])

    def residual(self, pixel: Array) -> Array:
        """Return the full sum less the picture at known pixels, (3, n), W/m^2."""
        result = np.empty((3, len(pixel)), self._exact.irradiance.dtype)
        blend = self._blends[0]
        residuals(pixel, self._irradiance[0], blend.weight, blend.across, self.split[1], *self._values, result)
        return result

    def share_evaluated(self) -> float:
        """Return the share of covered pixels that the picture would have evaluated."""
        count = np.count_nonzero(self._exact.is_known) + len(self._exact.unlit(self.split[1], self._levels[0]))
        return float(count) / max(1, int(np.count_nonzero(self._levels[0].covered)))

    def split_all(self) -> None:
        """Split every cell, for a picture without error."""
        for split in self.split[1:]:
            split[:] = True

    @stage("error_target.assemble")
    def picture(self) -> Array:
        """Evaluate the pixels of the last split cells and join all levels.

        -> (3, h, w): Irradiance, W/m^2, linear RGB.
        """
        self._exact.evaluate(self._exact.unlit(self.split[1], self._levels[0]))
        result, blend = np.empty_like(self._exact.irradiance), self._blends[0]
        fill_picture(self._irradiance[0], blend.weight, blend.across, self.split[1], self._levels[0].covered,
                     *self._values, result)
        return result


def _morton_path() -> Array:
    """Return row and column within a square in the order of its cells: bits of the index by turns (Morton)."""
    index = np.arange(SQUARE * SQUARE)
    return np.stack([sum((index >> (2 * bit + odd) & 1) << bit for bit in range(SQUARE.bit_length() - 1))
                     for odd in (1, 0)])


@kernel
def _list_unlit(
    split: Array, covered: Array, representative_pixel: Array, is_known: Array, path: Array, out: Array
) -> int:
    """List the representatives of split cells' children that are not known; return how many."""
    count = 0
    for top in range(0, split.shape[0], SQUARE):
        for left in range(0, split.shape[1], SQUARE):
            for k in range(path.shape[1]):
                i, j = top + path[0, k], left + path[1, k]
                if i < split.shape[0] and j < split.shape[1] and split[i, j]:
                    count = _list_unlit_children(i, j, covered, representative_pixel, is_known, count, out)
    return count


@kernel
def _list_unlit_children(
    i: int, j: int, covered: Array, representative_pixel: Array, is_known: Array, count: int, out: Array
) -> int:
    for y in range(2 * i, min(2 * i + 2, covered.shape[0])):
        for x in range(2 * j, min(2 * j + 2, covered.shape[1])):
            p = np.int64(representative_pixel[y, x]) if representative_pixel.size else y * covered.shape[1] + x
            if covered[y, x] and not is_known[p]:
                out[count] = p
                count += 1
    return count


@kernel(parallel=True)
def _mark_split(
    known: Array, irradiance: Array, surplus: Array, normal_error: Array, pixels: float, most: float, split: Array
) -> None:
    """Split a known cell where normal error or surplus promise more than `most` over its pixels, W^2/m^4."""
    height, width = known.shape
    for i in prange(height):
        for j in range(width):
            split[i, j] = False
            if not known[i, j]:
                continue
            largest_square, largest_surplus = 0.0, float(surplus[i, j])
            for y in range(max(i - 1, 0), min(i + 2, height)):
                for x in range(max(j - 1, 0), min(j + 2, width)):
                    red, green, blue = (float(irradiance[0, y, x]), float(irradiance[1, y, x]),
                                        float(irradiance[2, y, x]))
                    largest_square = max(largest_square, red * red + green * green + blue * blue)
                    largest_surplus = max(largest_surplus, 0.25 * float(surplus[y, x]))
            split[i, j] = largest_square * float(normal_error[i, j]) + pixels * largest_surplus > most
