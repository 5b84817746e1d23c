"""Kernels that look textures up: texels, levels, coordinates, and where a cut-out has a surface.

Symbols: u, v texture coordinates; n texels along an axis, the centre of texel i at (i + 1/2) / n.

A surface is there where factor x alpha >= cutoff. Alpha is blended between the four texels around (u, v) of the image
itself, whatever the distance; of textures that show the nearest texel it is that one's. Every map and every ray asks
`is_opaque`, so that all of them see the same holes.
"""

from typing import NamedTuple

import numpy as np

from refgi.jit import kernel
from refgi.jit.dispatch import borrowed
from refgi.scene.texture.table import FILTER, FIRST, MIRROR, NEAREST, REPEAT, WRAP_U, WRAP_V, TextureTable
from refgi.types import Array

Colour = tuple[float, float, float]

FARTHEST = 1e15  # texels; whole numbers of float64 are then still apart


@kernel
def inside(i: int, count: int, wrap: int) -> int:
    """Return the texel of the image that stands for texel i beyond its edges."""
    if wrap == REPEAT:
        if count & (count - 1) == 0:
            return i & (count - 1)
        return i - count * int(np.floor(i / count))
    if wrap == MIRROR:
        i -= 2 * count * int(np.floor(i / (2 * count)))
        return i if i < count else 2 * count - 1 - i
    return min(max(i, 0), count - 1)


@kernel
def near(x: float) -> float:
    """Return a place, in texels; 0 in place of one so far away, or so undefined, that no texel is the nearest."""
    return x if abs(x) < FARTHEST else 0.0


@kernel
def neighbours_of(x: float, count: int, wrap: int) -> tuple[int, int, float]:
    """Return the texels on both sides of a place along an axis, and the share of the second.

    `x`: u times `count`: texel i of the image lies from i to i + 1.
    """
    x = near(x)
    below = np.floor(x - 0.5)
    first = int(below)
    if 0 <= first < count - 1:
        return first, first + 1, x - 0.5 - below
    return inside(first, count, wrap), inside(first + 1, count, wrap), x - 0.5 - below


@kernel
def nearest(table: TextureTable, texture: int, u: float, v: float) -> Colour:
    """Return the texel of the image that (u, v) lies in."""
    row = table.texture[texture, FIRST]
    start, width, height = table.level[row, 0], table.level[row, 1], table.level[row, 2]
    i = inside(int(np.floor(near(u * width))), width, table.texture[texture, WRAP_U])
    j = inside(int(np.floor(near(v * height))), height, table.texture[texture, WRAP_V])
    at = start + j * width + i
    return np.float64(table.texels[at, 0]), np.float64(table.texels[at, 1]), np.float64(table.texels[at, 2])


@kernel
def bilinear(table: TextureTable, texture: int, level: int, u: float, v: float) -> Colour:
    """Return the blend of the four texels around (u, v) on a level of the image; 0 is the image itself."""
    row = table.texture[texture, FIRST] + level
    start, width, height = table.level[row, 0], table.level[row, 1], table.level[row, 2]
    wrap_u, wrap_v = table.texture[texture, WRAP_U], table.texture[texture, WRAP_V]
    left, right, p = neighbours_of(u * width, width, wrap_u)
    upper, lower, q = neighbours_of(v * height, height, wrap_v)
    ul, ur = start + upper * width + left, start + upper * width + right
    ll, lr = start + lower * width + left, start + lower * width + right
    c, d = 1.0 - p, 1.0 - q
    wul, wur, wll, wlr = c * d, p * d, c * q, p * q
    texels = table.texels
    return (wul * texels[ul, 0] + wur * texels[ur, 0] + wll * texels[ll, 0] + wlr * texels[lr, 0],
            wul * texels[ul, 1] + wur * texels[ur, 1] + wll * texels[ll, 1] + wlr * texels[lr, 1],
            wul * texels[ul, 2] + wur * texels[ur, 2] + wll * texels[ll, 2] + wlr * texels[lr, 2])


@kernel
def point_sample(table: TextureTable, texture: int, u: float, v: float) -> Colour:
    """Return the texture at a point, whatever covers it: bilinear, or the nearest texel where that is its filter."""
    if table.texture[texture, FILTER] == NEAREST:
        return nearest(table, texture, u, v)
    return bilinear(table, texture, 0, u, v)


@kernel
def barycentric(vertices: Array, faces: Array, triangle: int, x: float, y: float, z: float) -> tuple[float, float]:
    """Return the barycentric coordinates of a triangle's second and third corner at a point; 0 without area."""
    i, j, k = faces[triangle, 0], faces[triangle, 1], faces[triangle, 2]
    px, py, pz = vertices[i, 0], vertices[i, 1], vertices[i, 2]
    ax, ay, az = vertices[j, 0] - px, vertices[j, 1] - py, vertices[j, 2] - pz
    bx, by, bz = vertices[k, 0] - px, vertices[k, 1] - py, vertices[k, 2] - pz
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    qx, qy, qz = x - px, y - py, z - pz
    square = nx * nx + ny * ny + nz * nz
    if square == 0.0:
        return 0.0, 0.0
    # parts of the area N = a x b: (q x b) . N and (a x q) . N
    s = ((qy * bz - qz * by) * nx + (qz * bx - qx * bz) * ny + (qx * by - qy * bx) * nz) / square
    t = ((ay * qz - az * qy) * nx + (az * qx - ax * qz) * ny + (ax * qy - ay * qx) * nz) / square
    return s, t


@kernel
def colour_at(vertices: Array, faces: Array, colours: Array, triangle: int, x: float, y: float, z: float) -> Colour:
    """Return the vertex colours (m, 3, 3) of a triangle's corners at a point: linear between them, not beyond."""
    s, t = barycentric(vertices, faces, triangle, x, y, z)
    s = min(max(s, 0.0), 1.0)
    t = min(max(t, 0.0), 1.0 - s)
    r, g, b = colours[triangle, 0, 0], colours[triangle, 0, 1], colours[triangle, 0, 2]
    return (r + s * (colours[triangle, 1, 0] - r) + t * (colours[triangle, 2, 0] - r),
            g + s * (colours[triangle, 1, 1] - g) + t * (colours[triangle, 2, 1] - g),
            b + s * (colours[triangle, 1, 2] - b) + t * (colours[triangle, 2, 2] - b))


@kernel
def coordinates_at(vertices: Array, faces: Array, uv: Array, triangle: int, x: float, y: float,
                   z: float) -> tuple[float, float]:
    """Return the texture coordinates of a point on a triangle's plane, from its barycentric coordinates.

    `uv` (m, 3, 2): of each face's corners. Result: those of the first corner on a triangle without area.
    """
    s, t = barycentric(vertices, faces, triangle, x, y, z)
    u, v = uv[triangle, 0, 0], uv[triangle, 0, 1]
    return (u + s * (uv[triangle, 1, 0] - u) + t * (uv[triangle, 2, 0] - u),
            v + s * (uv[triangle, 1, 1] - v) + t * (uv[triangle, 2, 1] - v))


@kernel
def multiply_at(table: TextureTable, vertices: Array, faces: Array, uv: Array, triangle: Array, material: Array,
                position: Array, colour: Array) -> None:
    """Multiply colours by the textures at points.

    `triangle`, `material` (n,): of each point. `position` (n, 3): the points, m. `colour` (n, 3): changed where the
    material has a texture.
    """
    for i in range(len(triangle)):
        texture = table.of_material[material[i]]
        if texture >= 0:
            u, v = coordinates_at(vertices, faces, uv, triangle[i], position[i, 0], position[i, 1], position[i, 2])
            r, g, b = point_sample(table, texture, u, v)
            colour[i, 0] *= r
            colour[i, 1] *= g
            colour[i, 2] *= b


@kernel
def multiply_by_colours(vertices: Array, faces: Array, colours: Array, triangle: Array, position: Array,
                        colour: Array) -> None:
    """Multiply colours (n, 3) by the vertex colours of triangles (n,) at points (n, 3)."""
    for i in range(len(triangle)):
        r, g, b = colour_at(vertices, faces, colours, triangle[i], position[i, 0], position[i, 1], position[i, 2])
        colour[i, 0] *= r
        colour[i, 1] *= g
        colour[i, 2] *= b


START, WIDTH, HEIGHT, MASK_WRAP_U, MASK_WRAP_V, MASK_NEAREST = range(6)  # columns of `AlphaTable.mask`
FACTOR, CUTOFF = range(2)  # columns of `AlphaTable.limit`


class AlphaTable(NamedTuple):
    """Masks as arrays for kernels."""

    alpha: Array  # (n,) float32, 0 to 1: row by row, image by image
    mask: Array  # (k, 6) int64: first texel, width, height, wrap of u and v, whether the nearest texel counts
    limit: Array  # (k, 2) float64: factor, cutoff


NO_MASKS = AlphaTable(np.zeros(0, np.float32), np.zeros((0, 6), np.int64), np.zeros((0, 2)))


@kernel
def lent(table: AlphaTable) -> AlphaTable:
    """Return a table for calls of `is_opaque` in an inner loop; the one it is made of must be kept."""
    return AlphaTable(borrowed(table.alpha), borrowed(table.mask), borrowed(table.limit))


@kernel
def is_opaque(table: AlphaTable, mask: int, u: float, v: float) -> bool:
    """Return whether a surface is there at (u, v), by one of the masks; a mask without texels is a hole as a whole."""
    masks, alpha = table.mask, table.alpha
    width, height = masks[mask, WIDTH], masks[mask, HEIGHT]
    if width == 0:
        return False
    start, wrap_u, wrap_v = masks[mask, START], masks[mask, MASK_WRAP_U], masks[mask, MASK_WRAP_V]
    x, y = u * width, v * height
    if masks[mask, MASK_NEAREST]:
        i, j = inside(int(np.floor(near(x))), width, wrap_u), inside(int(np.floor(near(y))), height, wrap_v)
        value = np.float64(alpha[start + j * width + i])
    else:
        left, right, p = neighbours_of(x, width, wrap_u)
        upper, lower, q = neighbours_of(y, height, wrap_v)
        upper, lower = start + upper * width, start + lower * width
        # steps from one to the other: between equal texels the blend is exactly these
        above = alpha[upper + left] + p * (np.float64(alpha[upper + right]) - alpha[upper + left])
        below = alpha[lower + left] + p * (np.float64(alpha[lower + right]) - alpha[lower + left])
        value = above + q * (below - above)
    return bool(table.limit[mask, FACTOR] * value >= table.limit[mask, CUTOFF])
