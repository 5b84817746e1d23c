"""From subsplats to pixels: upsampling (Nichols and Wyman 2009, Sec. 3.5), and surface detail (Sec. 4.3, Eq. 3).

Each layer of the illumination buffer holds the whole irradiance of its texels or none, so that plain interpolation of
it makes halos and rings (Fig. 7). Instead the coarsest level is doubled, merged with the next layer, filtered among the
texels that hold irradiance and doubled again, down to the pixels.
"""

import inspect
import math
from collections.abc import Callable
from typing import Any, get_args

import numpy as np
import numpy.typing as npt

from refgi.error_target.grid import Subsplats, any_of_four, level_shape
from refgi.errors import expect
from refgi.jit import kernel, prange, threads
from refgi.rsm.pool import plane
from refgi.splat.multires.settings import Upsampling
from refgi.splat.multires.tent import demo_pass, tent_pass
from refgi.stages import stage
from refgi.types import Array

FEW_TEXELS = 1 << 16  # of a level, that one thread fills before others are awake


def _layer(values: Array, subsplats: Subsplats, level: int) -> Array:
    """Return the layer of one level, (3, h_l, w_l) W/m^2: irradiance at its subsplats, 0 elsewhere."""
    layer = np.zeros((3, *subsplats.leaf[level].shape), values.dtype)
    of_level = np.flatnonzero(subsplats.level == level)
    layer[:, subsplats.row[of_level], subsplats.column[of_level]] = values[:, of_level]
    return layer


def filled_cells(covered: Array, top: int) -> list[Array]:
    """Return which cells of levels 0 to `top` show any surface, (h_l, w_l) bool each."""
    levels = [covered]
    for level in range(1, top + 1):
        levels.append(np.empty(level_shape(covered.shape[0], covered.shape[1], level), np.bool_))
        any_of_four(levels[-2], levels[-1])
    return levels


def sorted_by_row(subsplats: Subsplats) -> tuple[list[Array], Array]:
    """Return the subsplats sorted by level and row.

    starts: for each level (h_l + 1,) int64, where its rows start in `order` and where the last one ends; order: (n,)
    int64.
    """
    heights = [len(leaf) for leaf in subsplats.leaf]
    bases = np.cumsum([0, *heights])
    starts = np.zeros(bases[-1] + 1, np.int64)
    order = np.empty(len(subsplats.level), np.int64)
    _sort(subsplats.level, subsplats.row, bases, starts, order)
    return [starts[base : base + height + 1] for base, height in zip(bases, heights, strict=False)], order


@kernel
def _sort(level: Array, row: Array, bases: Array, starts: Array, order: Array) -> None:
    """Sort by counting: subsplats of the same row stay in the order of the list."""
    for k in range(len(level)):
        starts[bases[level[k]] + row[k] + 1] += 1
    for key in range(len(starts) - 1):
        starts[key + 1] += starts[key]
    places = starts.copy()
    for k in range(len(level)):
        key = bases[level[k]] + row[k]
        order[places[key]] = k
        places[key] += 1


@stage("multires.upsample", steps="refgi.splat.multires.steps.upsample_steps")
def upsample(
    values: Array, subsplats: Subsplats, covered: Array, mode: Upsampling = "tent", *, filter_all: bool = False,
    corner_rule: bool = True,
) -> Array:
    """Interpolate the irradiance of subsplats at every pixel.

    values (3, n): Irradiance at the subsplats, W/m^2.
    mode: "tent": each texel is the weighted mean of the 3 x 3 around it that hold irradiance; "demo": of the coarser
        texels around, as in the authors' demo; "nearest": each pixel has the irradiance of its subsplat;
        "naive_bilinear": the sum of all layers, each interpolated as if it were black where it holds nothing.
    filter_all: Filter texels that were evaluated at a level as well, not only those from a coarser one ("tent",
        "demo").
    corner_rule: Count a diagonal texel only where one of the two beside it holds irradiance ("tent").
    -> (3, h, w): Irradiance, W/m^2; 0 where a pixel shows no surface.

    Raises `InputError` if the mode is unknown or shapes do not belong together.

    The paper gives no weights; those of "tent" interpolate bilinearly where all texels hold irradiance. It filters
    every texel, even those of the finest level, which blurs pixels that were evaluated one by one; `filter_all` and no
    `corner_rule` are the paper to the letter. A constant stays that constant to the bit, but for "naive_bilinear".
    """
    expect(mode in get_args(Upsampling), "mode", " or ".join(map(repr, get_args(Upsampling))), mode)
    expect(values.shape == (3, len(subsplats.level)), "values", f"shape (3, {len(subsplats.level)})", values.shape)
    expect(covered.shape == subsplats.shape, "covered", f"shape {subsplats.shape}", covered.shape)
    values, covered = np.ascontiguousarray(values), np.ascontiguousarray(covered)
    if mode == "tent":
        return _tent(values, subsplats, covered, filter_all, corner_rule)
    if mode == "demo":
        return _demo(values, subsplats, covered, filter_all)
    if mode == "nearest":
        return of_own_subsplat(values, subsplats.level, subsplats.row, subsplats.column, covered)
    return interpolated_apart(values, subsplats, covered)


picture_of: Callable[..., Array] = inspect.unwrap(upsample)  # unobserved


def of_own_subsplat(values: Array, level: Array, row: Array, column: Array, covered: Array) -> Array:
    """Return the picture (3, h, w) in which each pixel has the irradiance of its subsplat."""
    result = np.zeros((3, *covered.shape), values.dtype)
    _fill_nearest(values, level, row, column, covered, result)
    return result


def interpolated_apart(values: Array, subsplats: Subsplats, covered: Array) -> Array:
    """Return the sum (3, h, w) of all layers, each interpolated as if it were black where it holds nothing."""
    result = np.zeros((3, *covered.shape), values.dtype)
    for level in map(int, np.flatnonzero(subsplats.counts)):
        _add_level(_layer(values, subsplats, level), level, covered, result)
    return result


def _tent(values: Array, subsplats: Subsplats, covered: Array, filter_all: bool, corner_rule: bool) -> Array:
    rows = sorted_by_row(subsplats)
    filled = filled_cells(covered, subsplats.top)
    result, mask = black_level(filled[-1], values.dtype)
    for level in range(subsplats.top, -1, -1):
        result, mask = tent_level(values, subsplats.column, rows, level, (result, mask), filled[level], filter_all,
                                  corner_rule)
    return result


def tent_level(
    values: Array, column: Array, rows: tuple[list[Array], Array], level: int, coarse: tuple[Array, Array],
    filled: Array, filter_all: bool, corner_rule: bool,
) -> tuple[Array, Array]:
    """Return irradiance and mask of a level from those of the coarser one, and from the subsplats by `rows`."""
    starts, order = rows
    result, mask = _empty_level(filled, values.dtype)
    with threads(1 if mask.size <= FEW_TEXELS else None):
        tent_pass(values, order, starts[level], column, *coarse, filled, filter_all, 0.0 if corner_rule else 1.0,
                  result, mask)
    return result, mask


def _demo(values: Array, subsplats: Subsplats, covered: Array, filter_all: bool) -> Array:
    filled = filled_cells(covered, subsplats.top)
    result, mask = _layer(values, subsplats, subsplats.top), subsplats.leaf[-1]
    for level in range(subsplats.top - 1, -1, -1):
        result, mask = demo_level(values, subsplats, level, (result, mask), filled[level], filter_all)
    return result


def demo_level(
    values: Array, subsplats: Subsplats, level: int, coarse: tuple[Array, Array], filled: Array, filter_all: bool
) -> tuple[Array, Array]:
    """Return irradiance and mask of a level from those of the coarser one; the coarsest is its layer as it is."""
    layer, leaf = _layer(values, subsplats, level), subsplats.leaf[level]
    if level == subsplats.top:
        return layer, leaf
    result, mask = _empty_level(filled, values.dtype)
    demo_pass(layer, leaf, *coarse, filled, filter_all, result, mask)
    return result, mask


def _empty_level(filled: Array, dtype: np.dtype[Any]) -> tuple[Array, Array]:
    """Return uninitialised irradiance and mask of a level."""
    return plane((3, *filled.shape), dtype), plane(filled.shape, np.bool_)


def black_level(filled: Array, dtype: np.dtype[Any]) -> tuple[Array, Array]:
    """Return irradiance and mask of the level above one, without texels."""
    shape = level_shape(filled.shape[0], filled.shape[1], 1)
    return np.zeros((3, *shape), dtype), np.zeros(shape, np.bool_)


@kernel(parallel=True)
def _fill_nearest(values: Array, level: Array, row: Array, column: Array, covered: Array, result: Array) -> None:
    """Write each subsplat's irradiance to its pixels."""
    height, width = covered.shape
    for k in prange(len(level)):
        side = 1 << np.int64(level[k])
        top, left = row[k] * side, column[k] * side
        for c in range(3):
            for y in range(top, min(top + side, height)):
                for x in range(left, min(left + side, width)):
                    if covered[y, x]:
                        result[c, y, x] = values[c, k]


def _add_level(texels: Array, level: int, covered: Array, result: Array) -> None:
    """Add a layer, interpolated bilinearly between the centres of its texels."""
    rows, columns = (_bilinear_taps(*sizes, level, result.dtype)
                     for sizes in zip(covered.shape, texels.shape[1:], strict=True))
    _add_interpolated(texels, *rows, *columns, covered, result)


def _bilinear_taps(pixels: int, texels: int, level: int, dtype: np.dtype[Any]) -> tuple[Array, Array, Array]:
    """Return the texels before and behind each pixel of a row or column, and how far between them it lies."""
    place = (np.arange(pixels) + 0.5) / 2**level - 0.5
    before = np.floor(place).astype(np.int64)
    return np.maximum(before, 0), np.minimum(before + 1, texels - 1), (place - before).astype(dtype)


@kernel(parallel=True)
def _add_interpolated(
    texels: Array, above: Array, below: Array, down: Array, left: Array, right: Array, across: Array, covered: Array,
    result: Array,
) -> None:
    for y in prange(len(above)):
        for c in range(3):
            upper, lower, pixels = texels[c, above[y]], texels[c, below[y]], result[c, y]
            for x in range(len(left)):
                first = upper[left[x]] + across[x] * (upper[right[x]] - upper[left[x]])
                second = lower[left[x]] + across[x] * (lower[right[x]] - lower[left[x]])
                if covered[y, x]:
                    pixels[x] += first + down[y] * (second - first)


@stage("multires.detail")
def surface_detail(
    irradiance: Array, position: Array, normal: Array, covered: Array, eye: npt.ArrayLike, a: float
) -> Array:
    """Darken what faces away from the camera: E (a <V, N> + 1 - a) (AMS Eq. 3).

    irradiance (3, h, w): Indirect irradiance, W/m^2.
    normal (3, h, w): Unit normals on the camera's side.
    eye (3,) or (1, 3): Where the camera is, m.
    a: How much, 0 (nothing changes) to 1; the paper shows 0.5.
    -> (3, h, w): Irradiance, W/m^2; 0 where there is no surface.

    Raises `InputError` if `a` is no share.

    It is cosmetic; the factor lies in [1 - a, 1] and so only takes energy away. The paper's c is a colour; the albedo
    of c is a factor here and there, so that the order does not matter. A point at the eye itself keeps its light.
    """
    expect(0 <= a <= 1, "a", "a share from 0 to 1", a)
    result = np.empty_like(irradiance, order="C")
    _modulate(irradiance, position, normal, covered, np.asarray(eye, position.dtype).reshape(3), float(a),
              result)
    return result


@kernel(parallel=True)
def _modulate(
    irradiance: Array, position: Array, normal: Array, covered: Array, eye: Array, a: float, result: Array
) -> None:
    for i in prange(covered.shape[0]):
        _modulate_row(irradiance, position, normal, covered, eye, result.dtype.type(a), i, result)


@kernel
def _modulate_row(
    irradiance: Array, position: Array, normal: Array, covered: Array, eye: Array, a: Any, i: int, result: Array
) -> None:
    real = type(a)
    zero, one = real(0.0), real(1.0)
    for j in range(covered.shape[1]):
        x, y, z = eye[0] - position[0, i, j], eye[1] - position[1, i, j], eye[2] - position[2, i, j]
        square = x * x + y * y + z * z
        along = x * normal[0, i, j] + y * normal[1, i, j] + z * normal[2, i, j]
        cosine = along / math.sqrt(square) if square > zero else one
        # Eq. (3); a cosine may be more than 1 by rounding
        factor = a * min(max(cosine, zero), one) + (one - a)
        for c in range(3):
            result[c, i, j] = irradiance[c, i, j] * (factor if covered[i, j] else zero)
