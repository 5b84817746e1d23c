"""Which of several pixels a texel takes over: the one nearest to the eye.

Of equally near ones it is that nearest to the picture's vertical centre line, then the upper, then the left one. So a
mirror-symmetric picture of an even number of texels has mirror-symmetric levels, and the choice is the same whether
it is made at once or level by level.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel

Array = npt.NDArray[Any]

NOWHERE = 2**31 - 1  # place of what lies beyond the picture's edge


@kernel
def before(depth: Any, off_centre: int, pixel: int, other_depth: Any, other_off_centre: int, other_pixel: int) -> bool:
    """Return whether a pixel is taken rather than another.

    Parameters
    ----------
    depth, other_depth : float
        Along the view direction, m; inf where no surface is seen.
    off_centre, other_off_centre : int
        Distance from the centre line, half pixels.
    pixel, other_pixel : int
        Row * width + column.

    Returns
    -------
    bool
        Never true both ways round.
    """
    earlier = (off_centre < other_off_centre) | ((off_centre == other_off_centre) & (pixel < other_pixel))
    return bool((depth < other_depth) | ((depth == other_depth) & earlier))


@kernel
def choose_among_pixels(depth: Array, i: int, number: int, room_depth: Array, room_place: Array) -> None:
    """Choose a pixel for each texel of a row.

    Parameters
    ----------
    depth : (H, W) ndarray
        Of the picture.
    i : int
        Row of texels.
    number : int
        Level k: a texel covers 2^k x 2^k pixels.
    room_depth : (2, 2^k, W + 2^k) ndarray
        ``room_depth[0, 0]`` becomes the texels' depths.
    room_place : (2, 2, 2^k, W + 2^k) ndarray of int32
        ``room_place[0, 1, 0]`` becomes the texels' pixels; [.., 0, ..] is their distance from the centre line.
    """
    side = 1 << number
    for y in range(side):
        _load_pixels(depth, i * side + y, side, room_depth[0, y], room_place[0, 0, y], room_place[0, 1, y])
    count = depth.shape[1]
    for _ in range(number):
        count, side = (count + 1) // 2, side // 2
        for y in range(side):
            _halve(room_depth[0], room_place[0, 0], room_place[0, 1], y, count, room_depth[1, y], room_place[1, 0, y],
                   room_place[1, 1, y])
            _copy(room_depth[1, y], room_place[1, 0, y], room_place[1, 1, y], count, side, room_depth[0, y],
                  room_place[0, 0, y], room_place[0, 1, y])


@kernel
def _load_pixels(depth: Array, row: int, side: int, to_depth: Array, off_centre: Array, pixel: Array) -> None:
    height, width = depth.shape
    for c in range(width + side):
        to_depth[c] = np.inf
        off_centre[c] = abs(2 * c + 1 - width)
        pixel[c] = NOWHERE
    if row < height:
        for c in range(width):
            to_depth[c] = depth[row, c]
            pixel[c] = row * width + c


@kernel
def _halve(
    depth: Array, off_centre: Array, pixel: Array, y: int, count: int, to_depth: Array, to_off_centre: Array,
    to_pixel: Array,
) -> None:
    for j in range(count):
        row, c = 2 * y, 2 * j
        for child in range(1, 4):
            r, k = 2 * y + child // 2, 2 * j + child % 2
            if before(depth[r, k], off_centre[r, k], pixel[r, k], depth[row, c], off_centre[row, c], pixel[row, c]):
                row, c = r, k
        to_depth[j], to_off_centre[j], to_pixel[j] = depth[row, c], off_centre[row, c], pixel[row, c]


@kernel
def _copy(
    depth: Array, off_centre: Array, pixel: Array, count: int, side: int, to_depth: Array, to_off_centre: Array,
    to_pixel: Array,
) -> None:
    for j in range(count):
        to_depth[j], to_off_centre[j], to_pixel[j] = depth[j], off_centre[j], pixel[j]
    for j in range(count, count + side):
        to_depth[j], to_off_centre[j], to_pixel[j] = np.inf, NOWHERE, NOWHERE
