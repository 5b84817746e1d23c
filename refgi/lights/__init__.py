"""Pixel lights (VPLs): from maps or light paths, warped, fewer in the open (SII Sec. 3.5 to 3.7).

`pixel_lights` takes texels of reflective shadow maps as point lights, with T/N on each, which the papers do not state;
`warp` draws them after their `importance`, `shares` says what part of the map and of the surface each stands for,
`refraction` adds those behind glass and `walk` those of light paths. `selection` is what methods call.
"""

from refgi.lights.importance import importance, importance_pyramid
from refgi.lights.pixel_lights import choose_pixel_lights
from refgi.lights.refraction import refracted
from refgi.lights.walk import walk_lights
from refgi.lights.warp import Warp, warp_samples, warp_stacked
from refgi.pairs.pixel_lights import PixelLights

__all__ = [
    "PixelLights",
    "Warp",
    "choose_pixel_lights",
    "importance",
    "importance_pyramid",
    "refracted",
    "walk_lights",
    "warp_samples",
    "warp_stacked",
]
