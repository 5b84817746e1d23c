"""The light side: each receiver importance-samples light vertices by their unshadowed contribution.

The picture's pixels alternate between several sets of light vertices, so that what one set misses does not show in all
of them; receivers of one set make up tiles. For receiver x and sender i the unshadowed term is p_i min(q_i <n_x.w> /
r^2, b_i), with the sender's pattern q. A receiver sums the terms one after the other, places its picks evenly over the
total with one random shift (systematic sampling), finds by bisection of the running sums the point that each falls on,
and traces a shadow ray to it (next-event estimation to a light vertex). A pick stands for total / picks, so what
remains random is visibility and colour. Terms and comparisons run in float32, sums in one order everywhere.
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

TILE = 64  # most receivers that one parallel iteration owns: the SIMD lanes
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
def _fill_sums(points: LightVertices, tile: Array, first: int, sums: Array) -> None:
    """Fill the running sums of the terms of diffuse senders at each receiver of a tile, two senders at a time.

    `tile`: position and normal, one after the other. `sums`: a row of receivers for each sender behind one of zeros.
    Kahan's summation: what rounding takes from a small term goes to the next ones.
    """
    lost = np.zeros(TILE, np.float32)
    for i in range(TILE):
        sums[i] = np.float32(0)
    for j in range(0, len(sums) // TILE - 1, 2):
        k = first + j
        px, py, pz = points.position[0, k], points.position[1, k], points.position[2, k]
        qx, qy, qz = points.position[0, k + 1], points.position[1, k + 1], points.position[2, k + 1]
        power, power_q, bound, bound_q = points.power[k], points.power[k + 1], points.bound[k], points.bound[k + 1]
        kx, ky, kz = points.axis[0, k], points.axis[1, k], points.axis[2, k]
        lx, ly, lz = points.axis[0, k + 1], points.axis[1, k + 1], points.axis[2, k + 1]
        rows = sums[j * TILE : (j + 3) * TILE]
        for i in range(TILE):
            x, y, z = tile[i], tile[i + TILE], tile[i + 2 * TILE]
            nx, ny, nz = tile[i + 3 * TILE], tile[i + 4 * TILE], tile[i + 5 * TILE]
            one = power * _bounded_geometry(px - x, py - y, pz - z, nx, ny, nz, kx, ky, kz, bound) - lost[i]
            first_sum = rows[i] + one
            two = power_q * _bounded_geometry(qx - x, qy - y, qz - z, nx, ny, nz, lx, ly, lz, bound_q)
            two = two - ((first_sum - rows[i]) - one)
            second_sum = first_sum + two
            lost[i] = (second_sum - first_sum) - two
            rows[i + TILE] = first_sum
            rows[i + 2 * TILE] = second_sum


@kernel
def _find(sums: Array, shift: Array, share: Array, picks: int, found: Array) -> None:
    """Find for pick s of each lane the first sender at which the running sum exceeds (s + shift) share, else the last.

    `shift`, `share` (TILE,): of each lane. `found`: filled, a row of lanes for each pick. By bisection, all lanes
    together and free of branches.
    """
    last = np.int32(len(sums) // TILE - 2)
    for s in range(picks):
        row, step = found[s * TILE : (s + 1) * TILE], np.int32(1)
        row[:] = 0
        while 2 * step <= last:
            step = np.int32(2 * step)
        while step > 0:
            for i in range(TILE):
                k = np.int32(min(np.int32(row[i] + step), last))
                row[i] = k if sums[np.int64(k) * TILE + i] <= (np.float32(s) + shift[i]) * share[i] else row[i]
            step = np.int32(step >> 1)


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
         sampling: tuple[int, int, int, int, Any, bool], rays: tuple[Array, Array, Array, Array, Array]) -> None:
    """Pick light vertices for each receiver of some tiles; write shadow rays and their contributions.

    `starts` (sets, 2) int64: first block of each set and one past its last. `tiles`: receivers sorted by set, and the
    table of tiles. `sampling`: first receiver of the span; picks of each; seed and turn of the random shift; the
    tracer's grain: segments end above the sender's face by `ray_offset` and `far_offset`, m; whether faces hide what
    lies behind them. `rays`: filled: origins, directions (n, 3), reach (n,), contribution (n, 3) W/m^2, float32, and
    the point picked (n,) int32; n = picks x receivers. The reach is 0 where there is nothing to gain.
    """
    members, table = tiles
    longest = 0
    for k in range(len(starts)):
        longest = max(longest, (starts[k, 1] - starts[k, 0]) * BLOCK)
    tile, sums = np.empty(6 * TILE, np.float32), np.empty((longest + 1) * TILE, np.float32)
    found = np.empty(sampling[1] * TILE, np.int32)
    for number in prange(len(table)):
        low, high, chosen = table[number, 0], table[number, 1], table[number, 2]
        tile[:] = 0  # lanes beyond the last receiver receive nothing
        for i in range(high - low):
            for c in range(3):
                tile[c * TILE + i] = receivers.position[c, members[low + i]]
                tile[(3 + c) * TILE + i] = receivers.normal[c, members[low + i]]
        first, count = starts[chosen, 0] * BLOCK, (starts[chosen, 1] - starts[chosen, 0]) * BLOCK
        _fill_sums(points, tile, first, sums[: (count + 1) * TILE])
        _pick_all(points, receivers, members[low:high], sampling, (first, sums[: (count + 1) * TILE], found), rays)


@kernel
def _pick_all(points: LightVertices, receivers: RayReceivers, members: Array,
              sampling: tuple[int, int, int, int, Any, bool], senders: tuple[int, Array, Array],
              rays: tuple[Array, Array, Array, Array, Array]) -> None:
    """Let receivers pick among senders: their first number, running sums of their terms, space for what is found."""
    origins, directions, reach, contribution, picked = rays
    first, picks, seed, turn, grain, hide = sampling
    first_point, sums, found = senders
    shift, share, real = np.zeros(TILE, np.float32), np.zeros(TILE, np.float32), np.float32
    for i in range(len(members)):
        shift[i] = random_shift(receivers.pixel[members[i]], seed, turn)
        share[i] = sums[len(sums) - TILE + i] / real(picks)
    _find(sums, shift, share, picks, found)
    for i in range(len(members)):
        r = members[i]
        for s in range(picks):
            ray, k = (r - first) * picks + s, found[s * TILE + i]
            reach[ray] = real(0)
            if sums[(k + 1) * TILE + i] > sums[k * TILE + i]:
                j = first_point + k
                reach[ray] = aim(points, j, receivers, r, grain, hide, origins, directions, ray)
                picked[ray] = j
                for c in range(3):
                    contribution[ray, c] = share[i] * points.colour[c, j]


@kernel
def random_shift(pixel: int, seed: int, turn: int) -> Any:
    """Return how far a receiver's picks are shifted in a pass: 0 to 1 of the way from one to the next.

    A hash of seed and pixel, and from turn to turn a golden section on: any number of turns is spread evenly.
    """
    word = np.uint32(hash_bits(np.uint32(pixel) ^ np.uint32(seed)) + np.uint32(turn) * np.uint32(0x9E3779B9))
    return np.float32(word >> np.uint32(8)) * np.float32(2.0**-24)
