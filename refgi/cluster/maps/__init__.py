"""Paraboloid shadow maps of area lights (Sec. 4.2, 6), and the triangles that they are drawn from."""

from refgi.cluster.maps.occluders import Blockers, blockers, occluders
from refgi.cluster.maps.shadow_maps import ShadowMaps, shadow_maps

__all__ = ["Blockers", "ShadowMaps", "blockers", "occluders", "shadow_maps"]
