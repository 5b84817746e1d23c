"""How far the crowns of all levels reach together, and the smallest radius with which they cover the picture.

The crown of level k ends at 2 r texels of that level: r 2^K texels of the first of K levels. A receiver in a corner
needs the diagonal of the picture.
"""

import math
import warnings

from refgi.errors import RefgiWarning
from refgi.sssil.settings import HssilSettings


def chosen_radius(shape: tuple[int, int], settings: HssilSettings) -> float:
    """Return the inner radius of the crowns: that of the settings, else the smallest that covers the picture.

    Parameters
    ----------
    shape : tuple of int
        Rows and columns of the first level.
    settings : HssilSettings
        May name a radius.

    Returns
    -------
    float
        Texels, 1 or more.
    """
    return covering_radius(shape, settings.levels) if settings.radius is None else float(settings.radius)


def covering_radius(shape: tuple[int, int], levels: int) -> float:
    """Return the smallest inner radius with which the crowns cover the picture: its diagonal / 2^K.

    Parameters
    ----------
    shape : tuple of int
        Rows and columns of the first level.
    levels : int
        K.

    Returns
    -------
    float
        Texels, 1 or more.

    Examples
    --------
    >>> covering_radius((300, 400), 4)
    31.25
    """
    return max(1.0, math.hypot(*shape) / float(1 << levels))


def reach(settings: HssilSettings, radius: float) -> float:
    """Return how far the last crown ends from a receiver: r 2^K.

    Parameters
    ----------
    settings : HssilSettings
        Says how many levels there are.
    radius : float
        r, texels.

    Returns
    -------
    float
        Texels of the first level.
    """
    return radius * float(1 << settings.levels)


def expect_reach(shape: tuple[int, int], settings: HssilSettings) -> None:
    """Warn when light from one corner of the picture does not reach the other.

    Parameters
    ----------
    shape : tuple of int
        Rows and columns of the first level.
    settings : HssilSettings
        Say how far it reaches.

    Warns
    -----
    RefgiWarning
        With the reach, the diagonal, and the radius that would do.
    """
    diagonal = math.hypot(*shape)
    far = reach(settings, chosen_radius(shape, settings))
    if far < diagonal:
        warnings.warn(RefgiWarning(
            f"radius: samples reach {far:g} of the first level's diagonal of {diagonal:.0f} texels; "
            f"{math.ceil(covering_radius(shape, settings.levels))} texels cover it, as does none"), stacklevel=2)
