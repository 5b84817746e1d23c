"""Form factor of a receiver and a sample (Sec. 3.1, Eq. 3 and 4), and the innermost loop over samples.

The receivers of a row are the SIMD lanes. A tile of receivers is one array with strides known to the compiler, so that
few overlap checks remain in each call.

Symbols: d vector from receiver to sample; m = -n_j ds_j / pi of the sample; c = max(0, n . d) = r cos(theta);
s = max(0, m . d) = r R^2, with the radius R of the disc that has the sample's projected area; |d| = r.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel

Array = npt.NDArray[Any]

WIDE = 320  # lanes of a tile
ROWS = 12  # position, normal, sum of a group of samples, sum of all
POINT, TEXEL, DISC = 0, 1, 2  # form factors
LEAST = 1e-37  # stands in for a denominator of 0, where the numerator is 0 as well

X, Y, Z, NX, NY, NZ, R, G, B = (np.uint64(k * WIDE) for k in range(9))


@kernel
def form_factor(c: Any, s: Any, disc: Any, square: Any) -> Any:
    """Return c s / (r^4 + d r): Eq. 4 where the disc d is all that the sample stands for, Eq. 3 where it is 0.

    That is cos(theta) R^2 / (r^2 + D^2), without pi. `s` is r R^2 of all texels that the sample stands for, `disc` d of
    those that its disc covers, `square` r^2. 0 where c or s is 0, and where receiver and sample coincide.
    """
    least = type(c)(LEAST)
    # Eq. (4): cos(theta) R^2 / (r^2 + R^2); Eq. (3): cos(theta) cos(theta') ds / r^2
    below = square * square + disc * math.sqrt(square)
    return c * s / (below if below > least else least)


@kernel
def disc_texels(weight: float, form: int, share: float) -> float:
    """Return how many texels the disc of a sample covers that stands for `weight`: a share, but no less than a texel.

    One (TEXEL) or none (POINT) by other form factors. A sample that stands for less than a texel has all of that.
    """
    if form == DISC:
        return max(share * weight, min(1.0, weight))
    return 1.0 if form == TEXEL else 0.0


def form_of(name: str) -> int:
    """Return the number by which kernels know a form factor: that of a "disc", a "texel" or a "point"."""
    return {"point": POINT, "texel": TEXEL, "disc": DISC}[name]


@kernel
def term(px: Any, py: Any, pz: Any, nx: Any, ny: Any, nz: Any, qx: Any, qy: Any, qz: Any, mx: Any, my: Any, mz: Any,
         weight: Any, disc: Any) -> Any:
    """Return the form factor of one receiver and one sample that stands for `weight` texels, its disc for `disc`.

    p, n: position and normal of the receiver; q, m: position of the sample, and its reversed normal times area / pi.
    """
    zero = type(px)(0.0)
    dx, dy, dz = qx - px, qy - py, qz - pz
    square = dx * dx + dy * dy + dz * dz
    c = nx * dx + ny * dy + nz * dz
    s = mx * dx + my * dy + mz * dz
    c = c if c > zero else zero
    texel = s if s > zero else zero
    return form_factor(c, texel * weight, texel * disc, square)


@kernel
def add_two(
    tile: Array, low: int, lanes: int, packed: Array, step: int, first: int, first_weight: Any, first_disc: Any,
    second: int, second_weight: Any, second_disc: Any,
) -> None:
    """Add the light of two samples to each receiver of a tile; the two contributions are added to each other first.

    `tile` (ROWS * WIDE,) holds receivers and their sums, of which `lanes` from `low` on receive. `packed` holds texels,
    plane by plane, `step` elements apart; `first` and `second` are the places of the first receiver's samples in it.
    """
    # unsigned: no checks for places counted from the end
    by, a, b = np.uint64(step), np.uint64(first), np.uint64(second)
    a1, a2, a3, a4 = a + by, a + by * np.uint64(2), a + by * np.uint64(3), a + by * np.uint64(4)
    a5, a6, a7, a8 = a4 + by, a4 + by * np.uint64(2), a4 + by * np.uint64(3), a4 + by * np.uint64(4)
    b1, b2, b3, b4 = b + by, b + by * np.uint64(2), b + by * np.uint64(3), b + by * np.uint64(4)
    b5, b6, b7, b8 = b4 + by, b4 + by * np.uint64(2), b4 + by * np.uint64(3), b4 + by * np.uint64(4)
    for i in range(np.uint64(low), np.uint64(low + lanes)):
        px, py, pz, nx, ny, nz = tile[X + i], tile[Y + i], tile[Z + i], tile[NX + i], tile[NY + i], tile[NZ + i]
        g = term(px, py, pz, nx, ny, nz, packed[a + i], packed[a1 + i], packed[a2 + i], packed[a3 + i], packed[a4 + i],
                 packed[a5 + i], first_weight, first_disc)
        h = term(px, py, pz, nx, ny, nz, packed[b + i], packed[b1 + i], packed[b2 + i], packed[b3 + i], packed[b4 + i],
                 packed[b5 + i], second_weight, second_disc)
        # Eq. (1)
        tile[R + i] = tile[R + i] + (g * packed[a6 + i] + h * packed[b6 + i])
        tile[G + i] = tile[G + i] + (g * packed[a7 + i] + h * packed[b7 + i])
        tile[B + i] = tile[B + i] + (g * packed[a8 + i] + h * packed[b8 + i])


@kernel
def close_group(tile: Array, lanes: int) -> None:
    """Add the sums of a group of samples to the totals of a tile: many samples round like few."""
    zero = tile.dtype.type(0.0)
    for c in range(6, 9):
        here, there = np.uint64(c * WIDE), np.uint64((c + 3) * WIDE)
        for i in range(np.uint64(lanes)):
            tile[there + i] = tile[there + i] + tile[here + i]
            tile[here + i] = zero
