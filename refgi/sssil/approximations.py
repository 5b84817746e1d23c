"""What `hssil` approximates, in the order of its pipeline: from every pixel that lights every pixel to few samples.

A level more at full resolution reaches as far as one fewer at half, so that what switches the resolution off keeps the
reach.
"""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

from refgi.method import Approximation
from refgi.settings import replaced
from refgi.sssil.crown.reach import reach
from refgi.sssil.settings import MOST_LEVELS, MOST_SAMPLES, Bitmask, HssilSettings

MANY = 1024  # samples where not every texel can be one


def _ignores_visibility(settings: HssilSettings) -> Mapping[str, Any]:
    return {"visibility": False} if settings.visibility is None else {}


def _by_rays(settings: HssilSettings, _: Mapping[str, Any]) -> HssilSettings:
    return replaced(settings, {"visibility": "rays"}) if isinstance(settings.visibility, Bitmask) else settings


def _points(settings: HssilSettings, _: Mapping[str, Any]) -> HssilSettings:
    return replaced(settings, {"senders.form_factor": "point"})


def _one_level(settings: HssilSettings, _: Mapping[str, Any]) -> HssilSettings:
    """Return settings of one level that covers the picture, with the samples of all levels."""
    sampling = settings.sampling
    if sampling.levels == 1:
        return settings
    return replaced(settings, {"levels": 1, "radius": None, "senders.only_level": None,
                               "samples": min(MOST_SAMPLES, sampling.samples * sampling.levels)})


def _averaged(settings: HssilSettings, _: Mapping[str, Any]) -> HssilSettings:
    return replaced(settings, {"downsample": "average"})


def _whole_picture(settings: HssilSettings, options: Mapping[str, Any]) -> HssilSettings:
    """Return settings with as many levels as reach across the picture."""
    sampling, radius = settings.sampling, settings.sampling.radius
    if radius is None:
        return settings
    diagonal = math.hypot(*(-(-options[side] >> sampling.first_level) for side in ("width", "height")))
    while reach(sampling, radius) < diagonal and sampling.levels < MOST_LEVELS:
        sampling = dataclasses.replace(sampling, levels=sampling.levels + 1)
    return dataclasses.replace(settings, sampling=sampling)


def _full_resolution(settings: HssilSettings, _: Mapping[str, Any]) -> HssilSettings:
    sampling = settings.sampling
    more = 0 if sampling.radius is None else sampling.first_level  # a radius that is not set covers the picture
    return replaced(settings, {"start": "full", "levels": min(MOST_LEVELS, sampling.levels + more)})


def _every_texel(settings: HssilSettings, _: Mapping[str, Any]) -> HssilSettings:
    if isinstance(settings.visibility, Bitmask):  # marches along slices, which the pattern "all" has not
        return replaced(settings, {"samples": max(MANY, settings.sampling.samples)})
    return replaced(settings, {"pattern": "all", "samples": 1, "seed": 0})


def _unblurred(settings: HssilSettings, _: Mapping[str, Any]) -> HssilSettings:
    return dataclasses.replace(settings, blur=None)


def _single_frame(options: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return options of a frame that is not the last of several."""
    return {key: value for key, value in options.items() if key != "still"}


APPROXIMATIONS = (
    Approximation("unseen senders", "only what the camera sees sends light",
                  limit=lambda _: {"emitters": "visible"}),
    Approximation("visibility", "nothing blocks indirect light, or a bitmask of the screen for rays", _by_rays,
                  limit=_ignores_visibility),
    Approximation("clamp", "a sender is a disc (Eq. 4) for a point (Eq. 3), whose light has no bound", _points),
    Approximation("levels", "coarser texels for pixels farther away", _one_level),
    Approximation("downsampling", "a coarse texel is one of four for their average", _averaged),
    Approximation("cut", "crowns end before the picture does", _whole_picture),
    Approximation("upsampling", "the first level is half or a quarter of the resolution", _full_resolution),
    Approximation("few samples", "S samples a level for all its texels", _every_texel),
    Approximation("blur", "the mean over texels of the same surface", _unblurred),
    Approximation("temporal", "the frames before are blended in; here of a resting scene", frame=_single_frame))
