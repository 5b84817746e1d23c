"""Sample area: how much surface a pixel shows (Sec. 3.1, Eq. 2).

``ds = z^2 4 tan(f_h / 2) tan(f_v / 2) dP / (W H) cos(alpha) / cos(beta)`` with z the depth, alpha the angle of the
pixel's ray with the view direction and beta that with the surface's normal. For the ray d of length 1 along the view
direction cos(alpha) is ``1 / |d|`` and cos(beta) is ``-n.d / |d|``: their ratio is 1 / -n.d, without a root.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.rsm.memory import plane
from refgi.rsm.raster.projection import Projection
from refgi.sssil.pyramid.view import View, centre, view_of

Array = npt.NDArray[Any]

GRAZING = 1e-6  # least ratio of the cosines: below, it is rounding of a float32 normal


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
