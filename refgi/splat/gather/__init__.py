"""Gathering around the projected point (Reflective Shadow Maps 2005): what splatting replaced, and its baseline."""

from refgi.method import Method
from refgi.splat.gather.gather import (
    APPROXIMATIONS,
    PRESETS,
    DiscSettings,
    GatherSettings,
    Interpolation,
    gather,
    gather_lobes,
)

__all__ = [
    "PRESETS",
    "DiscSettings",
    "GatherSettings",
    "Interpolation",
    "gather",
]

METHOD = Method("gather", "Reflective Shadow Maps (2005): gathering around the projected point", gather, GatherSettings,
                visibility=False, presets=PRESETS, approximations=APPROXIMATIONS, lobes=gather_lobes)
