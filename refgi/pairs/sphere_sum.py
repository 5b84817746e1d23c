"""Virtual spherical lights (Hasan, Krivanek, Walter and Bala 2009), the clamp "sphere" of Eq. 2: one pair, and the sum.

The receiver sees a sphere of radius r in the cone sin a = min(1, r / |d|), over which both cosines are integrated:

    E = Phi / (pi^2 r^2) integral over the cone of <l . w> <n_x . w> dw,    l = -n_p.

Cones wholly above both horizons have a closed form; the others are cut into slices by half planes through the line
where both horizons meet, and a Gauss rule adds up the turn (docs/methods/sii_sum). A first pass over the lanes takes
the closed form and marks the others. Symbols: w0 = d / |d| cone axis, b angle between l and n_x, e and f their
bisectors, c = e x f the line of both horizons; chi turn of a slice from e, chi0 that of w0, v(chi) the slice's
direction; rho, s lengths of w0 across and along c; m = rho sin(chi - chi0), t = rho cos(chi - chi0); sigma = <c . w>; g
angle in a quadrant, y = tan(g / 2).
"""

import math
from typing import Any

import numpy as np

from refgi.jit import kernel, prange
from refgi.pairs.pair_sum import (
    GROUP,
    LEAST_SQUARE,
    NX,
    ROWS,
    SUM,
    TILE,
    TOTAL,
    X,
    close_group,
    load_tile,
    pair_cosines,
)
from refgi.pairs.pixel_lights import Range
from refgi.pairs.ranged_sum import weigh_by_range
from refgi.radiometry import orthonormal_basis
from refgi.types import Array

POINTS = 12  # of the Gauss rule in each quadrant; tests/pairs/test_sphere.py measures its error
LEAST_RATIO = 1e-12  # (r / |d|)^2 below which a horizon cuts the cone as it cuts a point
LEAST_LENGTH = 1e-6  # of l + n_x (they face apart) and l - n_x (they face each other)
TINY = 1e-30  # stands in for a square that rounds to 0

# Gauss-Legendre on 0..1 in sqrt(y): points crowd at g = 0, where a slice grazes the rim of a wide cone
_x, _w = np.polynomial.legendre.leggauss(POINTS)
PLACE = np.round(((_x + 1.0) / 2.0) ** 2, 14)  # digits that no linear algebra library gets otherwise
WEIGHT = np.round(_w * (_x + 1.0) / 2.0, 14)


@kernel
def cone_term(cl: Any, cx: Any, facing: Any, ratio: Any) -> Any:
    """Return the mean of <l . w> <n_x . w> over a cone above both horizons, times solid angle / (pi sin^2 a).

    `cl`, `cx`: cosines of the axis; `facing` l . n_x, `ratio` sin^2 a. The moments are B = 2 pi/3 (1 - cos^3 a) along
    the axis, A = pi (2/3 - cos a + cos^3 a / 3) across it, without cancellation by 1 - cos a = sin^2 a / (1 + cos a).
    """
    real = type(cl)
    one = real(1.0)
    third = real(1.0 / 3.0)
    cos_a = math.sqrt(one - ratio)
    share = one / (one + cos_a)
    along = (third + third) * (one + cos_a + cos_a * cos_a) * share
    across = third * ratio * (one + one + cos_a) * share * share
    return along * (cl * cx) + across * (facing - cl * cx)


@kernel
def cut_cone_term(w: Any, light: Any, normal: Any, ratio: Any) -> Any:
    """Return the integral of <l . w>+ <n_x . w>+ over a cone that a horizon may cut, divided by pi sin^2 a.

    `w` is the cone's axis, from receiver to light; `light` and `normal` are the unit vectors l (the light's normal
    reversed) and n_x; `ratio` is sin^2 a, `LEAST_RATIO` to 1.
    """
    real = type(ratio)
    zero, half = real(0.0), real(0.5)
    (lx, ly, lz), (nx, ny, nz) = light, normal
    ex, ey, ez = lx + nx, ly + ny, lz + nz
    cos_half = half * math.sqrt(ex * ex + ey * ey + ez * ez)  # cos(b / 2)
    if cos_half < real(LEAST_LENGTH):
        return zero  # no direction is above both horizons
    scale = half / cos_half
    ex, ey, ez = ex * scale, ey * scale, ez * scale
    fx, fy, fz = nx - lx, ny - ly, nz - lz
    along = fx * ex + fy * ey + fz * ez
    fx, fy, fz = fx - along * ex, fy - along * ey, fz - along * ez
    sin_half = half * math.sqrt(fx * fx + fy * fy + fz * fz)
    if sin_half < real(LEAST_LENGTH):
        sin_half = zero
        fx, fy, fz, _, _, _ = orthonormal_basis(ex, ey, ez)
    else:
        scale = half / sin_half
        fx, fy, fz = fx * scale, fy * scale, fz * scale
    x = w[0] * ex + w[1] * ey + w[2] * ez
    y = w[0] * fx + w[1] * fy + w[2] * fz
    s = abs(w[0] * (ey * fz - ez * fy) + w[1] * (ez * fx - ex * fz) + w[2] * (ex * fy - ey * fx))
    return _slices(x, y, s, cos_half, sin_half, ratio)


@kernel
def _slices(x: Any, y: Any, s: Any, cos_half: Any, sin_half: Any, ratio: Any) -> Any:
    """Add up the quadrants of slices around chi0, given w0 = (x, y, s) along e, f, c."""
    real = type(x)
    one, zero = real(1.0), real(0.0)
    square = x * x + y * y
    rho = math.sqrt(square)
    x, y = (x / rho, y / rho) if rho > real(TINY) else (one, zero)
    # l and n_x across c, along v(chi0) and turned from it
    l_along, l_turn = cos_half * x - sin_half * y, -(sin_half * x + cos_half * y)
    n_along, n_turn = cos_half * x + sin_half * y, sin_half * x - cos_half * y
    total = zero
    if square > ratio:  # the cone holds neither end of c: all its slices have t > 0
        for side in (-one, one):
            total += _open_quadrant(rho, s, l_along, side * l_turn, n_along, side * n_turn, ratio)
        return total
    for front in (-one, one):
        for side in (-one, one):
            total += _closed_quadrant(rho, s, front, front * l_along, side * l_turn, front * n_along, side * n_turn,
                                      ratio)
    return total


@kernel
def _open_quadrant(rho: Any, s: Any, l_along: Any, l_turn: Any, n_along: Any, n_turn: Any, ratio: Any) -> Any:
    """Integrate over m = sin a cos g, where slices end at the cone's rim on both sides."""
    real = type(rho)
    one, zero, two = real(1.0), real(0.0), real(2.0)
    sin_a = math.sqrt(ratio)
    first, last = _limits(rho * l_along, l_turn, sin_a, zero, one)
    first, last = _limits(rho * n_along, n_turn, sin_a, first, last)
    total = zero
    if first < last:
        for k in range(POINTS):
            y = first + (last - first) * real(PLACE[k])
            share = one / (one + y * y)
            sin_g, cos_g = two * y * share, (one - y * y) * share
            m = sin_a * cos_g
            t = math.sqrt(max(rho * rho - m * m, zero))
            length = max((one - ratio) + ratio * (sin_g * sin_g), real(TINY))  # s^2 + t^2
            # sigma runs over p - q .. p + q: 2 q (1 - p^2 - q^2 / 3), with q dchi = sin^2 a sin^2 g dg / length
            p, q = s * math.sqrt(one - ratio) / length, t * sin_a * sin_g / length
            cosines = max(l_along * t + l_turn * m, zero) * max(n_along * t + n_turn * m, zero) / (rho * rho)
            along = max(one - p * p - q * q * real(1.0 / 3.0), zero)
            total += real(WEIGHT[k]) * share * cosines * along * (sin_g * sin_g) / length
    return total * max(last - first, zero) * real(4.0 / math.pi)


@kernel
def _limits(along: Any, turn: Any, sin_a: Any, first: Any, last: Any) -> Any:
    """Narrow y = tan(g / 2) to where a cosine is above 0: a horizon crosses the cone at |m| = |along|."""
    real = type(along)
    one, zero = real(1.0), real(0.0)
    cos_g = min(abs(along) / sin_a, one)
    y = math.sqrt((one - cos_g) / (one + cos_g))
    if turn < zero:  # falls with m: m < along
        return (max(first, y), last) if along > zero else (one, zero)
    return (first, last) if along >= zero else (first, min(last, y))


@kernel
def _closed_quadrant(
    rho: Any, s: Any, front: Any, l_along: Any, l_turn: Any, n_along: Any, n_turn: Any, ratio: Any
) -> Any:
    """Integrate over |t| = rho sin g, |m| = rho cos g, where slices run from the cone's rim to the end of c."""
    real = type(rho)
    one, zero, two = real(1.0), real(0.0), real(2.0)
    first, last = _turn_limits(l_along, l_turn, zero, one)
    first, last = _turn_limits(n_along, n_turn, first, last)
    cos_a = math.sqrt(one - ratio)
    total = zero
    if first < last:
        for k in range(POINTS):
            y = first + (last - first) * real(PLACE[k])
            share = one / (one + y * y)
            sin_g, cos_g = two * y * share, (one - y * y) * share
            t = front * rho * sin_g
            root = math.sqrt(max(ratio - rho * rho * (cos_g * cos_g), zero))
            length = max(s * s + t * t, real(TINY))
            sigma, across = (s * cos_a - t * root) / length, max(t * cos_a + s * root, zero) / length
            # 1 - sigma of the rim; the slice has the integral of 1 - sigma^2 from there to 1
            depth = across * across / (one + sigma) if sigma > zero else min(one - sigma, two)
            cosines = max(l_along * sin_g + l_turn * cos_g, zero) * max(n_along * sin_g + n_turn * cos_g, zero)
            total += real(WEIGHT[k]) * share * cosines * (depth * depth) * (one - depth * real(1.0 / 3.0))
    return total * max(last - first, zero) * real(2.0 / math.pi) / ratio


@kernel
def _turn_limits(along: Any, turn: Any, first: Any, last: Any) -> Any:
    """Narrow y = tan(g / 2) to where along sin g + turn cos g is above 0."""
    real = type(along)
    zero = real(0.0)
    y = abs(turn) / max(abs(along) + math.sqrt(along * along + turn * turn), real(TINY))
    if along > zero:
        return (first, last) if turn >= zero else (max(first, y), last)
    return (first, min(last, y)) if turn > zero else (real(1.0), zero)


TERM, RATIO = range(ROWS, ROWS + 2)  # further rows of a tile: of one light, 1/m^2; sin^2 a of cones that are cut, or 0


@kernel(parallel=True)
def sum_spheres(
    position: Array, normal: Array, lights: Array, square_radius: Array, reach: Range | None, irradiance: Array
) -> None:
    """Fill irradiance (3, n), W/m^2, with the sum of every spherical light at every receiver (Hasan et al. 2009).

    Arguments as for `pair_sum.sum_pairs`, with `square_radius` (N,) the squares of the lights' radii, m^2, and `reach`
    by the point light in the middle of the sphere. No light is culled: one behind a horizon still reaches over it by
    its radius.
    """
    count = position.shape[1]
    for block in prange((count + TILE - 1) // TILE):
        first = block * TILE
        size = min(TILE, count - first)
        tile = np.zeros((ROWS + 2, TILE), position.dtype)
        load_tile(tile, position, normal, first, size)
        for group in range(0, lights.shape[1] - 1, GROUP):
            for k in range(group, min(group + GROUP, lights.shape[1] - 1)):
                light = lights[0, k], lights[1, k], lights[2, k], lights[3, k], lights[4, k], lights[5, k]
                whole_cones(tile, light, square_radius[k])
                cut_cones(tile, light, square_radius[k], size)
                if reach is not None:
                    weigh_by_range(tile, TERM, light, reach.square[k], reach.scale[k], reach.outside)
                for i in range(TILE):
                    tile[SUM, i] += tile[TERM, i] * lights[6, k]
                    tile[SUM + 1, i] += tile[TERM, i] * lights[7, k]
                    tile[SUM + 2, i] += tile[TERM, i] * lights[8, k]
            close_group(tile)
        for c in range(3):
            for i in range(size):
                irradiance[c, first + i] = tile[TOTAL + c, i]


@kernel
def whole_cones(tile: Array, light: Any, square_radius: Any) -> None:
    """Fill row TERM (1/m^2) where no horizon cuts the cone, and mark the other receivers in row RATIO.

    `light` is position and reversed normal, `square_radius` that of its sphere, m^2.
    """
    real = tile.dtype.type
    one, zero = real(1.0), real(0.0)
    px, py, pz, lx, ly, lz = light
    for i in range(tile.shape[1]):
        dx, dy, dz = px - tile[X, i], py - tile[X + 1, i], pz - tile[X + 2, i]
        nx, ny, nz = tile[NX, i], tile[NX + 1, i], tile[NX + 2, i]
        exact, cl, cx = pair_cosines(dx, dy, dz, lx, ly, lz, nx, ny, nz)
        square = exact if exact > real(LEAST_SQUARE) else real(LEAST_SQUARE)
        clamped = square if square > square_radius else square_radius
        ratio = square_radius / clamped
        inverse = one / math.sqrt(square)
        cl, cx = cl * inverse, cx * inverse
        low = cl if cl < cx else cx
        sin_a = math.sqrt(ratio) if ratio >= real(LEAST_RATIO) else zero
        term = cone_term(cl, cx, lx * nx + ly * ny + lz * nz, ratio) / clamped
        tile[TERM, i] = term if (low >= sin_a) & (low > zero) else zero
        tile[RATIO, i] = ratio if (low < sin_a) & (low > -sin_a) & (exact > real(LEAST_SQUARE)) else zero


@kernel
def cut_cones(tile: Array, light: Any, square_radius: Any, size: int) -> None:
    """Fill row TERM (1/m^2) of the receivers that `whole_cones` marked, out of the first `size`."""
    real = tile.dtype.type
    px, py, pz, lx, ly, lz = light
    for i in range(size):
        ratio = tile[RATIO, i]
        if ratio > real(0.0):
            dx, dy, dz = px - tile[X, i], py - tile[X + 1, i], pz - tile[X + 2, i]
            square = dx * dx + dy * dy + dz * dz
            inverse = real(1.0) / math.sqrt(square)
            axis = dx * inverse, dy * inverse, dz * inverse
            normal = tile[NX, i], tile[NX + 1, i], tile[NX + 2, i]
            tile[TERM, i] = cut_cone_term(axis, (lx, ly, lz), normal, ratio) / max(square, square_radius)
