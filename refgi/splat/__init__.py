"""Pixel lights splatted onto the picture: where they are significant, or where the picture changes.

`sii` (Dachsbacher and Stamminger 2006) turns texels of the reflective shadow map into pixel lights and adds the
irradiance of each to the pixels where it is significant; `multires` (Nichols and Wyman 2009) evaluates them all at
subsplats, large where nothing changes; `gather` (2005), which both replaced, lets each pixel look around its own place
in the map. All sum the same pair term, Eq. 2. They differ from the papers where these are silent or wrong: fluxes carry
exact solid angles and T / N, intensities 1 / pi, Phong lobes conserve their flux above the surface, the picture of
`sii` is that of the threshold alone, whatever bound found the pixels, and subsplats keep what was evaluated for them.

`reach` says how far lights count, `account` where the power goes; lights and pair sums are those of `refgi.lights` and
`refgi.pairs`, which other methods share.
`refinement` lists subsplats, `subsplats` lights them and makes a picture of them, `light_lists` refines for each light
by itself and `error_target` until an error is met. `gathering` holds the older method.
"""

from refgi.lights.walk import walk_lights
from refgi.pairs.irradiance import Receivers, irradiance
from refgi.pairs.settings import PairSettings
from refgi.splat.gathering.gather import GatherSettings, gather
from refgi.splat.multires import MultiresSettings, multires, shared_subsplats
from refgi.splat.settings import SplatSettings
from refgi.splat.sii import SiiSettings, sii
from refgi.splat.splat import cut_irradiance, splat

__all__ = [
    "GatherSettings",
    "MultiresSettings",
    "PairSettings",
    "Receivers",
    "SiiSettings",
    "SplatSettings",
    "cut_irradiance",
    "gather",
    "irradiance",
    "multires",
    "shared_subsplats",
    "sii",
    "splat",
    "walk_lights",
]
