"""Max mipmaps of depth slopes and of curvatures (Nichols and Wyman 2009, Sec. 3.2, Eq. 1).

A pair of neighbouring pixels that both show a surface counts for both: a step is in the cells on both its sides.
Symbols: z depth, m; N1, N2 normals and x1, x2 positions of a pair.
"""

import math
from typing import Any

import numpy as np

from refgi.error_target.grid import COLUMNS, ROWS, Mipmap, coarsen, element_count, layout, level_views, rows_of
from refgi.jit import kernel, prange
from refgi.stages import stage
from refgi.types import Array

# rows of pairs that a thread keeps: within a row, their distances; from BELOW on two rows of pairs with the row below,
# taking turns
BESIDE, DISTANCE, BELOW = range(3)


@stage("multires.depth_slopes")
def depth_slopes(depth: Array, covered: Array, top: int, relative: bool = True) -> Mipmap:
    """Return the steepest change of depth within each cell, sqrt((dz/dx)^2 + (dz/dy)^2), over z (AMS Sec. 3.2.1).

    depth (h, w): Axial depth, m.
    relative: Divide by z; the paper does not.
    -> high tuple of (h_l, w_l): The larger of both differences along each axis, 1/pixel, or m/pixel if not relative.

    The paper leaves the difference open: here dz/dx is the larger of those to both neighbours. A slope relative to the
    depth has one threshold for scenes of any size.
    """
    sizes, rows, values = _allocate(depth, top)
    _build_slopes(np.ascontiguousarray(depth), np.ascontiguousarray(covered), relative, sizes, rows, values)
    return _max_mip(values, sizes)


@stage("multires.curvatures")
def curvatures(normal: Array, position: Array, covered: Array, top: int, rate: bool = False) -> Mipmap:
    """Return the largest change of normal between neighbouring pixels within each cell (AMS Eq. 1; E-AMS-01).

    rate: Divide by the distance between the two points, which makes it a curvature: 1/R on a sphere of radius R.
    -> high tuple of (h_l, w_l): Largest length of N1 - N2, 0 to 2; for a rate over that of x1 - x2, 1/m.

    Eq. 1, 2 sin(arccos(N1 . N2) / 2), is the length of N1 - N2 and computed as that: the arc cosine has no digits near
    0 and no value where rounding makes the product exceed 1.
    """
    sizes, rows, values = _allocate(normal[0], top)
    _build_curvatures(np.ascontiguousarray(normal), np.ascontiguousarray(position), np.ascontiguousarray(covered),
                      rate, sizes, rows, values)
    return _max_mip(values, sizes)


def _allocate(plane: Array, top: int) -> tuple[Array, Array, Array]:
    """Return layout and uninitialised array of a max mipmap, and rows of pairs for each row of its coarsest level."""
    height, width = plane.shape
    sizes = layout(height, width, top)
    rows = np.zeros((sizes[top, ROWS], 4, width + 1), plane.dtype)
    return sizes, rows, np.empty(element_count(sizes), plane.dtype)


def _max_mip(values: Array, sizes: Array) -> Mipmap:
    pixels = int(sizes[0, ROWS] * sizes[0, COLUMNS])
    return Mipmap((), level_views(values, sizes), np.empty((0, 0), values.dtype), values[None, pixels:])


@kernel(parallel=True)
def _build_slopes(depth: Array, covered: Array, relative: bool, sizes: Array, rows: Array, values: Array) -> None:
    for strip in prange(len(rows)):
        _slopes_of_strip(np.int64(strip), depth, covered, relative, sizes, rows, values)


@kernel
def _slopes_of_strip(
    strip: Any, depth: Array, covered: Array, relative: bool, sizes: Array, rows: Array, values: Array
) -> None:
    """Fill all levels in a row of cells of the coarsest one."""
    height, width = depth.shape
    across = rows[strip, BESIDE]
    begin, end = rows_of(strip, 0, sizes)
    _depth_differences(depth, covered, max(begin - 1, 0), begin, 0, rows[strip, BELOW + begin % 2])
    for y in range(begin, end):
        above, below = rows[strip, BELOW + y % 2], rows[strip, BELOW + (y + 1) % 2]
        _depth_differences(depth, covered, y, y, 1, across[1:])
        _depth_differences(depth, covered, y, min(y + 1, height - 1), 0, below)
        _slopes_of_row(depth[y], covered[y], relative, across, above, below, values[y * width : (y + 1) * width])
    coarsen(strip, 0, sizes, values[:0], values)


@kernel
def _depth_differences(depth: Array, covered: Array, y: int, v: int, beside: int, out: Array) -> None:
    """Store |z1 - z2| of the pairs (y, x) and (v, x + beside), 0 where either shows no surface."""
    width = depth.shape[1] - beside
    one, other, one_covered, other_covered = depth[y], depth[v, beside:], covered[y], covered[v, beside:]
    for x in range(width):
        step = abs(one[x] - other[x])
        out[x] = step if one_covered[x] & other_covered[x] else depth.dtype.type(0.0)


@kernel
def _slopes_of_row(
    depth: Array, covered: Array, relative: bool, across: Array, above: Array, below: Array, out: Array
) -> None:
    one = depth.dtype.type(1.0)
    for x in range(len(out)):
        left, right = across[x], across[x + 1]
        horizontal = left if left > right else right
        vertical = above[x] if above[x] > below[x] else below[x]
        # Sec. 3.2.1: depth derivative
        slope = math.sqrt(horizontal * horizontal + vertical * vertical) / (depth[x] if relative else one)
        out[x] = slope if covered[x] else depth.dtype.type(0.0)


@kernel(parallel=True)
def _build_curvatures(
    normal: Array, position: Array, covered: Array, rate: bool, sizes: Array, rows: Array, values: Array
) -> None:
    for strip in prange(len(rows)):
        _curvatures_of_strip(np.int64(strip), normal, position, covered, rate, sizes, rows, values)


@kernel
def _curvatures_of_strip(
    strip: Any, normal: Array, position: Array, covered: Array, rate: bool, sizes: Array, rows: Array, values: Array
) -> None:
    """Fill all levels in a row of cells of the coarsest one."""
    height, width = covered.shape
    across, distance = rows[strip, BESIDE], rows[strip, DISTANCE]
    begin, end = rows_of(strip, 0, sizes)
    above = rows[strip, BELOW + begin % 2]
    _normal_differences(normal, position, covered, max(begin - 1, 0), begin, 0, rate, distance, above)
    for y in range(begin, end):
        above, below = rows[strip, BELOW + y % 2], rows[strip, BELOW + (y + 1) % 2]
        _normal_differences(normal, position, covered, y, y, 1, rate, distance, across[1:])
        _normal_differences(normal, position, covered, y, min(y + 1, height - 1), 0, rate, distance, below)
        _max_of_neighbours(across, above, below, values[y * width : (y + 1) * width])
    coarsen(strip, 0, sizes, values[:0], values)


@kernel
def _normal_differences(
    normal: Array, position: Array, covered: Array, y: int, v: int, beside: int, rate: bool, distance: Array, out: Array
) -> None:
    """Store |N1 - N2| or |N1 - N2| / |x1 - x2| of the pairs (y, x) and (v, x + beside), squared; 0 without surface."""
    zero = normal.dtype.type(0.0)
    width = covered.shape[1] - beside
    _squared_distances(normal, y, v, beside, out)
    if rate:
        _squared_distances(position, y, v, beside, distance)
        for x in range(width):
            out[x] = out[x] / distance[x] if out[x] > zero else zero
    one_covered, other_covered = covered[y], covered[v, beside:]
    for x in range(width):
        out[x] = out[x] if one_covered[x] & other_covered[x] else zero


@kernel
def _squared_distances(vectors: Array, y: int, v: int, beside: int, out: Array) -> None:
    """Store the squared distances of the vectors of the pairs (y, x) and (v, x + beside)."""
    for c in range(3):
        one, other = vectors[c, y], vectors[c, v, beside:]
        for x in range(len(other)):
            # Eq. (1), squared: 2 sin(arccos(N1 . N2) / 2) = |N1 - N2|
            difference = one[x] - other[x]
            square = difference * difference
            out[x] = out[x] + square if c else square


@kernel
def _max_of_neighbours(across: Array, above: Array, below: Array, out: Array) -> None:
    """Store the root of the largest of each pixel's four pairs."""
    for x in range(len(out)):
        horizontal = across[x] if across[x] > across[x + 1] else across[x + 1]
        vertical = above[x] if above[x] > below[x] else below[x]
        out[x] = math.sqrt(horizontal if horizontal > vertical else vertical)
