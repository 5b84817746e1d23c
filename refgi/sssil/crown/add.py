"""Two samples added to a tile of receivers: the innermost loop (Sec. 3.1, Eq. 3 and 4).

Receivers of a row are the SIMD lanes. Their tile is one array in which all distances are known to the compiler, so
that few checks for overlap are left to every call.

Symbols: d vector from receiver to sample, m = -n_j ds_j / pi of the sample, c = max(0, n . d), s = max(0, m . d),
g = c s / (r^4 + s r) for Eq. 4, c s / r^4 for Eq. 3: with |d| = r, what radiance is multiplied by, without pi.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel

Array = npt.NDArray[Any]

WIDE = 320  # lanes of a tile
ROWS = 12  # position, normal, sum of a group of samples, sum of all
LEAST = 1e-37  # stands in for a denominator of 0, where the numerator is 0 as well

X, Y, Z, NX, NY, NZ, R, G, B = (np.uint64(k * WIDE) for k in range(9))


@kernel
def term(px: Any, py: Any, pz: Any, nx: Any, ny: Any, nz: Any, qx: Any, qy: Any, qz: Any, mx: Any, my: Any, mz: Any,
         weight: Any, disc: bool) -> Any:
    """Return g of one receiver and one sample.

    Parameters
    ----------
    px, py, pz, nx, ny, nz : float
        Position and normal of the receiver.
    qx, qy, qz, mx, my, mz : float
        Position of the sample, and its reversed normal times area / pi of its texel.
    weight : float
        Texels that the sample stands for.
    disc : bool
        Eq. 4 instead of Eq. 3.

    Returns
    -------
    float
        g; 0 where either faces away and where both are at the same place.
    """
    real = type(px)
    zero, least = real(0.0), real(LEAST)
    dx, dy, dz = qx - px, qy - py, qz - pz
    square = dx * dx + dy * dy + dz * dz
    c = nx * dx + ny * dy + nz * dz
    s = mx * dx + my * dy + mz * dz
    c = c if c > zero else zero
    s = (s if s > zero else zero) * weight
    below = square * square
    if disc:
        below = below + s * math.sqrt(square)
    return c * s / (below if below > least else least)


@kernel
def add_two(
    tile: Array, low: int, lanes: int, packed: Array, step: int, first: int, first_weight: Any, second: int,
    second_weight: Any, disc: bool,
) -> None:
    """Add what two samples send to each receiver of a tile; the two are added to each other first.

    Parameters
    ----------
    tile : (ROWS * WIDE,) ndarray
        Receivers and their sums.
    low : int
        The first receiver that is lit.
    lanes : int
        How many of them are, from there on.
    packed : (n,) ndarray
        Texels, plane by plane; those of neighbouring receivers' samples are neighbours.
    step : int
        Elements from plane to plane.
    first : int
        Where the first sample of the first receiver is in the first plane.
    first_weight : float
        Texels that it stands for.
    second : int
        Likewise the second.
    second_weight : float
        Texels that it stands for.
    disc : bool
        Eq. 4 instead of Eq. 3.
    """
    tile = tile[low:]
    # unsigned: no checks for places counted from the end
    by, a, b = np.uint64(step), np.uint64(first + low), np.uint64(second + low)
    a1, a2, a3, a4 = a + by, a + by * np.uint64(2), a + by * np.uint64(3), a + by * np.uint64(4)
    a5, a6, a7, a8 = a4 + by, a4 + by * np.uint64(2), a4 + by * np.uint64(3), a4 + by * np.uint64(4)
    b1, b2, b3, b4 = b + by, b + by * np.uint64(2), b + by * np.uint64(3), b + by * np.uint64(4)
    b5, b6, b7, b8 = b4 + by, b4 + by * np.uint64(2), b4 + by * np.uint64(3), b4 + by * np.uint64(4)
    for i in range(np.uint64(lanes)):
        px, py, pz, nx, ny, nz = tile[X + i], tile[Y + i], tile[Z + i], tile[NX + i], tile[NY + i], tile[NZ + i]
        g = term(px, py, pz, nx, ny, nz, packed[a + i], packed[a1 + i], packed[a2 + i], packed[a3 + i], packed[a4 + i],
                 packed[a5 + i], first_weight, disc)
        h = term(px, py, pz, nx, ny, nz, packed[b + i], packed[b1 + i], packed[b2 + i], packed[b3 + i], packed[b4 + i],
                 packed[b5 + i], second_weight, disc)
        tile[R + i] = tile[R + i] + (g * packed[a6 + i] + h * packed[b6 + i])
        tile[G + i] = tile[G + i] + (g * packed[a7 + i] + h * packed[b7 + i])
        tile[B + i] = tile[B + i] + (g * packed[a8 + i] + h * packed[b8 + i])


@kernel
def close_group(tile: Array, lanes: int) -> None:
    """Add the sum of a group of samples to the sum of all, so that a sum of many rounds like one of few.

    Parameters
    ----------
    tile : (ROWS * WIDE,) ndarray
        Receivers and their sums.
    lanes : int
        How many of them are in use.
    """
    zero = tile.dtype.type(0.0)
    for c in range(6, 9):
        here, there = np.uint64(c * WIDE), np.uint64((c + 3) * WIDE)
        for i in range(np.uint64(lanes)):
            tile[there + i] = tile[there + i] + tile[here + i]
            tile[here + i] = zero
