"""Where in the reflective shadow map a pixel's disc of texels lies."""

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from refgi.rsm import Rsm

Array = npt.NDArray[Any]


def centers(rsm: "Rsm", points: Array) -> Array:
    """Return where in the map each point gathers: at its own place, or from outside at the nearest place towards it.

    Parameters
    ----------
    rsm : Rsm
        The map.
    points : (3, n) ndarray
        World space, m.

    Returns
    -------
    (2, n) ndarray of float64
        Row and column, continuous, on the stacked maps.
    """
    row, column, _ = rsm.project(points)
    center = np.stack([row, column]).astype(np.float64)
    outside = np.isnan(center[0])
    if outside.any():
        from refgi.rsm.raster.projection import ORTHOGRAPHIC

        maps = rsm.projection
        right, down, ahead = maps.frame[0] @ (points[:, outside] - maps.origin[0][:, None])
        plane = np.stack([down / maps.half[1], right / maps.half[0]])
        if maps.kind != ORTHOGRAPHIC:
            plane /= np.where(ahead > 0, ahead, 1e-30)  # behind the light: as far out as can be
        plane /= np.maximum(np.abs(plane).max(axis=0), 1)
        center[:, outside] = (plane + 1) / 2 * np.array([[maps.height], [maps.width]])
    return center
