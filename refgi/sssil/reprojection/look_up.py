"""W: fetch for every surface point the value of the same point in another view (Sec. 3.3)."""

import math
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.rsm.memory import plane
from refgi.rsm.projection import PERSPECTIVE, Projection
from refgi.scene.values import Vector
from refgi.stages import stage

Array = npt.NDArray[Any]
Fetch = Literal["bilinear", "nearest"]

SNAP = 2.0**-8  # texels: so far off may float32 put a point that lies at a texel's centre


class Seen(NamedTuple):
    """A view that is asked: who looks, and the surfaces that a texel sees."""

    projection: Projection  # one perspective map
    depth: Array  # (h, w) along the view direction, m; inf where no surface is seen
    normal: Array  # (3, h, w) unit vectors
    origin: Vector = (0.0, 0.0, 0.0)  # where the origin of the view's places lies, m (`Frame.origin`)


@stage("sssil.look_up", kept=False)
def look_up(
    values: Array, there: Seen, position: Array, normal: Array, covered: Array, *, depth_tolerance: float,
    normal_cosine: float, fetch: Fetch = "bilinear", origin: Vector | None = None,
) -> tuple[Array, Array]:
    """Fetch values of a view at surface points of another.

    Parameters
    ----------
    values : (3, h, w) ndarray
        What each texel of the view `there` holds.
    there : Seen
        The view that is asked.
    position : (3, h', w') ndarray
        The points, in the view's own world space unless `origin` is given, m.
    normal : (3, h', w') ndarray
        Their unit normals.
    covered : (h', w') ndarray of bool
        Which points there are.
    depth_tolerance : float
        Largest difference of a texel's depth from the point's, as a share of the point's.
    normal_cosine : float
        Smallest cosine between a texel's normal and the point's.
    fetch : {"bilinear", "nearest"}
        From the four texels around the point, or from the one it falls in.
    origin : tuple of 3 floats, optional
        Where the origin of `position` lies, m; that of `there` where absent.

    Returns
    -------
    found : (3, h', w') ndarray
        Mean of the texels that show the same surface, weighted bilinearly; 0 where none does.
    weight : (h', w') ndarray
        Share of the four weights that those texels have, 0 to 1.

    Raises
    ------
    InputError
        If the view is no single perspective map or sizes do not fit together.

    Notes
    -----
    A point within 1/256 texel of a texel's centre takes that texel alone, so that a view which did not move gives its
    values back unchanged, however often it is asked.
    """
    projection = there.projection
    expect(projection.kind == PERSPECTIVE and projection.maps == 1, "there", "one perspective map", projection.kind)
    expect(values.shape[1:] == there.depth.shape == projection.shape, "values", f"(3, h, w) with {projection.shape}",
           values.shape)
    dtype = position.dtype
    moved = np.zeros(3) if origin is None else np.subtract(there.origin, origin)
    eye = (projection.origin[0] + moved).astype(dtype)
    scale = np.array([projection.width, projection.height], dtype) / (2 * projection.half).astype(dtype)
    found, weight = plane(position.shape, dtype), plane(covered.shape, dtype)
    limits = np.array([depth_tolerance, normal_cosine, SNAP], dtype)
    _look_up(values, there.depth, there.normal, eye, projection.frame[0].astype(dtype), scale, limits,
             fetch == "nearest", position, normal, covered, found, weight)
    return found, weight


@kernel(parallel=True)
def _look_up(
    values: Array, depth: Array, normal_there: Array, eye: Array, frame: Array, scale: Array, limits: Array,
    nearest: bool, position: Array, normal: Array, covered: Array, found: Array, weight: Array,
) -> None:
    for row in prange(covered.shape[0]):
        for column in range(covered.shape[1]):
            for c in range(3):
                found[c, row, column] = 0
            weight[row, column] = 0
            if covered[row, column]:
                x, y, z = _place(position, row, column, eye, frame, scale, depth)
                if z > 0:
                    _fetch(values, depth, normal_there, x, y, z, limits, nearest, normal, row, column, found, weight)


@kernel
def _place(
    position: Array, row: int, column: int, eye: Array, frame: Array, scale: Array, depth: Array
) -> tuple[Any, Any, Any]:
    """Return column, row (a texel's centre at whole numbers) and depth of a point; depth -1 off the picture."""
    real = position.dtype.type
    half = real(0.5)
    dx, dy, dz = position[0, row, column] - eye[0], position[1, row, column] - eye[1], position[2, row, column] - eye[2]
    z = frame[2, 0] * dx + frame[2, 1] * dy + frame[2, 2] * dz
    right = frame[0, 0] * dx + frame[0, 1] * dy + frame[0, 2] * dz
    down = frame[1, 0] * dx + frame[1, 1] * dy + frame[1, 2] * dz
    if not z > 0:
        return half, half, real(-1)
    height, width = depth.shape
    x = right / z * scale[0] + (real(width) - real(1)) * half
    y = down / z * scale[1] + (real(height) - real(1)) * half
    inside = (x >= -half) & (y >= -half) & (x <= real(width) - half) & (y <= real(height) - half)
    return x, y, (z if inside else real(-1))


@kernel
def _fetch(
    values: Array, depth: Array, normal_there: Array, x: float, y: float, z: float, limits: Array, nearest: bool,
    normal: Array, row: int, column: int, found: Array, weight: Array,
) -> None:
    """Average the texels around a place that show the same surface as the point."""
    real = values.dtype.type
    one = real(1)
    height, width = depth.shape
    left, share_right = _split(x, limits, nearest)
    top, share_below = _split(y, limits, nearest)
    red, green, blue, total = real(0), real(0), real(0), real(0)
    first_red, first_green, first_blue = red, green, blue
    for tap in range(4):
        i, j = top + (tap >> 1), left + (tap & 1)
        share = (share_right if tap & 1 else one - share_right) * (share_below if tap >> 1 else one - share_below)
        if share > 0 and 0 <= i < height and 0 <= j < width:
            cosine = (normal_there[0, i, j] * normal[0, row, column] + normal_there[1, i, j] * normal[1, row, column]
                      + normal_there[2, i, j] * normal[2, row, column])
            if abs(depth[i, j] - z) <= limits[0] * z and cosine >= limits[1]:
                if total == 0:
                    first_red, first_green, first_blue = values[0, i, j], values[1, i, j], values[2, i, j]
                total += share
                red += share * (values[0, i, j] - first_red)  # differences: a constant stays itself to the bit
                green += share * (values[1, i, j] - first_green)
                blue += share * (values[2, i, j] - first_blue)
    if total > 0:
        found[0, row, column], found[1, row, column] = first_red + red / total, first_green + green / total
        found[2, row, column], weight[row, column] = first_blue + blue / total, min(total, one)


@kernel
def _split(x: float, limits: Array, nearest: bool) -> tuple[int, Any]:
    """Return the texel before a place and the share of the one behind it, 0 where the place is a centre."""
    real = limits.dtype.type
    near = math.floor(x + real(0.5))
    if nearest or abs(x - real(near)) <= limits[2]:
        return int(near), real(0)
    before = math.floor(x)
    return int(before), x - real(before)
