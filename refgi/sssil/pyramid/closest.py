"""Choice of the pixel that a texel stands for: the one nearest to the eye (Sec. 4, hierarchical maps).

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

NO_PIXEL = 2**31 - 1  # beyond the picture's edge


@kernel
def choose_pixels(depth: Array, i: int, side: int, nearest: Array, row: Array, chosen: Array) -> None:
    """Choose the nearest pixel for each texel of row i; `side` pixels along a texel's side.

    `depth` (H, W) m, inf for no surface. Scratch: `nearest` (W + side,), least depth of each column, and `row`, its
    row. `chosen` (w,) is filled with columns.
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
        chosen[j] = _best_across_centre(nearest, row, j * side, min(j * side + side, width), width)


@kernel
def _choose_columns(nearest: Array, side: int, first: int, end: int, start: int, step: int, chosen: Array) -> None:
    """Choose from column `start` of each texel on, which is next to the centre line, away from it."""
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
def _best_across_centre(nearest: Array, row: Array, first: int, end: int, width: int) -> int:
    """Return the best column of a texel that the centre line crosses."""
    best = first
    for c in range(first + 1, end):
        if is_nearer(nearest[c], abs(2 * c + 1 - width), row[c] * width + c,
                  nearest[best], abs(2 * best + 1 - width), row[best] * width + best):
            best = c
    return best


@kernel
def choose_texels(
    depth: Array, pixel: Array, i: int, width: int, nearest: Array, best_texel: Array, chosen: Array
) -> None:
    """Choose one of four texels of the finer level for each texel of row i.

    `depth` and `pixel` (h, w) are of the finer level, `width` of the picture. Scratch: `nearest` (w + 1,), least depth
    of each column; `best_texel` (3, w + 1), its row, its pixel's distance from the centre line, and that pixel.
    `chosen` (ceil(w / 2),) is filled with columns.
    """
    rows, columns = depth.shape
    row, off_centre, best = best_texel[0], best_texel[1], best_texel[2]
    upper, lower = np.int32(2 * i), np.int32(min(2 * i + 1, rows - 1))
    for c in range(np.uint64(columns)):
        above, below = pixel[upper, c], pixel[lower, c]
        from_centre, other = _off_centre(above, width), _off_centre(below, width)
        is_lower = is_nearer(depth[lower, c], other, below, depth[upper, c], from_centre, above)
        nearest[c] = depth[lower, c] if is_lower else depth[upper, c]
        row[c] = lower if is_lower else upper
        off_centre[c] = other if is_lower else from_centre
        best[c] = below if is_lower else above
    nearest[columns], off_centre[columns], best[columns] = np.inf, NO_PIXEL, NO_PIXEL
    for j in range(np.uint64(len(chosen))):
        left = np.uint64(2) * j
        right = left + np.uint64(1)
        is_right = is_nearer(nearest[right], off_centre[right], best[right],
                             nearest[left], off_centre[left], best[left])
        chosen[j] = np.int32(left) + (np.int32(1) if is_right else np.int32(0))


@kernel
def _off_centre(pixel: Any, width: int) -> Any:
    """Return how many half pixels a pixel lies beside the centre line; a division of integers has no SIMD form."""
    row = np.floor((pixel + 0.5) / width)
    return np.int32(abs(2.0 * (pixel - row * width) + 1.0 - width))


@kernel
def is_nearer(
    depth: Any, off_centre: int, pixel: int, other_depth: Any, other_off_centre: int, other_pixel: int
) -> bool:
    """Return whether a pixel goes before another: by depth, distance from the centre line in half pixels, then place.

    Never true both ways round.
    """
    earlier = (off_centre < other_off_centre) | ((off_centre == other_off_centre) & (pixel < other_pixel))
    return bool((depth < other_depth) | ((depth == other_depth) & earlier))
