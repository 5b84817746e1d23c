"""One name for the three filters of a map, told apart by the type of what they read when kernels are compiled."""

from typing import Any

import numpy.typing as npt

from refgi.cluster.filters.brute import Brute, brute_means, brutes, build_brute
from refgi.cluster.filters.depth_scale import DepthScale
from refgi.cluster.filters.mip import Mip, build_mip, mip_means, mip_of, mips
from refgi.cluster.filters.sat import Sat, build_sat, sat_means, sats
from refgi.cluster.settings import ValSettings
from refgi.jit import by_type

Array = npt.NDArray[Any]

# a read between texels is a tent twice as wide as a texel of its level: half the level makes it the filter's width
LEVEL_SHIFT = -1.0
MEANS: dict[Any, Any] = {Mip: mip_means, Sat: sat_means, Brute: brute_means}
FILL: dict[Any, Any] = {Mip: build_mip, Sat: build_sat, Brute: build_brute}


def filtered(
    filters: Any, s: Array, t: Array, radius: Array, wanted: Array, count: int, with_z: bool, out: Array
) -> None:
    """Read the means of the channels over a disc for each lane of a tile.

    Parameters
    ----------
    filters : Mip, Sat or Brute
        The filtered map.
    s, t, radius : (lanes,) ndarray
        Centre and radius of the discs, in units of the map's half side.
    wanted : (lanes,) ndarray of bool
        Lanes to read.
    count : int
        Lanes in use.
    with_z : bool
        All 4 M + 1 channels instead of the first 2 M.
    out : (channels, lanes) ndarray
        Filled where wanted.
    """
    MEANS[type(filters)](filters, s, t, radius, wanted, count, with_z, out)


@by_type(filtered)
def _by_type(
    filters: Any, s: Any, t: Any, radius: Any, wanted: Any, count: Any, with_z: Any, out: Any  # noqa: ARG001
) -> Any:
    means = MEANS[filters.instance_class]

    def call(
        filters: Any, s: Any, t: Any, radius: Any, wanted: Any, count: Any, with_z: Any, out: Any
    ) -> None:
        means(filters, s, t, radius, wanted, count, with_z, out)

    return call


def build(depth: Array, scale: DepthScale, settings: ValSettings, room: Any = None) -> Any:
    """Filter one map as settings ask for.

    Parameters
    ----------
    depth : (n, n) ndarray
        Radial distance, m; inf where nothing is seen.
    scale : DepthScale
        From metres to the series' scale.
    settings : ValSettings
        `prefilter`, `terms` and `quantisation` count.
    room : Mip, Sat or Brute, optional
        Of `room_for` with the same settings; overwritten and returned.

    Returns
    -------
    Mip, Sat or Brute
        In the dtype of `depth`.
    """
    room = room_for(len(depth), depth.dtype, settings) if room is None else room
    FILL[type(room)](depth, scale, room)
    return room


def room_for(n: int, dtype: npt.DTypeLike, settings: ValSettings) -> Any:
    """Make room for one filtered map.

    Parameters
    ----------
    n : int
        Texels along a side of the map.
    dtype : dtype
        Of the map.
    settings : ValSettings
        As in `build`.

    Returns
    -------
    Mip, Sat or Brute
        Not yet filled.

    Notes
    -----
    Sec. 6 filters square maps. The square beyond the unit disc, which the hemisphere does not reach, mirrors what lies
    within: holding nothing, it would let light leak in over the rim. Texel by texel, it is left out.
    """
    quantised = settings.quantisation == "published"
    if settings.prefilter == "mip":
        return mip_of(mips(1, n, settings.terms, dtype, shift=LEVEL_SHIFT, quantised=quantised, mirrored=True), 0)
    if settings.prefilter == "sat":
        return sats(n, settings.terms, dtype, quantised=quantised, mirrored=True)
    return brutes(n, settings.terms, dtype, box="val_alpha_over_pi" in settings.as_published, quantised=quantised)
