"""Depth scale: from distances to depths of the series and back, the scale that a depth map is compared on (Sec. 4.1).

The series' bias is a share of its range, so the scale says how near a blocker may come to a receiver and still cast a
shadow. The paper takes depths of [0, 1] and does not say of what. What a map holds are its occluders alone: on a scale
stretched from the nearest to the farthest of them, and even in ratios of distances instead of metres, the same few
terms tell more of them from what they shade.

Symbols: z distance from the map's centre, m; t depth of the series, 0 to `most`; near and far what the map holds, m.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.elementary import exp2, log2
from refgi.jit import kernel

Array = npt.NDArray[Any]

LEAST_RATIO = 1.05  # far over near: the bias is then more than the thousandth that the step keeps before surfaces
MOST_RATIO = 2.0**20  # the same: what is nearer counts as near


class DepthScale(NamedTuple):
    """How distances become depths; or with an axis in `origin` and `slope`, those of several maps."""

    logarithmic: bool
    origin: Any  # m: what is 0 on the series' scale
    slope: Any  # depth of the series for each metre, or each octave
    most: Any  # far end: what lies beyond, and nothing at all


def joined(scales: Sequence[DepthScale]) -> DepthScale:
    """Return the scales of several maps, all of one kind, as one with an axis."""
    return scales[0]._replace(origin=np.array([scale.origin for scale in scales], np.float64),
                              slope=np.array([scale.slope for scale in scales], np.float64))


def depth_scale(kind: str, near: float, far: float, scene_far: float, most: float) -> DepthScale:
    """Return the scale of one map, whose nearest and farthest distances are 0 < near <= far, m, as Python floats.

    "log_map": the logarithm of distances between these; "map": distances between them; "scene": distances up to
    `scene_far`, the farthest place of the scene's extent, m. `most` is the far end of the series' range. What the map
    holds ends 1 - `most` below that, both biases, so that its farthest blocker still hides wholly what lies beyond; or
    in the middle where so few terms leave less than that.
    """
    if kind == "scene":
        return DepthScale(False, 0.0, most / scene_far, most)
    near = max(near, far / MOST_RATIO)
    far = max(far, LEAST_RATIO * near)
    top = max(2.0 * most - 1.0, most / 2.0)
    span = math.log2(far / near) if kind == "log_map" else far - near
    return DepthScale(kind == "log_map", near, top / span, most)


@kernel
def series_depths(scale: DepthScale, distance: Array, depth: Array, count: int) -> None:
    """Fill depth[:count] with t, 0 to `scale.most`, of distances, m; inf where the map is empty."""
    real = distance.dtype.type
    origin, slope, most, zero = real(scale.origin), real(scale.slope), real(scale.most), real(0.0)
    if scale.logarithmic:
        inverse = real(1.0) / origin
        for i in range(count):
            t = log2(distance[i] * inverse) * slope
            t = t if t > zero else zero
            depth[i] = t if t < most else most
    else:
        for i in range(count):
            t = (distance[i] - origin) * slope
            t = t if t > zero else zero
            depth[i] = t if t < most else most


@kernel
def series_distance(scale: DepthScale, depth: Any) -> Any:
    """Return the distance, m, that a depth t of the series stands for."""
    real = type(depth)
    along = depth / real(scale.slope)
    return real(scale.origin) * exp2(along) if scale.logarithmic else along + real(scale.origin)
