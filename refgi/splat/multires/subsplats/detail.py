"""Surface detail restored ad hoc by <V, N> (Nichols and Wyman 2009, Sec. 4.3, Eq. 3)."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.stages import stage
from refgi.types import Array


@stage("multires.detail")
def surface_detail(
    irradiance: Array, position: Array, normal: Array, covered: Array, eye: npt.ArrayLike, a: float
) -> Array:
    """Darken what faces away from the camera: E (a <V, N> + 1 - a) (AMS Eq. 3).

    irradiance (3, h, w): Indirect irradiance, W/m^2.
    normal (3, h, w): Unit normals on the camera's side.
    eye (3,) or (1, 3): Where the camera is, m.
    a: How much, 0 (nothing changes) to 1; the paper shows 0.5.
    -> (3, h, w): Irradiance, W/m^2; 0 where there is no surface.

    Raises
    ------
    InputError
        If `a` is no share.

    Notes
    -----
    Cosmetic: the factor lies in [1 - a, 1] and so only takes energy away. The paper's c is a colour; the albedo of c is
    a factor here and there, so that the order does not matter. A point at the eye itself keeps its light.
    """
    expect(0 <= a <= 1, "a", "a share from 0 to 1", a)
    result = np.empty_like(irradiance, order="C")
    _modulate(irradiance, position, normal, covered, np.asarray(eye, position.dtype).reshape(3), float(a),
              result)
    return result


@kernel(parallel=True)
def _modulate(
    irradiance: Array, position: Array, normal: Array, covered: Array, eye: Array, a: float, result: Array
) -> None:
    for i in prange(covered.shape[0]):
        _modulate_row(irradiance, position, normal, covered, eye, result.dtype.type(a), i, result)


@kernel
def _modulate_row(
    irradiance: Array, position: Array, normal: Array, covered: Array, eye: Array, a: Any, i: int, result: Array
) -> None:
    real = type(a)
    zero, one = real(0.0), real(1.0)
    for j in range(covered.shape[1]):
        x, y, z = eye[0] - position[0, i, j], eye[1] - position[1, i, j], eye[2] - position[2, i, j]
        square = x * x + y * y + z * z
        along = x * normal[0, i, j] + y * normal[1, i, j] + z * normal[2, i, j]
        cosine = along / math.sqrt(square) if square > zero else one
        # Eq. (3); a cosine may be more than 1 by rounding
        factor = a * min(max(cosine, zero), one) + (one - a)
        for c in range(3):
            result[c, i, j] = irradiance[c, i, j] * (factor if covered[i, j] else zero)
