"""Pixels that the camera's motion brings into the picture (Sec. 3.3): light of the edge, less the faster it moves.

"New pixels revealed by camera panning and rotations, that weren't on the screen in the previous frame, also have an a
depending on the camera speed, to smoothly blend illumination values." The light they blend with, which the paper does
not name, is that of the texel at the edge of the earlier picture nearest to where their point would have been in it.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.elementary import exp2
from refgi.jit import kernel, prange
from refgi.rsm.pool import plane
from refgi.scene.values import Vector
from refgi.sssil.reprojection import SourceView, pixel_transform

Array = npt.NDArray[Any]


def fetch_entering(
    values: Array, source: SourceView, position: Array, covered: Array, weight: Array, origin: Vector, speed: float,
    reprojected: Array,
) -> Array:
    """Fetch the light at the edge of the earlier picture for pixels whose points lay outside it.

    The first three planes of `values` (3 or 4, h, w) are the earlier light, W/m^2; those of `reprojected` (3 or 4, h',
    w') are filled where a point entered. `position` (3, h', w'): where each point was then, m from `origin`; `weight`
    (h', w'): 0 where reprojection found no light; `speed`: at which the share falls to 1 / e, pixels a frame.
    Returns exp(-v / speed), (h', w'), of pixels that entered, whose point moved across the picture by v pixels; 0 of
    others, and of those where the edge shows no surface.
    """
    share = plane(covered.shape, reprojected.dtype)
    eye, frame, scale = pixel_transform(source, reprojected.dtype, origin)
    _fetch_entering(values, source.depth, eye, frame, scale, position, covered, weight,
                    reprojected.dtype.type(-math.log2(math.e) / speed), reprojected, share)
    return share


@kernel(parallel=True)
def _fetch_entering(
    values: Array, depth: Array, eye: Array, frame: Array, scale: Array, position: Array, covered: Array, weight: Array,
    falloff: Any, reprojected: Array, share: Array,
) -> None:
    for row in prange(covered.shape[0]):
        _fetch_row(row, values, depth, eye, frame, scale, position, covered, weight, falloff, reprojected, share)


@kernel
def _fetch_row(
    row: Any, values: Array, depth: Array, eye: Array, frame: Array, scale: Array, position: Array, covered: Array,
    weight: Array, falloff: Any, reprojected: Array, share: Array,
) -> None:
    real = share.dtype.type
    height, width, half = depth.shape[0], depth.shape[1], real(0.5)
    for column in range(share.shape[1]):
        share[row, column] = real(0)
        if weight[row, column] > real(0) or not covered[row, column]:
            continue
        dx = position[0, row, column] - eye[0]
        dy = position[1, row, column] - eye[1]
        dz = position[2, row, column] - eye[2]
        ahead = frame[2, 0] * dx + frame[2, 1] * dy + frame[2, 2] * dz
        if not ahead > real(0):
            continue
        x = (frame[0, 0] * dx + frame[0, 1] * dy + frame[0, 2] * dz) / ahead * scale[0] + scale[2]
        y = (frame[1, 0] * dx + frame[1, 1] * dy + frame[1, 2] * dz) / ahead * scale[1] + scale[3]
        if -half <= x <= real(width) - half and -half <= y <= real(height) - half:
            continue  # it was hidden, not outside
        j = int(np.rint(min(max(x, real(0)), real(width - 1))))
        i = int(np.rint(min(max(y, real(0)), real(height - 1))))
        if not depth[i, j] < np.inf:
            continue
        across, down = x - real(column), y - real(row)
        share[row, column] = exp2(math.sqrt(across * across + down * down) * falloff)
        for channel in range(3):
            reprojected[channel, row, column] = values[channel, i, j]
