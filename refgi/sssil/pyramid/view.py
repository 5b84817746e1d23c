"""Rays through the centres of pixels, as the levels' kernels follow them."""

import math
from typing import Any, NamedTuple

import numpy.typing as npt

from refgi.errors import expect
from refgi.jit import kernel
from refgi.rsm.raster.projection import Projection

Array = npt.NDArray[Any]

ROUNDING = 1e-12  # of a tangent: 90 degrees in radians are not quite 90 degrees


class View(NamedTuple):
    """A camera's picture of `height` x `width` pixels; vectors along the axes of the world.

    The ray through a point of the picture at (x, y) in [-1, 1]^2 is ``ahead + x across + y down``; its length along
    the view direction is 1, so that depth times ray is the point that is seen, from the eye.
    """

    height: int
    width: int
    across: Array  # (3,) float64: half the picture's width at depth 1, to the right
    down: Array  # (3,) float64: half its height
    ahead: Array  # (3,) float64 unit vector
    pixel_area: float  # of a pixel at depth 1, on a plane parallel to the picture


def view_of(projection: Projection, as_published: frozenset[str] = frozenset()) -> View:
    """Return the rays of a camera.

    Parameters
    ----------
    projection : Projection
        One perspective map.
    as_published : frozenset of str
        "hss_tan_f": fields of view as Eq. 3 prints them.

    Returns
    -------
    View
        What kernels need to know of it.

    Raises
    ------
    InputError
        If "hss_tan_f" meets a field of view of 90 degrees or more, whose tangent is not positive.

    Notes
    -----
    Eq. 2 has 4 tan(f_h / 2) tan(f_v / 2) / (W H); Eq. 3 prints 4 tan f_h tan f_v / (W H), 9 times as much at 60
    degrees.
    """
    right, down, ahead = projection.frame[0]
    horizontal, vertical = (float(half) for half in projection.half)
    tangents = horizontal * vertical
    if "hss_tan_f" in as_published:
        for half in (horizontal, vertical):
            degrees = math.degrees(2 * math.atan(half))
            expect(half < 1.0 - ROUNDING, "as_published 'hss_tan_f'", "a field of view of less than 90 degrees",
                   f"{degrees:.5g}")
        # tan f = 2 t / (1 - t^2) with t = tan(f / 2)
        tangents *= 4 / ((1 - horizontal * horizontal) * (1 - vertical * vertical))
    pixel_area = 4 * tangents / (projection.width * projection.height)
    return View(projection.height, projection.width, right * horizontal, down * vertical, ahead, pixel_area)


@kernel
def centre(index: int, count: int) -> float:
    """Return where the centre of a pixel lies between the picture's edges, -1 to 1.

    Parameters
    ----------
    index : int
        Column or row.
    count : int
        How many there are.

    Returns
    -------
    float
        Exactly the negative of the mirrored pixel's.
    """
    return float((2 * index + 1 - count) / count)
