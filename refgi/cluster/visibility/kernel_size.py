"""How much of a map a receiver looks at: the cone towards it, and the disc the cone is on the map (Sec. 4.1, 4.2).

A cone of half-angle a around a direction at polar angle theta is a disc on a stereographic map: centre
sin(theta) / (cos(theta) + cos(a)) and radius sin(a) / (cos(theta) + cos(a)), exactly. No angle is ever computed: only
tan(a) and the vector to the receiver.

Symbols: d distance from the area light's centre to the receiver (m), z that of blockers, p cos(beta) the penumbra
perpendicular to the view, Delta the size of the area light (m), alpha the penumbra's angle.
"""

import math
from typing import Any

from refgi.jit import kernel

STEEPEST = math.tan(math.radians(80.0))  # of a cone; nearer blockers would ask for more than the hemisphere


@kernel
def cone_tangent(delta: Any, d: Any, z: Any) -> Any:
    """Return tan(a) = Delta (d - z) / (2 d z): the cone that the light's extent, seen through z, is on the map.

    Parameters
    ----------
    delta : float
        Size of the light, m.
    d, z : float
        Distance of the receiver and of blockers, m; z > 0.

    Returns
    -------
    float
        0 for z >= d, at most tan(80 deg). Of the search with z the nearest depth, of the final filter with z_avg.

    Notes
    -----
    2 tan(a) = p cos(beta) / d with p cos(beta) = (d - z_avg) Delta / z_avg of Sec. 4.2, centred on the axis.
    """
    zero, cap = type(d)(0.0), type(d)(STEEPEST)
    tangent = delta * (d - z) / (type(d)(2.0) * d * z)
    return (tangent if tangent < cap else cap) if d > z else zero


@kernel
def published_tangent(delta: Any, d: Any, z: Any) -> Any:
    """Return tan(alpha / 2) with alpha = atan(p cos(beta) / d) as printed in Sec. 4.2.

    Parameters
    ----------
    delta : float
        Size of the light, m.
    d, z : float
        Distance of the receiver and of blockers, m; z > 0.

    Returns
    -------
    float
        At most 1: the printed angle starts at the axis, and so ends at 90 degrees.
    """
    ratio = type(d)(2.0) * cone_tangent(delta, d, z)
    return ratio / (type(d)(1.0) + math.sqrt(type(d)(1.0) + ratio * ratio))


@kernel
def solid_angle_tangent(delta: Any, d: Any) -> Any:
    """Return tan(a) = Delta / (2 d): the published search, half the angle under which the receiver sees the light.

    Parameters
    ----------
    delta : float
        Size of the light, m.
    d : float
        Distance of the receiver, m; > 0.

    Returns
    -------
    float
        That of blockers half-way; nearer ones beside this cone are missed. At most tan(80 deg).
    """
    tangent = delta / (type(d)(2.0) * d)
    return tangent if tangent < type(d)(STEEPEST) else type(d)(STEEPEST)


@kernel
def disc(x: Any, y: Any, z: Any, d: Any, tangent: Any) -> tuple[Any, Any, Any]:
    """Return the disc of a cone around the receiver.

    Parameters
    ----------
    x, y, z : float
        The receiver in the map's frame, m; z >= 0.
    d : float
        Its distance, m; > 0.
    tangent : float
        Of the cone's half-angle, below 90 degrees.

    Returns
    -------
    s, t, radius : float
        In [-1, 1] units of the map.
    """
    one = type(d)(1.0)
    cosine = one / math.sqrt(one + tangent * tangent)
    scale = one / (z + d * cosine)
    return x * scale, y * scale, d * tangent * cosine * scale


@kernel
def published_square(x: Any, y: Any, z: Any, d: Any, tangent: Any) -> tuple[Any, Any, Any]:
    """Return the square of side alpha / pi of the texture that Sec. 4.2 filters over, centred at the receiver.

    Parameters
    ----------
    x, y, z : float
        The receiver in the map's frame, m; z >= 0.
    d : float
        Its distance, m; > 0.
    tangent : float
        Of alpha / 2.

    Returns
    -------
    s, t, half : float
        In [-1, 1] units of the map; half the square's side, which takes the place of a radius.

    Notes
    -----
    (2 / pi)(1 + cos(theta)) times the width of the exact disc: 1.27 on the axis, 0.64 at the rim.
    """
    scale = type(d)(1.0) / (z + d)
    return x * scale, y * scale, math.atan(tangent) * type(d)(2.0 / math.pi)
