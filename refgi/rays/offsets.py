"""Ray offsets against self-intersection: the error bound of a surface point, in steps of float32.

A ray that starts on a surface must not hit it again. What moves the surface about in float32, with u = 2^-24: the
rounding of the start, u |y|, and that of the triangle test, a few u times the distance from the start to the corners.
No triangle that Embree has is longer than the larger of the scene's grain and the distance of its points from the
coordinates' origin (`cut`), so the lift 4 u (|y|_1 + grain) covers both, whatever lies elsewhere in the scene. A
segment's far end is subject to the rounding of its direction as well, u times its length.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel

Array = npt.NDArray[Any]

STEPS = 4 * 2.0**-24
GRAIN = 8.0  # times the power of 2 above half of the triangles' largest coordinates


def grain_of(vertices: Array, faces: Array) -> float:
    """Return the size of details in a scene as its rays know it: a power of 2 that single triangles do not move.

    `vertices` (n, 3): vertices, m. `faces` (m, 3): vertex indices. Result: length up to which triangles near the
    coordinates' origin stay whole, m.
    """
    if not len(faces):
        return GRAIN
    largest = np.abs(vertices).max(axis=1)[faces].max(axis=1)
    middle = float(np.partition(largest, len(largest) // 2)[len(largest) // 2])
    return GRAIN * 2.0 ** math.ceil(math.log2(max(middle, 1e-30)))


@kernel
def ray_offset(x: Any, y: Any, z: Any, grain: Any) -> Any:
    """Return the offset, m, of a ray's start from the surface at a point, against self-intersection.

    `x, y, z`: the point, m; `grain`: the tracer's, m. Of the type of x.
    """
    return type(x)(STEPS) * (abs(x) + abs(y) + abs(z) + grain)


@kernel
def far_offset(dx: Any, dy: Any, dz: Any) -> Any:
    """Return how much farther off its surface a segment (dx, dy, dz) must end for its length; m, of the type of dx."""
    return type(dx)(STEPS) * (abs(dx) + abs(dy) + abs(dz))
