"""Prefilters of convolution shadow maps (Sec. 6): mip maps and the brute force, chosen by type when kernels compile."""

from collections.abc import Sequence
from typing import Any

import numpy.typing as npt

from refgi.cluster.filters.brute import Brute, brute_means, brutes, build_brute
from refgi.cluster.filters.depth_scale import DepthScale, joined
from refgi.cluster.filters.mip import Mip, build_mips, mip_means, mip_of, mips
from refgi.cluster.settings import Csm
from refgi.jit import by_type

Array = npt.NDArray[Any]

# a read between texels is a tent twice as wide as a texel of its level: half the level makes it the filter's width
LEVEL_SHIFT = -1.0
MEANS: dict[Any, Any] = {Mip: mip_means, Brute: brute_means}


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
