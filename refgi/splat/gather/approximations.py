"""What `gather` approximates, in the order of its pipeline."""

import dataclasses
from collections.abc import Mapping
from typing import Any

from refgi.lights.approximations import RSM_RESOLUTION, VISIBILITY
from refgi.method import Approximation
from refgi.splat.gather.gather import GatherSettings

WHOLE_MAP = 1.42  # map widths: more than sqrt 2
MANY = 1 << 15  # texels of a disc


def _whole_map(settings: GatherSettings, _: Mapping[str, Any]) -> GatherSettings:
    disc = dataclasses.replace(settings.disc, radius=max(WHOLE_MAP, settings.disc.radius))
    return dataclasses.replace(settings, disc=disc)


def _many(settings: GatherSettings, _: Mapping[str, Any]) -> GatherSettings:
    disc = dataclasses.replace(settings.disc, samples=max(MANY, settings.disc.samples), seed=0)
    return dataclasses.replace(settings, disc=disc)


def _every_pixel(settings: GatherSettings, _: Mapping[str, Any]) -> GatherSettings:
    return dataclasses.replace(settings, interpolation=None)


APPROXIMATIONS = (
    VISIBILITY, RSM_RESOLUTION,
    Approximation("cut", "texels beyond a disc around the pixel's place in the map are left out", _whole_map),
    Approximation("few samples", f"S texels of the disc; off: {MANY}", _many),
    Approximation("upsampling", "pixels of a coarse grid are evaluated, similar ones interpolated", _every_pixel))
