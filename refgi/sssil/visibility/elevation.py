"""Elevation of samples above a receiver's plane, in 32 sectors, for visibility by a bitmask (Therrien et al. 2023).

Front and back of the surface at a sample lie in the plane of the eye, the receiver and the sample. Their elevation
there counts in sectors from the receiver's horizon on the sample's side over its normal to the other horizon. Sectors
are steps of ::

    q(a, b) = a / (a + |b|), 2 - that where b < 0, 0 where a < 0

for a direction with a along the normal and b along the horizon: they have 0.64 to 1.27 of equal angles, and need no
arctangent. The visibility of a sample is that of the two sectors whose middles are next to it, interpolated; and 1
where it is as high as all before it, which keeps receding surfaces from occluding themselves.

Symbols: d vector from receiver to sample (m), c = n . d, l distance of the receiver from the eye (m).
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.sssil.crown.add import LEAST

Array = npt.NDArray[Any]

SECTORS = 32
# planes of a packed level; 1 / l, l, and the cosine of the direction to the eye against the normal
X, N, L, AREA, INVERSE, LENGTH, FACING, PLANES = 0, 3, 6, 9, 10, 11, 12, 13


@kernel(parallel=True)
def pack(
    position: Array, normal: Array, radiance: Array, area: Array, scale: Any, phases: int, packed: Array
) -> None:
    """Write the planes of a level row by row, columns by their phase; `INVERSE` is 0 where there is no surface."""
    zero, one, over_pi = scale - scale, scale / scale, scale * scale / type(scale)(math.pi)
    lanes = packed.shape[2] // phases
    for row in prange(area.shape[0]):
        for column in range(area.shape[1]):
            square, along, at = zero, zero, column % phases * lanes + column // phases
            for c in range(3):
                packed[row, X + c, at] = position[c, row, column] * scale
                packed[row, N + c, at] = normal[c, row, column]
                packed[row, L + c, at] = radiance[c, row, column]
                square += packed[row, X + c, at] * packed[row, X + c, at]
                along -= packed[row, X + c, at] * normal[c, row, column]
            packed[row, AREA, at] = area[row, column] * over_pi
            length = math.sqrt(square)
            packed[row, LENGTH, at] = length
            packed[row, INVERSE, at] = one / length if square > zero else zero
            packed[row, FACING, at] = along * packed[row, INVERSE, at]


@kernel
def direction(receiver: Array, p: Any, sender: Array, q: Any) -> Any:
    """Return d and n . d of a receiver and a sample."""
    dx = sender[X, q] - receiver[X, p]
    dy = sender[X + 1, q] - receiver[X + 1, p]
    dz = sender[X + 2, q] - receiver[X + 2, p]
    return dx, dy, dz, receiver[N, p] * dx + receiver[N + 1, p] * dy + receiver[N + 2, p] * dz


@kernel
def heights(receiver: Array, p: Any, sender: Array, q: Any, dx: Any, dy: Any, dz: Any, c: Any,
             thickness: Any) -> Any:
    """Return q of a sample's front and back, 0 to 2; both 0 where there is no surface."""
    zero = type(dx)(0.0)
    toward = receiver[X, p] * dx + receiver[X + 1, p] * dy + receiver[X + 2, p] * dz
    x = -toward * receiver[INVERSE, p]  # along the receiver's direction to the eye
    # |p x d| and not the root of d^2 - x^2, of which nothing is left where one of both is near the eye
    ax = receiver[X + 1, p] * dz - receiver[X + 2, p] * dy
    ay = receiver[X + 2, p] * dx - receiver[X, p] * dz
    az = receiver[X, p] * dy - receiver[X + 1, p] * dx
    y = math.sqrt(ax * ax + ay * ay + az * az) * receiver[INVERSE, p]
    # the back lies on the sample's ray from the eye: further by a share of all that grows along it
    share, length, facing = thickness * sender[INVERSE, q], receiver[LENGTH, p], receiver[FACING, p]
    front = _height(x, y, c, facing)
    back = _height(x + share * (x - length), y + share * y, c + share * (c - facing * length), facing)
    covered = sender[INVERSE, q] > zero
    return front if covered else zero, back if covered else zero


@kernel
def _height(x: Any, y: Any, c: Any, facing: Any) -> Any:
    """Return q of a direction with x to the eye, y across and c along the normal."""
    real = type(x)
    zero, least = real(0.0), real(LEAST)
    a = (c if c > zero else zero) * y
    b = facing * (x * x + y * y) - c * x  # both times y and the length of the normal within the slice
    below = a + abs(b)
    part = a / (below if below > least else least)
    beyond = (b < zero) & (a > zero)
    return real(2.0) - part if beyond else part


@kernel
def visibility(height: Any, highest: Any, mask: Any) -> Any:
    """Return the visibility of a sample, 0 to 1."""
    real, last = type(height), np.int32(SECTORS - 1)
    one = real(1.0)
    place = height * real(SECTORS // 2) + real(0.5)
    upper = np.int32(place)  # its middle is above the sample, that of the sector before it below
    share = place - real(upper)
    high, low = np.uint32(min(upper, last)), np.uint32(min(max(np.int32(upper - 1), np.int32(0)), last))
    bit_high, bit_low = np.uint32(mask >> high) & np.uint32(1), np.uint32(mask >> low) & np.uint32(1)
    free = one - (share * real(bit_high) + (one - share) * real(bit_low))
    return one if height >= highest else free


@kernel
def sector_mask(back: Any, front: Any) -> Any:
    """Return the sectors whose middles lie between the heights of back and front."""
    real = type(front)
    half, sectors = real(0.5), real(SECTORS // 2)
    return np.uint32(_bits_below(np.int32(front * sectors + half)) & ~_bits_below(np.int32(back * sectors + half)))


@kernel
def _bits_below(sector: Any) -> Any:
    """Return the bits of all sectors before one, 0 to 32 or more."""
    last = min(sector, np.int32(SECTORS))
    half = np.uint32(last >> 1) & np.uint32(31)  # no shift reaches 32 bits, which processors disagree about
    rest = np.uint32(np.uint32(last) - half) & np.uint32(31)
    return np.uint32(np.uint32(np.uint32(np.uint32(1) << half) << rest) - np.uint32(1))
