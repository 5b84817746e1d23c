"""W: fetch for every surface point the value of the same point in another view (Sec. 3.3)."""

from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.rsm.memory import plane
from refgi.rsm.raster.projection import PERSPECTIVE, Projection
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
        Largest difference of a texel's depth from the point's, or from that of the point's tangent plane where the
        texel sees it, as a share of the point's.
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
    The paper compares depths. On a plane seen at a grazing angle those of neighbouring texels differ by more than any
    useful tolerance: there a texel passes as well whose depth is that of the plane.

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
    size = np.array([projection.width, projection.height])
    scale = np.concatenate([size / (2 * projection.half), (size - 1) / 2]).astype(dtype)
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
        _place(row, eye, frame, scale, position, covered, found)
        _fetch(row, values, depth, normal_there, frame, scale, limits, nearest, normal, found, weight)


@kernel
def _place(
    row: int, eye: Array, frame: Array, scale: Array, position: Array, covered: Array, place: Array
) -> None:
    """Find column, row (a texel's centre at whole numbers) and depth of a row of points; depth -1 where none is."""
    real = position.dtype.type
    rx, ry, rz = frame[0, 0] * scale[0], frame[0, 1] * scale[0], frame[0, 2] * scale[0]
    ux, uy, uz = frame[1, 0] * scale[1], frame[1, 1] * scale[1], frame[1, 2] * scale[1]
    fx, fy, fz = frame[2, 0], frame[2, 1], frame[2, 2]
    for column in range(covered.shape[1]):
        dx = position[0, row, column] - eye[0]
        dy = position[1, row, column] - eye[1]
        dz = position[2, row, column] - eye[2]
        depth = fx * dx + fy * dy + fz * dz
        ahead = (depth > real(0)) & covered[row, column]
        place[0, row, column] = (rx * dx + ry * dy + rz * dz) / depth + scale[2]
        place[1, row, column] = (ux * dx + uy * dy + uz * dz) / depth + scale[3]
        place[2, row, column] = depth if ahead else real(-1)


@kernel
def _fetch(
    row: int, values: Array, depth: Array, normal_there: Array, frame: Array, scale: Array, limits: Array,
    nearest: bool, normal: Array, found: Array, weight: Array,
) -> None:
    """Average the texels around each place of `found` that show the same surface; the mean takes its place."""
    real = values.dtype.type
    one, half, zero = real(1), real(0.5), real(0)
    height, width = depth.shape
    right_end, bottom_end = real(width) - half, real(height) - half
    least_cosine, snap = limits[1], limits[2]
    view = _rays(frame, scale)
    for column in range(weight.shape[1]):
        x, y, z = found[0, row, column], found[1, row, column], found[2, row, column]
        red, green, blue, total = zero, zero, zero, zero
        first_red, first_green, first_blue = zero, zero, zero
        if z > 0 and -half <= x <= right_end and -half <= y <= bottom_end:
            nx, ny, nz = normal[0, row, column], normal[1, row, column], normal[2, row, column]
            left, share_right = _split(x, snap, nearest)
            top, share_below = _split(y, snap, nearest)
            margin = limits[0] * z
            for below in range(2 if share_below > 0 else 1):
                i = top + below
                share_row = share_below if below else one - share_below
                for beside in range(2 if share_right > 0 else 1):
                    j = left + beside
                    if not (0 <= i < height and 0 <= j < width):
                        continue
                    cosine = normal_there[0, i, j] * nx + normal_there[1, i, j] * ny + normal_there[2, i, j] * nz
                    near = abs(depth[i, j] - z) <= margin
                    if not near and cosine >= least_cosine:  # the depth of the tangent plane: z <n.r> / <n.r_tap>
                        slant = _slant(real(j), real(i), nx, ny, nz, view)
                        plane_depth = z * _slant(x, y, nx, ny, nz, view)
                        near = slant < 0 and abs(depth[i, j] * slant - plane_depth) <= margin * -slant
                    if near and cosine >= least_cosine:
                        share = share_row * (share_right if beside else one - share_right)
                        if total == zero:
                            first_red, first_green, first_blue = values[0, i, j], values[1, i, j], values[2, i, j]
                        total += share
                        red += share * (values[0, i, j] - first_red)  # differences: a constant stays, to the bit
                        green += share * (values[1, i, j] - first_green)
                        blue += share * (values[2, i, j] - first_blue)
        inverse = one / total if total > zero else zero
        found[0, row, column] = first_red + red * inverse
        found[1, row, column] = first_green + green * inverse
        found[2, row, column] = first_blue + blue * inverse
        weight[row, column] = min(total, one)


@kernel
def _rays(frame: Array, scale: Array) -> Any:
    """Return a step to the right, one down, the ray through the middle, and the middle's place."""
    across, down = scale.dtype.type(1) / scale[0], scale.dtype.type(1) / scale[1]
    return (frame[0, 0] * across, frame[0, 1] * across, frame[0, 2] * across, frame[1, 0] * down, frame[1, 1] * down,
            frame[1, 2] * down, frame[2, 0], frame[2, 1], frame[2, 2], scale[2], scale[3])


@kernel
def _slant(x: Any, y: Any, nx: Any, ny: Any, nz: Any, view: Any) -> Any:
    """Return <n . r> of the view ray of depth 1 through a place; `view` is made by `_rays`."""
    r0, r1, r2, d0, d1, d2, f0, f1, f2, middle_x, middle_y = view
    return (r0 * nx + r1 * ny + r2 * nz) * (x - middle_x) + (d0 * nx + d1 * ny + d2 * nz) * (y - middle_y) + (
        f0 * nx + f1 * ny + f2 * nz)


@kernel
def _split(x: Any, snap: Any, nearest: bool) -> tuple[int, Any]:
    """Return the texel before a place and the share of the one behind it, 0 where the place is a centre."""
    near = np.floor(x + snap)
    share = x - near
    if nearest:
        return int(np.rint(x)), share - share
    return int(near), (share if share > snap else share - share)
