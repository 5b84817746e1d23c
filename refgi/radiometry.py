"""Radiometry shared by every method, as scalar kernels: lights, solid angles, local frames, Phong lobes.

Kernels take float32 or float64 scalars and keep the type, but for the light of lamps, which is float64: a narrow spot
is lost in the rounding of float32 cosines. Other angles enter as cosines, directions as unit vectors.
Units: radiant intensity W/sr, irradiance W/m^2, solid angle sr. The equations are those of docs/radiometry; a lobe
is cos^P around an axis, and K(th, P) is the part of its flux that leaves above a surface tilted by th.

Symbols: r unit vector along the lobe's axis, w a direction, n the surface's normal, th the angle between r and n,
P the exponent, K(th, P) the part of cos^P above the surface, ``h = |r - w|^2 / 2`` = 1 - r . w.

The lobe is I(w) = c <r . w>^P where n . w > 0, with c = (P + 1) / (2 pi K) for unit flux. The power is taken as
2^(P log2(1 - h)): near the axis, where a lobe of exponent 10^6 lives, h keeps its digits and r . w does not. So both
vectors must be unit vectors: a length off by e costs e^2 / 2 in h. In float64 that holds for every exponent a material
may have (1e20, half of whose flux lies within 1.2e-10 rad); in float32 h is good to 1e-13, which suffices to 1e8.

A receiver reflects by f_s(w, w_o) = specular (P + 2) / (2 pi) <m . w>^P, m the direction to the eye w_o mirrored: no
part of it depends on the tilt, so it is reciprocal, and no more leaves than arrives. The form above is a sender's: with
its K a receiver's would not be reciprocal, and reflect up to 1.36 of a uniform field (docs/radiometry).
"""

import math
from typing import Any

import numpy as np

from refgi.elementary import exp2, log2p1
from refgi.elementary.twofold import add, length_across, length_along, multiply, root
from refgi.jit import kernel

SPOT, POINT, DIRECTIONAL = 0, 1, 2  # LightTable.kind
SHARP = 1e6  # Phong exponent from which on a lobe has the shape of its limit

UNCERTAIN = 1e-14  # of a length: more than rounding takes from the products of three components
FOR_FLOAT32 = 1e-7  # from here on it is less than 1e-7 of the cosine over that at the edge


@kernel
def smooth_edge(above: Any, span: Any, bend: Any, linear: Any) -> Any:
    """Return t (l + (1 - l) t) (1 + 2 b - 2 b t) of t = above / span, moved into [0, 1]: smoothstep, t t or t.

    `above` is how much the cosine of an angle off a spot's axis exceeds that of the outer half-angle, `span` (>= 0; 0
    makes a step) how much that of the inner half-angle does; `bend` b and `linear` l as in `refgi.scene.light.SHAPES`.
    """
    real = type(above)
    if above >= span:
        return real(1.0)
    if above <= real(0.0):
        return real(0.0)
    t = above / span
    b, straight = real(bend), real(linear)
    return real(t * (straight + (real(1.0) - straight) * t) * (real(1.0) + b + b - b * t - b * t))


@kernel
def falloff_in_float64(d: Any, axis: Any, cone: Any, plain: float) -> tuple[float, bool]:
    """Return the share of a spot's on-axis intensity in one direction, and whether float64 alone suffices for it.

    Arguments as in `spot_falloff`; free of branches. cos a - cos b = sin(b - a) sin(b + a) / (cos a + cos b) with the
    angle a off the axis and the outer half-angle b, and sin a, cos a from the lengths of d x axis and d . axis.
    """
    along = d[0] * axis[0] + d[1] * axis[1] + d[2] * axis[2]
    x, y, z = d[1] * axis[2] - d[2] * axis[1], d[2] * axis[0] - d[0] * axis[2], d[0] * axis[1] - d[1] * axis[0]
    square = x * x + y * y + z * z
    across, length = math.sqrt(square), math.sqrt(square + along * along)
    edge, slack = cone[0] * along - cone[2] * across, UNCERTAIN * length
    above = edge * (cone[0] * along + cone[2] * across) / (length * (along + length * cone[2]))
    t = above / cone[4]
    t = t if t < 1.0 else 1.0
    t = t if edge > slack else 0.0
    whole = (edge > slack) & (above * (edge - slack) > cone[4] * edge)
    bent, share = cone[6] * t, t * (cone[7] + (1.0 - cone[7]) * t)
    return share * (1.0 + cone[6] + cone[6] - bent - bent), (edge < -slack) | whole | (edge > plain * length)


@kernel
def spot_falloff(d: Any, axis: Any, cone: Any, plain: float) -> Any:
    """Return the share of a spot's on-axis intensity in one direction, within 8 ULP of float32 or float64.

    `d` leads away from the spot, `axis` is where it shines, both float64 of any length above 0; `cone` is of
    `refgi.scene.light.cone_row`, (8,) float64; `plain` the sine of the angle inside the cone from which on float64
    alone will do (`FOR_FLOAT32`, or inf for nowhere). What sin(b - a) cancels is known to twice the precision where it
    matters.
    """
    share, certain = falloff_in_float64(d, axis, cone, plain)
    return share if certain else smooth_edge(_above_the_edge(d, axis, cone), cone[4], cone[6], cone[7])


@kernel
def _above_the_edge(d: Any, axis: Any, cone: Any) -> Any:
    """Return cos a - cos b, rounded a few times."""
    along, across = length_along(d, axis), length_across(d, axis)
    one, other = multiply((cone[0], cone[1]), along), multiply((cone[2], cone[3]), across)
    edge = add(one, (-other[0], -other[1]))  # |d| sin(b - a)
    if edge[0] < 0.0:
        return -1.0
    length = root(add(multiply(along, along), multiply(across, across)))
    below = multiply(length, add(along, multiply(length, (cone[2], cone[3]))))
    return multiply(edge, add(one, other))[0] / below[0]


@kernel
def radiant_intensity(lights: Any, k: int, wx: Any, wy: Any, wz: Any) -> Any:
    """Return the intensity (W/sr, linear RGB) of spot or point light k along w, float64 of any length above 0."""
    share = 1.0
    if lights.kind[k] == SPOT:
        axis = lights.direction
        share = spot_falloff((wx, wy, wz), (axis[k, 0], axis[k, 1], axis[k, 2]), lights.cone[k], np.inf)
    peak = lights.intensity
    return peak[k, 0] * share, peak[k, 1] * share, peak[k, 2] * share


@kernel
def incident_light(lights: Any, k: int, x: Any, y: Any, z: Any) -> Any:
    """Return the direction and distance to light k from a point (m), and its unshadowed irradiance there: I(w) / d^2.

    7 floats: unit vector towards the light, distance (m; inf when directional), irradiance on a surface perpendicular
    to that vector (W/m^2, RGB). All 0 at the light itself. Float64 whatever the type of the point: how far it lies off
    a narrow spot's axis would be lost in float32.
    """
    zero = 0.0
    if lights.kind[k] == DIRECTIONAL:
        axis, irradiance = lights.direction, lights.intensity
        return -axis[k, 0], -axis[k, 1], -axis[k, 2], np.inf, irradiance[k, 0], irradiance[k, 1], irradiance[k, 2]
    dx = lights.position[k, 0] - np.float64(x)
    dy = lights.position[k, 1] - np.float64(y)
    dz = lights.position[k, 2] - np.float64(z)
    distance = math.sqrt(dx * dx + dy * dy + dz * dz)
    if distance == zero:
        return zero, zero, zero, zero, zero, zero, zero
    wx, wy, wz = dx / distance, dy / distance, dz / distance
    falloff = 1.0 / (distance * distance)
    if lights.kind[k] == SPOT:
        axis = lights.direction
        plain = FOR_FLOAT32 if isinstance(x, np.float32) else np.inf
        falloff *= spot_falloff((-dx, -dy, -dz), (axis[k, 0], axis[k, 1], axis[k, 2]), lights.cone[k], plain)
    peak = lights.intensity
    return wx, wy, wz, distance, peak[k, 0] * falloff, peak[k, 1] * falloff, peak[k, 2] * falloff


@kernel
def corner_solid_angle_perspective(x: Any, y: Any) -> Any:
    """Return F(x, y) of a perspective image at z = 1: a rectangle spans F11 - F01 - F10 + F00.

    F is the signed solid angle of the rectangle from (0, 0) to (x, y), sr.
    """
    real = type(x)
    return math.atan2(x * y, math.sqrt(real(1.0) + x * x + y * y))


@kernel
def corner_solid_angle_paraboloid(u: Any, v: Any) -> Any:
    """Return F(u, v) of a paraboloid image, (u, v) = (x, y) / (1 + z): a rectangle spans F11 - F01 - F10 + F00.

    F is the signed solid angle from (0, 0) to (u, v), sr; the hemisphere is the unit disc, which texels must be masked
    to.
    """
    real = type(u)
    su = math.sqrt(real(1.0) + u * u)
    sv = math.sqrt(real(1.0) + v * v)
    return real(2.0) * (v / sv * math.atan(u / sv) + u / su * math.atan(v / su))


@kernel
def orthonormal_basis(nx: Any, ny: Any, nz: Any) -> Any:
    """Return tangent and bitangent (6 floats) that make a right-handed frame with a unit normal, without branches.

    The construction of Duff et al. 2017 (JCGT 6, 1): the sign of z moves the seam to z = 0.
    """
    real = type(nx)
    sign = math.copysign(real(1.0), nz)
    a = real(-1.0) / (sign + nz)
    b = nx * ny * a
    return real(1.0) + sign * nx * nx * a, sign * b, -sign * nx, b, sign + ny * ny * a, -ny


@kernel
def lobe_fraction(cos_theta: Any, exponent: Any) -> Any:
    """Return K(th, P), the part of a cos^P lobe's flux above a surface whose normal is th off the lobe's axis.

    P >= 0, real; below a cosine of 0 the part is that of the mirrored tilt, 1 - K(pi - th). In the type of `cos_theta`,
    computed in float64.
    K = 1 - I(sin^2 th; (P + 1) / 2, 1/2) / 2 with the regularised incomplete beta function I, by its continued fraction
    on the side where that converges fast. K(th, 0) = 1 - th/pi, K(th, 1) = (1 + cos th)/2. From P = 10^6 on, where the
    fraction takes sqrt(P) steps, I(x; a, 1/2) = erfc sqrt(-(a - 1/4) ln x), off by less than 1 / (24 a^2).
    """
    real = type(cos_theta)
    c = min(1.0, abs(np.float64(cos_theta)))
    a = 0.5 * (exponent + 1.0)
    if exponent >= SHARP:
        inside = 0.5 * math.erfc(math.sqrt(-(a - 0.25) * math.log1p(-c * c))) if c < 1.0 else 0.0
        return real(1.0 - inside if cos_theta >= 0 else inside)
    if cos_theta >= 0 and a * c * c > 50.0:  # x^a < 2e-22: nothing beside 1
        return real(1.0)
    x = (1.0 - c) * (1.0 + c)
    if x < (a + 1.0) / (a + 2.5):
        # x^a (1-x)^(1/2) / (a B(a, 1/2)), the power through log1p because x may be just below 1
        lead = math.exp(a * math.log1p(-c * c)) * c * _gamma_step(a) / (a * math.sqrt(math.pi))
        part = 0.5 * lead * _beta_fraction(x, a, 0.5)  # as small as it is: 1 less the rest would lose its digits
        return real(1.0 - part if cos_theta >= 0 else part)
    lead = math.exp(a * math.log1p(-c * c)) * c * _gamma_step(a) * 2.0 / math.sqrt(math.pi) if c < 1.0 else 0.0
    half = 0.5 * lead * _beta_fraction(c * c, 0.5, a)
    return real(0.5 + half if cos_theta >= 0 else 0.5 - half)


@kernel
def _gamma_step(a: float) -> float:
    """Return Gamma(a + 1/2) / Gamma(a) for a >= 1/2, without the difference of two large logarithms."""
    factor = 1.0
    while a < 16.0:
        factor *= a / (a + 0.5)
        a += 1.0
    w = a - 0.25
    q = 1.0 / (w * w)
    series = q * (1 / 64 + q * (-19 / 8192 + q * (631 / 524288 - q * 174317 / 134217728)))
    return factor * math.sqrt(w) * (1.0 + series)


@kernel
def _beta_fraction(x: float, a: float, b: float) -> float:
    """Return the continued fraction of the incomplete beta function by the method of Lentz."""
    tiny = 1e-300
    d = 1.0 / _away_from_zero(1.0 - (a + b) * x / (a + 1.0), tiny)
    c, value = 1.0, d
    for m in range(1, 20000):
        even = m * (b - m) * x / ((a + 2 * m - 1.0) * (a + 2 * m))
        d = 1.0 / _away_from_zero(1.0 + even * d, tiny)
        c = _away_from_zero(1.0 + even / c, tiny)
        value *= d * c
        odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1.0))
        d = 1.0 / _away_from_zero(1.0 + odd * d, tiny)
        c = _away_from_zero(1.0 + odd / c, tiny)
        value *= d * c
        if abs(d * c - 1.0) < 3e-16:
            break
    return value


@kernel
def _away_from_zero(value: float, tiny: float) -> float:
    return value if abs(value) > tiny else tiny


LEAST_FRACTION = 1e-12  # of a lobe above the surface; less is rounding, of lobes that point into it


@kernel
def inverse_fraction(cos_theta: Any, exponent: Any) -> Any:
    """Return 1 / K(th, P) in the type of `cos_theta`, or 0 for a lobe of which nothing leaves the surface."""
    real = type(cos_theta)
    fraction = lobe_fraction(cos_theta, exponent)
    return real(1.0) / fraction if fraction > real(LEAST_FRACTION) else real(0.0)


@kernel
def lobe_norm(cos_theta: Any, exponent: Any) -> Any:
    """Return c = (P + 1) / (2 pi K), 1/sr, the peak intensity of a lobe of unit flux.

    In the type of `cos_theta`, the cosine of axis and normal; 0 for a lobe of which nothing leaves the surface.
    """
    real = type(cos_theta)
    # (P + 1) / (2 pi K): SII Eq. (3) normalised to unit flux above the surface
    return (exponent + real(1.0)) * real(1.0 / (2.0 * math.pi)) * inverse_fraction(cos_theta, exponent)


@kernel
def lobe_gap(rx: Any, ry: Any, rz: Any, wx: Any, wy: Any, wz: Any) -> Any:
    """Return ``h = |r - w|^2 / 2`` for an axis r of length 1 and a vector w of any length but 0.

    That is 1 - cos of the angle between them, 0 to 2, in the type of the arguments.
    """
    real = type(wx)
    inverse = real(1.0) / math.sqrt(wx * wx + wy * wy + wz * wz)
    ox, oy, oz = rx - wx * inverse, ry - wy * inverse, rz - wz * inverse
    return real(0.5) * (ox * ox + oy * oy + oz * oz)


@kernel
def lobe_power(gap: Any, exponent: Any) -> Any:
    """Return <r . w>^P = (1 - h)^P of the gap h of `lobe_gap`; 0 from a right angle on. Both of one type."""
    real = type(gap)
    return exp2(exponent * log2p1(-gap)) if gap < real(1.0) else real(0.0)


@kernel
def lobe_direction(u: float, v: float, exponent: float) -> tuple[float, float, float]:
    """Return a direction around z (unit vector) of density (P + 1) / (2 pi) cos^P.

    (u, v) is a point of the unit square, u > 0. 1 - z keeps its digits, however sharp the lobe is.
    """
    gap = -math.expm1(math.log(u) / (exponent + 1.0))  # 1 - u^(1 / (P + 1))
    across, phi = math.sqrt(gap * (2.0 - gap)), 2.0 * np.pi * v
    return across * math.cos(phi), across * math.sin(phi), 1.0 - gap


@kernel
def receiver_norm(exponent: Any) -> Any:
    """Return (P + 2) / (2 pi), 1/sr, by which a receiver's lobe of reflectance 1 reflects at most all light."""
    real = type(exponent)
    return (exponent + real(2.0)) * real(1.0 / (2.0 * math.pi))


@kernel
def mirrored(wx: Any, wy: Any, wz: Any, nx: Any, ny: Any, nz: Any) -> Any:
    """Return m = 2 (n . w) n - w: the direction w, away from the surface, mirrored in it (all unit vectors)."""
    twice = type(wx)(2.0) * (wx * nx + wy * ny + wz * nz)
    return twice * nx - wx, twice * ny - wy, twice * nz - wz


@kernel
def receiver_lobe(mx: Any, my: Any, mz: Any, wx: Any, wy: Any, wz: Any, exponent: Any) -> Any:
    """Return (P + 2) / (2 pi) <m . w>^P, 1/sr: f_s of a receiver over its specular reflectance, where n . w > 0.

    m is the direction to the eye, mirrored (unit vector), w any vector towards the light. Whether w and the eye lie
    above the surface is for the caller to know.
    """
    return receiver_norm(exponent) * lobe_power(lobe_gap(mx, my, mz, wx, wy, wz), exponent)
