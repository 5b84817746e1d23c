"""The light side: each receiver importance-samples light vertices by their unshadowed contribution.

The picture's pixels alternate between several sets of light vertices, so that what one set misses does not show in all
of them; receivers of one set make up tiles. For receiver x and sender i the unshadowed term is p_i min(q_i <n_x.w> /
r^2, b_i), with the sender's pattern q. A receiver sums the terms in blocks of 32 and parts of 8, places its picks
evenly over the total with one random shift (systematic sampling), finds the point that each falls on, and traces a
shadow ray to it (next-event estimation to a light vertex). A pick stands for total / picks, so what remains random is
visibility and colour. Sums and comparisons run in float32, everywhere in one order.
"""

from itertools import pairwise
from typing import Any

import numpy as np

from refgi.jit import kernel, prange
from refgi.pairs.shadow_rays import RayReceivers
from refgi.rays import far_offset, ray_offset
from refgi.sampling import hash_bits
from refgi.truth.light_vertices import BLOCK, LightVertices
from refgi.types import Array

TILE = 256  # most receivers that one parallel iteration owns: the SIMD lanes
PART = 8  # senders whose terms a pick may have to compute again
PARTS = BLOCK // PART
TINY = np.float32(1e-30)  # m^2; smaller squared distances count as this one, so that no 0 / 0 arises
BELOW_1 = np.float32(1 - 2.0**-24)


@kernel
def _bounded_geometry(
    dx: Any, dy: Any, dz: Any, nx: Any, ny: Any, nz: Any, mx: Any, my: Any, mz: Any, bound: Any
) -> Any:
    """Return min(G, b) for d = y - x, receiver normal n and sender normal m; free of branches."""
    zero = np.float32(0)
    r2 = dx * dx + dy * dy + dz * dz
    inverse = np.float32(1) / (r2 if r2 > TINY else TINY)
    cos_x = nx * dx + ny * dy + nz * dz
    cos_y = -(mx * dx + my * dy + mz * dz)
    # G = <n_x.w> <n_y.-w> / r^2, the geometry term of SII Eq. (2)
    geometry = ((cos_x if cos_x > zero else zero) * inverse) * ((cos_y if cos_y > zero else zero) * inverse)
    return geometry if geometry < bound else bound  # MIS: the light side's weight is min(1, b / G)


@kernel
def _sum_diffuse(points: LightVertices, tile: Array, first: int, count: int, parts: Array) -> None:
    """Fill the sums of the terms of each part of diffuse senders at each receiver of a tile, two senders at a time."""
    for p in range(count):
        for j in range(first + p * PART, first + p * PART + PART, 2):
            px, py, pz = points.position[0, j], points.position[1, j], points.position[2, j]
            qx, qy, qz = points.position[0, j + 1], points.position[1, j + 1], points.position[2, j + 1]
            power, power_q, bound, bound_q = points.power[j], points.power[j + 1], points.bound[j], points.bound[j + 1]
            kx, ky, kz = points.axis[0, j], points.axis[1, j], points.axis[2, j]
            lx, ly, lz = points.axis[0, j + 1], points.axis[1, j + 1], points.axis[2, j + 1]
            for i in range(TILE):
                x, y, z, nx, ny, nz = tile[0, i], tile[1, i], tile[2, i], tile[3, i], tile[4, i], tile[5, i]
                one = power * _bounded_geometry(px - x, py - y, pz - z, nx, ny, nz, kx, ky, kz, bound)
                two = power_q * _bounded_geometry(qx - x, qy - y, qz - z, nx, ny, nz, lx, ly, lz, bound_q)
                parts[p, i] = (parts[p, i] + one) + two


@kernel
def _diffuse_term(points: LightVertices, j: int, tile: Array, i: int) -> Any:
    """Return the term of one diffuse sender at one receiver, bit for bit that which was summed."""
    dx, dy = points.position[0, j] - tile[0, i], points.position[1, j] - tile[1, i]
    dz = points.position[2, j] - tile[2, i]
    return points.power[j] * _bounded_geometry(dx, dy, dz, tile[3, i], tile[4, i], tile[5, i], points.axis[0, j],
                                      points.axis[1, j], points.axis[2, j], points.bound[j])


@kernel
def aim(points: LightVertices, j: int, receivers: RayReceivers, r: int, grain: Any, hide: bool, origins: Array,
        directions: Array, ray: int) -> Any:
    """Write the shadow segment to a picked point and return its reach: 1, or 0 where a face is seen from behind.

    `hide`: as in `Sides`; without, no segment is traced, and its reach is 1.
    """
    real = np.float32
    from_x, from_y = real(0), real(0)
    x, y, z = points.position[0, j], points.position[1, j], points.position[2, j]
    offset = ray_offset(x, y, z, grain)
    offset += far_offset(x - receivers.position[0, r], y - receivers.position[1, r], z - receivers.position[2, r])
    for c in range(3):
        origins[ray, c] = receivers.origin[c, r]
        directions[ray, c] = points.position[c, j] + offset * points.facing[c, j] - receivers.origin[c, r]
        toward = points.position[c, j] - receivers.position[c, r]
        from_x += receivers.facing[c, r] * toward
        from_y -= points.facing[c, j] * toward
    return real(1) if not hide or (from_x > real(0) and from_y > real(0)) else real(0)


def tiles(set_of: Array, first: int, last: int) -> tuple[Array, Array]:
    """Sort a span of receivers by their set and cut them into tiles.

    `set_of` (r,) int: which set of light vertices each receiver picks from. `first`, `last`: first receiver of the span
    and one past the last. Returns (last - first,), (t, 3), both int64: receivers; and for each tile where it begins and
    ends among them, and its set.
    """
    order = np.argsort(set_of[first:last], kind="stable")
    sets = set_of[first:last][order]
    ends = [0, *(1 + np.flatnonzero(np.diff(sets))).tolist(), last - first]
    cuts = [(low, min(low + TILE, end), sets[low]) for begin, end in pairwise(ends) for low in range(begin, end, TILE)]
    return first + order, np.array(cuts, np.int64).reshape(-1, 3)


@kernel(parallel=True)
def pick(points: LightVertices, starts: Array, receivers: RayReceivers, tiles: tuple[Array, Array],
         sampling: tuple[int, int, int, Any, bool], rays: tuple[Array, Array, Array, Array, Array]) -> None:
    """Pick light vertices for each receiver of some tiles; write shadow rays and their contributions.

    `starts` (sets, 2) int64: first block of each set and one past its last. `tiles`: receivers
    sorted by set, and the table of tiles. `sampling`: first receiver of the span; picks of each; seed of the random
    shift, a hash of it and the receiver's pixel; the tracer's grain: segments end above the sender's face by
    `ray_offset` and `far_offset`, m; whether faces hide what lies behind them. `rays`: filled: origins, directions
    (n, 3), reach (n,), contribution (n, 3) W/m^2, float32, and the point picked (n,) int32; n = picks x receivers. The
    reach is 0 where there is nothing to gain.
    """
    members, table = tiles
    for number in prange(len(table)):
        low, high, chosen = table[number, 0], table[number, 1], table[number, 2]
        count = high - low
        # positions and normals; lanes beyond the count receive nothing
        tile = np.zeros((6, TILE), np.float32)
        for c in range(3):
            for i in range(count):
                tile[c, i] = receivers.position[c, members[low + i]]
                tile[3 + c, i] = receivers.normal[c, members[low + i]]
        first, size = starts[chosen, 0] * BLOCK, starts[chosen, 1] - starts[chosen, 0]
        parts = np.zeros((size * PARTS, TILE), np.float32)
        _sum_diffuse(points, tile, first, size * PARTS, parts)
        blocks = np.zeros((size, TILE), np.float32)
        for p in range(parts.shape[0]):
            for i in range(TILE):
                blocks[p // PARTS, i] += parts[p, i]
        _pick_all(points, receivers, members[low:high], tile, sampling, (first, blocks, parts), rays)


@kernel
def _pick_all(points: LightVertices, receivers: RayReceivers, members: Array, tile: Array,
              sampling: tuple[int, int, int, Any, bool], sums: tuple[int, Array, Array],
              rays: tuple[Array, Array, Array, Array, Array]) -> None:
    """Let receivers pick: walk the blocks, the parts of the block a pick falls in, the terms of that part."""
    origins, directions, reach, contribution, picked = rays
    first, picks, seed, grain, hide = sampling
    first_point, blocks, parts = sums
    real = np.float32
    for i in range(len(members)):
        r, total = members[i], real(0)
        for b in range(blocks.shape[0]):
            total += blocks[b, i]
        for s in range(picks):
            reach[(r - first) * picks + s] = real(0)
        shift, share = random_shift(receivers.pixel[r], seed), total / real(picks)
        b, before = 0, real(0)  # block, and the sum of those before it
        for s in range(picks if total > real(0) else 0):
            ray = (r - first) * picks + s
            target = (real(s) + shift) * share
            b, before, p, rest = part_of(blocks, parts, i, target, b, before)
            j, end = first_point + p * PART, first_point + p * PART + PART - 1
            term = _diffuse_term(points, j, tile, i)
            while j < end and term <= rest:
                rest -= term
                j += 1
                term = _diffuse_term(points, j, tile, i)
            if term > real(0):
                reach[ray] = aim(points, j, receivers, r, grain, hide, origins, directions, ray)
                picked[ray] = j
                for c in range(3):
                    contribution[ray, c] = share * points.colour[c, j]


@kernel
def random_shift(pixel: int, seed: int) -> Any:
    """Return how far a receiver's picks are shifted in a pass: 0 to 1 of the way from one to the next."""
    return np.float32(hash_bits(np.uint32(pixel) ^ np.uint32(seed)) >> np.uint32(8)) * np.float32(2.0**-24)


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
