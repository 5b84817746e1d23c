"""The shadows of area lights as kernels read them, one after the other, or all of them kept for list after list.

One pass over all receivers filters few maps at a time, while they are in the cache. Receivers that come in lists would
filter every map again for each: their filtered maps are kept, as far as they fit into `MOST_KEPT`.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from refgi.cluster.clustering.rectangle import AreaLights
from refgi.cluster.filters.prefilter import allocate_mips, build_several
from refgi.cluster.settings import BY_MAPS, Csm
from refgi.cluster.visibility.search_region import scale_of, series
from refgi.cluster.visibility.shadow import shadow_of
from refgi.jit import thread_count
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.cluster.maps.shadow_maps import ShadowMaps
    from refgi.cluster.settings import ValSettings

MOST_KEPT = 1 << 23  # texels of all maps whose filters are kept: some 240 MB of four terms in float32

Shadows = dict[int, Any]  # by area light; None for one that nothing occludes


def kept_shadows(areas: AreaLights, maps: "ShadowMaps | None", settings: "ValSettings") -> Shadows | None:
    """Return the shadows of all area lights; None where maps are not read by kernels, or are too many to keep."""
    if not isinstance(settings.visibility, BY_MAPS) or (maps is not None and maps.depth.size > MOST_KEPT):
        return None
    every = np.flatnonzero(areas.members > 0)
    return dict(shadows_of(maps, areas, every, settings, len(every)))


def shadows_of(
    maps: "ShadowMaps | None", areas: AreaLights, chosen: Array, settings: "ValSettings", at_once: int | None = None
) -> Iterator[tuple[int, Any]]:
    """Return some area lights with their shadows; None for those that nothing occludes.

    `at_once` maps are filtered at a time, as many as there are threads where it is not given; those are overwritten by
    the next.
    """
    map_of = np.full(len(areas.delta), -1) if maps is None or settings.visibility is None else maps.map_of
    filtered = (map_of >= 0) & (areas.delta != 0) & isinstance(settings.visibility, Csm)
    filters = _filters(maps, map_of[chosen[filtered[chosen]]], settings, at_once or thread_count())
    for m in chosen:
        if maps is None or map_of[m] < 0:
            yield m, None
        else:
            yield m, shadow_of(maps, areas, m, settings, filters=next(filters) if filtered[m] else None)


def _filters(maps: "ShadowMaps | None", chosen: Array, settings: "ValSettings", at_once: int) -> Iterator[Any]:
    """Filter some maps in their order, one for each thread at a time: all at once would leave the cache."""
    if maps is None or len(chosen) == 0:
        return
    csm, box = settings.visibility, "val_alpha_over_pi" in settings.as_published
    assert isinstance(csm, Csm)
    depth, scratch = maps.depth, None
    if csm.prefilter == "mip":
        scratch = allocate_mips(min(at_once, len(chosen)), depth.shape[1], depth.dtype, csm)
    for first in range(0, len(chosen), at_once):  # what was filtered before is no longer in use
        some = chosen[first : first + at_once]
        scales = [scale_of(maps, k, csm.depth_scale, series(csm)) for k in some]
        yield from build_several(depth[some], scales, csm, box, scratch)
