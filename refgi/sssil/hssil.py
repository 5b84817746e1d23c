"""Hierarchical Screen-Space Indirect Illumination (Soler, Hoel, Rochet, Jay and Holzschuch 2009)."""

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.diagnostics import is_due
from refgi.settings import replaced
from refgi.sssil.blur import blur
from refgi.sssil.cameras import join_cameras
from refgi.sssil.crown.gather import gather
from refgi.sssil.crown.loss import warn_of_few_samples
from refgi.sssil.crown.reach import chosen_radius, warn_short_reach
from refgi.sssil.pyramid.levels import pyramid, sender_pyramid
from refgi.sssil.pyramid.view import Level
from refgi.sssil.settings import Bitmask, HssilSettings, Rays
from refgi.sssil.upsampling.upsample import Guide, upsample
from refgi.sssil.visibility.bitmask import bitmask_gather
from refgi.sssil.visibility.rays import ray_gather
from refgi.stages import skip

if TYPE_CHECKING:
    from refgi.frame import Frame

Array = npt.NDArray[Any]


def hssil(frame: "Frame", settings: HssilSettings) -> Array:
    """Light what a camera sees by what it sees, near by at high and far away at low resolution.

    Parameters
    ----------
    frame : Frame
        Scene, camera and lights.
    settings : HssilSettings
        Sampling, levels, visibility and cameras.

    Returns
    -------
    (3, h, w) ndarray
        Indirect irradiance, W/m^2, linear RGB.
    """
    irradiance = one_view(frame, settings)
    if not (settings.cameras.count or settings.cameras.views):
        skip("sssil.cameras", "one camera")
        return irradiance
    # Sec. 5, discussion
    return join_cameras(frame, irradiance, settings.cameras, lambda other: one_view(other, settings))


def one_view(frame: "Frame", settings: HssilSettings) -> Array:
    """Return the indirect irradiance (3, h, w), W/m^2, of what a camera sees by what this camera alone sees."""
    levels = pyramid(frame, settings)  # Sec. 4, hierarchical maps
    senders = sender_pyramid(frame, levels, settings)
    if is_due("sssil.reach"):
        warn_short_reach(levels[0].shape, settings.sampling)
    settings = replaced(settings, {"sampling.radius": chosen_radius(levels[0].shape, settings.sampling)})
    warn_of_few_samples(levels, senders, settings)
    irradiance = gather_level(frame, levels[-1], len(levels) - 1, settings, senders[-1])
    for index in reversed(range(len(levels) - 1)):  # Sec. 3.2: starting from the smallest
        added = gather_level(frame, levels[index], index, settings, senders[index])
        irradiance = upsample(irradiance, guide_of(levels[index + 1]), guide_of(levels[index]), settings, added)
    if levels[0].number == 0:
        skip("sssil.upsample", "light was gathered at full resolution")
        return irradiance
    depth, normal = frame.gbuffer.resolve("depth", "normal")
    return upsample(irradiance, guide_of(levels[0]), Guide(depth, normal), settings)


def gather_level(frame: "Frame", level: Level, index: int, settings: HssilSettings, senders: Level) -> Array:
    """Return the irradiance of the texels of one level from samples of it, blurred where these differ by receiver.

    (3, h, w), W/m^2. `index` is 0 for the first level, whose inner disc is sampled as well; `senders` the level as
    senders.
    """
    if settings.senders.only_level not in (None, index):
        return np.zeros_like(level.radiance)
    if isinstance(settings.visibility, Bitmask):
        irradiance = bitmask_gather(level, index, settings, frame.visible_extent.diagonal, senders)
    elif isinstance(settings.visibility, Rays):
        irradiance = ray_gather(level, index, settings, frame, senders)
    else:
        irradiance = gather(level, index, settings, senders)
    if settings.blur is None or settings.sampling.pattern in ("fixed", "all"):
        skip("sssil.blur", "none is asked for" if settings.blur is None else "all receivers share samples")
        return irradiance
    return blur(irradiance, level, settings.blur)


def guide_of(level: Level) -> Guide:
    """Return the guide (depths, normals) of joint bilateral upsampling to or from a level."""
    return Guide(level.depth, level.normal)
