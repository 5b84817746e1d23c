"""Which pixel of several a texel takes over: the one nearest to the eye.

Of equally near ones it is that nearest to the picture's vertical centre line, then the upper, then the left one. So a
mirror-symmetric picture of an even number of texels has mirror-symmetric levels, and the choice is the same whether
it is made at once or level by level. The best of each column is found first, with the columns as SIMD lanes, then the
best of neighbouring columns.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel

Array = npt.NDArray[Any]

BEYOND = 2**31 - 1  # place of what lies beyond the picture's edge


@kernel
def choose_pixels(depth: Array, i: int, side: int, nearest: Array, row: Array, chosen: Array) -> None:
    """Choose a pixel for each texel of a row.

    Parameters
    ----------
    depth : (H, W) ndarray
        Of the picture, m; inf where no surface is seen.
    i : int
        Row of texels.
    side : int
        Pixels along a side of a texel.
    nearest : (W + side,) ndarray
        Room for the least depth of each column.
    row : (W + side,) ndarray of int32
        Becomes the row of the best pixel of each column.
    chosen : (w,) ndarray of int32
        Becomes the column of the best pixel of each texel.
    """
    height, width = depth.shape
    first, columns = np.int32(i * side), np.uint64(width)
    for c in range(columns):
        nearest[c] = depth[first, c]
        row[c] = first
    for r in range(first + 1, min(first + side, height)):
        for c in range(columns):
            lower = depth[r, c] < nearest[c]
            nearest[c] = depth[r, c] if lower else nearest[c]
            row[c] = np.int32(r) if lower else row[c]
    for c in range(width, width + side):
        nearest[c] = np.inf
    before_centre = width // (2 * side)
    past_centre = (width + 2 * side - 1) // (2 * side)
    _choose_columns(nearest, side, 0, before_centre, side - 1, -1, chosen)
    _choose_columns(nearest, side, past_centre, len(chosen), 0, 1, chosen)
    for j in range(before_centre, past_centre):
        chosen[j] = _astride(nearest, row, j * side, min(j * side + side, width), width)


@kernel
def _choose_columns(nearest: Array, side: int, first: int, end: int, start: int, step: int, chosen: Array) -> None:
    """Choose from column `start` of each texel on, which lies next to the centre line, away from it."""
    if side == 2:  # a constant stride is loaded in SIMD lanes
        for k in range(np.uint64(end - first)):
            j = k + np.uint64(first)
            left = np.uint64(2) * j
            right = left + np.uint64(1)
            is_right = (nearest[right] <= nearest[left]) if step < 0 else (nearest[right] < nearest[left])
            chosen[j] = np.int32(left) + (np.int32(1) if is_right else np.int32(0))
        return
    for texel in range(first, end):
        best = texel * side + start
        for away in range(1, side):
            c = texel * side + start + away * step
            best = c if nearest[c] < nearest[best] else best
        chosen[texel] = best


@kernel
def _astride(nearest: Array, row: Array, first: int, end: int, width: int) -> int:
    """Return the best column of a texel that the centre line crosses."""
    best = first
    for c in range(first + 1, end):
        if before(nearest[c], abs(2 * c + 1 - width), row[c] * width + c,
                  nearest[best], abs(2 * best + 1 - width), row[best] * width + best):
            best = c
    return best


@kernel
def choose_texels(
    depth: Array, pixel: Array, i: int, width: int, nearest: Array, place: Array, chosen: Array
) -> None:
    """Choose one of four texels of the finer level for each texel of a row.

    Parameters
    ----------
    depth : (h, w) ndarray
        Of the finer level, m.
    pixel : (h, w) ndarray of int32
        Which pixels of the picture these are.
    i : int
        Row of the coarser level.
    width : int
        Of the picture, pixels.
    nearest : (w + 1,) ndarray
        Room for the least depth of each column.
    place : (3, w + 1) ndarray of int32
        ``place[0]`` becomes the row of the best texel of each column; room for its pixel's distance from the centre
        line and the pixel.
    chosen : (ceil(w / 2),) ndarray of int32
        Becomes the column of the best texel.
    """
    rows, columns = depth.shape
    row, off_centre, best = place[0], place[1], place[2]
    upper, lower = np.int32(2 * i), np.int32(min(2 * i + 1, rows - 1))
    for c in range(np.uint64(columns)):
        above, below = pixel[upper, c], pixel[lower, c]
        from_centre, other = _off_centre(above, width), _off_centre(below, width)
        is_lower = before(depth[lower, c], other, below, depth[upper, c], from_centre, above)
        nearest[c] = depth[lower, c] if is_lower else depth[upper, c]
        row[c] = lower if is_lower else upper
        off_centre[c] = other if is_lower else from_centre
        best[c] = below if is_lower else above
    nearest[columns], off_centre[columns], best[columns] = np.inf, BEYOND, BEYOND
    for j in range(np.uint64(len(chosen))):
        left = np.uint64(2) * j
        right = left + np.uint64(1)
        is_right = before(nearest[right], off_centre[right], best[right], nearest[left], off_centre[left], best[left])
        chosen[j] = np.int32(left) + (np.int32(1) if is_right else np.int32(0))


@kernel
def _off_centre(pixel: Any, width: int) -> Any:
    """Return how many half pixels a pixel lies beside the centre line; a division of integers has no SIMD form."""
    row = np.floor((pixel + 0.5) / width)
    return np.int32(abs(2.0 * (pixel - row * width) + 1.0 - width))


@kernel
def before(depth: Any, off_centre: int, pixel: int, other_depth: Any, other_off_centre: int, other_pixel: int) -> bool:
    """Return whether a pixel is taken rather than another.

    Parameters
    ----------
    depth : float
        Along the view direction, m; inf where no surface is seen.
    off_centre : int
        Distance from the centre line, half pixels.
    pixel : int
        Row * width + column.
    other_depth, other_off_centre, other_pixel : float, int, int
        Those of the other.

    Returns
    -------
    bool
        Never true both ways round.
    """
    earlier = (off_centre < other_off_centre) | ((off_centre == other_off_centre) & (pixel < other_pixel))
    return bool((depth < other_depth) | ((depth == other_depth) & earlier))
