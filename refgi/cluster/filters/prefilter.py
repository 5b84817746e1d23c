"""Prefilters of convolution shadow maps (Sec. 6): mip maps, or means texel by texel; then each as a step (Sec. 4.1, 6).

By brute force a disc takes the texels whose centres it holds, within the unit disc, or the one it lies in. The box is
the square around it, at least a texel wide, whose texels count by area; one beyond the map moves to its edge.

- terms: M.
- pending (area light, h, w) bool: Who asks.
- region (area light, s t radius, h, w): Discs of the map, in units of half its side.
- weighed: All channels, else the first 2 M.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from numba import types

from refgi.cluster.filters.basis import DepthScale, beyond_disc, fill_basis, fill_beyond, joined, normalise
from refgi.cluster.filters.mip import mip_means as means_of_mip
from refgi.cluster.filters.mip_build import build_mips, halve, round_texels
from refgi.cluster.filters.pyramid import EIGHT, Mip, level_offsets, mips, stack_array
from refgi.cluster.settings import MOST_TERMS, Csm
from refgi.jit import by_type, kernel
from refgi.stages import stage
from refgi.types import Array

SUMS = stack_array(1, 4 * MOST_TERMS + 1, types.float64)


class Brute(NamedTuple):
    """Channels of every texel of a map."""

    depth: Array  # (n, n): t
    basis: Array  # (n, n, 2 M)
    basis_z: Array  # (n, n, 2 M + 1)
    box: bool  # the square around the disc instead of the disc
    quantised: bool  # 8 bits for the basis, 16 for basis-z
    beyond: Array  # (count, 2) int32: texels beyond the unit disc and what they copy


def brutes(
    size: int, terms: int, dtype: npt.DTypeLike, *, box: bool = False, quantised: bool = False, mirrored: bool = False
) -> Brute:
    """Allocate the filters of one map of n x n texels, M terms; `mirrored` counts for a `box`, which looks there."""
    return Brute(np.zeros((size, size), dtype), np.zeros((size, size, 2 * terms), dtype),
                 np.zeros((size, size, 2 * terms + 1), dtype), box, quantised, beyond_disc(size, mirrored))


@kernel
def build_brute(depth: Array, scale: DepthScale, brute: Brute) -> None:
    """Fill the channels of one map of radial distances, (n, n), m; inf where it is empty."""
    normalise(depth, scale, brute.depth)
    fill_beyond(brute.beyond, brute.depth)
    fill_basis(brute.depth, brute.basis.shape[2] // 2, brute.quantised, brute.basis, brute.basis_z)


@kernel
def brute_means(
    brute: Brute, s: Array, t: Array, radius: Array, active: Array, count: int, with_z: bool, out: Array
) -> None:
    """Fill out (channels, lanes) with the means over the disc of each active lane; as `mip.mip_means`."""
    n, channels = len(brute.depth), brute.basis.shape[2]
    real, sums = s.dtype.type, SUMS(s)[0]
    used = 2 * channels + 1 if with_z else channels
    for i in range(count):
        if not active[i]:
            continue
        for c in range(used):
            sums[c] = 0.0
        x, y, half = _box(s[i], t[i], radius[i], n, brute.box)
        total = 0.0
        for row in range(max(int(np.floor(y - half)), 0), min(int(np.ceil(y + half)), n)):
            for column in range(max(int(np.floor(x - half)), 0), min(int(np.ceil(x + half)), n)):
                weight = _weight(column, row, x, y, half, n, brute.box)
                if weight > 0.0:
                    total += weight
                    _add(brute, row, column, weight, with_z, sums)
        if total == 0.0:
            total = 1.0
            column, row = min(max(int(x), 0), n - 1), min(max(int(y), 0), n - 1)
            _add(brute, row, column, total, with_z, sums)
        for c in range(used):
            out[c, i] = real(sums[c] / total)


@kernel
def _box(s: float, t: float, radius: float, n: int, box: bool) -> tuple[float, float, float]:
    """Return middle and half side in texels."""
    x, y, half = 0.5 * n * (s + 1.0), 0.5 * n * (t + 1.0), 0.5 * n * radius
    if box:
        x, y, half = min(max(x, 0.0), 1.0 * n), min(max(y, 0.0), 1.0 * n), max(half, 0.5)
    return x, y, half


@kernel
def _weight(column: int, row: int, x: float, y: float, half: float, n: int, box: bool) -> float:
    """Return how much a texel counts: the area in the box, or 1 with its centre in the disc and the unit disc."""
    if box:
        wide = min(column + 1.0, x + half) - max(1.0 * column, x - half)
        high = min(row + 1.0, y + half) - max(1.0 * row, y - half)
        return max(wide, 0.0) * max(high, 0.0)
    middle, u, v = 0.5 * n, column + 0.5, row + 0.5
    inside = (u - x) * (u - x) + (v - y) * (v - y) <= half * half
    within = (u - middle) * (u - middle) + (v - middle) * (v - middle) <= middle * middle
    return 1.0 if inside & within else 0.0


@kernel
def _add(brute: Brute, row: int, column: int, weight: float, with_z: bool, sums: Array) -> None:
    channels = brute.basis.shape[2]
    for c in range(channels):
        sums[c] += weight * brute.basis[row, column, c]
    if with_z:
        for c in range(channels + 1):
            sums[channels + c] += weight * brute.basis_z[row, column, c]


# a read between texels is a tent twice as wide as a texel of its level: half the level makes it the filter's width
LEVEL_SHIFT = -1.0
MEANS: dict[Any, Any] = {Mip: means_of_mip, Brute: brute_means}


def filter_means(
    filters: Any, s: Array, t: Array, radius: Array, active: Array, count: int, with_z: bool, out: Array
) -> None:
    """Read the means over a disc, in units of the map's half side, for each active lane of the `count` in use.

    `out` (channels, lanes) is filled where active: all 4 M + 1 channels with `with_z`, else the first 2 M.
    """
    MEANS[type(filters)](filters, s, t, radius, active, count, with_z, out)


@by_type(filter_means)
def _by_type(
    filters: Any, s: Any, t: Any, radius: Any, active: Any, count: Any, with_z: Any, out: Any  # noqa: ARG001
) -> Any:
    means = MEANS[filters.instance_class]

    def call(
        filters: Any, s: Any, t: Any, radius: Any, active: Any, count: Any, with_z: Any, out: Any
    ) -> None:
        means(filters, s, t, radius, active, count, with_z, out)

    return call


def build_filters(depth: Array, scale: DepthScale, settings: Csm, box: bool) -> Any:
    """Filter one map (n, n), distances in m, as settings ask for; `box`: brute force over squares, not discs."""
    return build_several(depth[None], (scale,), settings, box)[0]


def build_several(
    depth: Array, scales: Sequence[DepthScale], settings: Csm, box: bool, scratch: Mip | None = None
) -> list[Any]:
    """Filter several maps (k, n, n), one on each thread; `scratch` of `allocate_mips`, k or more, is overwritten."""
    size, dtype = depth.shape[1], depth.dtype
    if settings.prefilter == "mip":
        several = allocate_mips(len(depth), size, dtype, settings) if scratch is None else scratch
        build_mips(depth, joined(scales), several)
        return [_pyramid(several, k) for k in range(len(depth))]
    filtered = []
    for one, scale in zip(depth, scales, strict=True):
        filtered.append(brutes(size, settings.terms, dtype, box=box, quantised=settings.quantisation == "published"))
        build_brute(one, scale, filtered[-1])
    return filtered


def allocate_mips(count: int, size: int, dtype: npt.DTypeLike, settings: Csm) -> Mip:
    """Allocate the pyramids of `count` maps of size x size texels, a leading axis, not yet filled."""
    return mips(count, size, settings.terms, dtype, shift=LEVEL_SHIFT, quantised=settings.quantisation == "published",
                mirrored=True)


@stage("cluster.map_depths", kept=False)
def map_depths(depth: Array, origin: Array, slope: Array, end: Array, logarithmic: bool, mirrored: bool) -> Array:
    """Turn distances into depths of the series: log2(z / origin) slope or (z - origin) slope, 0 to the end (E-VAL-05).

    depth (area light, row, column): Distances, m; inf where nothing is.
    origin (area light,): Distance of depth 0, m.
    slope (area light,): Depths per octave or metre; 0 on empty maps.
    end (one,): Depth of what is farthest, and of nothing.
    logarithmic: By octaves, else by metres.
    mirrored: Whether texels beyond the disc hold what the texel at (s, t) min(1 / r, 1 - 1.5 / n) / r does.
    -> (area light, row, column): Depth t; the end where nothing is; 0 on empty maps.
    """
    made = np.zeros_like(depth)
    for k in np.flatnonzero(slope > 0):
        scale = DepthScale(logarithmic, float(origin[k]), float(slope[k]), float(end[0]))
        normalise(np.ascontiguousarray(depth[k]), scale, made[k])
        fill_beyond(beyond_disc(depth.shape[1], mirrored), made[k])
    return made


@stage("cluster.basis", kept=False)
def basis(t: Array, terms: int, in_bytes: bool) -> Array:
    """Fill sines and cosines of each texel's depth, and the same times the depth (VAL Sec. 4.1, 6, E-VAL-02).

    t (area light, row, column): Depths of the series.
    in_bytes: Whether they are kept in 8 bits, those times the depth in half floats.
    -> (area light, channel, row, column): S_1.., C_1.., t S_1.., t C_1.., t; 0 on empty maps.
    """
    made = np.zeros((len(t), 4 * terms + 1, *t.shape[1:]), t.dtype)
    for k in np.flatnonzero(t.any(axis=(1, 2))):
        parts = [np.zeros((*t.shape[1:], 2 * terms + extra), t.dtype) for extra in (0, 1)]
        fill_basis(t[k], terms, in_bytes, *parts)
        made[k] = np.moveaxis(np.concatenate(parts, axis=2), 2, 0)
    return made


@stage("cluster.mip_levels", kept=False)
def mip_levels(basis: Array, in_bytes: bool) -> dict[str, Array]:
    """Halve each level by means of 2 x 2 texels down to one; of an odd side the last counts twice (VAL Sec. 6).

    basis (area light, channel, row, column): Level 0.
    in_bytes: Whether levels are kept in 8 bits and half floats.
    -> (area light, channel, row, column): Means over the texels of the map that lie below one of this level.
    """
    levels: dict[str, Array] = {}
    level = basis
    while level.shape[2] > 1:
        level = levels[str(len(levels) + 1)] = _halved(level, in_bytes)
    return levels


def _halved(level: Array, in_bytes: bool) -> Array:
    """Return the next level by the kernels of the mip maps, whose texels are rows of channels."""
    count, channels, side, _ = level.shape
    terms, half = channels // 4, (side + 1) // 2
    made = np.zeros((count, channels, half, half), level.dtype)
    new = slice(side * side, side * side + half * half)
    for k in np.flatnonzero(level.any(axis=(1, 2, 3))):
        texels = np.moveaxis(level[k].reshape(channels, -1), 0, 1)
        parts = [np.zeros((new.stop + EIGHT, -(-2 * terms // EIGHT) * EIGHT), level.dtype) for _ in range(2)]
        depth = np.zeros(len(parts[0]), level.dtype)
        for part, first in zip(parts, (0, 2 * terms), strict=True):
            part[: new.start, : 2 * terms] = texels[:, first : first + 2 * terms]
        depth[: new.start] = texels[:, -1]
        halve(parts[0], parts[1], depth, 0, new.start, side)
        if in_bytes:
            empty = mips(1, 1, terms, level.dtype, quantised=True)
            round_texels(_pyramid(empty, 0)._replace(basis=parts[0], basis_z=parts[1], mean_depth=depth),
                         new.start, half * half)
        made[k] = np.concatenate([*(part[new, : 2 * terms] for part in parts), depth[new, None]], axis=1).T.reshape(
            channels, half, half)
    return made


@stage("cluster.mip_means", kept=False)
def mip_means(
    pending: Array, region: Array, basis: Array, levels: Mapping[str, Array], t: Array | None, terms: int, weighed: bool
) -> Array:
    """Read means of the channels over discs by 8 texels of two levels (VAL Sec. 6).

    basis (area light, channel, row, column): Level 0.
    levels mapping of str to (area light, channel, row, column): Levels from 1 on.
    t (area light, row, column): Depths of the series where the basis is kept in 8 bits, of which level 0 is made anew.
    -> (area light, channel, h, w): Means of the channels over the disc; 0 where none is asked for.
    """
    size, count = basis.shape[2], 2 * terms

    def mip(k: int) -> Mip:
        made = _pyramid(mips(1, size, terms, basis.dtype, shift=LEVEL_SHIFT, quantised=t is not None), 0)
        made.depth[:] = basis[k, -1] if t is None else t[k]
        for start, level in zip(level_offsets(size)[0][1:], levels.values(), strict=True):
            flat = level[k].reshape(len(level[k]), -1).T
            here = slice(start, start + len(flat))
            made.basis[here, :count], made.basis_z[here, :count] = flat[:, :count], flat[:, count : 2 * count]
            made.mean_depth[here] = flat[:, -1]
        return made

    return _means(pending, region, mip, terms, weighed)


@stage("cluster.disc_means", kept=False)
def disc_means(pending: Array, region: Array, basis: Array, terms: int, weighed: bool) -> Array:
    """Average the texels with their centre in a disc and in the hemisphere, or that of its middle (VAL Sec. 6).

    basis (area light, channel, row, column): Channels of each texel.
    -> (area light, channel, h, w): Means of the channels over the disc; 0 where none is asked for.
    """
    return _brute(pending, region, basis, terms, weighed, box=False)


@stage("cluster.box_means", kept=False)
def box_means(pending: Array, region: Array, basis: Array, terms: int, weighed: bool) -> Array:
    """Average texels over the squares around discs, at least a texel wide, by area (VAL Sec. 6).

    basis (area light, channel, row, column): Channels of each texel.
    -> (area light, channel, h, w): Means of the channels over the square; 0 where none is asked for.
    """
    return _brute(pending, region, basis, terms, weighed, box=True)


def _brute(pending: Array, region: Array, basis: Array, terms: int, weighed: bool, box: bool) -> Array:
    def brute(k: int) -> Any:
        made = brutes(basis.shape[2], terms, basis.dtype, box=box)
        made.depth[:], made.basis[:] = basis[k, -1], np.moveaxis(basis[k, : 2 * terms], 0, 2)
        made.basis_z[:] = np.moveaxis(basis[k, 2 * terms :], 0, 2)
        return made

    return _means(pending, region, brute, terms, weighed)


def _means(pending: Array, region: Array, filters: Any, terms: int, weighed: bool) -> Array:
    channels = 4 * terms + 1 if weighed else 2 * terms
    made = np.zeros((len(pending), channels, *pending.shape[1:]), region.dtype)
    for k in np.flatnonzero(pending.any(axis=(1, 2))):
        s, t, radius = (np.ascontiguousarray(one).reshape(-1) for one in region[k])
        asked = pending[k].reshape(-1)
        means = np.zeros((4 * terms + 1, len(asked)), region.dtype)
        filter_means(filters(int(k)), s, t, radius, asked, len(asked), weighed, means)
        made[k].reshape(channels, -1)[:, asked] = means[:channels, asked]
    return made


def _pyramid(several: Mip, k: int) -> Mip:
    """Return views of pyramid k of several, as `mip_of` without a kernel to compile."""
    return several._replace(depth=several.depth[k], basis=several.basis[k], basis_z=several.basis_z[k],
                            mean_depth=several.mean_depth[k])
