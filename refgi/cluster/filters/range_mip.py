"""The nearest and the farthest depth within any box of a map, for decisions before anything is filtered.

Each level keeps the least and the largest depth of 2 x 2 texels of the level before; a box reads the level of which
it touches no more than 2 x 2. What comes back bounds the depths of all texels that the box touches: the nearest is
never farther, and the farthest never nearer, than theirs. Depths are the map's own, m, inf where nothing is seen, as
outside the unit disc: nothing is shadowed throughout there.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.cluster.filters.eight import room_of
from refgi.cluster.filters.pyramid import level_offsets
from refgi.jit import kernel, prange

Array = npt.NDArray[Any]

CHUNK = 64  # texels made at once
LINES = room_of(2, 2 * CHUNK)


class RangeMip(NamedTuple):
    """One map's pyramid, or with a leading axis those of several."""

    depth: Array  # (n, n), m: level 0
    nearest: Array  # (texels,): levels 1 and up
    farthest: Array  # (texels,)
    first: Array  # (levels,) int64: first texel of each level; of no use for level 0


def range_mips(depth: Array) -> RangeMip:
    """Build the pyramids of several maps.

    Parameters
    ----------
    depth : (K, n, n) ndarray
        Radial distances, m; inf where nothing is seen.

    Returns
    -------
    RangeMip
        Arrays with a leading axis of K.
    """
    first, total = level_offsets(depth.shape[1])
    shape = (len(depth), max(total, 1))
    several = RangeMip(depth, np.empty(shape, depth.dtype), np.empty(shape, depth.dtype), first)
    _build(several)
    return several


@kernel
def range_mip_of(several: RangeMip, k: Any) -> RangeMip:
    """Return one of several pyramids.

    Parameters
    ----------
    several : RangeMip
        With a leading axis.
    k : int
        Which.

    Returns
    -------
    RangeMip
        Views of that pyramid.
    """
    return RangeMip(several.depth[k], several.nearest[k], several.farthest[k], several.first)


@kernel(parallel=True)
def _build(several: RangeMip) -> None:
    for k in prange(len(several.depth)):
        _build_one(several.depth[k], several.nearest[k], several.farthest[k], several.first)


@kernel
def _build_one(depth: Array, nearest: Array, farthest: Array, first: Array) -> None:
    side = len(depth)
    for level in range(1, len(first)):
        half = (side + 1) // 2
        end = first[level] + half * half
        low, high = nearest[first[level] : end].reshape(half, half), farthest[first[level] : end].reshape(half, half)
        if level == 1:
            _halve(depth, depth, low, high)
        else:
            finer = slice(first[level - 1], first[level])
            _halve(nearest[finer].reshape(side, side), farthest[finer].reshape(side, side), low, high)
        side = half


@kernel
def _halve(fine_low: Array, fine_high: Array, low: Array, high: Array) -> None:
    last = len(fine_low) - 1
    both = LINES(fine_low)
    nearer, farther = both[0], both[1]
    for i in range(len(low)):
        above, below = 2 * i, min(2 * i + 1, last)
        for start in range(0, len(low), CHUNK):
            count, texels = min(CHUNK, len(low) - start), min(2 * CHUNK, last + 1 - 2 * start)
            for j in range(texels):
                nearer[j] = min(fine_low[above, 2 * start + j], fine_low[below, 2 * start + j])
                farther[j] = max(fine_high[above, 2 * start + j], fine_high[below, 2 * start + j])
            if texels < 2 * count:  # an odd side: the last column counts twice
                nearer[texels], farther[texels] = nearer[texels - 1], farther[texels - 1]
            for j in range(count):
                low[i, start + j] = min(nearer[2 * j], nearer[2 * j + 1])
                high[i, start + j] = max(farther[2 * j], farther[2 * j + 1])


@kernel
def range_in_box(mip: RangeMip, s_low: float, s_high: float, t_low: float, t_high: float) -> tuple[Any, Any]:
    """Return bounds of the depths of all texels that a box touches.

    Parameters
    ----------
    mip : RangeMip
        One map's pyramid.
    s_low, s_high, t_low, t_high : float
        The box, in units of the map's half side; beyond the map its edge is read.

    Returns
    -------
    nearest, farthest : float
        No farther and no nearer than every texel, m.
    """
    n = len(mip.depth)
    scale = 0.5 * n
    left, right = _texel(s_low, scale, n), _texel(s_high, scale, n)
    top, bottom = _texel(t_low, scale, n), _texel(t_high, scale, n)
    span, level = max(right - left, bottom - top), 0
    while (1 << level) < span:
        level += 1
    left, right, top, bottom = left >> level, right >> level, top >> level, bottom >> level
    if level == 0:
        a, b, c, d = mip.depth[top, left], mip.depth[top, right], mip.depth[bottom, left], mip.depth[bottom, right]
        return min(min(a, b), min(c, d)), max(max(a, b), max(c, d))
    side, first = (n + (1 << level) - 1) >> level, mip.first[level]
    above, below = first + top * side, first + bottom * side
    near, far = mip.nearest, mip.farthest
    return (min(min(near[above + left], near[above + right]), min(near[below + left], near[below + right])),
            max(max(far[above + left], far[above + right]), max(far[below + left], far[below + right])))  # fmt: skip


@kernel
def _texel(position: float, scale: float, n: int) -> int:
    """Return the texel that a coordinate lies in, the outermost for one beyond the map or NaN."""
    place = (position + 1.0) * scale
    return int(min(max(place, 0.0), n - 1.0)) if place == place else 0


@kernel
def nearest_in_discs(
    mip: RangeMip, s: Array, t: Array, radius: Array, wanted: Array, count: int, out: Array
) -> None:
    """Bound from below the depths in the box around a disc for each lane of a tile.

    Parameters
    ----------
    mip : RangeMip
        One map's pyramid.
    s, t, radius : (lanes,) ndarray
        Centre and radius of the discs, in units of the map's half side.
    wanted : (lanes,) ndarray
        Lanes to read.
    count : int
        Lanes in use.
    out : (lanes,) ndarray
        Filled where wanted: no texel that the box touches is nearer, m.
    """
    for i in range(count):
        if wanted[i]:
            near, _ = range_in_box(mip, s[i] - radius[i], s[i] + radius[i], t[i] - radius[i], t[i] + radius[i])
            out[i] = near
