"""Percentage closer soft shadows (PCSS): the blocker search, then percentage closer filtering, texel by texel.

[Fernando 2005] with two rules that [Dong09] lacks. A texel hides the receiver if its depth lies before the receiver's
tangent plane along the texel's own direction, since on a radial map a flat receiver is nearer to the centre at
neighbouring texels; and it counts in the search only within the cone from the receiver to the light.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.cluster.filters.basis import DepthScale
from refgi.cluster.settings import Pcss
from refgi.cluster.visibility.pcf import SLACK, cone_tangent, disc, least_depth, published_square, published_tangent
from refgi.cluster.visibility.search_region import (
    DEPTH,
    EXTENT,
    FRAME,
    NEAREST,
    RADIUS,
    D,
    FilterSizing,
    S,
    Scratch,
    T,
    X,
    Y,
    Z,
    find_search_regions,
)
from refgi.jit import kernel
from refgi.types import Array

LEAST_COSINE = math.cos(math.radians(80.0))  # of a direction that is searched


class BlockerTest(NamedTuple):
    """Which texels count as blockers."""

    receiver_plane: bool  # before the receiver's tangent plane; else nearer than the receiver by a bias
    cone: bool  # within the cone from the receiver to the light, in the search
    share: Any  # of its distance that a receiver keeps, and
    bias: Any  # m that it loses; without `receiver_plane` alone


class PcssShadow(NamedTuple):
    """One map and the depth test."""

    constants: Array  # of `light_constants`
    sizing: FilterSizing
    test: BlockerTest
    depth: Array  # (n, n) m; inf where the map is empty
    casters: Array  # of `casters_of`


def blocker_test(settings: Pcss, scale: DepthScale) -> BlockerTest:
    """Return which texels count as blockers; a bias is a share of the scale, on a logarithmic one a factor."""
    along = (settings.constant_bias.value if settings.constant_bias else 0.0) / scale.slope
    moved = (2.0**-along, 0.0) if scale.logarithmic else (1.0, along)
    return BlockerTest(settings.constant_bias is None, settings.cone, *moved)


@kernel
def pcss_tile(
    shadow: PcssShadow, points: Array, facing: Array, size: int, active: Array, visible: Array, scratch: Scratch
) -> None:
    """Fill V = 1 - blocked share of the penumbra's disc, of active receivers (>= 3, >= size), m; 1 elsewhere."""
    pending, rows = scratch.pending, scratch.rows
    if find_search_regions(shadow.constants, shadow.sizing, points, size, active, pending, visible, rows) > 0:
        compare_texels(shadow, facing, size, pending, visible, rows)


@kernel
def compare_texels(
    shadow: PcssShadow, facing: Array, size: int, pending: Array, visible: Array, rows: Array
) -> None:
    """Compare each pending receiver with every texel of its search disc, then of its penumbra's disc.

    Fills `visible` and, where there are blockers, row DEPTH with z_avg (m), and S to RADIUS with the penumbra's disc.
    The others leave `pending`.
    """
    find_blockers(shadow, facing, size, pending, rows)
    filter_texels(shadow, facing, size, pending, visible, rows)


@kernel
def find_blockers(shadow: PcssShadow, facing: Array, size: int, pending: Array, rows: Array) -> None:
    """Find the blockers in each pending receiver's search disc; fill DEPTH and S to RADIUS, or leave `pending`."""
    constants, sizing, near = shadow.constants, shadow.sizing, shadow.constants[NEAREST]
    for i in range(size):
        if not pending[i]:
            continue
        if not _may_be_blocked(shadow.casters, len(shadow.depth), rows[S, i], rows[T, i], rows[RADIUS, i]):
            pending[i] = False
            continue
        x, y, z, d, extent = rows[X, i], rows[Y, i], rows[Z, i], rows[D, i], rows[EXTENT, i]
        _, blocked, total = count_blockers(
            shadow.depth, shadow.test, (rows[S, i], rows[T, i], rows[RADIUS, i]), (x, y, z, d),
            to_map_frame(constants, facing, i), extent, True, sizing.axial)
        pending[i] = blocked > 0
        if blocked == 0:
            continue
        least = near * rows.dtype.type(LEAST_COSINE) if sizing.axial else near
        mean = min(max(total / rows.dtype.type(blocked), least), d)  # Sec. 4.1: z_avg
        rows[DEPTH, i] = mean
        # Sec. 4.2: alpha = arctan(p cos(beta) / d)
        tangent = published_tangent(extent, d, mean) if sizing.alpha else cone_tangent(extent, d, mean)
        where = published_square(x, y, z, d, tangent) if sizing.alpha_over_pi else disc(x, y, z, d, tangent)
        rows[S, i], rows[T, i], rows[RADIUS, i] = where


@kernel
def _may_be_blocked(casters: Array, n: int, cs: Any, ct: Any, radius: Any) -> bool:
    """Return whether the texels that `count_blockers` looks at may hold anything."""
    first, last = _texels(cs, radius, n)
    top, bottom = _texels(ct, radius, n)
    column, row = _nearest(cs, n), _nearest(ct, n)
    return bool(least_depth(casters, min(first, column), max(last, column), min(top, row), max(bottom, row)) < np.inf)


@kernel
def filter_texels(
    shadow: PcssShadow, facing: Array, size: int, pending: Array, visible: Array, rows: Array
) -> None:
    """Fill `visible` with the share of each pending receiver's disc, rows S to RADIUS, that does not hide it."""
    real = rows.dtype.type
    for i in range(size):
        if not pending[i]:
            continue
        count, blocked, _ = count_blockers(
            shadow.depth, shadow.test, (rows[S, i], rows[T, i], rows[RADIUS, i]),
            (rows[X, i], rows[Y, i], rows[Z, i], rows[D, i]), to_map_frame(shadow.constants, facing, i),
            rows[EXTENT, i], False, False)
        visible[i] = real(1.0) - real(blocked) / real(max(count, 1))


@kernel
def to_map_frame(constants: Array, vectors: Array, i: int) -> tuple[Any, Any, Any]:
    """Return vector i of (3, n), world space, along right, down, forward of the map."""
    vx, vy, vz = vectors[0, i], vectors[1, i], vectors[2, i]
    return (
        vx * constants[FRAME] + vy * constants[FRAME + 1] + vz * constants[FRAME + 2],
        vx * constants[FRAME + 3] + vy * constants[FRAME + 4] + vz * constants[FRAME + 5],
        vx * constants[FRAME + 6] + vy * constants[FRAME + 7] + vz * constants[FRAME + 8],
    )


@kernel
def count_blockers(
    depth: Array, test: BlockerTest, where: Any, receiver: Any, normal: Any, extent: Any, search: bool, axial: bool
) -> tuple[int, int, Any]:
    """Return how many texels a disc has, how many of them hide a receiver, and the sum of the depths of those, m.

    `where` is (s, t, radius), `receiver` (x, y, z, d) and `normal` in the map's frame; the cone counts in the `search`
    alone; `axial` depths are along the axis. Texels have their centre in the disc, at least the nearest one.
    """
    cs, ct, radius = where
    n = depth.shape[0]
    first, last = _texels(cs, radius, n)
    top, bottom = _texels(ct, radius, n)
    found = _scan(depth, test, (first, last, top, bottom), (cs, ct, radius * radius), receiver, normal, extent, search,
                  axial)
    if found[0] > 0:
        return found
    column, row = _nearest(cs, n), _nearest(ct, n)
    everywhere = (cs, ct, type(radius)(np.inf))
    return _scan(depth, test, (column, column, row, row), everywhere, receiver, normal, extent, search, axial)


@kernel
def _scan(
    depth: Array, test: BlockerTest, box: Any, around: Any, receiver: Any, normal: Any, extent: Any, search: bool,
    axial: bool,
) -> tuple[int, int, Any]:
    real = depth.dtype.type
    one, two, half, n = real(1.0), real(2.0), real(0.5), depth.shape[0]
    cs, ct, square = around
    step = two / real(n)
    first, last, top, bottom = box
    count, blocked, total = 0, 0, real(0.0)
    for row in range(top, bottom + 1):
        t = (real(row) + half) * step - one
        for column in range(first, last + 1):
            s = (real(column) + half) * step - one
            inside = s * s + t * t
            if (s - cs) * (s - cs) + (t - ct) * (t - ct) > square or inside > one:
                continue
            count += 1
            z = depth[row, column]
            scale = one / (one + inside)
            w = (two * s * scale, two * t * scale, (one - inside) * scale)
            width = step * scale  # half of what the texel is wide, as an angle
            if not is_blocker(z, w, test, receiver, normal) or (
                search and test.cone and is_outside_cone(z, w, width, receiver, extent)
            ):
                continue
            blocked += 1
            total += z * _axial_share(w, receiver) if axial else z
    return count, blocked, total


@kernel
def _axial_share(w: Any, receiver: Any) -> Any:
    """Return the cosine between a texel's direction and that to the receiver."""
    x, y, depth, d = receiver
    return (x * w[0] + y * w[1] + depth * w[2]) / d


@kernel
def _texels(middle: Any, radius: Any, n: int) -> tuple[int, int]:
    """Return the first and last texel with its centre within the radius."""
    half, size = type(middle)(0.5), type(middle)(n)
    place, reach = (middle + type(middle)(1.0)) * half * size - half, radius * half * size
    return max(math.ceil(place - reach), 0), min(math.floor(place + reach), n - 1)


@kernel
def _nearest(middle: Any, n: int) -> Any:
    place = (middle + type(middle)(1.0)) * type(middle)(0.5) * type(middle)(n)
    return min(max(math.floor(place), 0), n - 1)


@kernel
def is_blocker(z: Any, w: Any, test: BlockerTest, receiver: Any, normal: Any) -> Any:
    """Return z < d_plane(w) (1 - slack): whether depth z in direction w lies before a receiver's plane."""
    x, y, depth, d = receiver
    limit = d * type(d)(test.share) - type(d)(test.bias)
    if test.receiver_plane:
        a, b, c = normal
        height, slope = a * x + b * y + c * depth, a * w[0] + b * w[1] + c * w[2]
        limit = height / slope if height * slope > type(d)(0.0) else d
    return z < limit * type(d)(1.0 - SLACK)


@kernel
def is_outside_cone(z: Any, w: Any, width: Any, receiver: Any, extent: Any) -> Any:
    """Return whether all that a texel stands for lies outside the cone from the receiver to the light.

    Its offset exceeds (Delta / 2)(1 - s / d) by more than half its diagonal, `width` being half its side as an angle.
    """
    x, y, depth, d = receiver
    along = (x * w[0] + y * w[1] + depth * w[2]) * z / d
    a, b, c = y * w[2] - depth * w[1], depth * w[0] - x * w[2], x * w[1] - y * w[0]
    offset = math.sqrt(a * a + b * b + c * c) / d - type(d)(math.sqrt(2.0)) * width
    return along >= d or z * offset > extent * type(d)(0.5) * (type(d)(1.0) - along / d)
