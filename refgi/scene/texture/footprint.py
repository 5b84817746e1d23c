"""The mean of a texture over what a pixel covers: probes on its footprint, each blended between two mip levels.

The footprint of a pixel is the parallelogram that its sides a and b span on the image, in texels. It is divided into
n_a x n_b equal parts no longer than its shorter side, and a probe in the middle of each is looked up where a texel is
as long as the part. A longer footprint thus has more probes along it and is not blurred across (anisotropic
filtering); of those more than `MOST` times as long as wide the parts are longer.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel
from refgi.scene.texture.lookup import neighbours_of
from refgi.scene.texture.table import FILTER, FIRST, LEVELS, NEAREST, TRILINEAR, WRAP_U, WRAP_V, TextureTable

Array = npt.NDArray[Any]

MOST = 32  # probes along a side
SHORTEST = 0.5  # texel; smaller parts see no more of a blend of four
EDGE_ON = 1e12  # texels a pixel, of a surface that is seen edge-on


@kernel
def probe_counts(a: float, b: float) -> tuple[int, int]:
    """Return how many probes lie along the sides of a footprint, lengths in texels."""
    part = max(min(a, b), max(a, b) / MOST, SHORTEST)
    # a side that rounding makes longer than the part has no second probe
    return max(1, int(np.ceil(a / part - 1e-6))), max(1, int(np.ceil(b / part - 1e-6)))


@kernel
def footprint_means(table: TextureTable, texture: Array, place: Array, count: int, colour: Array) -> None:
    """Look up what each texture's filter makes of each of a row of pixels: the mean over its footprint, or a point.

    `texture` (n,): row of the table, -1 for none. `place` (6, n): u and v of the pixel's centre, their change to the
    next pixel of the row, and to that of the next row. `count`: how many pixels there are. `colour` (3, n): filled
    where there is a texture.

    One loop and no calls with arrays: each call counts references, over which threads wait for each other.
    """
    texels, sizes, textures = table.texels, table.level, table.texture
    for x in range(count):
        if texture[x] < 0:
            continue
        chosen, first, levels = textures[texture[x], FILTER], textures[texture[x], FIRST], textures[texture[x], LEVELS]
        wrap_u, wrap_v = textures[texture[x], WRAP_U], textures[texture[x], WRAP_V]
        width, height = sizes[first, 1], sizes[first, 2]
        across, down, level = plan(chosen, levels, place[2, x] * width, place[3, x] * height,
                                   place[4, x] * width, place[5, x] * height)
        below = int(level)
        share = level - below
        red, green, blue = 0.0, 0.0, 0.0
        for upwards in range(1 if share == 0.0 else 2):
            row = first + below + upwards
            start, width, height = sizes[row, 0], sizes[row, 1], sizes[row, 2]
            # the first probe, and the steps along both sides, in texels of the level
            sx, sy, tx, ty = 0.0, 0.0, 0.0, 0.0
            if across * down > 1:
                sx, sy = place[2, x] * width / across, place[3, x] * height / across
                tx, ty = place[4, x] * width / down, place[5, x] * height / down
            x0 = place[0, x] * width - 0.5 * ((across - 1) * sx + (down - 1) * tx)
            y0 = place[1, x] * height - 0.5 * ((across - 1) * sy + (down - 1) * ty)
            along = 0
            weight = (share if upwards else 1.0 - share) / (across * down)
            for _ in range(across * down):
                left, right, p = neighbours_of(x0, width, wrap_u)
                upper, lower, q = neighbours_of(y0, height, wrap_v)
                if chosen == NEAREST:
                    p, q = nearer(p), nearer(q)
                ul, ur = np.uint64(start + upper * width + left), np.uint64(start + upper * width + right)
                ll, lr = np.uint64(start + lower * width + left), np.uint64(start + lower * width + right)
                a, b = weight * (1.0 - p) * (1.0 - q), weight * p * (1.0 - q)
                c, d = weight * (1.0 - p) * q, weight * p * q
                red += a * texels[ul, 0] + b * texels[ur, 0] + c * texels[ll, 0] + d * texels[lr, 0]
                green += a * texels[ul, 1] + b * texels[ur, 1] + c * texels[ll, 1] + d * texels[lr, 1]
                blue += a * texels[ul, 2] + b * texels[ur, 2] + c * texels[ll, 2] + d * texels[lr, 2]
                x0, y0, along = x0 + sx, y0 + sy, along + 1
                if along == across:
                    x0, y0, along = x0 + tx - across * sx, y0 + ty - across * sy, 0
        colour[0, x], colour[1, x], colour[2, x] = red, green, blue


@kernel
def nearer(share: float) -> float:
    """Return the whole of the nearer one of two texels' centres, the second where both are as near."""
    return 1.0 if share >= 0.5 else 0.0


@kernel
def plan(chosen: int, levels: int, ax: float, ay: float, bx: float, by: float) -> tuple[int, int, float]:
    """Return how many probes lie along both sides of a footprint, and their level between the image, 0, and the last.

    `chosen`: the filter. `ax`, `ay`, `bx`, `by`: sides of the footprint, in texels of the image.
    """
    a, b = math.sqrt(ax * ax + ay * ay), math.sqrt(bx * bx + by * by)
    if chosen != TRILINEAR or max(a, b) <= SHORTEST:
        return 1, 1, 0.0
    if not a + b < EDGE_ON:
        return 1, 1, levels - 1.0  # the mean of the image
    across, down = probe_counts(a, b)
    part = max(a / across, b / down)
    return across, down, min(math.log2(part), levels - 1.0) if part > 1.0 else 0.0
