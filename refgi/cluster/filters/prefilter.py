"""Prefilters of convolution shadow maps (Sec. 6): mip maps and the brute force, chosen by type when kernels compile."""

from typing import Any

import numpy.typing as npt

from refgi.cluster.filters.brute import Brute, brute_means, brutes, build_brute
from refgi.cluster.filters.depth_scale import DepthScale
from refgi.cluster.filters.mip import Mip, build_mip, mip_means, mip_of, mips
from refgi.cluster.settings import Csm
from refgi.jit import by_type

Array = npt.NDArray[Any]

# a read between texels is a tent twice as wide as a texel of its level: half the level makes it the filter's width
LEVEL_SHIFT = -1.0
MEANS: dict[Any, Any] = {Mip: mip_means, Brute: brute_means}
BUILD: dict[Any, Any] = {Mip: build_mip, Brute: build_brute}


def filter_means(
    filters: Any, s: Array, t: Array, radius: Array, active: Array, count: int, with_z: bool, out: Array
) -> None:
    """Read the means of the channels over a disc for each lane of a tile.

    Parameters
    ----------
    filters : Mip or Brute
        The filtered map.
    s, t, radius : (lanes,) ndarray
        Centre and radius of the discs, in units of the map's half side.
    active : (lanes,) ndarray of bool
        Lanes to read.
    count : int
        Lanes in use.
    with_z : bool
        All 4 M + 1 channels instead of the first 2 M.
    out : (channels, lanes) ndarray
        Filled where active.
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


def build_filters(depth: Array, scale: DepthScale, settings: Csm, box: bool, scratch: Any = None) -> Any:
    """Filter one map as settings ask for.

    Parameters
    ----------
    depth : (n, n) ndarray
        Radial distance, m; inf where the map is empty.
    scale : DepthScale
        From metres to the series' scale.
    settings : Csm
        Terms, filter and quantisation.
    box : bool
        Brute force filters over squares instead of discs.
    scratch : Mip or Brute, optional
        Of `allocate_filters` with the same settings; overwritten and returned.

    Returns
    -------
    Mip or Brute
        In the dtype of `depth`.
    """
    scratch = allocate_filters(len(depth), depth.dtype, settings, box) if scratch is None else scratch
    BUILD[type(scratch)](depth, scale, scratch)
    return scratch


def allocate_filters(n: int, dtype: npt.DTypeLike, settings: Csm, box: bool) -> Any:
    """Allocate the filters of one map.

    Parameters
    ----------
    n : int
        Texels along a side of the map.
    dtype : dtype
        Of the map.
    settings : Csm
        Terms, filter and quantisation.
    box : bool
        As in `build_filters`.

    Returns
    -------
    Mip or Brute
        Not yet filled.

    Notes
    -----
    Sec. 6 filters square maps. The square beyond the unit disc, which the hemisphere does not reach, mirrors what lies
    within: holding nothing, it would let light leak in over the rim. Texel by texel, it is left out.
    """
    quantised = settings.quantisation == "published"
    if settings.prefilter == "mip":
        return mip_of(mips(1, n, settings.terms, dtype, shift=LEVEL_SHIFT, quantised=quantised, mirrored=True), 0)
    return brutes(n, settings.terms, dtype, box=box, quantised=quantised)
