"""How much surface a pixel sees: what turns irradiance at pixels into flux on the visible surface."""

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from refgi.rsm import GBuffer
    from refgi.scene import Geometry

Array = npt.NDArray[Any]


def pixel_areas(buffer: "GBuffer", geometry: "Geometry") -> Array:
    """Return the area of surface behind every pixel: solid angle times d^2 / cos.

    Parameters
    ----------
    buffer : GBuffer
        What a camera sees.
    geometry : Geometry
        The triangles that it sees.

    Returns
    -------
    (h, w) ndarray
        Area, m^2, float64; 0 where there is no surface.

    Notes
    -----
    The pixel's solid angle is exact; distance and cosine are those of its centre, so the areas add up to a face's own
    up to the pixels on its edge. The cosine is that of the triangle: a normal interpolated for shading has no area.
    """
    from refgi.rsm.buffers.solid_angle import texel_solid_angles

    areas = np.zeros(buffer.covered.shape)
    seen = buffer.covered
    corners = geometry.vertices[geometry.faces[buffer.triangle_id[seen]]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    view = buffer.position[:, seen].T - buffer.projection.origin[0]
    square = (view**2).sum(axis=1)
    facing = np.abs((normal * view).sum(axis=1))  # |n| d cos
    length = np.sqrt((normal**2).sum(axis=1) * square)
    slant = np.divide(length, facing, out=np.zeros_like(length), where=facing > 0)
    areas[seen] = texel_solid_angles(buffer.projection)[seen] * square * slant
    return areas
