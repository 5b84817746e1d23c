"""How much memory screen-space indirect light takes beside what every picture takes: levels, light, further views."""

from refgi.sssil.pyramid.memory import level_bytes
from refgi.sssil.settings import HssilSettings

PACKED_FLOATS = 15  # of a texel of the level that is summed: senders as kernels read them, its light and that below
VIEW_FLOATS = 32  # of a pixel of a further view: its G-buffer, direct and indirect light, and temporaries
RAY_BYTES = 1 << 26  # rays that are held at a time


def extra_bytes(settings: HssilSettings, pixels: int, float_bytes: int) -> int:
    """Estimate the memory that levels and further views add to a picture.

    Parameters
    ----------
    settings : HssilSettings
        First level, number of levels, views.
    pixels : int
        Of the picture.
    float_bytes : int
        4 or 8.

    Returns
    -------
    int
        Bytes, rather too many than too few.
    """
    texels = -(-pixels >> 2 * settings.first_level)
    view = level_bytes(settings, pixels, float_bytes) + PACKED_FLOATS * texels * float_bytes
    further = VIEW_FLOATS * pixels * float_bytes if settings.cameras or settings.views else 0
    return view + further + (RAY_BYTES if settings.visibility == "rays" else 0)
