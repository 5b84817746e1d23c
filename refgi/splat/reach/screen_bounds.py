"""Bounds on the screen: the rectangle around a light's ball, and pixels that a bound's drawing covers (SII Sec. 3.2).

The paper's first bound is a quadrilateral in screen space. Here it is the exact rectangle of the ball of radius R_0
around the light: the tangents from the eye, horizontally and vertically.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.pairs.ranged_sum import LANES

if TYPE_CHECKING:
    from refgi.rsm import Projection

Array = npt.NDArray[Any]

SLACK = 0.01  # pixels that a receiver may be away from its pixel's centre


def screen_quads(projection: "Projection", position: Array, radius: Array) -> Array:
    """Return the rectangles of pixels that see into balls.

    Parameters
    ----------
    projection : Projection
        One perspective map.
    position : (3, N) ndarray
        Centres, m.
    radius : (N,) ndarray
        Radii, m.

    Returns
    -------
    (4, N) ndarray of float64
        Top, bottom, left and right in texel coordinates (centres at + 1/2), infinite where the eye is inside the ball;
        top > bottom for a ball behind the eye.

    Raises
    ------
    InputError
        If the map is no single perspective one.
    """
    from refgi.rsm.raster.projection import PERSPECTIVE

    expect(projection.kind == PERSPECTIVE and projection.maps == 1, "projection", "one perspective map",
           f"kind {projection.kind}, {projection.maps} maps")
    right, down, ahead = projection.frame[0] @ (position - projection.origin[0][:, None])
    quads = []
    for across, half, size in ((down, projection.half[1], projection.height),
                               (right, projection.half[0], projection.width)):
        low, high = _tangents(across, ahead, radius)
        quads += [(low / half + 1) * 0.5 * size, (high / half + 1) * 0.5 * size]
    return np.stack(quads)


def _tangents(across: Array, ahead: Array, radius: Array) -> tuple[Array, Array]:
    """Return the slopes between which a circle is seen; low > high when it lies behind the eye."""
    distance = np.hypot(across, ahead)
    outside = distance > radius
    angle = np.arctan2(across, ahead)
    half = np.arcsin(np.minimum(1, radius / np.maximum(distance, np.finfo(np.float64).tiny)))
    low, high = angle - half, angle + half
    straight = np.pi / 2
    unseen = outside & ((low >= straight) | (high <= -straight))
    with np.errstate(invalid="ignore"):
        left = np.where(outside & (low > -straight), np.tan(np.clip(low, -straight, straight)), -np.inf)
        right = np.where(outside & (high < straight), np.tan(np.clip(high, -straight, straight)), np.inf)
    return np.where(unseen, np.inf, left), np.where(unseen, -np.inf, right)


def tiles_of_quads(quads: Array, places: Array, width: int) -> Array:
    """Tell which tiles of receivers have pixels in which rectangles.

    Parameters
    ----------
    quads : (4, N) ndarray
        Rectangles.
    places : (n,) ndarray of int64
        Flat indices of the receivers' pixels, tile after tile.
    width : int
        Of the picture.

    Returns
    -------
    (ceil(n / LANES), N) ndarray of bool
        Whether the rectangle around a tile's pixels meets the light's.
    """
    starts = np.arange(0, len(places), LANES)
    (top, bottom), (left, right) = ((np.minimum.reduceat(part, starts)[:, None] + 0.5 - SLACK,
                                     np.maximum.reduceat(part, starts)[:, None] + 0.5 + SLACK)
                                    for part in np.divmod(places, width))
    meet: Array = (quads[0] <= bottom) & (quads[1] >= top) & (quads[2] <= right) & (quads[3] >= left)
    return meet


def tiles_of_pixels(mask: Array, places: Array) -> Array:
    """Tell which tiles of receivers have pixels in a mask.

    Parameters
    ----------
    mask : (h, w) ndarray of bool
        Pixels.
    places : (n,) ndarray of int64
        Flat indices of the receivers' pixels, tile after tile.

    Returns
    -------
    (ceil(n / LANES),) ndarray of bool
        Whether any is.
    """
    tiles: Array = np.logical_or.reduceat(mask.reshape(-1)[places], np.arange(0, len(places), LANES))
    return tiles
