"""Which cells of a picture are refined, and the list of subsplats (AMS Sec. 3.2 and 3.3: Nichols and Wyman 2009).

Level l has cells of 2^l x 2^l pixels, cut by the picture at its right and lower border; level 0 is the picture, `top`
the coarsest level. A pixel without surface (triangle_id < 0) counts nowhere.

Symbols: N1, N2 normals and x1, x2 positions of neighbouring pixels; t threshold of a test; level, row i, column j of a
cell.
"""

from typing import Any

import numpy as np

EMPTY, KEPT, REFINED = 0, 1, 2  # states of cells
BESIDE = (np.s_[..., 1:-1, :-2], np.s_[..., 1:-1, 2:], np.s_[..., :-2, 1:-1], np.s_[..., 2:, 1:-1])


def grid(shape: Any, level: int) -> tuple[int, int]:
    """Return rows and columns of a level of a picture (h, w)."""
    return -(-shape[0] >> level), -(-shape[1] >> level)


def of_cells(join: Any, plane: Any, level: int, rim: int = 0) -> Any:
    """Return what `join` makes of the pixels (..., h, w) of each cell, (..., h_l, w_l); `rim` pixels around count too.

    The rim of the paper's Fig. 15: an edge that lies between two cells is in both.
    """
    side, (height, width) = 1 << level, plane.shape[-2:]
    made = np.empty((*plane.shape[:-2], *grid((height, width), level)), plane.dtype)
    for i, j in np.ndindex(*made.shape[-2:]):
        y, x = i * side, j * side
        rows = slice(max(y - rim, 0), y + side + rim)
        columns = slice(max(x - rim, 0), x + side + rim)
        made[..., i, j] = join(plane[..., rows, columns])
    return made


# ranges: the cell's least and largest depth, and those of its normals' components


def depth_ranges(depth: Any, triangle_id: Any, top: int, rim: int) -> list[Any]:
    """Return least depths of levels 1 to top, then the largest ones, m (AMS Sec. 3.2.1)."""
    return ranges(depth, triangle_id, top, rim)


def normal_ranges(normal: Any, triangle_id: Any, top: int, rim: int, components: int) -> list[Any]:
    """Return least components of normals, (3 or 2, h_l, w_l), of levels 1 to top, then the largest ones (Sec. 3.2.2).

    E-AMS-07: the paper compares x, y and z, the authors' demo x and y.
    """
    return ranges(normal[:components], triangle_id, top, rim)


def ranges(plane: Any, triangle_id: Any, top: int, rim: int) -> list[Any]:
    """Return least values of levels 1 to top, inf in cells without surface, then the largest ones, -inf there."""
    shown = triangle_id >= 0
    levels = range(1, top + 1)
    low, high = np.where(shown, plane, np.inf), np.where(shown, plane, -np.inf)
    # E-AMS-06: the least of all four quadrants
    least = [of_cells(lambda cell: cell.min(axis=(-2, -1), initial=np.inf), low, level, rim) for level in levels]
    largest = [of_cells(lambda cell: cell.max(axis=(-2, -1), initial=-np.inf), high, level, rim) for level in levels]
    return [*least, *largest]


# differences of neighbours: the steepest slope of depth, the largest curvature


def slopes(depth: Any, triangle_id: Any, top: int, relative: bool) -> list[Any]:
    """Return the steepest change of depth in each cell of levels 1 to top, m per pixel or 1 per pixel (Sec. 3.2.1)."""
    shown = triangle_id >= 0
    left, right, above, below = np.abs(differences(np.where(shown, depth, 0), shown))
    dx, dy = np.maximum(left, right), np.maximum(above, below)
    slope = np.sqrt(dx**2 + dy**2)
    if relative:
        slope = slope / np.where(shown, depth, 1)
    return largest_in_cells(slope, top)


def curvatures(normal: Any, position: Any, triangle_id: Any, top: int, rate: bool) -> list[Any]:
    """Return the largest chord between neighbouring normals in each cell, over the points' distance for a rate, 1/m.

    E-AMS-01: 2 sin(arccos(N1 . N2) / 2) is |N1 - N2|, and a curvature (1/R on a sphere) only over the distance.
    """
    shown = triangle_id >= 0
    # Eq. (1)
    chords = [np.sqrt((step**2).sum(axis=0)) for step in differences(normal, shown)]
    if rate:
        away = [np.sqrt((step**2).sum(axis=0)) for step in differences(position, shown)]
        chords = [np.divide(one, r, out=np.zeros_like(one), where=one > 0) for one, r in zip(chords, away, strict=True)]
    left, right, above, below = chords
    curvature = np.maximum(np.maximum(left, right), np.maximum(above, below))
    return largest_in_cells(curvature, top)


def differences(plane: Any, shown: Any) -> list[Any]:
    """Return pixels less their left, right, upper and lower neighbours; 0 where either of both shows no surface."""
    edges = [(0, 0)] * (plane.ndim - 2) + [(1, 1), (1, 1)]
    around, known = np.pad(plane, edges), np.pad(shown, 1)
    return [np.where(shown & known[there], plane - around[there], 0) for there in BESIDE]


def largest_in_cells(plane: Any, top: int) -> list[Any]:
    """Return the largest value in each cell of levels 1 to top."""
    return [of_cells(lambda cell: cell.max(), plane, level) for level in range(1, top + 1)]


# tests against thresholds


def discontinuities(
    top: int, finest: int, depth_least: Any = None, depth_largest: Any = None, slope: Any = None,
    normal_least: Any = None, normal_largest: Any = None, curvature: Any = None, depth_threshold: float = 0,
    depth_measure: str = "", slope_threshold: float = 0, slope_measure: str = "", normal_threshold: float = 0,
    curvature_threshold: float = 0,
) -> list[Any]:
    """Return which cells of levels 1 to top any test finds discontinuous, (h_l, w_l) bool (AMS Sec. 3.2).

    Arrays are lists of levels, None where there is no such test. Measures: "absolute" t metres (as published),
    "relative" t times the depth, "demo" 3 t / level times the depth (E-AMS-07).
    """
    marked = []
    for level in range(1, top + 1):
        tests, k = [], level - 1
        if depth_least is not None:
            tests.append(depths_differ(depth_least[k], depth_largest[k], level, depth_threshold, depth_measure))
        if slope is not None:
            slope_limit = slope_threshold * (3 / level if slope_measure == "demo" else 1)
            tests.append(slope[k] > slope_limit)
        if normal_least is not None:
            tests.append(normals_differ(normal_least[k], normal_largest[k], normal_threshold))
        if curvature is not None:
            tests.append(curvature[k] > curvature_threshold)
        found = np.logical_or.reduce(tests)
        marked.append(found & (level > finest))  # the finest level is never refined
    return marked


def depths_differ(least: Any, largest: Any, level: int, threshold: float, measure: str) -> Any:
    """Return where the range of depths exceeds the threshold (Sec. 3.2.1)."""
    limit = threshold * (3 / level if measure == "demo" else 1)
    most = limit if measure == "absolute" else limit * least
    return largest - least > most


def normals_differ(least: Any, largest: Any, threshold: float) -> Any:
    """Return where the range of any component of normals exceeds the threshold (Sec. 3.2.2)."""
    spread = np.where(np.isinf(least), 0, largest - least)
    return (spread > threshold).any(axis=0)


# cells that are refined, and the list of those that are not


def states(discontinuous: Any, triangle_id: Any, diagonal: str) -> list[Any]:
    """Return which cells of levels 1 to top are EMPTY, KEPT or REFINED (AMS Sec. 3.3, 5.2)."""
    found = []
    for level, marked in enumerate(discontinuous, 1):
        shown = of_cells(lambda cell: cell.any(), triangle_id >= 0, level)
        needed = marked | asked_by_neighbours(marked, diagonal)
        found.append(np.where(shown, np.where(needed, REFINED, KEPT), EMPTY))
    return found


def asked_by_neighbours(marked: Any, diagonal: str) -> Any:
    """Return which cells are refined for discontinuous neighbours (Fig. 15; E-AMS-10).

    "literal": all across a corner, as published; "corner": those across a bare corner, whose both shared neighbours are
    smooth; "full8": all eight; "off": none.
    """
    rows, columns = marked.shape
    around, asked = np.pad(marked, 1), np.zeros_like(marked)  # E-AMS-10: outside the screen no discontinuity
    for y, x in np.ndindex(3, 3):
        there = around[y : y + rows, x : x + columns]
        beside_row, beside_column = around[y : y + rows, 1:-1], around[1:-1, x : x + columns]
        across_corner = y != 1 and x != 1
        if diagonal == "corner":
            there = there & ~(beside_row | beside_column)
        if diagonal == "full8" or (across_corner and diagonal != "off"):
            asked |= there
    return asked


def subsplats(triangle_id: Any, cell_states: Any, finest: int) -> tuple[Any, ...]:
    """Return level, row, column and representative pixel (n,) of the subsplats: every surface lies in one (Sec. 3.3).

    Cells of the coarsest level row by row, depth first within them. A pixel is row * width + column.
    """
    shown, top = triangle_id >= 0, len(cell_states)
    grids = [np.where(triangle_id >= 0, KEPT, EMPTY), *cell_states]
    cells = [leaf for i, j in np.ndindex(*grids[top].shape) for leaf in leaves(grids, top, i, j, finest)]
    level, row, column = np.array(cells, np.int64).reshape(-1, 3).T
    pixel = np.array([representative(shown, *cell) for cell in cells], np.int64)
    return level, row, column, pixel


def leaves(grids: Any, level: int, i: int, j: int, finest: int) -> list[tuple[int, int, int]]:
    """Return the subsplats in a cell: itself, or those in its four children (E-AMS-08: coarser cells decide first)."""
    rows, columns = grids[level].shape
    if i >= rows or j >= columns or grids[level][i, j] == EMPTY:
        return []
    if grids[level][i, j] == KEPT or level == finest:
        return [(level, i, j)]
    quadrants = ((0, 0), (0, 1), (1, 0), (1, 1))
    return [leaf for y, x in quadrants for leaf in leaves(grids, level - 1, 2 * i + y, 2 * j + x, finest)]


def representatives(triangle_id: Any, top: int) -> list[Any]:
    """Return the representative pixel of every cell of levels 0 to top, (h_l, w_l); -1 without surface (E-AMS-11)."""
    shapes = [grid(triangle_id.shape, level) for level in range(top + 1)]
    return [np.array([[representative(triangle_id >= 0, level, i, j) for j in range(columns)] for i in range(rows)])
            for level, (rows, columns) in enumerate(shapes)]


def representative(shown: Any, level: int, i: int, j: int) -> int:
    """Return the pixel of a cell that stands for it; -1 without surface (E-AMS-11: the paper does not say).

    The pixel right and below of its centre; where that shows no surface the nearest that does, the first of several.
    """
    side, (height, width) = 1 << level, shown.shape
    row = min(i * side + side // 2, height - 1)
    column = min(j * side + side // 2, width - 1)
    if shown[row, column]:
        return int(row * width + column)
    y, x = np.nonzero(shown[i * side : (i + 1) * side, j * side : (j + 1) * side])
    if len(y) == 0:
        return -1
    y, x = y + i * side, x + j * side
    square = (y - row) ** 2 + (x - column) ** 2
    nearest = np.argmin(square)
    return int(y[nearest] * width + x[nearest])
