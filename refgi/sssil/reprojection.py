"""Reprojection W: the value of each surface point in another view, with a disocclusion test (Sec. 3.3)."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.rsm.pool import plane
from refgi.rsm.raster.projection import PERSPECTIVE, Projection
from refgi.scene.values import Vector
from refgi.sssil.settings import Fetch
from refgi.stages import stage
from refgi.types import Array

SNAP = 2.0**-8  # texels: so far off may float32 put a point that lies at a texel's centre


class SourceView(NamedTuple):
    """A view that values are fetched from: its camera, and depths and normals of its texels."""

    projection: Projection  # one perspective map
    depth: Array  # (h, w) along the view direction, m; inf where there is no surface
    normal: Array  # (3, h, w) unit vectors
    origin: Vector = (0.0, 0.0, 0.0)  # where the origin of the view's places lies, m (`Frame.origin`)


@stage("sssil.reproject", kept=False)
def reproject(
    values: Array, source: SourceView, position: Array, normal: Array, covered: Array, *, depth_tolerance: float,
    normal_cosine: float, fetch: Fetch = "bilinear", origin: Vector | None = None,
) -> tuple[Array, Array]:
    """Fetch values of a view at surface points of another; disoccluded points get none.

    values (3 or 4, h, w): Values for each texel of `source`.
    source: The view that values are fetched from.
    position (3, h', w'): The points, in the view's own world space unless `origin` is given, m.
    normal (3, h', w'): Their unit normals.
    covered (h', w') bool: Pixels with a surface point.
    depth_tolerance: Largest difference of a texel's depth from the point's, or from that of the point's tangent plane
        at the texel, as a share of the point's.
    normal_cosine: Smallest cosine between a texel's normal and the point's.
    fetch: From the four texels around the point, or from the one it falls in.
    origin: Origin of `position`, m; that of `source` where absent.
    -> mean (3 or 4, h', w'): Mean of the texels that show the same surface, weighted bilinearly; 0 where none does.
    -> weight (h', w'): Share of the four weights that those texels have, 0 to 1.

    Raises
    ------
    InputError
        If the view is no single perspective map or sizes do not fit together.

    Notes
    -----
    The paper compares depths. On a plane seen at a grazing angle those of neighbouring texels differ by more than any
    useful tolerance: there a texel passes as well if its depth is that of the plane.

    A point within 1/256 texel of a texel's centre takes that texel alone, so that a view which did not move returns its
    values unchanged, however often it is reprojected.
    """
    return fetched(values, source, position, normal, covered, depth_tolerance, normal_cosine, fetch, origin)


def fetched(
    values: Array, source: SourceView, position: Array, normal: Array, covered: Array, depth_tolerance: float,
    normal_cosine: float, fetch: Fetch, origin: Vector | None = None,
) -> tuple[Array, Array]:
    """Return what `reproject` does, as no stage of its own."""
    projection = source.projection
    expect(projection.kind == PERSPECTIVE and projection.maps == 1, "there", "one perspective map", projection.kind)
    expect(len(values) in (3, 4) and values.shape[1:] == source.depth.shape == projection.shape, "values",
           f"(3 or 4, h, w) with {projection.shape}", values.shape)
    dtype = position.dtype
    mean, weight = plane((len(values), *covered.shape), dtype), plane(covered.shape, dtype)
    limits = np.array([depth_tolerance, normal_cosine, SNAP], dtype)
    shift = (0.0, 0.0, 0.0) if origin is None else np.subtract(source.origin, origin)
    _reproject(values, source.depth, source.normal, pixel_transform(projection, dtype, shift), limits,
               fetch == "nearest", position, normal, covered, mean, weight)
    return mean, weight


class PixelTransform(NamedTuple):
    """What takes points to the texels of a view."""

    eye: Array  # (3,) m
    axes: Array  # (3, 3) unit vectors right, down and ahead
    scale: Array  # (4,) texels for each tangent, across and down, and the middle of the picture


def pixel_transform(
    projection: Projection, dtype: npt.DTypeLike, shift: Vector | Array = (0.0, 0.0, 0.0)
) -> PixelTransform:
    """Return what takes points to the texels of a view whose origin lies at `shift`, m, from theirs."""
    size = np.array([projection.width, projection.height])
    scale = np.concatenate([size / (2 * projection.half), (size - 1) / 2])
    return PixelTransform(*(part.astype(dtype) for part in (projection.origin[0] + shift, projection.frame[0], scale)))


@kernel(parallel=True)
def _reproject(
    values: Array, depth: Array, source_normal: Array, to: PixelTransform, limits: Array, nearest: bool,
    position: Array, normal: Array, covered: Array, mean: Array, weight: Array,
) -> None:
    for row in prange(covered.shape[0]):
        _project_row(row, to, position, covered, mean)
        _fetch_row(row, values, depth, source_normal, to, limits, nearest, normal, mean, weight)


@kernel
def _project_row(row: int, to: PixelTransform, position: Array, covered: Array, projected: Array) -> None:
    """Find column, row (a texel's centre at whole numbers) and depth of a row of points; depth -1 where none is."""
    real, eye, axes, scale = position.dtype.type, to.eye, to.axes, to.scale
    rx, ry, rz = axes[0, 0] * scale[0], axes[0, 1] * scale[0], axes[0, 2] * scale[0]
    ux, uy, uz = axes[1, 0] * scale[1], axes[1, 1] * scale[1], axes[1, 2] * scale[1]
    fx, fy, fz = axes[2, 0], axes[2, 1], axes[2, 2]
    for column in range(covered.shape[1]):
        dx = position[0, row, column] - eye[0]
        dy = position[1, row, column] - eye[1]
        dz = position[2, row, column] - eye[2]
        depth = fx * dx + fy * dy + fz * dz
        ahead = (depth > real(0)) & covered[row, column]
        projected[0, row, column] = (rx * dx + ry * dy + rz * dz) / depth + scale[2]
        projected[1, row, column] = (ux * dx + uy * dy + uz * dz) / depth + scale[3]
        projected[2, row, column] = depth if ahead else real(-1)


@kernel
def _fetch_row(
    row: int, values: Array, depth: Array, source_normal: Array, to: PixelTransform, limits: Array, nearest: bool,
    normal: Array, mean: Array, weight: Array,
) -> None:
    """Average the texels around each place of `mean` that show the same surface; the average replaces the place."""
    real = values.dtype.type
    one, half, zero = real(1), real(0.5), real(0)
    height, width = depth.shape
    right_end, bottom_end = real(width) - half, real(height) - half
    least_cosine, snap = limits[1], limits[2]
    view = _rays(to.axes, to.scale)
    for column in range(weight.shape[1]):
        x, y, z = mean[0, row, column], mean[1, row, column], mean[2, row, column]
        red, green, blue, fourth, total = zero, zero, zero, zero, zero
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
                    cosine = source_normal[0, i, j] * nx + source_normal[1, i, j] * ny + source_normal[2, i, j] * nz
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
                        if values.shape[0] > 3:
                            fourth += share * values[3, i, j]
        inverse = one / total if total > zero else zero
        mean[0, row, column] = first_red + red * inverse
        mean[1, row, column] = first_green + green * inverse
        mean[2, row, column] = first_blue + blue * inverse
        if values.shape[0] > 3:
            mean[3, row, column] = fourth * inverse
        weight[row, column] = min(total, one)


@kernel
def _rays(axes: Array, scale: Array) -> Any:
    """Return a step to the right, one down, the ray through the middle, and the middle's place."""
    across, down = scale.dtype.type(1) / scale[0], scale.dtype.type(1) / scale[1]
    return (axes[0, 0] * across, axes[0, 1] * across, axes[0, 2] * across, axes[1, 0] * down, axes[1, 1] * down,
            axes[1, 2] * down, axes[2, 0], axes[2, 1], axes[2, 2], scale[2], scale[3])


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
