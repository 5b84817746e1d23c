"""Memory estimate of clustered visibility: its shadow maps, and these filtered."""

import numba

from refgi.cluster.adaptive import MOST_TEXELS, WITHOUT_MAPS
from refgi.cluster.filters.eight import EIGHT
from refgi.cluster.settings import ValSettings
from refgi.lights.settings import MapLights

LISTED_FLOATS = 24  # of a pixel, where receivers are gathered by lists: measured, and a fifth more


def extra_bytes(settings: ValSettings, size: tuple[int, int], float_bytes: int) -> int:
    """Estimate the memory that area lights add to a picture.

    Parameters
    ----------
    settings : ValSettings
        How many area lights, and what their maps are.
    size : tuple of 2 ints
        Width and height of the picture, pixels.
    float_bytes : int
        4 or 8.

    Returns
    -------
    int
        Bytes, rather too many than too few.
    """
    texels, count = settings.map_resolution**2, _maps(settings)
    sides = 2 if settings.behind == "dual_paraboloid" else 1
    depth = 2 * count * sides * texels * float_bytes  # twice: maps on which there is nothing are dropped by a copy
    series = settings.visibility == "csm"
    at_once = min(count, numba.get_num_threads() + 1) if series else 0  # one of them is read from
    filtered = at_once * texels * _filtered_bytes(settings, float_bytes)
    return depth + filtered + size[0] * size[1] * LISTED_FLOATS * float_bytes


def _maps(settings: ValSettings) -> int:
    """Return the most maps there may be."""
    if settings.visibility in WITHOUT_MAPS:
        return 0
    texels = settings.map_resolution**2
    asked = settings.area_lights if settings.target_error is None else max(1, MOST_TEXELS // texels)
    source = settings.lights.source
    if isinstance(source, MapLights):
        return asked if source.pattern == "all" else min(asked, settings.lights.count)
    return min(asked, settings.lights.count * source.bounces)


def _filtered_bytes(settings: ValSettings, float_bytes: int) -> int:
    """Return what one filtered map takes for each of its texels."""
    channels = 4 * settings.terms + 2  # basis, basis-z, mean depth, and the depth itself
    if settings.prefilter == "brute":
        return channels * float_bytes
    basis = -(-2 * settings.terms // EIGHT) * EIGHT
    above = 2 * basis + 3  # basis, basis-z, mean, least and most depth: a third of the texels lies above the map's own
    return (1 + above // 3) * float_bytes
