"""Importance of texels for warping: flux, flux times lobe peak, and both times (1 - openness) (SII Sec. 3.5).

The largest channel of Phi_diffuse + g(P) Phi_lobe, 0 only where all flux is; g(P) = (P + 1) / 2 is the peak of a
normalised Phong lobe over that of a diffuse light (the paper takes P). `importance_pyramid` sums it over 2^l x 2^l
cells with borders at rows floor(i H / 2^l) and columns floor(j W / 2^l), for any size of map, down to texels.
"""

import math
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from refgi.errors import expect
from refgi.jit import kernel
from refgi.rsm.buffers.reflective import Rsm
from refgi.stages import stage
from refgi.types import Array

Kind = Literal["flux", "peak", "openness"]


def importance(rsm: Rsm, *kind: Any, **options: Any) -> Array:
    """Return the importance of each texel of a map for `warp_samples`.

    Parameters
    ----------
    rsm : Rsm
        The map.
    *kind, **options : object
        Those of `flux_importance`.

    Returns
    -------
    (H, W) ndarray
        W, dtype of the map.
    """
    return flux_importance(rsm.flux, rsm.lobe_flux, rsm.lobe_exponent, *kind, **options)


@stage("lights.importance", each="lamp")
def flux_importance(
    flux: Array, lobe_flux: Array | None, lobe_exponent: Array | None, kind: Kind = "flux",
    openness: Array | None = None, floor: float = 0.05, defensive: float = 0.0, as_printed: bool = False,
) -> Array:
    """Compute the importance of each texel for `warp_samples`: the largest channel of its flux (SII Sec. 3.5).

    flux (3, H, W): Flux of the diffuse part, W.
    lobe_flux (3, H, W): Flux of the lobe, W.
    lobe_exponent (H, W): Its exponent P.
    kind: Phi; Phi g(P); or Phi g(P) max(floor, 1 - O).
    openness (H, W): Share O of unoccluded directions, 0 to 1, for the kind "openness".
    floor: Least factor that openness leaves, 0 to 1. With 0 texels in the open are never chosen and their flux is lost.
    defensive: Share beta, 0 to 1, of the samples that are uniform over the map.
    as_printed: Take g(P) = P, so that sharp lobes count up to twice as much; with it a lobe of P = 0 is never chosen.
    -> (H, W): Importance of each texel, W, in the dtype of the flux.

    Raises `InputError` if a name is unknown, a number out of range, or openness is missing or of another shape.

    p = Phi (1 - O) P is zero where O = 1: the estimate then lacks that flux, hence the floor.

    With method A a texel's density is at least beta of the uniform one on every level, so for any f the mean of
    (w Phi f)^2 is at most 1 / beta times that of uniform samples, and the variance at most
    1 / beta Var + (1 / beta - 1) mean^2. Uniform over the map, not over texels with flux alone, because a cell's
    samples spread over all of its texels unless the warp goes down to them. Method B takes products of marginals:
    there the share keeps every texel within reach but gives no such bound.
    """
    expect(kind in get_args(Kind), "kind", " or ".join(get_args(Kind)), kind)
    expect(0 <= floor <= 1, "floor", "0 to 1", floor)
    expect(0 <= defensive <= 1, "defensive", "0 to 1", defensive)
    real = flux.dtype.type
    if lobe_flux is None or lobe_exponent is None:
        result: Array = flux.max(axis=0)
    else:
        result = np.empty_like(flux[0])
        growth, least = (0.0, 1.0) if kind == "flux" else (1.0, 0.0) if as_printed else (0.5, 0.5)
        _add_lobes(flux, lobe_flux, lobe_exponent, real(growth), real(least), result)
    if kind == "openness":
        result = result * _hidden(openness, real(floor), result)
    if defensive:
        result = real(1 - defensive) * result + real(defensive * result.mean(dtype=np.float64))
    return result


@kernel
def _add_lobes(flux: Array, lobe_flux: Array, exponent: Array, growth: Any, least: Any, result: Array) -> None:
    """Fill the largest channel of Phi_diffuse + g(P) Phi_lobe, g = growth P + least."""
    real = result.dtype.type
    for row in range(result.shape[0]):
        for column in range(result.shape[1]):
            peak = growth * exponent[row, column] + least
            most = real(0)
            for c in range(3):
                most = max(most, flux[c, row, column] + peak * lobe_flux[c, row, column])
            result[row, column] = most


def _hidden(openness: Array | None, floor: Any, like: Array) -> Array:
    """Return max(floor, 1 - O)."""
    if openness is None or np.shape(openness) != like.shape:
        expect(False, "openness", f"shape {like.shape} for the kind 'openness'",
               None if openness is None else np.shape(openness))
        raise AssertionError
    expect(bool(((openness >= 0) & (openness <= 1)).all()), "openness", "numbers from 0 to 1", "others")
    hidden: Array = np.maximum(1 - openness, floor).astype(like.dtype)
    return hidden


class Levels(NamedTuple):
    """A pyramid as the warp's kernel reads it."""

    coarse: Array  # S_0, S_1 .. one after the other, those above the map's level that are used
    finest: Array  # (H, W): the map
    depth: int  # L: the map's level


def importance_pyramid(importance: Array) -> tuple[Array, ...]:
    """Sum an importance map over ever larger cells.

    Parameters
    ----------
    importance : (H, W) ndarray
        Importance of each texel, >= 0, any unit.

    Returns
    -------
    tuple of ndarray
        S_0 (1, 1) .. S_L, L = ceil(log2(max(H, W))): S_l has (2^l, 2^l) sums, float64, and S_L is the map.

    Raises
    ------
    InputError
        If the map is empty or not two-dimensional, or holds negative or infinite numbers or NaN.

    Examples
    --------
    >>> [s.tolist() for s in importance_pyramid(np.array([[1.0, 2.0], [3.0, 4.0]]))]
    [[[10.0]], [[1.0, 2.0], [3.0, 4.0]]]
    """
    importance = np.asarray(importance)
    expect(importance.ndim == 2 and importance.size > 0, "importance", "shape (H, W) with texels", importance.shape)
    finest = np.ascontiguousarray(importance, np.float32 if importance.dtype == np.float32 else np.float64)
    expect(bool(finest.min() >= 0), "importance", "numbers >= 0", "negative numbers or NaN")
    levels = [finest]
    for level in range((max(finest.shape) - 1).bit_length() - 1, -1, -1):
        sums = np.empty((1 << level, 1 << level))
        if len(levels) == 1:
            _sum_texels(finest, level, sums)
        else:
            _sum_quarters(levels[-1], sums)
        levels.append(sums)
    expect(math.isfinite(levels[-1].sum()), "importance", "numbers with a finite sum", "infinity")
    return tuple(reversed(levels))


def packed(pyramid: tuple[Array, ...], levels: int) -> Levels:
    """Put the first `levels` levels below S_0 of a pyramid into one array, for `cell_sum`."""
    coarse = [sums.reshape(-1) for sums in pyramid[: min(levels + 1, len(pyramid) - 1)]]
    return Levels(np.concatenate([np.empty(0), *coarse]), pyramid[-1], len(pyramid) - 1)


@kernel
def border(index: int, level: int, size: int) -> int:
    """Return the first row or column of a cell, floor(index size / 2^level)."""
    return (index * size) >> level


@kernel
def _sum_texels(finest: Array, level: int, sums: Array) -> None:
    """Sum the texels of each cell of a level, rows first: columns are the SIMD lanes."""
    height, width = finest.shape
    rows = np.empty(width)
    for i in range(1 << level):
        rows[:] = 0.0
        for row in range(border(i, level, height), border(i + 1, level, height)):
            for column in range(width):
                rows[column] += finest[row, column]
        for j in range(1 << level):
            total = 0.0
            for column in range(border(j, level, width), border(j + 1, level, width)):
                total += rows[column]
            sums[i, j] = total


@kernel
def _sum_quarters(below: Array, sums: Array) -> None:
    for i in range(sums.shape[0]):
        for j in range(sums.shape[1]):
            sums[i, j] = ((below[2 * i, 2 * j] + below[2 * i, 2 * j + 1])
                          + (below[2 * i + 1, 2 * j] + below[2 * i + 1, 2 * j + 1]))


@kernel
def cell_sum(levels: Levels, level: int, i: int, j: int) -> Any:
    """Return the importance S_level[i, j] of a cell of a packed level; 0 for a cell without texels."""
    if level < levels.depth:
        return levels.coarse[((1 << (2 * level)) - 1) // 3 + (i << level) + j]
    height, width = levels.finest.shape
    row, column = border(i, level, height), border(j, level, width)
    if row == border(i + 1, level, height) or column == border(j + 1, level, width):
        return 0.0
    return levels.finest[row, column]
