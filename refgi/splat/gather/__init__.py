"""Gathering around the projected point (Reflective Shadow Maps 2005): what splatting replaced, and its baseline.

`gather` sums the texels around each pixel's own place in the map: `gather_sum` sums Eq. 2 over a disc of texels there,
`interpolation` carries the light of a coarse grid of pixels to the others.
"""

from refgi.method import Method
from refgi.splat.gather.gather import APPROXIMATIONS, PRESETS, DiscSettings, GatherSettings, Interpolation, gather
from refgi.splat.gather.lobes import gather_lobes

__all__ = [
    "PRESETS",
    "DiscSettings",
    "GatherSettings",
    "Interpolation",
    "gather",
]

METHOD = Method("gather", "Reflective Shadow Maps (2005): gathering around the projected point", gather, GatherSettings,
                visibility=False, presets=PRESETS, approximations=APPROXIMATIONS, lobes=gather_lobes)
