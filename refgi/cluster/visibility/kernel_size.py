"""Filter sizes: the cone from an area light to a receiver, and the disc that it is on the map (Sec. 4.1, 4.2).

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
    """Return tan(a) = Delta (d - z) / (2 d z), 0 for z >= d, at most tan(80 deg).

    The cone that the light's extent, seen through z > 0, is on the map: of the search with z the nearest depth, of the
    final filter with z_avg. 2 tan(a) = p cos(beta) / d with p cos(beta) = (d - z_avg) Delta / z_avg of Sec. 4.2,
    centred on the axis.
    """
    zero, cap = type(d)(0.0), type(d)(STEEPEST)
    # Sec. 4.2: p cos(beta) = (d - z_avg) Delta / z_avg, Fig. 3
    tangent = delta * (d - z) / (type(d)(2.0) * d * z)
    return (tangent if tangent < cap else cap) if d > z else zero


@kernel
def published_tangent(delta: Any, d: Any, z: Any) -> Any:
    """Return tan(alpha / 2) with alpha = arctan(p cos(beta) / d) as printed in Sec. 4.2; at most 1.

    The printed angle starts at the axis, and so ends at 90 degrees.
    """
    ratio = type(d)(2.0) * cone_tangent(delta, d, z)
    return ratio / (type(d)(1.0) + math.sqrt(type(d)(1.0) + ratio * ratio))


@kernel
def solid_angle_tangent(delta: Any, d: Any) -> Any:
    """Return tan(a) = Delta / (2 d), at most tan(80 deg): half the angle under which the receiver sees the light.

    The published search. It is that of blockers half-way; nearer ones beside this cone are missed.
    """
    tangent = delta / (type(d)(2.0) * d)
    return tangent if tangent < type(d)(STEEPEST) else type(d)(STEEPEST)


@kernel
def farthest_tangent(delta: Any, d: Any, r: Any) -> Any:
    """Return tan(theta) of the directions in which a point at the distance r may lie before the light, <= tan(80 deg).

    It does where r sin(theta) <= (Delta / 2)(1 - r cos(theta) / d), that is theta <= arcsin(Delta cos(phi) / 2 r) - phi
    with tan(phi) = Delta / 2 d; in all directions where r <= (Delta / 2) cos(phi). 0 for r >= d.
    """
    zero, one, cap = type(d)(0.0), type(d)(1.0), type(d)(STEEPEST)
    phi = delta / (type(d)(2.0) * d)
    sine = delta / (type(d)(2.0) * r * math.sqrt(one + phi * phi))
    if r >= d or sine >= one:
        return zero if r >= d else cap
    outer = sine / math.sqrt(one - sine * sine)
    below = one + outer * phi
    tangent = (outer - phi) / below
    return tangent if tangent < cap else cap


@kernel
def disc(x: Any, y: Any, z: Any, d: Any, tangent: Any) -> tuple[Any, Any, Any]:
    """Return centre s, t and radius, in [-1, 1] units, of the disc that a cone around the receiver is on the map.

    The receiver (x, y, z; z >= 0, m) is in the map's frame at the distance d > 0; `tangent` is of the cone's
    half-angle.
    """
    one = type(d)(1.0)
    cosine = one / math.sqrt(one + tangent * tangent)
    scale = one / (z + d * cosine)
    return x * scale, y * scale, d * tangent * cosine * scale


@kernel
def published_square(x: Any, y: Any, z: Any, d: Any, tangent: Any) -> tuple[Any, Any, Any]:
    """Return s, t and half the side of the square of side alpha / pi of the texture around the receiver (Sec. 4.2).

    In [-1, 1] units; `tangent` is of alpha / 2. (2 / pi)(1 + cos(theta)) times the width of the exact disc: 1.27 on the
    axis, 0.64 at the rim.
    """
    scale = type(d)(1.0) / (z + d)
    return x * scale, y * scale, math.atan(tangent) * type(d)(2.0 / math.pi)
