"""The pyramids of what a camera sees: position, normal, direct light and sample area (Sec. 4)."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.rsm.memory import plane
from refgi.rsm.projection import Projection
from refgi.sssil.level import Level
from refgi.sssil.pyramid.coarser import fill_coarser_level
from refgi.sssil.pyramid.start import Picture, fill_first_level
from refgi.sssil.pyramid.view import view_of
from refgi.sssil.settings import HssilSettings
from refgi.stages import skip, stage

if TYPE_CHECKING:
    from refgi.frame import Frame

Array = npt.NDArray[Any]


def pyramid(frame: "Frame", settings: HssilSettings) -> list[Level]:
    """Return what a camera sees at the resolutions that light is gathered at.

    Parameters
    ----------
    frame : Frame
        The scene, seen and lit.
    settings : HssilSettings
        First level, number of levels and how texels become one.

    Returns
    -------
    list of Level
        Finest first; fewer than asked for where the samples of the last ones would all lie off the picture.
    """
    buffer = frame.gbuffer
    depth, normal, albedo = buffer.resolve("depth", "normal", "albedo")
    count = useful_levels((frame.height, frame.width), settings)
    if count < settings.levels:
        skip("sssil.level", f"no texel of level {settings.first_level + count} has another in its crown")
    return list(levels(depth, normal, albedo, frame.direct, buffer.projection, settings.first_level, count,
                       settings.downsample, settings.as_published & {"hss_tan_f"}))


def useful_levels(shape: tuple[int, int], settings: HssilSettings) -> int:
    """Return how many levels have texels that lie within each other's crown.

    Parameters
    ----------
    shape : tuple of 2 ints
        Height and width of the picture.
    settings : HssilSettings
        Radius, first level and number of levels.

    Returns
    -------
    int
        At least 1: the first level has a disc.
    """
    if settings.radius is None:  # chosen so that all reach
        return settings.levels
    for index in range(1, settings.levels):
        height, width = level_shape(shape, settings.first_level + index)
        if settings.radius >= math.hypot(height, width):
            return index
    return settings.levels


def level_shape(shape: tuple[int, int], number: int) -> tuple[int, int]:
    """Return rows and columns of a level.

    Parameters
    ----------
    shape : tuple of 2 ints
        Height and width of the picture.
    number : int
        Level k: texels of 2^k x 2^k pixels.

    Returns
    -------
    tuple of 2 ints
        As many as cover the picture.
    """
    return -(-shape[0] >> number), -(-shape[1] >> number)


@stage("sssil.pyramid")
def levels(
    depth: Array, normal: Array, albedo: Array, direct: Array, projection: Projection, first: int, count: int,
    downsample: str = "closest", as_published: frozenset[str] = frozenset(),
) -> tuple[Level, ...]:
    """Return levels of a picture, the first from its pixels, each further one from that before.

    Parameters
    ----------
    depth : (H, W) ndarray
        Along the view direction, m; inf where no surface is seen.
    normal : (3, H, W) ndarray
        Unit vectors on the side that is seen, world space.
    albedo : (3, H, W) ndarray
        Diffuse reflectance.
    direct : (3, H, W) ndarray
        Direct irradiance, W/m^2.
    projection : Projection
        The camera's map.
    first, count : int
        Number of the first level, and how many.
    downsample : {"closest", "average", "closest_average"}
        How texels become one.
    as_published : frozenset of str
        "hss_tan_f": sample areas with the tangents of Eq. 3 as printed.

    Returns
    -------
    tuple of Level
        Finest first.
    """
    view = view_of(projection, as_published)
    made = [_room(first, (view.height, view.width), depth.dtype)]
    fill_first_level(Picture(depth, normal, albedo, direct), view, made[0])
    for number in range(first + 1, first + count):
        made.append(_room(number, (view.height, view.width), depth.dtype))
        fill_coarser_level(made[-2], view.height, view.width, made[-1])
    return tuple(made)


def _room(number: int, shape: tuple[int, int], dtype: npt.DTypeLike) -> Level:
    h, w = level_shape(shape, number)
    three = (3, h, w)
    return Level(number, plane(three, dtype), plane((h, w), dtype), plane(three, dtype), plane(three, dtype),
                 plane((h, w), dtype), plane((h, w), np.int32))
