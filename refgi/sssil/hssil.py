"""Hierarchical Screen-Space Indirect Illumination (Soler, Hoel, Rochet, Jay and Holzschuch 2009)."""

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.sssil.cameras import several_cameras
from refgi.sssil.crown.gather import gather
from refgi.sssil.crown.reach import chosen_radius, expect_reach
from refgi.sssil.level import Level
from refgi.sssil.pyramid.levels import pyramid
from refgi.sssil.settings import HssilSettings
from refgi.sssil.upsampling.upsample import Guide, upsample
from refgi.sssil.visibility.bitmask import bitmask_gather
from refgi.sssil.visibility.rays import ray_gather
from refgi.stages import skip

if TYPE_CHECKING:
    from refgi.frame import Frame

Array = npt.NDArray[Any]


def hssil(frame: "Frame", settings: HssilSettings) -> Array:
    """Light what a camera sees by what it sees, near by in detail and far away coarsely.

    Parameters
    ----------
    frame : Frame
        The scene, seen and lit.
    settings : HssilSettings
        How densely, at which resolutions, and by how many cameras.

    Returns
    -------
    (3, h, w) ndarray
        Indirect irradiance, W/m^2, linear RGB.
    """
    light = one_view(frame, settings)
    if not (settings.cameras or settings.views):
        skip("sssil.cameras", "one camera")
        return light
    return several_cameras(frame, light, settings, one_view)  # Sec. 5, discussion


def one_view(frame: "Frame", settings: HssilSettings) -> Array:
    """Light what a camera sees by what this camera alone sees.

    Parameters
    ----------
    frame : Frame
        The scene, seen and lit.
    settings : HssilSettings
        How densely and at which resolutions.

    Returns
    -------
    (3, h, w) ndarray
        Indirect irradiance, W/m^2.
    """
    levels = pyramid(frame, settings)  # Sec. 4, hierarchical maps
    expect_reach(levels[0].shape, settings)
    settings = dataclasses.replace(settings, radius=chosen_radius(levels[0].shape, settings))
    light = gathered(frame, levels[-1], len(levels) - 1, settings)
    for index in reversed(range(len(levels) - 1)):  # Sec. 3.2: starting from the smallest
        here = gathered(frame, levels[index], index, settings)
        light = upsample(light, guide(levels[index + 1]), guide(levels[index]), settings, here)
    if levels[0].number == 0:
        skip("sssil.upsample", "light was gathered at full resolution")
        return light
    depth, normal = frame.gbuffer.resolve("depth", "normal")
    return upsample(light, guide(levels[0]), Guide(depth, normal), settings)


def gathered(frame: "Frame", level: Level, index: int, settings: HssilSettings) -> Array:
    """Return what the texels of one level receive from samples of it.

    Parameters
    ----------
    frame : Frame
        The scene.
    level : Level
        Receivers and senders.
    index : int
        0 for the first level, whose inner disc is sampled as well.
    settings : HssilSettings
        How many samples, and what may block them.

    Returns
    -------
    (3, h, w) ndarray
        Irradiance, W/m^2.
    """
    if settings.only_level not in (None, index):
        return np.zeros_like(level.radiance)
    if settings.visibility == "bitmask":
        return bitmask_gather(level, index, settings, frame.seen_extent.diagonal)
    if settings.visibility == "rays":
        return ray_gather(level, index, settings, frame)
    return gather(level, index, settings)


def guide(level: Level) -> Guide:
    """Return what says which texels of a level belong together.

    Parameters
    ----------
    level : Level
        The level.

    Returns
    -------
    Guide
        Its depths and normals.
    """
    return Guide(level.depth, level.normal)
