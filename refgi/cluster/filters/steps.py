"""Filters of convolution shadow maps one step after the other: depths, basis, mip levels, means (VAL Sec. 4.1, 6).

A texel's channels are sin(c_k t) for all k, cos(c_k t), t sin(c_k t), t cos(c_k t), then t, its depth.

- terms: M.
- pending (area light, h, w) bool: Who asks.
- region (area light, s t radius, h, w): Discs of the map, in units of half its side.
- weighed: All channels, else the first 2 M.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from refgi.cluster.filters.basis import DepthScale, beyond_disc, fill_basis, fill_beyond, normalise
from refgi.cluster.filters.mip_build import halve, round_texels
from refgi.cluster.filters.prefilter import LEVEL_SHIFT, brutes, filter_means
from refgi.cluster.filters.pyramid import EIGHT, Mip, level_offsets, mip_of, mips
from refgi.stages import stage
from refgi.types import Array


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
            round_texels(mip_of(empty, 0)._replace(basis=parts[0], basis_z=parts[1], mean_depth=depth), new.start,
                         half * half)
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
        made = mip_of(mips(1, size, terms, basis.dtype, shift=LEVEL_SHIFT, quantised=t is not None), 0)
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
