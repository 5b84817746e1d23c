"""What the levels take in memory (Sec. 3.2: mip levels of the buffers add a third to them)."""

from refgi.sssil.settings import HssilSettings

FLOATS = 11  # a texel: position, depth, normal, radiance, area
PIXEL_BYTES = 4  # and the pixel that it shows


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
