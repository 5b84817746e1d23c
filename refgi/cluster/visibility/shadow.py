"""The shadow of one area light as kernels read it: PCF, PCSS or CSM, chosen by its type when kernels are compiled."""

from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from refgi.cluster.clustering.rectangle import AreaLights
from refgi.cluster.filters.prefilter import build_filters
from refgi.cluster.maps.shadow_maps import ShadowMaps
from refgi.cluster.settings import ConstantBias, Csm, Hard, Pcf, Pcss
from refgi.cluster.visibility.csm import CsmShadow, csm_tile
from refgi.cluster.visibility.pcf import PcfShadow, pcf_shadow, pcf_tile
from refgi.cluster.visibility.pcss import PcssShadow, blocker_test, pcss_tile
from refgi.cluster.visibility.search_region import filter_sizing, light_constants, scale_of
from refgi.cluster.visibility.series import series
from refgi.jit import by_type

if TYPE_CHECKING:
    from refgi.cluster.settings import ValSettings

Array = npt.NDArray[Any]

TILES: dict[Any, Any] = {PcfShadow: pcf_tile, PcssShadow: pcss_tile, CsmShadow: csm_tile}


def shadow_of(
    maps: ShadowMaps, areas: AreaLights, m: int, settings: "ValSettings", behind: bool = False, filters: Any = None
) -> Any:
    """Return the shadow of area light m, which has a map and, without extent, casts a hard shadow, for `shadow_tile`.

    `visibility` is one of `BY_MAPS`; `behind`: of the map of the hemisphere behind; `filters`, the filtered map of
    `Csm`, is made where absent.
    """
    k, delta, kind = int(maps.map_of[m]), float(areas.delta[m]), settings.visibility
    if isinstance(kind, Hard) or delta == 0.0:
        return pcf_shadow(maps, k, 1, behind)
    if isinstance(kind, Pcf):
        return pcf_shadow(maps, k, kind.texels, behind)
    depth, sizing = (maps.behind if behind else maps.depth), filter_sizing(settings)
    assert depth is not None
    if isinstance(kind, Pcss):
        bias = kind.constant_bias or ConstantBias()
        scale = scale_of(maps, k, bias.scale, series(Csm(bias=bias.value)), behind)
        return PcssShadow(light_constants(maps, k, delta, None, behind), sizing, blocker_test(kind, scale), depth[k])
    assert isinstance(kind, Csm)
    chain = series(kind)
    scale = scale_of(maps, k, kind.depth_scale, chain, behind)
    if filters is None:
        filters = build_filters(depth[k], scale, kind, "val_alpha_over_pi" in settings.as_published)
    constants = light_constants(maps, k, delta, chain, behind)
    return CsmShadow(constants, sizing, scale, chain.weight.astype(depth.dtype), filters)


def filter_channels(shadow: Any) -> int:
    """Return how many channels of a filtered map a shadow reads."""
    return 4 * len(shadow.weight) + 1 if isinstance(shadow, CsmShadow) else 0


def shadow_tile(
    shadow: Any, points: Array, facing: Array, size: int, active: Array, visible: Array, scratch: Any
) -> None:
    """Fill V, 0 to 1, of the active ones of `size` receivers; `active` is overwritten with nothing but True.

    Points and the normals of their surfaces, on either side, are (>= 3, >= size), world space, m; the normals may be
    empty for CSM. `scratch` is overwritten.
    """
    TILES[type(shadow)](shadow, points, facing, size, active, visible, scratch)


@by_type(shadow_tile)
def _by_type(
    shadow: Any, points: Any, facing: Any, size: Any, active: Any, visible: Any, scratch: Any  # noqa: ARG001
) -> Any:
    tile = TILES[shadow.instance_class]

    def call(shadow: Any, points: Any, facing: Any, size: Any, active: Any, visible: Any, scratch: Any) -> None:
        tile(shadow, points, facing, size, active, visible, scratch)

    return call
