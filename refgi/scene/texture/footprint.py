"""The mean of a texture over what a pixel covers: probes on its footprint, each trilinear between two mip levels.

The footprint of a pixel is the parallelogram that its sides a and b span on the image, in texels. It is divided into
n_a x n_b equal parts, so that parts are no longer than 1 / `FINENESS` of the shorter side, and a probe in the middle of
each is looked up where a texel is as long as the part. A longer footprint thus has more probes along it and is not
blurred across (anisotropic filtering); of very long ones, over `MOST` probes, the parts grow.
"""

import math

from refgi.jit import kernel
from refgi.scene.texture.lookup import Colour, bilinear, point_sample
from refgi.scene.texture.table import FILTER, FIRST, LEVELS, TRILINEAR, TextureTable

FINENESS = 2.0  # probes along the shorter side
MOST = 32  # along a side


@kernel
def probe_counts(a: float, b: float) -> tuple[int, int]:
    """Return how many probes lie along sides of a footprint, lengths in texels: one where a texel is larger."""
    shorter, longer = min(a, b), max(a, b)
    if longer <= 0.5:
        return 1, 1
    part = max(shorter / FINENESS, longer / MOST, 0.5)
    return max(1, int(math.ceil(a / part - 1e-9))), max(1, int(math.ceil(b / part - 1e-9)))


@kernel
def footprint_mean(table: TextureTable, texture: int, u: float, v: float, ux: float, vx: float, uy: float,
                   vy: float) -> Colour:
    """Return what a texture's filter makes of a pixel: its mean over the footprint, or the value at its middle.

    `u`, `v`: of the pixel's centre. `ux`, `vx`, `uy`, `vy`: how they change from a pixel to the next.
    """
    if table.texture[texture, FILTER] != TRILINEAR:
        return point_sample(table, texture, u, v)
    first, levels = table.texture[texture, FIRST], table.texture[texture, LEVELS]
    width, height = float(table.level[first, 1]), float(table.level[first, 2])
    a, b = math.hypot(ux * width, vx * height), math.hypot(uy * width, vy * height)
    if not a + b < 1e12:  # seen edge-on: everything at once
        return bilinear(table, texture, levels - 1, u, v)
    across, down = probe_counts(a, b)
    part = max(a / across, b / down)
    level = 0.0
    if part > 1.0:
        level = min(math.log2(part), levels - 1.0)
    below = min(int(level), levels - 1)
    share = level - below
    red, green, blue = 0.0, 0.0, 0.0
    for j in range(down):
        t = (j + 0.5) / down - 0.5
        for i in range(across):
            s = (i + 0.5) / across - 0.5
            x, y = u + s * ux + t * uy, v + s * vx + t * vy
            r, g, b = bilinear(table, texture, below, x, y)
            if share > 0.0:
                fr, fg, fb = bilinear(table, texture, below + 1, x, y)
                r, g, b = r + share * (fr - r), g + share * (fg - g), b + share * (fb - b)
            red, green, blue = red + r, green + g, blue + b
    scale = 1.0 / (across * down)
    return red * scale, green * scale, blue * scale
