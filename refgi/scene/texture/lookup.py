"""Kernels that look textures up: one texel, between four, and between levels; and the texture coordinates of a point.

Symbols: u, v texture coordinates; n texels along an axis, the centre of texel i at (i + 1/2) / n.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel
from refgi.scene.texture.table import FILTER, FIRST, MIRROR, NEAREST, REPEAT, WRAP_U, WRAP_V, TextureTable

Array = npt.NDArray[Any]
Colour = tuple[float, float, float]


@kernel
def wrapped(u: float, wrap: int) -> float:
    """Return the coordinate within the image, 0 to 1, that stands for u beyond its edges."""
    if wrap == REPEAT:
        return u - math.floor(u)
    if wrap == MIRROR:
        u = abs(u - 2.0 * math.floor(0.5 * u + 0.5))  # a triangle wave: 0 at even, 1 at odd numbers
    return min(max(u, 0.0), 1.0)


@kernel
def neighbours(x: float, count: int, wrap: int) -> tuple[int, int, float]:
    """Return the texels on both sides of a place along an axis, and the share of the second.

    `x`: 0 to `count`, texel i from i to i + 1.
    """
    below = math.floor(x - 0.5)
    share = x - 0.5 - below
    first = int(below)
    second = first + 1
    if first < 0:  # beyond a mirrored edge lies the same texel
        first = count - 1 if wrap == REPEAT else 0
    if second >= count:
        second = 0 if wrap == REPEAT else count - 1
    return first, second, share


@kernel
def nearest(table: TextureTable, texture: int, u: float, v: float) -> Colour:
    """Return the texel of the image that (u, v) lies in."""
    row = table.texture[texture, FIRST]
    start, width, height = table.level[row, 0], table.level[row, 1], table.level[row, 2]
    i = min(int(wrapped(u, table.texture[texture, WRAP_U]) * width), width - 1)
    j = min(int(wrapped(v, table.texture[texture, WRAP_V]) * height), height - 1)
    at = start + j * width + i
    return np.float64(table.texels[at, 0]), np.float64(table.texels[at, 1]), np.float64(table.texels[at, 2])


@kernel
def bilinear(table: TextureTable, texture: int, level: int, u: float, v: float) -> Colour:
    """Return the blend of the four texels around (u, v) on a level of the image; 0 is the image itself."""
    row = table.texture[texture, FIRST] + level
    start, width, height = table.level[row, 0], table.level[row, 1], table.level[row, 2]
    wrap_u, wrap_v = table.texture[texture, WRAP_U], table.texture[texture, WRAP_V]
    left, right, a = neighbours(wrapped(u, wrap_u) * width, width, wrap_u)
    upper, lower, b = neighbours(wrapped(v, wrap_v) * height, height, wrap_v)
    ul, ur = np.uint64(start + upper * width + left), np.uint64(start + upper * width + right)
    ll, lr = np.uint64(start + lower * width + left), np.uint64(start + lower * width + right)
    c, d = 1.0 - a, 1.0 - b
    texels = table.texels
    return (d * (c * texels[ul, 0] + a * texels[ur, 0]) + b * (c * texels[ll, 0] + a * texels[lr, 0]),
            d * (c * texels[ul, 1] + a * texels[ur, 1]) + b * (c * texels[ll, 1] + a * texels[lr, 1]),
            d * (c * texels[ul, 2] + a * texels[ur, 2]) + b * (c * texels[ll, 2] + a * texels[lr, 2]))


@kernel
def point_sample(table: TextureTable, texture: int, u: float, v: float) -> Colour:
    """Return the texture at a point, whatever covers it: bilinear, or the nearest texel where that is its filter."""
    if table.texture[texture, FILTER] == NEAREST:
        return nearest(table, texture, u, v)
    return bilinear(table, texture, 0, u, v)


@kernel
def coordinates_at(vertices: Array, faces: Array, uv: Array, triangle: int, x: float, y: float,
                   z: float) -> tuple[float, float]:
    """Return the texture coordinates of a point on a triangle's plane, from its barycentric coordinates.

    `uv` (m, 3, 2): of each face's corners. Result: those of the first corner on a triangle without area.
    """
    i, j, k = faces[triangle, 0], faces[triangle, 1], faces[triangle, 2]
    px, py, pz = vertices[i, 0], vertices[i, 1], vertices[i, 2]
    ax, ay, az = vertices[j, 0] - px, vertices[j, 1] - py, vertices[j, 2] - pz
    bx, by, bz = vertices[k, 0] - px, vertices[k, 1] - py, vertices[k, 2] - pz
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    qx, qy, qz = x - px, y - py, z - pz
    square = nx * nx + ny * ny + nz * nz
    u, v = uv[triangle, 0, 0], uv[triangle, 0, 1]
    if square == 0.0:
        return u, v
    # parts of the area N = a x b: (q x b) . N and (a x q) . N
    s = ((qy * bz - qz * by) * nx + (qz * bx - qx * bz) * ny + (qx * by - qy * bx) * nz) / square
    t = ((ay * qz - az * qy) * nx + (az * qx - ax * qz) * ny + (ax * qy - ay * qx) * nz) / square
    return (u + s * (uv[triangle, 1, 0] - u) + t * (uv[triangle, 2, 0] - u),
            v + s * (uv[triangle, 1, 1] - v) + t * (uv[triangle, 2, 1] - v))
