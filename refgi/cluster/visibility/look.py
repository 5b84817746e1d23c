"""Where a receiver looks for blockers of an area light (Sec. 4.1, 4.2): the rows and numbers all passes share.

Receivers are the SIMD lanes. The rows of a tile's room hold what one pass leaves to the next.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.cluster.filters.depth_scale import DepthScale, depth_scale
from refgi.cluster.maps.shadow_maps import BACKWARD, ShadowMaps
from refgi.cluster.settings import ValSettings
from refgi.cluster.visibility.kernel_size import (
    cone_tangent,
    disc,
    published_square,
    solid_angle_tangent,
)
from refgi.cluster.visibility.series import series
from refgi.jit import kernel

Array = npt.NDArray[Any]

# rows of the room
X, Y, Z, D, EXTENT = 0, 1, 2, 3, 4  # receiver in the map's frame, its distance, the light's size towards it; m
S, T, RADIUS = 5, 6, 7  # where it looks, in [-1, 1] units
SINE, COSINE, STEP_SINE, STEP_COSINE = 8, 9, 10, 11  # of c_k d' for the current k, of 2 pi d'
SHADE, DEPTH = 12, 13  # sums over k; the latter becomes z_avg, m
ON_SERIES = 14  # t(d), the receiver's distance on the series' scale
ROOM_ROWS = 15
# places in the numbers of an area light
CENTER, FRAME, DELTA, NEAREST, SEARCH_BIAS, BIAS, GAIN = 0, 3, 12, 13, 14, 15, 16
NUMBERS = 17


class Choices(NamedTuple):
    """How filters are sized."""

    alpha: bool  # the printed angle of the penumbra
    alpha_over_pi: bool  # squares of side alpha / pi
    solid_angle: bool  # the search of blockers half-way
    foreshortened: bool  # the light's size as the receiver sees it


def choices(settings: ValSettings) -> Choices:
    """Return how settings size filters.

    Parameters
    ----------
    settings : ValSettings
        Its switches `as_published` and `foreshortened` count.

    Returns
    -------
    Choices
        One flag each.
    """
    published = settings.as_published
    return Choices("val_alpha" in published, "val_alpha_over_pi" in published,
                   "val_search_solid_angle" in published, settings.foreshortened)


def numbers_of(maps: ShadowMaps, k: int, delta: float, settings: ValSettings, behind: bool = False) -> Array:
    """Return what the kernels need to know of one area light and its map.

    Parameters
    ----------
    maps : ShadowMaps
        The maps.
    k : int
        Which one.
    delta : float
        Size of its area light, m.
    settings : ValSettings
        Series and bias.
    behind : bool
        Of the map of the hemisphere behind.

    Returns
    -------
    (NUMBERS,) ndarray
        In the dtype of the maps; see the places named above.
    """
    chain, numbers = series(settings), np.zeros(NUMBERS, maps.depth.dtype)
    near = maps.near if maps.near_behind is None or not behind else maps.near_behind
    numbers[CENTER : CENTER + 3] = maps.center[k]
    numbers[FRAME : FRAME + 9] = (BACKWARD @ maps.frame[k] if behind else maps.frame[k]).ravel()
    numbers[DELTA], numbers[NEAREST] = delta, near[k]
    numbers[SEARCH_BIAS], numbers[BIAS], numbers[GAIN] = chain.search_bias, chain.bias, chain.gain
    return numbers


def scale_of(maps: ShadowMaps, k: int, settings: ValSettings, behind: bool = False) -> DepthScale:
    """Return the scale on which depths of one map are compared.

    Parameters
    ----------
    maps : ShadowMaps
        The maps.
    k : int
        Which one; it holds something.
    settings : ValSettings
        Series and `depth_scale`.
    behind : bool
        Of the map of the hemisphere behind.

    Returns
    -------
    DepthScale
        From metres to the series' scale.
    """
    near, far = (maps.near_behind, maps.far_behind) if behind else (maps.near, maps.far)
    assert near is not None
    assert far is not None
    chain = series(settings)
    return depth_scale(settings.depth_scale, float(near[k]), float(far[k]), float(maps.scene_far[k]), chain.range)


@kernel
def look(
    numbers: Array, choices: Choices, points: Array, size: int, wanted: Array, todo: Array, visible: Array, room: Array
) -> int:
    """Find where each receiver looks for blockers.

    Parameters
    ----------
    numbers : (NUMBERS,) ndarray
        The area light.
    choices : Choices
        How filters are sized.
    points : (>= 3, >= size) ndarray
        Receivers, world space, m.
    size : int
        How many.
    wanted : (>= size,) ndarray of bool
        Which of them.
    todo : (>= size,) ndarray of bool
        Filled: which may be shadowed at all.
    visible : (>= size,) ndarray
        Filled with 1.
    room : (ROOM_ROWS, >= size) ndarray
        Filled in rows X to RADIUS.

    Returns
    -------
    int
        How many may be shadowed.

    Notes
    -----
    Receivers behind the area light's plane see it whole (Sec. 5.1), those nearer than the nearest depth as well.
    """
    real = points.dtype.type
    zero, one, near, delta = real(0.0), real(1.0), numbers[NEAREST], numbers[DELTA]
    cx, cy, cz = numbers[CENTER], numbers[CENTER + 1], numbers[CENTER + 2]
    rx, ry, rz = numbers[FRAME], numbers[FRAME + 1], numbers[FRAME + 2]
    dx, dy, dz = numbers[FRAME + 3], numbers[FRAME + 4], numbers[FRAME + 5]
    fx, fy, fz = numbers[FRAME + 6], numbers[FRAME + 7], numbers[FRAME + 8]
    for i in range(size):
        px, py, pz = points[0, i] - cx, points[1, i] - cy, points[2, i] - cz
        d = math.sqrt(px * px + py * py + pz * pz)
        x, y, z = px * rx + py * ry + pz * rz, px * dx + py * dy + pz * dz, px * fx + py * fy + pz * fz
        ahead = wanted[i] & (z > zero) & (d > near)
        todo[i] = ahead
        visible[i] = one
        d = d if ahead else one
        z = z if ahead else one
        extent = delta * math.sqrt(z / d) if choices.foreshortened else delta
        room[X, i], room[Y, i], room[Z, i], room[D, i], room[EXTENT, i] = x, y, z, d, extent
        room[RADIUS, i] = solid_angle_tangent(extent, d) if choices.solid_angle else cone_tangent(extent, d, near)
    place_filters(choices.alpha_over_pi, size, room)
    return count_of(todo, size)


@kernel
def place_filters(squares: bool, size: int, room: Array) -> None:
    """Turn the tangents of cones into places and radii on the map.

    Parameters
    ----------
    squares : bool
        Squares of side alpha / pi instead of discs.
    size : int
        How many receivers.
    room : (ROOM_ROWS, >= size) ndarray
        Receivers, and tangents in row RADIUS; filled in rows S to RADIUS.
    """
    if squares:
        for i in range(size):
            where = published_square(room[X, i], room[Y, i], room[Z, i], room[D, i], room[RADIUS, i])
            room[S, i], room[T, i], room[RADIUS, i] = where
    else:
        for i in range(size):  # without a call of the library of C, these are SIMD lanes
            where = disc(room[X, i], room[Y, i], room[Z, i], room[D, i], room[RADIUS, i])
            room[S, i], room[T, i], room[RADIUS, i] = where


@kernel
def count_of(flags: Array, size: int) -> int:
    """Count what is true.

    Parameters
    ----------
    flags : (>= size,) ndarray of bool
        What to count.
    size : int
        Of the first this many.

    Returns
    -------
    int
        How many.
    """
    count = 0
    for i in range(size):
        count += 1 if flags[i] else 0
    return count
