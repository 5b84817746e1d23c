"""Rays through the centres of pixels, as the levels' kernels follow them.

Sample area: how much surface a pixel shows (Sec. 3.1, Eq. 2).

``ds = z^2 4 tan(f_h / 2) tan(f_v / 2) dP / (W H) cos(alpha) / cos(beta)`` with z the depth, alpha the angle of the
pixel's ray with the view direction and beta that with the surface's normal. For the ray d of length 1 along the view
direction cos(alpha) is ``1 / |d|`` and cos(beta) is ``-n.d / |d|``: their ratio is 1 / -n.d, without a root.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.rsm.memory import plane
from refgi.rsm.raster.projection import Projection

Array = npt.NDArray[Any]

ROUNDING = 1e-12  # of a tangent: 90 degrees in radians are not quite 90 degrees
GRAZING = 1e-6  # least ratio of the cosines: below, it is rounding of a float32 normal


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


def sample_area(
    depth: Array, normal: Array, projection: Projection, as_published: frozenset[str] = frozenset()
) -> Array:
    """Return the surface that each pixel shows, ``ds`` of Eq. 2 with ``dP = 1``.

    Parameters
    ----------
    depth : (h, w) ndarray
        Along the view direction, m; inf where no surface is seen.
    normal : (3, h, w) ndarray
        Unit vectors, world space.
    projection : Projection
        The camera's map.
    as_published : frozenset of str
        "hss_tan_f": the tangents of Eq. 3 as printed.

    Returns
    -------
    (h, w) ndarray
        m^2, in the dtype of `depth`. 0 where no surface is seen or the normal does not face the eye.

    Raises
    ------
    InputError
        If shapes do not fit, or "hss_tan_f" meets a field of view of 90 degrees or more.

    Notes
    -----
    The paper lets beta be the angle at the "receiving" surface; it is that of the sample's own. At silhouettes
    cos(beta) goes to 0 and the area has no bound: a ratio under a millionth, which is rounding, counts as a millionth.
    """
    shape = (projection.height, projection.width)
    expect(depth.shape == shape, "depth", f"shape {shape}", depth.shape)
    expect(normal.shape == (3, *shape), "normal", f"shape {(3, *shape)}", normal.shape)
    area = plane(shape, depth.dtype)
    _fill(np.ascontiguousarray(depth), np.ascontiguousarray(normal, depth.dtype), view_of(projection, as_published),
          area)
    return area


@kernel
def pixel_surface(depth: float, facing: float, pixel_area: float) -> float:
    """Return ``ds`` of Eq. 2 for one pixel.

    Parameters
    ----------
    depth : float
        Along the view direction, m; inf where no surface is seen.
    facing : float
        ``cos(beta) / cos(alpha)``: -n.d for the ray d of length 1 along the view direction.
    pixel_area : float
        Of the pixel at depth 1.

    Returns
    -------
    float
        m^2; 0 where no surface is seen or it does not face the eye.
    """
    seen = (depth < np.inf) & (facing > 0.0)
    z = depth if seen else 0.0
    return float(z * z * pixel_area / max(facing, GRAZING))  # Eq. 2


@kernel(parallel=True)
def _fill(depth: Array, normal: Array, view: View, area: Array) -> None:
    for row in prange(depth.shape[0]):
        _fill_row(depth, normal, view, row, area)


@kernel
def _fill_row(depth: Array, normal: Array, view: View, row: int, area: Array) -> None:
    y = centre(row, view.height)
    dx, dy, dz = (view.ahead[0] + y * view.down[0], view.ahead[1] + y * view.down[1], view.ahead[2] + y * view.down[2])
    ax, ay, az = view.across[0], view.across[1], view.across[2]
    for c in range(view.width):
        x = centre(c, view.width)
        facing = -(normal[0, row, c] * (dx + x * ax) + normal[1, row, c] * (dy + x * ay)
                   + normal[2, row, c] * (dz + x * az))
        area[row, c] = pixel_surface(float(depth[row, c]), facing, view.pixel_area)
