"""What area lights see: paraboloid maps of distances, and the hard test for what is hidden from their centre."""

from refgi.cluster.maps.hard import hard_visibility
from refgi.cluster.maps.occluders import Blockers, blockers, occluders
from refgi.cluster.maps.shadow_maps import ShadowMaps, shadow_maps

__all__ = ["Blockers", "ShadowMaps", "blockers", "hard_visibility", "occluders", "shadow_maps"]
