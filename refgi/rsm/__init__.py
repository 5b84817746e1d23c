"""The software rasterizer, and what it feeds: G-buffer, reflective shadow maps, direct light, pixel lights.

Reflective shadow maps follow Dachsbacher and Stamminger 2005 and their splatting paper of 2006 (SII), with the flux
calibrated: exact solid angles, the spot's falloff integrated over each texel, and T/N on every pixel light, none of
which the papers state. The rasterizer keeps a visibility buffer (triangle and nearness) and resolves attributes in a
second pass, only those that are asked for.
"""

from refgi.rsm.depth_maps import paraboloid_depth_maps
from refgi.rsm.direct import direct_irradiance, shadow_map_visibility
from refgi.rsm.facing import facing_normals
from refgi.rsm.gbuffer import GBuffer, gbuffer
from refgi.rsm.importance import importance
from refgi.rsm.leaving import leaving_radiance
from refgi.rsm.pixel_lights import PixelLights, choose_pixel_lights
from refgi.rsm.projection import Projection, camera_projection, project
from refgi.rsm.pyramid import importance_pyramid
from refgi.rsm.raster import Visibility, rasterize
from refgi.rsm.reflective import Rsm, incident_flux, reflective_shadow_map, texel_shares
from refgi.rsm.refraction import refracted
from refgi.rsm.warp import Warp, warp_samples, warp_stacked

__all__ = [
    "GBuffer",
    "PixelLights",
    "Projection",
    "Rsm",
    "Visibility",
    "Warp",
    "camera_projection",
    "choose_pixel_lights",
    "direct_irradiance",
    "facing_normals",
    "gbuffer",
    "importance",
    "importance_pyramid",
    "incident_flux",
    "leaving_radiance",
    "paraboloid_depth_maps",
    "project",
    "rasterize",
    "reflective_shadow_map",
    "refracted",
    "shadow_map_visibility",
    "texel_shares",
    "warp_samples",
    "warp_stacked",
]
