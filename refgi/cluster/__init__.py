"""Clustered visibility: pixel lights that share the soft shadow of a virtual area light.

`val` (Dong, Grosch, Ritschel, Kautz and Seidel 2009) groups pixel lights by `kmeans` into area lights (`rectangle`),
draws one paraboloid shadow map for each (`occluders`, `maps`) and filters it (`filters`) into soft `visibility`, which
the lights of a cluster share: `interleave`, `area_sum` and `clustered` sum them, `geometry_blur` joins the blocks.
`reference` and `back_projection` hold the references of soft shadows. Unlike the paper, each light counts n^2 times in
the pixels that sum it, and irradiance is blurred instead of radiance.
"""

from refgi.cluster.clustered import clustered_irradiance
from refgi.cluster.geometry_blur import blur
from refgi.cluster.kmeans import Clustering, cluster
from refgi.cluster.maps import ShadowMaps, shadow_maps
from refgi.cluster.rectangle import AreaLights, area_lights
from refgi.cluster.settings import PRESETS, ValSettings
from refgi.cluster.val import APPROXIMATIONS, extra_bytes, val, val_ledger, val_lobes
from refgi.method import Method

__all__ = [
    "PRESETS",
    "AreaLights",
    "Clustering",
    "ShadowMaps",
    "ValSettings",
    "area_lights",
    "blur",
    "cluster",
    "clustered_irradiance",
    "shadow_maps",
    "val",
    "val_lobes",
]

METHOD = Method(
    "val", "Clustered Visibility (2009): pixel lights share the soft shadows of virtual area lights", val, ValSettings,
    visibility=lambda settings: settings.visibility is not None, ledger=val_ledger, memory=extra_bytes,
    presets=PRESETS, approximations=APPROXIMATIONS, lobes=val_lobes)
