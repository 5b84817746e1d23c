"""The basis of the series: sines and cosines of each texel's depth, and the same times the depth (Sec. 4.1, 6).

S_k = sin(c_k t), C_k = cos(c_k t), c_k = (2k - 1) pi, from the first pair by turning it on by 2 pi t:

    S_k+1 = S_k cos(2 pi t) + C_k sin(2 pi t),   C_k+1 = C_k cos(2 pi t) - S_k sin(2 pi t).

t is the depth over the range of the series, 0 to less than 1 (the rest keeps the far end from wrapping around to the
near one); where nothing is seen it is the far end. The paper's channels are the 2 M of the basis and the 2 M of the
"basis-z"; the mean of (1 - f) t needs the plain t as well.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.cluster.filters.depth_scale import DepthScale, series_depths
from refgi.cluster.filters.quantise import eight_bits, half_precision
from refgi.jit import kernel

Array = npt.NDArray[Any]

# sin(pi u) / u and cos(pi u) in powers of u^2, |u| <= 1/2: Taylor series to half a unit in the last place
SINE = tuple((-1) ** k * math.pi ** (2 * k + 1) / math.factorial(2 * k + 1) for k in range(12))
COSINE = tuple((-1) ** k * math.pi ** (2 * k) / math.factorial(2 * k) for k in range(13))


@kernel
def normalise(depth: Array, scale: DepthScale, out: Array) -> None:
    """Turn the distances of a map into depths of the series.

    Parameters
    ----------
    depth : (n, n) ndarray
        Radial distance, m; inf where nothing is seen.
    scale : DepthScale
        What depth a distance is.
    out : (n, n) ndarray
        Filled with t; `scale.most` where nothing is seen.
    """
    for i in range(depth.shape[0]):
        series_depths(scale, depth[i], out[i], depth.shape[1])


@kernel
def sine_cosine(t: Any) -> tuple[Any, Any]:
    """Return sin(pi t) and cos(pi t) of a depth.

    Parameters
    ----------
    t : float
        -1/4 (a depth less the largest bias) to 1, float32 or float64.

    Returns
    -------
    tuple of 2 floats
        Within 2.4e-7 (float64: 4e-16) from 0 on, 4.5e-7 (8e-16) below.
    """
    real = type(t)
    u = t - real(0.5)
    q = u * u
    if isinstance(t, np.float32):
        a, b = real(SINE[7]), real(COSINE[7])
        for k in (6, 5, 4, 3, 2, 1, 0):
            a, b = a * q + real(SINE[k]), b * q + real(COSINE[k])
    else:
        a, b = real(SINE[11]), real(COSINE[12])
        for k in (10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0):
            a = a * q + real(SINE[k])
        for k in (11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0):
            b = b * q + real(COSINE[k])
    return b, -(u * a)


@kernel
def turned(sine: Any, cosine: Any, by_sine: Any, by_cosine: Any) -> tuple[Any, Any]:
    """Return sine and cosine of the sum of two angles.

    Parameters
    ----------
    sine, cosine : float
        Of the one angle.
    by_sine, by_cosine : float
        Of the other.

    Returns
    -------
    tuple of 2 floats
        From S_k, C_k and the sine and cosine of 2 pi t, S_k+1 and C_k+1.
    """
    return sine * by_cosine + cosine * by_sine, cosine * by_cosine - sine * by_sine


@kernel
def fill_basis(depth: Array, terms: int, quantised: bool, basis: Array, basis_z: Array) -> None:
    """Write the basis and the basis-z of every texel of a map.

    Parameters
    ----------
    depth : (n, n) ndarray
        t.
    terms : int
        M.
    quantised : bool
        Keep 8 bits of the basis and 16 of the basis-z.
    basis : (n, n, 2 M) ndarray
        Filled with S_1 .. S_M, C_1 .. C_M.
    basis_z : (n, n, 2 M + 1) ndarray
        Filled with t S_1 .. t S_M, t C_1 .. t C_M, t.
    """
    for i in range(depth.shape[0]):
        for j in range(depth.shape[1]):
            t = depth[i, j]
            sine, cosine = sine_cosine(t)
            by_sine, by_cosine = turned(sine, cosine, sine, cosine)
            for k in range(terms):
                basis[i, j, k], basis[i, j, terms + k] = sine, cosine
                basis_z[i, j, k], basis_z[i, j, terms + k] = t * sine, t * cosine
                sine, cosine = turned(sine, cosine, by_sine, by_cosine)
            basis_z[i, j, 2 * terms] = t
            if quantised:
                for c in range(2 * terms):
                    basis[i, j, c] = eight_bits(basis[i, j, c])
                for c in range(2 * terms + 1):
                    basis_z[i, j, c] = half_precision(basis_z[i, j, c])
