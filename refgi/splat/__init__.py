"""Pixel lights splatted onto the picture, and the gathering they replaced.

`sii` (Dachsbacher and Stamminger 2006) turns texels of the reflective shadow map into pixel lights and adds the
irradiance of each to every pixel; `gather` (2005) lets each pixel look around its own place in the map. Both sum the
same pair term, Eq. 2, in `irradiance`. They differ from the paper where it is silent or wrong: fluxes carry exact
solid angles and T / N, intensities 1 / pi, and Phong lobes conserve their flux above the surface.
"""

from refgi.splat.gather import GatherSettings, gather
from refgi.splat.irradiance import Receivers, irradiance
from refgi.splat.settings import PairSettings, SplatSettings
from refgi.splat.sii import SiiSettings, sii
from refgi.splat.walk import walk_lights

__all__ = [
    "GatherSettings",
    "PairSettings",
    "Receivers",
    "SiiSettings",
    "SplatSettings",
    "gather",
    "irradiance",
    "sii",
    "walk_lights",
]
