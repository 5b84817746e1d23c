"""The light side of glossy receivers: picks among light vertices by what the receiver's lobe makes of them.

As `refgi.truth.light_side`, with another term: for receiver x and sender i it is, by the power heuristic,

    p_i <n_i.-w> <n_x.w> (P + 2) / (2 pi) <m.w>^P / (r^2 (1 + (A / r^2)^2)),    A = a_i D <m.w>^P <g_i.-w>,

p_i the sender's intensity along its normal n_i, g_i its face normal, a_i the area that one of the light's rays stands
for when they are spread evenly, D what the receiver's own directions count on the axis (`density_on_axis`). With A = 0
it is f_s I cos / r^2 over s; near a lobe's axis, or near a sender, A bounds it. Computed in float32, everywhere in one
order. Senders are diffuse: lobes come by cells of light (`refgi.truth.cell_pass`). Receivers above `SHARPEST_VERTEX`
take nothing.
"""

import math
from typing import Any

import numpy as np

from refgi.elementary import exp2, log2p1
from refgi.jit import kernel, prange
from refgi.pairs.shadow_rays import RayReceivers
from refgi.truth.light_side import BELOW_1, TILE, aim, random_shift
from refgi.truth.light_vertices import BLOCK, LightVertices
from refgi.truth.lobe_cells import SHARPEST_VERTEX, Lobes, density_on_axis
from refgi.types import Array

PART = 8  # senders whose terms a pick may have to compute again
PARTS = BLOCK // PART
NEAREST = np.float32(1e-12)  # m^2; smaller squared distances count as this one: no term of the sharpest lobe overflows
LANES = 16  # receivers of a tile are filled up to a multiple of that
ROWS = 12  # of a tile: position, normal, m, P, (P + 2) / (2 pi), D


@kernel
def _vertex(points: LightVertices, j: int) -> Any:
    """Return what `_factors` needs of sender j: place, normal, face normal, power, area."""
    return (points.position[0, j], points.position[1, j], points.position[2, j], points.normal[0, j],
            points.normal[1, j], points.normal[2, j], points.facing[0, j], points.facing[1, j], points.facing[2, j],
            points.power[j], points.bound[j])


@kernel
def _factors(vertex: Any, tile: Array, i: int) -> Any:
    """Return what a pair's weight is made of, without branches.

    Result: -h of the receiver's lobe, p <n_i.-w> <n_x.w> (P + 2) / (2 pi), r^2, A without the receiver's power.
    """
    px, py, pz, ux, uy, uz, fx, fy, fz, power, area = vertex
    zero, half = np.float32(0), np.float32(0.5)
    dx, dy, dz = px - tile[0, i], py - tile[1, i], pz - tile[2, i]
    r2 = dx * dx + dy * dy + dz * dz
    r2 = r2 if r2 > NEAREST else NEAREST
    inverse = np.float32(1) / np.sqrt(r2)
    wx, wy, wz = dx * inverse, dy * inverse, dz * inverse
    cos_x = tile[3, i] * wx + tile[4, i] * wy + tile[5, i] * wz
    leaving = -(ux * wx + uy * wy + uz * wz)
    cos_face = -(fx * wx + fy * wy + fz * wz)
    ex, ey, ez = tile[6, i] - wx, tile[7, i] - wy, tile[8, i] - wz
    h = half * (ex * ex + ey * ey + ez * ez)
    factor = power * (cos_x if cos_x > zero else zero) * (leaving if leaving > zero else zero) * tile[10, i]
    factor = factor if h < BELOW_1 else zero
    shared = area * tile[11, i] * (cos_face if cos_face > zero else zero)
    return -(h if h < BELOW_1 else BELOW_1), factor, r2, shared


@kernel
def _sum_terms(points: LightVertices, tile: Array, lanes: int, first: int, parts: Array) -> None:
    """Fill the sums of the terms of each part of senders at receivers of a tile: one loop a function, for SIMD."""
    power, factor = np.empty(TILE, np.float32), np.empty(TILE, np.float32)
    square, shared = np.empty(TILE, np.float32), np.empty(TILE, np.float32)
    for p in range(parts.shape[0]):
        for j in range(first + p * PART, first + p * PART + PART):
            if points.power[j] <= np.float32(0):
                continue
            vertex = _vertex(points, j)
            for i in range(lanes):
                power[i], factor[i], square[i], shared[i] = _factors(vertex, tile, i)
            for i in range(lanes):
                power[i] = log2p1(power[i])
            for i in range(lanes):
                power[i] = exp2(tile[9, i] * power[i])
            for i in range(lanes):
                ratio = shared[i] * power[i] / square[i]
                parts[p, i] += factor[i] * (power[i] / (square[i] * (np.float32(1) + ratio * ratio)))


@kernel
def _term(points: LightVertices, j: int, tile: Array, i: int) -> Any:
    """Return the term of one sender at one receiver, bit for bit that which was summed."""
    h, factor, square, shared = _factors(_vertex(points, j), tile, i)
    power = exp2(tile[9, i] * log2p1(h))
    ratio = shared * power / square
    return factor * (power / (square * (np.float32(1) + ratio * ratio)))


@kernel(parallel=True)
def pick_for_lobes(points: LightVertices, starts: Array, receivers: RayReceivers, lobes: Lobes,
                   tiles: tuple[Array, Array], sampling: tuple[int, int, int, int, Any, bool, float],
                   rays: tuple[Array, Array, Array, Array, Array]) -> None:
    """Pick light vertices for each glossy receiver of some tiles; write shadow rays and their contributions.

    As `refgi.truth.light_side.pick`, but the vertices' `bound` is a_i, m^2; `sampling` ends with N, 0 for no
    directions. The contributions are radiance, W/m^2/sr.
    """
    members, table = tiles
    for number in prange(len(table)):
        low, high, chosen = table[number, 0], table[number, 1], table[number, 2]
        # lanes beyond the count receive nothing
        tile = np.zeros((ROWS, TILE), np.float32)
        _fill_tile(receivers, lobes, members[low:high], sampling[6], tile)
        first, size = starts[chosen, 0], starts[chosen, 1] - starts[chosen, 0]
        parts, blocks = np.zeros((size * PARTS, TILE), np.float32), np.zeros((size, TILE), np.float32)
        lanes = min(TILE, (high - low + LANES - 1) // LANES * LANES)
        _sum_terms(points, tile, lanes, first * BLOCK, parts)
        for p in range(parts.shape[0]):
            for i in range(lanes):
                blocks[p // PARTS, i] += parts[p, i]
        _pick_all(points, receivers, lobes, members[low:high], tile, sampling, (first * BLOCK, blocks, parts),
                  rays)


@kernel
def _fill_tile(receivers: RayReceivers, lobes: Lobes, members: Array, directions: float, tile: Array) -> None:
    for i in range(len(members)):
        r = members[i]
        for c in range(3):
            tile[c, i], tile[3 + c, i] = receivers.position[c, r], receivers.normal[c, r]
            tile[6 + c, i] = lobes.mirrored[c, r]
        tile[9, i] = lobes.exponent[r]
        if directions == 0 or lobes.exponent[r] <= SHARPEST_VERTEX:
            tile[10, i] = (lobes.exponent[r] + 2) / (2 * math.pi)
        tile[11, i] = density_on_axis(lobes.exponent[r], directions)


@kernel
def _pick_all(points: LightVertices, receivers: RayReceivers, lobes: Lobes, members: Array, tile: Array,
              sampling: tuple[int, int, int, int, Any, bool, float], sums: tuple[int, Array, Array],
              rays: tuple[Array, Array, Array, Array, Array]) -> None:
    """Let receivers pick: walk the blocks, the parts of the block a pick falls in, the terms of that part."""
    origins, directions, reach, contribution, picked = rays
    first, picks, seed, turn, grain, hide, _ = sampling
    first_point, blocks, parts = sums
    real = np.float32
    for i in range(len(members)):
        r, total = members[i], real(0)
        for b in range(blocks.shape[0]):
            total += blocks[b, i]
        for s in range(picks):
            reach[(r - first) * picks + s] = real(0)
        shift, share = random_shift(receivers.pixel[r], seed, turn), total / real(picks)
        b, before = 0, real(0)  # block, and the sum of those before it
        for s in range(picks if total > real(0) else 0):
            ray = (r - first) * picks + s
            target = (real(s) + shift) * share
            b, before, p, rest = part_of(blocks, parts, i, target, b, before)
            j, end = first_point + p * PART, first_point + p * PART + PART - 1
            term = _term(points, j, tile, i)
            while j < end and term <= rest:
                rest -= term
                j += 1
                term = _term(points, j, tile, i)
            if term > real(0):
                reach[ray] = aim(points, j, receivers, r, grain, hide, origins, directions, ray)
                picked[ray] = j
                for c in range(3):
                    contribution[ray, c] = share * points.colour[c, j] * real(lobes.specular[c, r])


@kernel
def part_of(blocks: Array, parts: Array, i: int, target: Any, b: int, before: Any) -> tuple[int, Any, int, Any]:
    """Find the part of senders that a pick of receiver i falls in, from block b on, `before` the sum of those before.

    Returns its block, the sum before that, the part, and what of `target` remains there.
    """
    while b < blocks.shape[0] - 1 and before + blocks[b, i] <= target:
        before += blocks[b, i]
        b += 1
    rest = target - before
    p, end = b * PARTS, b * PARTS + PARTS - 1
    while p < end and parts[p, i] <= rest:
        rest -= parts[p, i]
        p += 1
    return b, before, p, rest
