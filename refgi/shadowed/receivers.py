"""The points that rays light: where they lie, which way they face and where their shadow rays start."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.rays import STEPS
from refgi.scene import Geometry

Array = npt.NDArray[Any]

ROUNDED = 2.0**-14  # of a point's coordinates: it is off its face by that at most, or not meant to lie on it


class Receivers(NamedTuple):
    """The points whose irradiance is asked for, without the pixels that see nothing."""

    pixel: Array  # (r,) int64, flat index into the picture
    position: Array  # (3, r) float32, m
    normal: Array  # (3, r) float32: the G-buffer's
    facing: Array  # (3, r) float32: the face's normal on the same side
    origin: Array  # (3, r) float32: where rays start, lifted off the face, m


def receivers(geometry: Geometry, position: Array, normal: Array, triangle_id: Array, grain: float) -> Receivers:
    """Take the covered pixels of a G-buffer, or any choice of them, as receivers.

    Parameters
    ----------
    geometry : Geometry
        The triangles.
    position, normal : (3, h, w) or (3, n) ndarray
        The G-buffer's, world space.
    triangle_id : (h, w) or (n,) int ndarray
        Which triangle each pixel sees; -1 for none.
    grain : float
        The tracer's: rays start above the face by `ray_offset`, m.

    Returns
    -------
    Receivers
        In picture order; `pixel` counts through the given points.
    """
    pixel = np.flatnonzero(triangle_id.reshape(-1) >= 0)
    at = np.ascontiguousarray(position.reshape(3, -1)[:, pixel], np.float64)
    up = np.ascontiguousarray(normal.reshape(3, -1)[:, pixel], np.float64)
    corner = geometry.vertices[geometry.faces[triangle_id.reshape(-1)[pixel]]]
    face = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]).T
    face *= np.where((face * up).sum(axis=0) < 0, -1.0, 1.0) / np.linalg.norm(face, axis=0)
    # what the rasterizer's rounding moved off the face is taken back
    size = np.abs(at).sum(axis=0) + grain
    height = ((at - corner[:, 0].T) * face).sum(axis=0)
    lift = STEPS * size - np.where(np.abs(height) < ROUNDED * size, height, 0)
    return Receivers(pixel, *(np.ascontiguousarray(a, np.float32) for a in (at, up, face, at + lift * face)))
