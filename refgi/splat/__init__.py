"""Pixel lights splatted onto the picture, and the gathering they replaced.

`sii` (Dachsbacher and Stamminger 2006) turns texels of the reflective shadow map into pixel lights and adds the
irradiance of each to the pixels where it is significant; `gather` (2005) lets each pixel look around its own place in
the map. Both sum the same pair term, Eq. 2. They differ from the paper where it is silent or wrong: fluxes carry exact
solid angles and T / N, intensities 1 / pi, Phong lobes conserve their flux above the surface, and the picture is that
of the threshold alone, whatever bound found the pixels.

`lights` chooses the lights, `pairs` sums over pairs, `reach` says how far lights count, `account` where the power
goes, `gathering` holds the older method.
"""

from refgi.splat.gathering.gather import GatherSettings, gather
from refgi.splat.irradiance import Receivers, irradiance
from refgi.splat.lights.walk import walk_lights
from refgi.splat.settings import PairSettings, SplatSettings
from refgi.splat.sii import SiiSettings, sii
from refgi.splat.splat import cut_irradiance, splat

__all__ = [
    "GatherSettings",
    "PairSettings",
    "Receivers",
    "SiiSettings",
    "SplatSettings",
    "cut_irradiance",
    "gather",
    "irradiance",
    "sii",
    "splat",
    "walk_lights",
]
