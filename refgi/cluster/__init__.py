"""Clustered visibility: pixel lights that share the soft shadow of a virtual area light.

`val` (Dong, Grosch, Ritschel, Kautz and Seidel 2009) groups pixel lights by k-means into area lights, draws one
paraboloid shadow map for each and filters it into soft visibility, which the lights of a cluster share.

`clustering` makes the area lights, `maps` their shadow maps, `filters` the prefilters of these, `visibility` hard
shadows, PCF, PCSS and convolution shadow maps, `lighting` the picture. `adaptive` finds a number of area lights;
`reference` holds the references of these steps and the error of each.
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
