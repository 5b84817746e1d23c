"""Pixel lights splatted onto the picture, three methods that do not import each other: `sii`, `multires`, `gather`.

All sum the same pair term, Eq. 2; lights and pair sums are those of `refgi.lights` and `refgi.pairs`.
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
