"""From pixel lights to area lights and what each of them sees: Sec. 5 and the maps of Sec. 6."""

from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from refgi.cluster.area_lights import AreaLights
from refgi.cluster.clustering.kmeans import cluster
from refgi.cluster.clustering.rectangle import area_lights
from refgi.cluster.maps.occluders import ends_of
from refgi.cluster.maps.shadow_maps import ShadowMaps, shadow_maps
from refgi.stages import skip

if TYPE_CHECKING:
    from refgi.cluster.settings import ValSettings
    from refgi.frame import Frame
    from refgi.lights import PixelLights

Array = npt.NDArray[Any]

WITHOUT_MAPS = ("none", "members", "rectangle")  # kinds of visibility that look at no map


def grouped(
    frame: "Frame", lights: "PixelLights", settings: "ValSettings", count: int, footprint: Array | None = None
) -> tuple[AreaLights, ShadowMaps | None]:
    """Group pixel lights into area lights and draw what occludes them.

    Parameters
    ----------
    frame : Frame
        The scene.
    lights : PixelLights
        N pixel lights.
    settings : ValSettings
        Kind of clusters and of maps.
    count : int
        M, how many area lights.
    footprint : (N,) ndarray, optional
        Surface area of each light, m^2, where a cluster of one light is its footprint.

    Returns
    -------
    AreaLights
        One for each cluster.
    ShadowMaps or None
        What each sees; None where the kind of visibility does not ask.
    """
    clusters = cluster(lights.position, lights.normal, count, distance=settings.distance,
                       weights=(settings.position_weight, settings.normal_weight), diagonal=frame.lit_extent.diagonal,
                       rounds=settings.rounds)
    areas = area_lights(lights, clusters, settings, footprint)
    if settings.visibility in WITHOUT_MAPS:
        skip("cluster.shadow_maps", f"visibility {settings.visibility!r} looks at none")
        return areas, None
    tracer = frame.tracer if settings.maps == "rays" else None
    return areas, shadow_maps(frame.scene.geometry, areas, settings, frame.dtype, tracer, ends_of(frame, lights))
