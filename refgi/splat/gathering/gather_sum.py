"""The sum of RSM gathering: each receiver sums Eq. 2 over a disc of texels around its own place in the map.

The pattern is polar with radius r_max xi_1, so its density falls as 1 / r and each sample weighs xi_1
(Dachsbacher and Stamminger 2005). Symbols as in `pair_sum`.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.draws import GATHERING, draws
from refgi.jit import kernel, prange
from refgi.pairs.pair_sum import geometry_term
from refgi.sampling import halton

Array = npt.NDArray[Any]


class GatherMap(NamedTuple):
    """What gathering reads of a reflective shadow map."""

    position: Array  # (3, H, W) of the texels' surface, moved by the offset, m
    normal: Array  # (3, H, W) unit vectors
    flux: Array  # (3, H, W) reflected flux, W


def disc_pattern(samples: int, seed: int, weight_squared: bool = False) -> Array:
    """Return offsets in the unit disc and the weight of each: area integral = mean of weight * value.

    Parameters
    ----------
    samples : int
        Number of points.
    seed : int
        0: the plain Halton set; else a shift of it drawn with this seed.
    weight_squared : bool
        Weigh by xi_1^2 as is often done (switch `rsm_weight_squared`), not by xi_1.

    Returns
    -------
    (samples, 3) ndarray of float64
        Offset down, offset right, weight.

    Examples
    --------
    >>> pattern = disc_pattern(10_000, 0)
    >>> round(float(pattern[:, 2].mean()), 2)  # the disc's area, pi
    3.14
    """
    shift = draws(seed, GATHERING, 2).tolist() if seed else None
    xi, turn = halton(samples, shift=shift, start=1).T
    # density 1 / (2 pi xi): the weight is 2 pi xi; with xi^2 the mean weight is kept, 2 pi * 3/2 xi^2
    weight = 2 * math.pi * (1.5 * xi * xi if weight_squared else xi)
    return np.stack([xi * np.cos(2 * math.pi * turn), xi * np.sin(2 * math.pi * turn), weight], axis=1)


@kernel(parallel=True)
def gather_discs(
    position: Array, normal: Array, center: Array, source: GatherMap, pattern: Array, scale: Any, irradiance: Array
) -> None:
    """Add E = scale * sum over the pattern of weight Phi g for every receiver.

    Parameters
    ----------
    position, normal : (3, n) ndarray
        Receivers, world space; m and unit vectors.
    center : (2, n) ndarray of float64
        Their row and column in the map, continuous.
    source : GatherMap
        The map.
    pattern : (S, 3) ndarray
        Rows down and columns right of the centre, and weight (dtype of the receivers).
    scale : float
        1 / (pi S) times the texels in a disc of unit weight.
    irradiance : (3, n) ndarray
        Added to, W/m^2. Texels outside the map count 0.
    """
    real = position.dtype.type
    height, width = source.flux.shape[1:]
    for i in prange(position.shape[1]):
        red, green, blue = real(0.0), real(0.0), real(0.0)
        x, y, z = position[0, i], position[1, i], position[2, i]
        nx, ny, nz = normal[0, i], normal[1, i], normal[2, i]
        for s in range(pattern.shape[0]):
            row = math.floor(center[0, i] + pattern[s, 0])
            column = math.floor(center[1, i] + pattern[s, 1])
            if 0 <= row < height and 0 <= column < width:
                t, u = int(row), int(column)
                fr, fg, fb = source.flux[0, t, u], source.flux[1, t, u], source.flux[2, t, u]
                if fr > 0 or fg > 0 or fb > 0:
                    p, n = source.position, source.normal
                    g = geometry_term(p[0, t, u] - x, p[1, t, u] - y, p[2, t, u] - z,
                                      -n[0, t, u], -n[1, t, u], -n[2, t, u], nx, ny, nz)
                    g *= real(pattern[s, 2])
                    red, green, blue = red + g * fr, green + g * fg, blue + g * fb
        irradiance[0, i] += red * scale
        irradiance[1, i] += green * scale
        irradiance[2, i] += blue * scale
