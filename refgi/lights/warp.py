"""Hierarchical warping of sample points after an importance map (SII Sec. 3.5, after Clarberg et al. 2005; P2).

On each level a sample goes to one half of its cell in proportion to the half's importance and its local coordinate is
stretched over that half, first in y, then in x: method A by the columns of the half it has chosen, B by those of the
whole cell. Its weight w is 1 / density, so that (T/N) sum w_i Phi(s_i) is unbiased for every level. Where sides are no
powers of two the halves' shares a and 1 - a of the cell's texels take the place of the 1/2 in Eq. (5) and (6).
"""

import dataclasses
from typing import Any, Literal

import numpy as np

from refgi.errors import expect
from refgi.jit import kernel
from refgi.lights.importance import Levels, border, cell_sum, importance_pyramid, packed
from refgi.stages import stage
from refgi.types import Array

Method = Literal["A", "B"]

BELOW_1 = 1.0 - 2.0**-53


@dataclasses.dataclass(frozen=True)
class Warp:
    """How samples follow an importance map: `method` "A" or "B", `levels` of halving (at most down to texels)."""

    method: Method = "A"
    levels: int = 3

    def __post_init__(self) -> None:
        expect(self.method in ("A", "B"), "method", "'A' or 'B'", self.method)
        expect(isinstance(self.levels, int | np.integer) and self.levels >= 0, "levels", "a whole number >= 0",
               self.levels)


@stage("lights.warp", each="lamp")
def warp_stacked(points: Array, importance: Array, maps: int, warp: Warp) -> tuple[Array, Array]:
    """Warp points of the unit square over several maps that are stacked along rows (SII Sec. 3.5, Eq. 5 and 6).

    points (point, uv): Points (u, v) in [0, 1).
    importance (k h, w): Importance of each texel, >= 0.
    maps: k: a cube's six faces, a dual paraboloid's two.
    -> warped (point, uv) float64: Warped points in [0, 1) over the stacked maps.
    -> density_weight (point,) float64: Weight w of each point, 1 / density over the unit square.

    SII Sec. 3.6 mentions such a "pre-warping step". v chooses the map in proportion to its importance and, stretched
    over the map's share, becomes the coordinate on it: strata of the points remain strata of each map.
    """
    pyramids = [importance_pyramid(one) for one in np.split(np.asarray(importance), maps)]
    if maps == 1:
        return warp_samples(points, pyramids[0], warp.levels, warp.method)
    samples = _checked(points)
    chosen, v, weights = _choose_map(samples[:, 1], np.array([float(pyramid[0].sum()) for pyramid in pyramids]))
    warped = np.stack([samples[:, 0], v], axis=1)
    height = len(importance) // maps
    for k in np.unique(chosen):
        here = chosen == k
        on_map, its_weights = warp_samples(warped[here], pyramids[k], warp.levels, warp.method)
        end = k * height + _cell_end(texel_of(on_map[:, 1], height), min(warp.levels, len(pyramids[k]) - 1), height)
        row = np.minimum(k * height + on_map[:, 1] * height, np.nextafter(end, 0.0))  # the sum may round up to it
        warped[here] = np.stack([on_map[:, 0], _clamped_to_texel(row, maps * height)], axis=1)
        weights[here] *= its_weights
    return warped, weights


def warp_samples(points: Array, pyramid: tuple[Array, ...], levels: int, method: Method) -> tuple[Array, Array]:
    """Move points of the unit square to where the map is important (Eq. 4 to 6).

    Parameters
    ----------
    points : (n, 2) array_like
        Points (u, v) in [0, 1): u along columns, v along rows, downwards.
    pyramid : tuple of ndarray
        As from `importance_pyramid`.
    levels : int
        Levels of halving; at the pyramid's depth the cells are texels and the warp stops.
    method : {"A", "B"}
        Columns of the chosen half, or of the whole cell.

    Returns
    -------
    points : (n, 2) ndarray of float64
        Warped points in [0, 1).
    weights : (n,) ndarray of float64
        1 / density. Their sum is n in the mean only and is not rescaled: with method A down to the texels every
        weight times the importance it found is the map's mean, and rescaling would spoil that.

    Raises
    ------
    InputError
        If a point lies outside [0, 1), or a name or number is not usable.

    Notes
    -----
    "Top" in Eq. (4) is read as the rows with v < 1/2, rows growing downwards. A cell without importance keeps its
    samples as they are; none gets there with method A unless the whole map is black, some do with method B.
    """
    Warp(method, levels)
    samples = _checked(points)
    used = min(levels, len(pyramid) - 1)
    warped, weights = np.empty_like(samples), np.empty(len(samples))
    _warp(samples, packed(pyramid, used), used, method == "A", warped, weights)
    return warped, weights


def texel_of(coordinate: Array, size: int) -> Array:
    """Return the texel, 0 to size - 1, that holds each coordinate (n,) in [0, 1)."""
    return np.asarray(np.minimum((coordinate * size).astype(np.int64), size - 1))


def _checked(points: Array) -> Array:
    samples = np.ascontiguousarray(points, np.float64)
    expect(samples.ndim == 2 and samples.shape[1] == 2, "points", "shape (n, 2)", samples.shape)
    expect(bool(((samples >= 0) & (samples < 1)).all()), "points", "coordinates in [0, 1)", "others")
    return samples


def _choose_map(v: Array, sums: Array) -> tuple[Array, Array, Array]:
    """Return the map that each coordinate falls on, the coordinate there, and the weight."""
    ends = np.cumsum(sums if sums.any() else np.ones(len(sums)))
    ends /= ends[-1]
    chosen = np.searchsorted(ends, v, side="right")  # a map without importance has no width
    starts = np.concatenate([[0.0], ends[:-1]])
    width = (ends - starts)[chosen]
    return chosen, np.clip((v - starts[chosen]) / width, 0, BELOW_1), 1 / (len(sums) * width)


def _cell_end(row: Array, level: int, rows: int) -> Array:
    """Return the first row after the cell of a level that holds each row."""
    borders = (np.arange((1 << level) + 1) * rows) >> level
    return np.asarray(borders[np.searchsorted(borders, row, side="right")], np.float64)


def _clamped_to_texel(row: Array, rows: int) -> Array:
    """Return row / rows, by a rounding step off where needed, so that `texel_of` finds the same row."""
    v = row / rows
    v = np.where(np.floor(v * rows) < np.floor(row), np.nextafter(v, 1), v)
    return np.asarray(np.where(np.floor(v * rows) > np.floor(row), np.nextafter(v, 0), v))


@kernel
def _halve(y: float, first: float, second: float, share: float) -> Any:
    """Return which half y goes to, its coordinate there and the factor of its weight; `share` is 1/2 in the paper."""
    total = first + second
    # Eq. (4)
    r = first / total if total > 0 else share
    if y < r:
        stretch = total / first if total > 0 else 1 / share
        # Eq. (5), (6)
        return 0, min(y * stretch, BELOW_1), share * stretch
    stretch = total / second if total > 0 else 1 / (1 - share)
    # Eq. (5), (6)
    return 1, min((y - r) * stretch, BELOW_1), (1 - share) * stretch


@kernel
def _share(index: int, level: int, size: int) -> float:
    """Return the first half's share of the texels of cell `index` of the level above, along a side of `size`."""
    start, middle = border(2 * index, level, size), border(2 * index + 1, level, size)
    end = border(2 * index + 2, level, size)
    return 0.5 if middle - start == end - middle else (middle - start) / (end - start)


@kernel
def _place(index: int, level: int, size: int, local: float) -> float:
    """Return the coordinate on the map of a local coordinate in a cell, in the texel that holds it."""
    start = border(index, level, size)
    texels = border(index + 1, level, size) - start
    texel = start + min(int(local * texels), texels - 1)
    place = (start + local * texels) / size
    for _ in range(2):  # rounding is off by two steps at most
        if int(place * size) < texel:
            place = np.nextafter(place, 1.0)
        elif int(place * size) > texel:
            place = np.nextafter(place, 0.0)
    return place


@kernel
def _warp_one(x: float, y: float, pyramid: Levels, levels: int, by_half: bool) -> Any:
    height, width = pyramid.finest.shape
    i, j, weight = 0, 0, 1.0
    for level in range(1, levels + 1):
        top_left, top_right = cell_sum(pyramid, level, 2 * i, 2 * j), cell_sum(pyramid, level, 2 * i, 2 * j + 1)
        bottom_left = cell_sum(pyramid, level, 2 * i + 1, 2 * j)
        bottom_right = cell_sum(pyramid, level, 2 * i + 1, 2 * j + 1)
        down, y, factor = _halve(y, top_left + top_right, bottom_left + bottom_right, _share(i, level, height))
        weight *= factor
        left, right = top_left + bottom_left, top_right + bottom_right
        if by_half:
            left, right = (bottom_left, bottom_right) if down else (top_left, top_right)
        across, x, factor = _halve(x, left, right, _share(j, level, width))
        weight *= factor
        i, j = 2 * i + down, 2 * j + across
    return _place(j, levels, width, x), _place(i, levels, height, y), weight


@kernel
def _warp(points: Array, pyramid: Levels, levels: int, by_half: bool, warped: Array, weights: Array) -> None:
    for k in range(len(points)):
        x, y, weight = _warp_one(points[k, 0], points[k, 1], pyramid, levels, by_half)
        warped[k, 0], warped[k, 1], weights[k] = x, y, weight
