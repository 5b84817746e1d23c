"""How much memory screen-space indirect light takes beside what every picture takes: levels, light, samples, views."""

import math

from refgi.sssil.pyramid.memory import level_bytes
from refgi.sssil.settings import HssilSettings

PACKED_FLOATS = 33  # of a texel of the level that is summed: senders with darkness around, its light and that below
VIEW_FLOATS = 32  # of a pixel of a further view: its G-buffer, direct and indirect light, and temporaries
RAY_BYTES = 1 << 26  # rays that are held at a time
TALLEST = 4  # as high as wide: taller pictures are rare, and their samples are not counted wholly
OFFSET_BYTES, SLICED_BYTES = 16, 32  # of a sample in an even and an odd column of a row, and of one in a slice
CANDIDATE_BYTES = 104  # of a texel that may be among all around a receiver
LISTED_RAY_BYTES = 48  # of a sample of one receiver


def extra_bytes(settings: HssilSettings, pixels: int, float_bytes: int) -> int:
    """Estimate the memory that levels, samples and further views add to a picture.

    Parameters
    ----------
    settings : HssilSettings
        First level, number of levels, pattern, views.
    pixels : int
        Of the picture.
    float_bytes : int
        4 or 8.

    Returns
    -------
    int
        Bytes, rather too many than too few but for pictures more than four times as high as wide.
    """
    texels = -(-pixels >> 2 * settings.first_level)
    view = level_bytes(settings, pixels, float_bytes) + PACKED_FLOATS * texels * float_bytes
    further = VIEW_FLOATS * pixels * float_bytes if settings.cameras or settings.views else 0
    return view + further + _sample_bytes(settings, texels) + (RAY_BYTES if settings.visibility == "rays" else 0)


def _sample_bytes(settings: HssilSettings, texels: int) -> int:
    """Return what the list of the first level's samples takes, the longest of all levels'."""
    rows = math.ceil(math.sqrt(TALLEST * texels))
    if settings.pattern == "all":
        # of a picture as high as assumed, the diagonal over 2^K
        radius = settings.radius or max(1.0, math.hypot(rows, rows / TALLEST) / 2**settings.levels)
        rays = LISTED_RAY_BYTES * math.pi * (2 * radius) ** 2 if settings.visibility == "rays" else 0
        return int(CANDIDATE_BYTES * (4 * radius + 3) * (2 * radius + 2) + rays)
    if settings.pattern == "pixel":
        return 0
    rows = 1 if settings.pattern == "fixed" else rows
    if settings.visibility == "bitmask":  # half as many blockers as samples of the crown
        return SLICED_BYTES * rows * (3 * settings.samples // 2 + settings.inner + 3 * settings.slice_count)
    return OFFSET_BYTES * rows * (settings.samples + settings.inner)
