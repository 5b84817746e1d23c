"""The surface that each texel of a reflective shadow map shows its light: A = O d^2 / cos."""

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange

if TYPE_CHECKING:
    from refgi.rsm import Rsm

Array = npt.NDArray[Any]

LEAST_COSINE = 1e-3  # surfaces seen from the side would be endless


def texel_areas(rsm: "Rsm") -> Array:
    """Return the area of surface behind each texel that reflects anything.

    Parameters
    ----------
    rsm : Rsm
        A map.

    Returns
    -------
    (H, W) ndarray
        m^2, in the map's dtype; 0 where nothing is reflected. A directional light's texels have an area in place of a
        solid angle, and d is 1.
    """
    from refgi.scene import DirectionalLight

    light, areas = rsm.light, np.zeros_like(rsm.solid_angle)
    far = isinstance(light, DirectionalLight)
    source = np.asarray(light.direction if isinstance(light, DirectionalLight) else light.position, np.float64)
    _fill_areas(rsm.position, rsm.normal, rsm.solid_angle, rsm.flux, rsm.lobe_flux, source, far, areas)
    return areas


@kernel(parallel=True)
def _fill_areas(
    position: Array, normal: Array, solid_angle: Array, flux: Array, lobe: Array | None, source: Array, far: bool,
    areas: Array,
) -> None:
    for i in prange(areas.shape[0]):
        for j in range(areas.shape[1]):
            reflected = flux[0, i, j] != 0 or flux[1, i, j] != 0 or flux[2, i, j] != 0
            if lobe is not None:
                reflected = reflected or lobe[0, i, j] != 0 or lobe[1, i, j] != 0 or lobe[2, i, j] != 0
            if reflected:
                square, along = 0.0, 0.0
                for axis in range(3):
                    d = source[axis] - (0.0 if far else float(position[axis, i, j]))
                    square += d * d
                    along += d * normal[axis, i, j]
                cosine = abs(along) / np.sqrt(square) if square > 0.0 else 0.0
                areas[i, j] = solid_angle[i, j] * (1.0 if far else square) / max(cosine, LEAST_COSINE)
