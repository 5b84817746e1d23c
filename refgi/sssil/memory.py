"""Memory estimate of screen-space indirect light beside the picture's buffers: levels, sums, samples, further cameras.

Mip levels of the buffers add a third to them (Sec. 4).
"""

import math

from refgi.method import Extent
from refgi.sssil.crown.pattern import PHASES
from refgi.sssil.crown.reach import chosen_radius
from refgi.sssil.settings import Bitmask, HssilSettings, Rays

FLOATS = 11  # a texel: position, depth, normal, radiance, area
SENDER_FLOATS = 10  # a texel of drawn senders: the same but the depth
PIXEL_BYTES = 4  # and the pixel that it shows
PLANES, LIGHT_FLOATS = 9, 9  # of a texel of the level that is summed: as senders, its light blurred or not, that below
PADDING = 32  # lanes around a row of senders at least, for each of the phases into which columns are split
VIEW_FLOATS = 32  # of a pixel of a further view: its G-buffer, direct and indirect light, and temporaries
RAY_BYTES = 1 << 26  # rays that are held at a time
OFFSET_BYTES, SLICED_BYTES = 16, 32  # of a sample with its weight, and of one in a slice
CANDIDATE_BYTES = 104  # of a texel that may be among all around a receiver
LISTED_RAY_BYTES = 48  # of a sample of one receiver


def level_bytes(settings: HssilSettings, pixels: int, float_bytes: int) -> int:
    """Return the bytes that the levels of one picture take; texels that its edge cuts are counted as their share.

    With n levels from full resolution on it is ``(4 - 4^(1 - n)) / 3`` times the first; from half resolution on, a
    quarter of that. The mean of radiance alone needs the number of its pixels as well; drawn senders are levels of
    their own.

    >>> from refgi.sssil.settings import SamplingSettings
    >>> level_bytes(HssilSettings(SamplingSettings(start="full", levels=1)), 100, 4)
    4800
    """
    sampling, downsample = settings.sampling, settings.senders.downsample
    floats = FLOATS + (downsample == "closest_average")
    numbers = range(sampling.first_level, sampling.first_level + sampling.levels)
    texels = [-(-pixels >> 2 * number) for number in numbers]
    drawn = [count for count, number in zip(texels, numbers, strict=True) if number > 0]  # pixels are their own senders
    senders = sum(drawn) * (SENDER_FLOATS * float_bytes + PIXEL_BYTES) if downsample == "resampled" else 0
    return sum(texels) * (floats * float_bytes + PIXEL_BYTES) + senders


def extra_bytes(settings: HssilSettings, extent: Extent) -> int:
    """Estimate the bytes that levels, samples and further cameras add to a picture, rather too many than too few."""
    size, float_bytes = extent.size, extent.float_bytes
    pixels = size[0] * size[1]
    columns, rows = (-(-side >> settings.sampling.first_level) for side in size)
    radius = chosen_radius((rows, columns), settings.sampling)
    phases = settings.sampling.tile if settings.sampling.pattern == "interleaved" else PHASES
    padded = columns + 2 * min(math.ceil(2 * radius), columns) + PADDING * phases
    view = level_bytes(settings, pixels, float_bytes)
    view += (PLANES * padded * (rows + 1) + LIGHT_FLOATS * columns * rows) * float_bytes
    further = VIEW_FLOATS * pixels * float_bytes if settings.cameras.count or settings.cameras.views else 0
    samples = _sample_bytes(settings, rows, columns, radius)
    return view + further + samples + (RAY_BYTES if isinstance(settings.visibility, Rays) else 0)


def _sample_bytes(settings: HssilSettings, rows: int, columns: int, radius: float) -> int:
    """Return the memory of the first level's list of samples, the longest of all levels'."""
    sampling = settings.sampling
    if sampling.pattern == "all":
        reach = math.ceil(2 * radius)
        candidates = (2 * min(reach, rows) + 1) * (min(reach, columns) + 1)
        rays = 2 * LISTED_RAY_BYTES * candidates if isinstance(settings.visibility, Rays) else 0
        return CANDIDATE_BYTES * candidates + rays
    if sampling.pattern == "pixel":
        return 0
    if sampling.pattern == "fixed":
        rows = 1
    if isinstance(settings.visibility, Bitmask):  # half as many occluders as samples of the crown
        slices = settings.visibility.count(sampling.samples)
        return SLICED_BYTES * rows * (3 * sampling.samples // 2 + sampling.inner + 3 * slices)
    sets = sampling.tile**2 if sampling.pattern == "interleaved" else PHASES * rows
    return OFFSET_BYTES * sets * (sampling.samples + sampling.inner)
