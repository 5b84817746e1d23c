"""Prefilters of convolution shadow maps (Sec. 6): mip maps, or means texel by texel at a cost that grows with the disc.

By brute force the disc takes the texels whose centres it holds, within the unit disc, or the one it lies in. The box is
the square around the disc, at least a texel wide; texels count by the area of them that it holds, those beyond the unit
disc too, and what of it lies beyond the map is cut off. A box with its middle beyond the map is moved to its edge. Sums
are float64 for any map.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from numba import types

from refgi.cluster.filters.basis import DepthScale, beyond_disc, fill_basis, fill_beyond, joined, normalise
from refgi.cluster.filters.mip import Mip, build_mips, mip_of, mips
from refgi.cluster.filters.mip import mip_means as means_of_mip
from refgi.cluster.filters.pyramid import stack_array
from refgi.cluster.settings import MOST_TERMS, Csm
from refgi.jit import by_type, kernel
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
    """Allocate the filters of one map of n x n texels with M terms, not yet filled.

    `box` filters over the square around the disc instead of the disc; `quantised` keeps 8 bits of the basis and 16 of
    the basis-z; `mirrored` mirrors the disc in the square beyond it, which otherwise holds the far end; boxes alone
    look there.
    """
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
    """Read the means of the channels over a disc for each active lane of the `count` in use of a tile.

    Centres (s, t) and radii are in units of the map's half side; `out` (channels, lanes) is filled where active: all 4
    M + 1 channels with `with_z`, else the first 2 M.
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
    """Filter one map (n, n), radial distances in m, inf where it is empty, as settings ask for; in its dtype.

    `scale` takes metres to the series' scale. `box`: brute force filters over squares instead of discs.
    """
    return build_several(depth[None], (scale,), settings, box)[0]


def build_several(
    depth: Array, scales: Sequence[DepthScale], settings: Csm, box: bool, scratch: Mip | None = None
) -> list[Any]:
    """Filter several maps (k, n, n) at once, one on each thread, as `build_filters` does one.

    `scratch`, of `allocate_mips` for k maps or more with the same settings, is overwritten. Sec. 6 filters square maps.
    The square beyond the unit disc, which the hemisphere does not reach, mirrors what lies within: holding nothing, it
    would let light leak in over the rim. Texel by texel, it is left out.
    """
    size, dtype = depth.shape[1], depth.dtype
    if settings.prefilter == "mip":
        several = allocate_mips(len(depth), size, dtype, settings) if scratch is None else scratch
        build_mips(depth, joined(scales), several)
        return [mip_of(several, k) for k in range(len(depth))]
    filtered = []
    for one, scale in zip(depth, scales, strict=True):
        filtered.append(brutes(size, settings.terms, dtype, box=box, quantised=settings.quantisation == "published"))
        build_brute(one, scale, filtered[-1])
    return filtered


def allocate_mips(count: int, size: int, dtype: npt.DTypeLike, settings: Csm) -> Mip:
    """Allocate the pyramids of `count` maps of size x size texels, a leading axis, not yet filled."""
    return mips(count, size, settings.terms, dtype, shift=LEVEL_SHIFT, quantised=settings.quantisation == "published",
                mirrored=True)
