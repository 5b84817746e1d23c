"""Clustered visibility: pixel lights that share the soft shadow of a virtual area light.

`val` (Dong, Grosch, Ritschel, Kautz and Seidel 2009) groups pixel lights by k-means into area lights, draws one
paraboloid shadow map for each and filters it into soft visibility, which the lights of a cluster share.

`clustering` makes the area lights, `maps` what they see, `filters` means over parts of a map, `visibility` soft shadows
of them, `lighting` the picture. `adaptive` says how many area lights are enough; `reference` holds what each of these
steps is measured against, and what it costs.
"""

from refgi.cluster.clustering.kmeans import Clusters, cluster
from refgi.cluster.clustering.rectangle import AreaLights, area_lights
from refgi.cluster.lighting.blur import blur
from refgi.cluster.lighting.clustered import clustered_irradiance
from refgi.cluster.maps.shadow_maps import ShadowMaps, shadow_maps
from refgi.cluster.memory import extra_bytes
from refgi.cluster.settings import ValSettings
from refgi.cluster.val import val
from refgi.method import Method

__all__ = [
    "AreaLights",
    "Clusters",
    "ShadowMaps",
    "ValSettings",
    "area_lights",
    "blur",
    "cluster",
    "clustered_irradiance",
    "shadow_maps",
    "val",
]

METHOD = Method(
    "val", "Clustered Visibility (2009): pixel lights share the soft shadows of virtual area lights", val, ValSettings,
    visibility=True, memory=extra_bytes)
