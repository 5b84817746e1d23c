"""How much light leaves through each texel: exact solid angles, and a spot's falloff integrated over them.

With image-plane coordinates (x, y), r^2 = x^2 + y^2:

- perspective: cos a = (1 + r^2)^(-1/2), density of solid angle (1 + r^2)^(-3/2),
- paraboloid: cos a = (1 - r^2)/(1 + r^2), density 4/(1 + r^2)^2, cut at the unit disc (docs/radiometry).

A spot's intensity depends on r alone. Where it is constant over a texel its integral is a difference of corners; where
a circle cuts the texel it is a closed form along y and a Gauss rule along x; elsewhere a 4 x 4 Gauss rule. The texels
of coarse maps are cut into parts for these rules. All maps are symmetric about both axes; one quadrant is computed and
mirrored.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel, prange
from refgi.radiometry import (
    FOR_FLOAT32,
    corner_solid_angle_paraboloid,
    corner_solid_angle_perspective,
    smooth_edge,
    spot_falloff,
)
from refgi.rsm.raster.projection import ORTHOGRAPHIC, PARABOLOID, Projection
from refgi.scene.light import SHAPES, Falloff, cone_row
from refgi.stages import stage
from refgi.types import Array

# Gauss-Legendre rules of 4 and of 8 nodes on [0, 1]
FEW_NODES = (0.06943184420297371, 0.33000947820757187, 0.6699905217924281, 0.9305681557970263)
FEW_WEIGHTS = (0.17392742256872693, 0.32607257743127307, 0.32607257743127307, 0.17392742256872693)
NODES = (0.019855071751231912, 0.10166676129318664, 0.2372337950418355, 0.4082826787521751,
         0.5917173212478248, 0.7627662049581645, 0.8983332387068134, 0.9801449282487681)
WEIGHTS = (0.05061426814518853, 0.11119051722668721, 0.15685332293894344, 0.18134189168918083,
           0.18134189168918083, 0.15685332293894344, 0.11119051722668721, 0.05061426814518853)
LARGEST_PART = 0.17  # side of what the Gauss rules integrate, on the image plane
MOST_PARTS = 64  # along a side
SUBSAMPLES = 4  # per side of a texel that a spot's cone crosses askew


class Circles(NamedTuple):
    """A spot's cone on the image plane."""

    inner: float  # radius of full intensity
    outer: float  # radius beyond which there is none
    span: float  # cosine of the inner half-angle minus that of the outer
    bend: float = 1.0  # of `smooth_edge`, as `linear`
    linear: float = 0.0


def texel_solid_angles(projection: Projection) -> Array:
    """Return the solid angle of every texel.

    Returns (H, W): sr, float64; of an orthographic map the area perpendicular to the light, m^2.

    A hemisphere's paraboloid map is cut at the unit disc and sums to 2 pi exactly: the part of a rim texel whose
    centre lies outside, which sees nothing, counts with its inner neighbour.
    """
    if projection.kind == ORTHOGRAPHIC:
        area = 4.0 * projection.half[0] * projection.half[1] / (projection.height * projection.width)
        return np.full(projection.shape, area)
    radius = 1.0 if projection.kind == PARABOLOID else math.inf
    return _stacked(projection, _texel_integrals(_intrinsics(projection), Circles(radius, radius, 0.0)))


def texel_solid_angles_at(projection: Projection, texel: Array) -> Array:
    """Return what `texel_solid_angles` gives at some texels.

    `projection`: the maps. `texel` (n,) int: texels of the flattened maps. Returns (n,): sr or m^2, float64.
    """
    if projection.kind in (ORTHOGRAPHIC, PARABOLOID):
        return texel_solid_angles(projection).reshape(-1)[texel]
    return _integrals_at(projection, Circles(math.inf, math.inf, 0.0), texel)


def spot_power(projection: Projection, inner: float, outer: float, falloff: Falloff = "smoothstep") -> Array:
    """Return the integral of a spot's falloff over every texel of one map that looks along the spot's axis.

    `projection`: a perspective or paraboloid map. `inner`, `outer`: the spot's half-angles, rad. Returns (H, W): sr,
    float64: the texel's power is this times the on-axis intensity. When the map encloses the cone, it sums to
    2 pi (1 - cos inner + m (cos inner - cos outer)), m of `refgi.scene.light.MEANS`.
    """
    circles = _circles(projection.kind, inner, outer, falloff)
    return _stacked(projection, _texel_integrals(_intrinsics(projection), circles))


def spot_power_at(
    projection: Projection, inner: float, outer: float, texel: Array, falloff: Falloff = "smoothstep"
) -> Array:
    """Return what `spot_power` gives at some texels.

    `projection`: a perspective or paraboloid map. `inner`, `outer`: the spot's half-angles, rad. `texel` (n,) int:
    texels of the flattened map. Returns (n,): sr, float64.
    """
    if projection.kind == PARABOLOID:  # whose rim texels hold what their neighbours give them
        return spot_power(projection, inner, outer, falloff).reshape(-1)[texel]
    return _integrals_at(projection, _circles(projection.kind, inner, outer, falloff), texel)


def _integrals_at(projection: Projection, spot: Circles, texel: Array) -> Array:
    integrals = np.empty(len(texel))
    _fill_texels(_intrinsics(projection), spot, texel % (projection.height * projection.width), integrals)
    return integrals


def _intrinsics(projection: Projection) -> Projection:
    """Return one such map at the origin: what integrals over texels depend on, wherever the light moves."""
    return projection._replace(origin=np.zeros((1, 3)), frame=np.eye(3)[None], reach=math.inf)


def _circles(kind: int, inner: float, outer: float, falloff: Falloff) -> Circles:
    part = 0.5 if kind == PARABOLOID else 1.0
    span = 2.0 * math.sin((outer + inner) / 2) * math.sin((outer - inner) / 2)
    return Circles(math.tan(part * inner), math.tan(part * outer), span, *SHAPES[falloff])


def _stacked(projection: Projection, one: Array) -> Array:
    return one if projection.maps == 1 else np.tile(one, (projection.maps, 1))


@stage("rsm.solid_angles")
def _texel_integrals(projection: Projection, spot: Circles) -> Array:
    """Integrate solid angle, or a spot's falloff over it, over every texel of a map.

    spot: The spot's cones; without falloff for plain solid angles.
    -> (h, w) float64: Integral over each texel, sr.
    """
    height, width = projection.height, projection.width
    quadrant = np.zeros(((height + 1) // 2, (width + 1) // 2))
    _fill_quadrant(projection, spot, quadrant)
    if projection.kind == PARABOLOID:
        _move_rim_inwards(projection, quadrant)
    # row 0 of the quadrant touches the axis; the middle row of an odd height is half a row on either side
    across = np.concatenate([quadrant[:, ::-1], quadrant[:, width % 2 :]], axis=1)
    whole = np.concatenate([across[::-1], across[height % 2 :]], axis=0)
    if width % 2:
        whole[:, width // 2] *= 2.0
    if height % 2:
        whole[height // 2] *= 2.0
    return whole


@kernel(parallel=True)
def _fill_quadrant(projection: Projection, spot: Circles, quadrant: Array) -> None:
    for i in prange(quadrant.shape[0]):
        for j in range(quadrant.shape[1]):
            quadrant[i, j] = _integral(projection, spot, i, j)


@kernel
def _fill_texels(projection: Projection, spot: Circles, texel: Array, integrals: Array) -> None:
    height, width = projection.height, projection.width
    for k in range(len(texel)):
        row, column = texel[k] // width, texel[k] % width
        i, j = _from_axis(row, height), _from_axis(column, width)
        # half of a middle row or column lies on either side of the axis
        twice = (2.0 if height % 2 and i == 0 else 1.0) * (2.0 if width % 2 and j == 0 else 1.0)
        integrals[k] = _integral(projection, spot, i, j) * twice


@kernel
def _from_axis(place: int, size: int) -> int:
    """Return the row of the quadrant for a row of the map, or the column for a column."""
    half = (size + 1) // 2
    return half - 1 - place if place < half else place - half + size % 2


@kernel
def _integral(projection: Projection, spot: Circles, i: int, j: int) -> Any:
    """Return the integral over one texel of the quadrant."""
    kind, (hx, hy) = projection.kind, (projection.half[0], projection.half[1])
    dx, dy = 2.0 * hx / projection.width, 2.0 * hy / projection.height
    shift_x, shift_y = 0.5 * (projection.width % 2), 0.5 * (projection.height % 2)
    y0, y1 = max((i - shift_y) * dy, 0.0), (i + 1 - shift_y) * dy
    x0, x1 = max((j - shift_x) * dx, 0.0), (j + 1 - shift_x) * dx
    parts = 1 if spot.span == 0.0 else min(math.ceil(max(dx, dy) / LARGEST_PART), MOST_PARTS)
    if parts == 1:
        return _power(kind, x0, x1, y0, y1, spot)
    total, wide, high = 0.0, (x1 - x0) / parts, (y1 - y0) / parts
    for p in range(parts):
        for q in range(parts):
            total += _power(kind, x0 + p * wide, x0 + (p + 1) * wide, y0 + q * high, y0 + (q + 1) * high, spot)
    return total


@kernel
def _rectangle(kind: int, x0: float, x1: float, y0: float, y1: float) -> Any:
    if kind == PARABOLOID:
        return (
            corner_solid_angle_paraboloid(x1, y1)
            - corner_solid_angle_paraboloid(x0, y1)
            - corner_solid_angle_paraboloid(x1, y0)
            + corner_solid_angle_paraboloid(x0, y0)
        )
    return (
        corner_solid_angle_perspective(x1, y1)
        - corner_solid_angle_perspective(x0, y1)
        - corner_solid_angle_perspective(x1, y0)
        + corner_solid_angle_perspective(x0, y0)
    )


@kernel
def _power(kind: int, x0: float, x1: float, y0: float, y1: float, spot: Circles) -> Any:
    """Integrate the falloff over a rectangle of the first quadrant."""
    inner, outer = spot.inner, spot.outer
    farthest = math.sqrt(x1 * x1 + y1 * y1)
    if farthest <= inner:
        return _rectangle(kind, x0, x1, y0, y1)
    if math.sqrt(x0 * x0 + y0 * y0) >= outer:
        return 0.0
    if math.sqrt(x0 * x0 + y0 * y0) >= inner and farthest <= outer:
        return _smooth_power(kind, x0, x1, y0, y1, spot)
    # between these abscissae no circle enters or leaves through the top or bottom side
    enters, leaves = _meets(inner, y0, x0, x1), _meets(outer, y1, x0, x1)
    cuts = (x0, _meets(inner, y1, x0, x1), min(enters, leaves), max(enters, leaves), _meets(outer, y0, x0, x1), x1)
    total = 0.0
    for piece in range(5):
        left, size = cuts[piece], cuts[piece + 1] - cuts[piece]
        if size > 0.0:
            for node in range(8):
                # a circle may be upright at the right end: x = left + size (1 - (1 - q)^2) makes it smooth there
                rest = 1.0 - NODES[node]
                x, step = left + size * (1.0 - rest * rest), 2.0 * size * rest * WEIGHTS[node]
                middle = min(max(math.sqrt(max(inner * inner - x * x, 0.0)), y0), y1)
                top = min(max(math.sqrt(max(outer * outer - x * x, 0.0)), y0), y1)
                constant = _strip(kind, x, middle) - _strip(kind, x, y0)
                total += step * (constant + _falloff_strip(kind, x, middle, top, spot))
    return total


@kernel
def _smooth_power(kind: int, x0: float, x1: float, y0: float, y1: float, spot: Circles) -> float:
    total = 0.0
    for node in range(4):
        x = x0 + FEW_NODES[node] * (x1 - x0)
        total += FEW_WEIGHTS[node] * _falloff_strip(kind, x, y0, y1, spot)
    return total * (x1 - x0)


@kernel
def _meets(radius: float, y: float, x0: float, x1: float) -> float:
    """Return the abscissa where a circle meets the horizontal through y, moved into [x0, x1]."""
    return min(max(math.sqrt(max(radius * radius - y * y, 0.0)), x0), x1)


@kernel
def _strip(kind: int, x: float, y: float) -> float:
    """Return the integral of the density of solid angle over [0, y] at fixed x."""
    square = 1.0 + x * x
    if kind == PARABOLOID:
        root = math.sqrt(square)
        return 2.0 * (y / (square * (square + y * y)) + math.atan(y / root) / (square * root))
    return y / (square * math.sqrt(square + y * y))


@kernel
def _falloff_strip(kind: int, x: float, y0: float, y1: float, spot: Circles) -> float:
    total = 0.0
    edge = 1.0 + spot.outer * spot.outer
    root_edge = math.sqrt(edge)
    if y1 > y0:
        for node in range(4):
            y = y0 + FEW_NODES[node] * (y1 - y0)
            square = 1.0 + x * x + y * y
            inside = spot.outer * spot.outer - (x * x + y * y)
            # cos a - cos outer: the radius is tan(a/2), or tan a, of which 1 / root is the cosine
            if kind == PARABOLOID:
                density, above = 4.0 / (square * square), 2.0 * inside / (square * edge)
            else:
                root = math.sqrt(square)
                density, above = 1.0 / (root * square), inside / (root * root_edge * (root + root_edge))
            total += FEW_WEIGHTS[node] * density * smooth_edge(above, spot.span, spot.bend, spot.linear)
    return total * (y1 - y0)


@kernel
def _move_rim_inwards(projection: Projection, quadrant: Array) -> None:
    """Move what texels with a centre beyond the hemisphere hold to the neighbour nearer to the axis."""
    step = 2.0 * projection.half[0] / projection.width
    shift = 0.5 - 0.5 * (projection.width % 2)
    for i in range(quadrant.shape[0]):
        for j in range(quadrant.shape[1]):
            if _beyond(i, j, shift, step) and quadrant[i, j] > 0.0:
                to_i, to_j = (i - 1, j) if i > j else (i, j - 1)
                if i == j or _beyond(to_i, to_j, shift, step):
                    to_i, to_j = i - 1, j - 1
                quadrant[to_i, to_j] += quadrant[i, j]
                quadrant[i, j] = 0.0


@kernel
def _beyond(i: int, j: int, shift: float, step: float) -> bool:
    x, y = (j + shift) * step, (i + shift) * step
    return x * x + y * y > 1.0


def sampled_spot_share(
    projection: Projection, axis: Array, inner: float, outer: float, falloff: Falloff = "smoothstep"
) -> Array:
    """Return the mean falloff of a spot over each texel of maps that do not look along its axis.

    `projection`: perspective maps, such as the faces of a cube. `axis` (3,): unit vector along the spot. `inner`,
    `outer`: the spot's half-angles, rad. Returns (H, W): 0 to 1, float64, from 4 x 4 samples a texel.
    """
    share = np.empty(projection.shape)
    _sample_spot(projection, np.asarray(axis, np.float64), cone_row(inner, outer, falloff), share)
    return share


@kernel(parallel=True)
def _sample_spot(projection: Projection, axis: Array, cone: Array, share: Array) -> None:
    height, width, frame = projection.height, projection.width, projection.frame
    for row in prange(share.shape[0]):
        m = row // height
        ax = frame[m, 0, 0] * axis[0] + frame[m, 0, 1] * axis[1] + frame[m, 0, 2] * axis[2]
        ay = frame[m, 1, 0] * axis[0] + frame[m, 1, 1] * axis[1] + frame[m, 1, 2] * axis[2]
        az = frame[m, 2, 0] * axis[0] + frame[m, 2, 1] * axis[1] + frame[m, 2, 2] * axis[2]
        for column in range(width):
            total, whole = 0.0, 0.0
            for s in range(SUBSAMPLES * SUBSAMPLES):
                x = (2.0 * (column + (s % SUBSAMPLES + 0.5) / SUBSAMPLES) / width - 1.0) * projection.half[0]
                y = (2.0 * (row - m * height + (s // SUBSAMPLES + 0.5) / SUBSAMPLES) / height - 1.0)
                y *= projection.half[1]
                scale = 1.0 / math.sqrt(1.0 + x * x + y * y)
                density = scale * scale * scale
                total += density * spot_falloff((x, y, 1.0), (ax, ay, az), cone, FOR_FLOAT32)
                whole += density
            share[row, column] = total / whole
