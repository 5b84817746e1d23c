"""Distance of a pixel light from a cluster: position and normal, weighted (Sec. 5.1).

d = w_x |x - c| + w_a angle(n, n_c), the printed form, or d = w_x |x - c|^2 + w_a |n - n_c|^2. Weights arrive with their
units taken in, and whether to square. Angles are exact to rounding everywhere: near 0 and pi the arc cosine of a dot
product is not, and lights of one wall differ by just that.
"""

import math
from typing import Any

from refgi.jit import kernel

HALF_PI = 0.5 * math.pi


@kernel
def angle(dot: Any, apart: Any) -> Any:
    """Return the angle between two unit vectors, 0 to pi within 1e-15, without branches.

    From their dot product and the squared length of their difference, of the sum instead where `dot` is negative:
    2 asin(apart^(1/2) / 2), or pi less that, beyond 60 degrees off the perpendicular, and pi/2 - asin(dot) within.
    asin(s) = s + s z P(z) with z = s^2 <= 1/4; P is of degree 11.
    """
    steep = abs(dot) >= 0.5
    z = min(0.25 * apart, 0.3) if steep else dot * dot
    s = math.sqrt(z) if steep else dot
    p = 2.8285381520428275e-02
    p = p * z - 1.0908304349000406e-02
    p = p * z + 1.6129764409156828e-02
    p = p * z + 7.7714397645414456e-03
    p = p * z + 1.1882032645784928e-02
    p = p * z + 1.3928781847841392e-02
    p = p * z + 1.7355334434132383e-02
    p = p * z + 2.2372043664706378e-02
    p = p * z + 3.0381947490254527e-02
    p = p * z + 4.4642857101464970e-02
    p = p * z + 7.5000000000219780e-02
    p = p * z + 1.6666666666666646e-01
    arc = s + s * (z * p)
    return (2.0 * arc if dot > 0.0 else math.pi - 2.0 * arc) if steep else HALF_PI - arc


@kernel
def linear(
    x: Any, y: Any, z: Any, nx: Any, ny: Any, nz: Any, cx: Any, cy: Any, cz: Any, ax: Any, ay: Any, az: Any,
    per_metre: Any, per_radian: Any,
) -> Any:
    """Return w_x |x - c| + w_a angle(n, n_c) of a light (x, y, z; n) and an area light (c; a); m, unit normals."""
    dx, dy, dz = x - cx, y - cy, z - cz
    dot = nx * ax + ny * ay + nz * az
    side = math.copysign(1.0, dot)
    ex, ey, ez = nx - side * ax, ny - side * ay, nz - side * az
    turn = angle(dot, ex * ex + ey * ey + ez * ez)
    # Sec. 5.1: d = w_x dx + w_a dalpha
    return per_metre * math.sqrt(dx * dx + dy * dy + dz * dz) + per_radian * turn


@kernel
def fill_linear(lights: Any, count: int, other: Any, k: int, per_metre: float, per_radian: float, out: Any) -> None:
    """Fill out[:count] with w_x |x - c| + w_a angle(n, n_c) of lights (6, r) and area light k of `other` (6, M).

    Rows are position, m, and unit normal.
    """
    x, y, z, nx, ny, nz = lights[0], lights[1], lights[2], lights[3], lights[4], lights[5]
    cx, cy, cz, ax, ay, az = other[0, k], other[1, k], other[2, k], other[3, k], other[4, k], other[5, k]
    if per_radian == 0.0:
        for i in range(count):
            dx, dy, dz = x[i] - cx, y[i] - cy, z[i] - cz
            out[i] = per_metre * math.sqrt(dx * dx + dy * dy + dz * dz)
        return
    for i in range(count):
        out[i] = linear(x[i], y[i], z[i], nx[i], ny[i], nz[i], cx, cy, cz, ax, ay, az, per_metre, per_radian)


@kernel
def fill_squares(lights: Any, count: int, other: Any, k: int, per_area: float, per_square: float, out: Any) -> None:
    """Fill out[:count] with w_x |x - c|^2 + w_a |n - n_c|^2 of lights (6, r) and area light k of `other` (6, M).

    Rows are position, m, and unit normal.
    """
    x, y, z, nx, ny, nz = lights[0], lights[1], lights[2], lights[3], lights[4], lights[5]
    cx, cy, cz, ax, ay, az = other[0, k], other[1, k], other[2, k], other[3, k], other[4, k], other[5, k]
    for i in range(count):
        dx, dy, dz = x[i] - cx, y[i] - cy, z[i] - cz
        ex, ey, ez = nx[i] - ax, ny[i] - ay, nz[i] - az
        out[i] = per_area * (dx * dx + dy * dy + dz * dz) + per_square * (ex * ex + ey * ey + ez * ez)
