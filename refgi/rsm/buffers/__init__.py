"""G-buffer, reflective shadow maps, direct light, and the radiance that a camera receives.

`gbuffer` resolves the attributes of each texel's triangle (`lines`, `attributes`), only those that are used;
`reflective` adds the flux that reaches each texel from a light (`light_projection`, `solid_angle`).
"""

from refgi.rsm.buffers.direct import direct_irradiance, shadow_map_visibility
from refgi.rsm.buffers.gbuffer import GBuffer, facing_normals, gbuffer
from refgi.rsm.buffers.leaving import leaving_radiance
from refgi.rsm.buffers.light_projection import incident_flux, texel_shares
from refgi.rsm.buffers.reflective import Rsm, reflective_shadow_map

__all__ = [
    "GBuffer",
    "Rsm",
    "direct_irradiance",
    "facing_normals",
    "gbuffer",
    "incident_flux",
    "leaving_radiance",
    "reflective_shadow_map",
    "shadow_map_visibility",
    "texel_shares",
]
