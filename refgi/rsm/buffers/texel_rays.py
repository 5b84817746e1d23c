"""Rays of texels: from the centre of projection, or of parallel light, through a texel's centre."""

from typing import Any

from refgi.jit import kernel
from refgi.rsm.raster.projection import ORTHOGRAPHIC, PARABOLOID, Projection


@kernel
def texel_ray(projection: Projection, row: int, column: int) -> tuple[float, float, float, float, float, float]:
    """Return the ray through a texel centre of the stacked maps.

    `row`, `column`: texel of the stacked maps. Result: origin (m) and direction in world space; the direction's length
    is one unit of depth.
    """
    view, v = row_view(projection, row)
    u = ((column + 0.5) * (2.0 / projection.width) - 1.0) * projection.half[0]
    return image_ray(projection.kind, view, u, v)


@kernel
def row_view(projection: Projection, row: int) -> Any:
    """Return what the rays of a row have in common.

    `row`: row of the stacked maps. Result: origin, right, down and forward of the row's map; the row's coordinate on
    the image plane.
    """
    m = row // projection.height
    v = ((row - m * projection.height + 0.5) * (2.0 / projection.height) - 1.0) * projection.half[1]
    o, f = projection.origin, projection.frame
    return (o[m, 0], o[m, 1], o[m, 2], f[m, 0, 0], f[m, 0, 1], f[m, 0, 2], f[m, 1, 0], f[m, 1, 1], f[m, 1, 2],
            f[m, 2, 0], f[m, 2, 1], f[m, 2, 2]), v  # fmt: skip


@kernel
def image_ray(kind: int, view: Any, u: float, v: float) -> tuple[float, float, float, float, float, float]:
    """Return origin and direction at a point of the image plane.

    `kind`: kind of the projection. `view`: as `row_view` gives it. `u`, `v`: coordinates on the image plane.
    """
    ox, oy, oz, rx, ry, rz, qx, qy, qz, fx, fy, fz = view
    if kind == ORTHOGRAPHIC:
        return ox + u * rx + v * qx, oy + u * ry + v * qy, oz + u * rz + v * qz, fx, fy, fz
    ahead = 1.0
    if kind == PARABOLOID:
        scale = 1.0 / (1.0 + u * u + v * v)
        ahead = (1.0 - u * u - v * v) * scale
        u, v = 2.0 * u * scale, 2.0 * v * scale
    return ox, oy, oz, u * rx + v * qx + ahead * fx, u * ry + v * qy + ahead * fy, u * rz + v * qz + ahead * fz
