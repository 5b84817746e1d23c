"""Software rasterizer (`raster`), and the buffers it fills (`buffers`): G-buffer, reflective shadow maps, direct light.

Reflective shadow maps follow Dachsbacher and Stamminger 2005 and their splatting paper of 2006 (SII), with the flux
calibrated: exact solid angles and the spot's falloff integrated over each texel, neither of which the papers state. The
rasterizer keeps a visibility buffer (triangle and nearness) and resolves attributes in a second pass, only those that
are used.
"""

from refgi.rsm.buffers import (
    GBuffer,
    Rsm,
    direct_irradiance,
    facing_normals,
    gbuffer,
    incident_flux,
    leaving_radiance,
    reflective_shadow_map,
    shadow_map_visibility,
    texel_shares,
)
from refgi.rsm.raster import Projection, Visibility, camera_projection, paraboloid_depth_maps, project, rasterize

__all__ = [
    "GBuffer",
    "Projection",
    "Rsm",
    "Visibility",
    "camera_projection",
    "direct_irradiance",
    "facing_normals",
    "gbuffer",
    "incident_flux",
    "leaving_radiance",
    "paraboloid_depth_maps",
    "project",
    "rasterize",
    "reflective_shadow_map",
    "shadow_map_visibility",
    "texel_shares",
]
