"""A virtual area light stands for the visibility of the lights of one cluster (Sec. 4, 5)."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy.typing as npt

Array = npt.NDArray[Any]
Given = Callable[[int, Array, Array], Array]  # (area light, points (3, n), facing (3, n)) -> V (n,)


class AreaLights(NamedTuple):
    """M rectangles; those of empty clusters have no `members` and are of no use."""

    center: Array  # (3, M) float64, m
    normal: Array  # (3, M) float64, unit vectors
    frame: Array  # (M, 3, 3) float64: rows right, down, forward of its map, unit vectors; forward is the normal
    side: Array  # (2, M) float64, m: of the bounding rectangle, along its own axes
    axes: Array  # (M, 2, 3) float64: unit vectors along the sides, in the plane of the normal
    offset: Array  # (2, M) float64, m: the rectangle's middle, along the axes from `center`
    delta: Array  # (M,) float64, m: Delta, the size of the light as a filter sees it; 0: a point
    radius: Array  # (M,) float64, m: from the centre to the farthest light of the cluster
    members: Array  # (M,) int64: lights of the cluster
    of: Array  # (N,) int32: C(i), the area light of each pixel light
