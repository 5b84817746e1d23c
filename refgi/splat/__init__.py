"""Pixel lights splatted onto the picture, three methods that do not import each other.

`sii` (Dachsbacher and Stamminger 2006) adds the irradiance of each pixel light to the pixels where it is significant;
`multires` (Nichols and Wyman 2009) evaluates them all at subsplats, large where nothing changes; `gather` (2005), which
both replaced, lets each pixel look around its own place in the map. All sum the same pair term, Eq. 2; lights and pair
sums are those of `refgi.lights` and `refgi.pairs`, which other methods share.
"""

from refgi.lights import walk_lights
from refgi.pairs.irradiance import Receivers, irradiance
from refgi.pairs.settings import PairSettings
from refgi.splat.gather import GatherSettings, gather
from refgi.splat.multires import MultiresSettings, multires, shared_subsplats
from refgi.splat.sii import ReachSettings, SiiSettings, cut_irradiance, sii, splat

__all__ = [
    "GatherSettings",
    "MultiresSettings",
    "PairSettings",
    "ReachSettings",
    "Receivers",
    "SiiSettings",
    "cut_irradiance",
    "gather",
    "irradiance",
    "multires",
    "shared_subsplats",
    "sii",
    "splat",
    "walk_lights",
]
