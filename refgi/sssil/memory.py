"""How much memory screen-space indirect light takes beside what every picture takes: levels, light, samples, views.

What the levels take in memory (Sec. 3.2: mip levels of the buffers add a third to them).
"""

import math

from refgi.sssil.crown.reach import chosen_radius
from refgi.sssil.settings import HssilSettings

FLOATS = 11  # a texel: position, depth, normal, radiance, area
PIXEL_BYTES = 4  # and the pixel that it shows
PLANES, LIGHT_FLOATS = 9, 6  # of a texel of the level that is summed: as senders, and its light and that below
PADDING = 64  # lanes around a row of senders at least, twice 16 for even and for odd columns
VIEW_FLOATS = 32  # of a pixel of a further view: its G-buffer, direct and indirect light, and temporaries
RAY_BYTES = 1 << 26  # rays that are held at a time
OFFSET_BYTES, SLICED_BYTES = 16, 32  # of a sample in an even and an odd column of a row, and of one in a slice
CANDIDATE_BYTES = 104  # of a texel that may be among all around a receiver
LISTED_RAY_BYTES = 48  # of a sample of one receiver


def level_bytes(settings: HssilSettings, pixels: int, float_bytes: int) -> int:
    """Return the memory that the levels of one picture take.

    Parameters
    ----------
    settings : HssilSettings
        First level, number of levels, and how texels become one.
    pixels : int
        Of the picture.
    float_bytes : int
        Of one number, 4 or 8.

    Returns
    -------
    int
        Bytes; texels that the picture's edge cuts are counted as their share.

    Notes
    -----
    With n levels from full resolution on it is ``(4 - 4^(1 - n)) / 3`` times the first; from half resolution on, a
    quarter of that. The mean of radiance alone keeps how many pixels it is of.

    Examples
    --------
    >>> level_bytes(HssilSettings(start="full", levels=1), 100, 4)
    4800
    """
    floats = FLOATS + (settings.downsample == "closest_average")
    numbers = range(settings.first_level, settings.first_level + settings.levels)
    return sum(-(-pixels >> 2 * number) for number in numbers) * (floats * float_bytes + PIXEL_BYTES)


def extra_bytes(settings: HssilSettings, size: tuple[int, int], float_bytes: int) -> int:
    """Estimate the memory that levels, samples and further views add to a picture.

    Parameters
    ----------
    settings : HssilSettings
        First level, number of levels, pattern, views.
    size : tuple of 2 ints
        Width and height of the picture, pixels.
    float_bytes : int
        4 or 8.

    Returns
    -------
    int
        Bytes, rather too many than too few.
    """
    pixels = size[0] * size[1]
    columns, rows = (-(-side >> settings.first_level) for side in size)
    radius = chosen_radius((rows, columns), settings)
    padded = columns + 2 * min(math.ceil(2 * radius), columns) + PADDING
    view = level_bytes(settings, pixels, float_bytes)
    view += (PLANES * padded * (rows + 1) + LIGHT_FLOATS * columns * rows) * float_bytes
    further = VIEW_FLOATS * pixels * float_bytes if settings.cameras or settings.views else 0
    samples = _sample_bytes(settings, rows, columns, radius)
    return view + further + samples + (RAY_BYTES if settings.visibility == "rays" else 0)


def _sample_bytes(settings: HssilSettings, rows: int, columns: int, radius: float) -> int:
    """Return what the list of the first level's samples takes, the longest of all levels'."""
    if settings.pattern == "all":
        reach = math.ceil(2 * radius)
        candidates = (2 * min(reach, rows) + 1) * (min(reach, columns) + 1)
        rays = 2 * LISTED_RAY_BYTES * candidates if settings.visibility == "rays" else 0
        return CANDIDATE_BYTES * candidates + rays
    if settings.pattern == "pixel":
        return 0
    rows = 1 if settings.pattern == "fixed" else rows
    if settings.visibility == "bitmask":  # half as many blockers as samples of the crown
        return SLICED_BYTES * rows * (3 * settings.samples // 2 + settings.inner + 3 * settings.slice_count)
    return OFFSET_BYTES * rows * (settings.samples + settings.inner)
