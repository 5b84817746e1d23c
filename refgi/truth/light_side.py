"""The light side: each receiver picks lit points in proportion to what they would give it unshadowed.

For receiver x and sender i the unshadowed term is p_i min(q_i <n_x.w> / r^2, b_i), with the sender's pattern q. A
receiver sums the terms in blocks of 32 and parts of 8, places its picks evenly over the total with one random shift
(systematic sampling), finds the point that each falls on, and sends it a shadow ray. A pick stands for total / picks,
so what remains random is visibility and colour. Sums and comparisons run in float32, everywhere in one order.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.lobes import lobe_gap, lobe_power
from refgi.rays import far_offset, ray_offset
from refgi.sampling import hash_bits
from refgi.shadowed import Receivers
from refgi.truth.lit_points import BLOCK, LitPoints

Array = npt.NDArray[Any]

TILE = 256  # receivers that one parallel iteration owns: the SIMD lanes
PART = 8  # senders whose terms a pick may have to compute again
PARTS = BLOCK // PART
TINY = np.float32(1e-30)  # m^2; smaller squared distances count as this one, so that no 0 / 0 arises


@kernel
def _diffuse(dx: Any, dy: Any, dz: Any, nx: Any, ny: Any, nz: Any, mx: Any, my: Any, mz: Any, bound: Any) -> Any:
    """Return min(G, b) for d = y - x, receiver normal n and sender normal m; free of branches."""
    zero = np.float32(0)
    r2 = dx * dx + dy * dy + dz * dz
    inverse = np.float32(1) / (r2 if r2 > TINY else TINY)
    cos_x = nx * dx + ny * dy + nz * dz
    cos_y = -(mx * dx + my * dy + mz * dz)
    geometry = ((cos_x if cos_x > zero else zero) * inverse) * ((cos_y if cos_y > zero else zero) * inverse)
    return geometry if geometry < bound else bound


@kernel
def _glossy(points: LitPoints, j: int, dx: Any, dy: Any, dz: Any, nx: Any, ny: Any, nz: Any) -> Any:
    """Return min(q <n.w> / r^2, b) for a sender with or without a lobe."""
    zero = np.float32(0)
    r2 = max(dx * dx + dy * dy + dz * dz, TINY)
    cos_x = nx * dx + ny * dy + nz * dz
    above = -(points.normal[0, j] * dx + points.normal[1, j] * dy + points.normal[2, j] * dz)
    if above <= zero or cos_x <= zero:
        return zero
    r = np.sqrt(r2)
    if points.exponent[j] == np.float32(1):
        along = -(points.axis[0, j] * dx + points.axis[1, j] * dy + points.axis[2, j] * dz)
        power = (along if along > zero else zero) / r
    else:
        power = lobe_power(lobe_gap(points.axis[0, j], points.axis[1, j], points.axis[2, j], -dx, -dy, -dz),
                           points.exponent[j])
    pattern = points.peak[j] * power
    return min(pattern * (cos_x / r) / r2, points.bound[j])


@kernel
def _sum_parts(points: LitPoints, tile: Array, glossy: bool, parts: Array) -> None:
    """Fill the sums of the terms of each part of the senders at each receiver of a tile, two senders at a time."""
    for p in range(parts.shape[0]):
        for j in range(p * PART, p * PART + PART, 2):
            px, py, pz = points.position[0, j], points.position[1, j], points.position[2, j]
            qx, qy, qz = points.position[0, j + 1], points.position[1, j + 1], points.position[2, j + 1]
            power, power_q = points.power[j], points.power[j + 1]
            if glossy:
                for i in range(TILE):
                    x, y, z, nx, ny, nz = tile[0, i], tile[1, i], tile[2, i], tile[3, i], tile[4, i], tile[5, i]
                    one = power * _glossy(points, j, px - x, py - y, pz - z, nx, ny, nz)
                    two = power_q * _glossy(points, j + 1, qx - x, qy - y, qz - z, nx, ny, nz)
                    parts[p, i] = (parts[p, i] + one) + two
                continue
            bound, bound_q = points.bound[j], points.bound[j + 1]
            kx, ky, kz = points.axis[0, j], points.axis[1, j], points.axis[2, j]
            lx, ly, lz = points.axis[0, j + 1], points.axis[1, j + 1], points.axis[2, j + 1]
            for i in range(TILE):
                x, y, z, nx, ny, nz = tile[0, i], tile[1, i], tile[2, i], tile[3, i], tile[4, i], tile[5, i]
                one = power * _diffuse(px - x, py - y, pz - z, nx, ny, nz, kx, ky, kz, bound)
                two = power_q * _diffuse(qx - x, qy - y, qz - z, nx, ny, nz, lx, ly, lz, bound_q)
                parts[p, i] = (parts[p, i] + one) + two


@kernel
def _term(points: LitPoints, j: int, tile: Array, i: int, glossy: bool) -> Any:
    """Return the term of one sender at one receiver, bit for bit that which was summed."""
    dx, dy = points.position[0, j] - tile[0, i], points.position[1, j] - tile[1, i]
    dz = points.position[2, j] - tile[2, i]
    nx, ny, nz = tile[3, i], tile[4, i], tile[5, i]
    if glossy:
        return points.power[j] * _glossy(points, j, dx, dy, dz, nx, ny, nz)
    return points.power[j] * _diffuse(dx, dy, dz, nx, ny, nz, points.axis[0, j], points.axis[1, j], points.axis[2, j],
                                      points.bound[j])


@kernel
def _aim(points: LitPoints, j: int, to: Receivers, r: int, grain: Any, origins: Array, directions: Array,
         ray: int) -> Any:
    """Write the shadow segment to a picked point and return its reach: 1, or 0 where a face is seen from behind."""
    real = np.float32
    from_x, from_y = real(0), real(0)
    x, y, z = points.position[0, j], points.position[1, j], points.position[2, j]
    offset = ray_offset(x, y, z, grain)
    offset += far_offset(x - to.position[0, r], y - to.position[1, r], z - to.position[2, r])
    for c in range(3):
        origins[ray, c] = to.origin[c, r]
        directions[ray, c] = points.position[c, j] + offset * points.facing[c, j] - to.origin[c, r]
        toward = points.position[c, j] - to.position[c, r]
        from_x += to.facing[c, r] * toward
        from_y -= points.facing[c, j] * toward
    return real(1) if from_x > real(0) and from_y > real(0) else real(0)


@kernel(parallel=True)
def pick(points: LitPoints, to: Receivers, span: tuple[int, int], picks: int, seed: int, glossy: bool, grain: Any,
         rays: tuple[Array, Array, Array, Array]) -> None:
    """Let each receiver of a span pick lit points, and write the shadow rays and what they are worth.

    Parameters
    ----------
    points : LitPoints
        Senders, whole blocks.
    to : Receivers
        Receivers.
    span : tuple of 2 ints
        First receiver and one past the last.
    picks : int
        Picks of each receiver.
    seed : int
        Random shift: a hash of it and the receiver's pixel.
    glossy : bool
        Whether any sender has a lobe.
    grain : float32
        The tracer's: segments end above the sender's face by `ray_offset` and `far_offset`, m.
    rays : tuple of 4 arrays
        Filled: origins, directions (n, 3), reach (n,), worth (n, 3) W/m^2; n = picks x receivers, float32.
    """
    first, last = span
    for number in prange((last - first + TILE - 1) // TILE):
        low = first + number * TILE
        count = min(TILE, last - low)
        tile = np.zeros((6, TILE), np.float32)  # positions and normals; lanes beyond the count receive nothing
        for c in range(3):
            tile[c, :count] = to.position[c, low : low + count]
            tile[3 + c, :count] = to.normal[c, low : low + count]
        parts = np.zeros((len(points.power) // PART, TILE), np.float32)
        _sum_parts(points, tile, glossy, parts)
        blocks = np.zeros((len(points.power) // BLOCK, TILE), np.float32)
        for p in range(parts.shape[0]):
            for i in range(TILE):
                blocks[p * PART // BLOCK, i] += parts[p, i]
        _pick_all(points, to, low, count, tile, (picks, seed, glossy, grain), (blocks, parts), first, rays)


@kernel
def _pick_all(points: LitPoints, to: Receivers, low: int, count: int, tile: Array, how: tuple[int, int, bool, Any],
              sums: tuple[Array, Array], first: int, rays: tuple[Array, Array, Array, Array]) -> None:
    """Let receivers pick: walk the blocks, the parts of the block a pick falls in, the terms of that part."""
    origins, directions, reach, worth = rays
    picks, seed, glossy, grain = how
    blocks, parts = sums
    real = np.float32
    for i in range(count):
        total = real(0)
        for b in range(blocks.shape[0]):
            total += blocks[b, i]
        shift = real(hash_bits(np.uint32(to.pixel[low + i]) ^ np.uint32(seed)) >> np.uint32(8)) * real(2.0**-24)
        share = total / real(picks)
        b, before = 0, real(0)  # block, and the sum of those before it
        for s in range(picks):
            ray = (low + i - first) * picks + s
            reach[ray] = real(0)
            target = (real(s) + shift) * share
            while b < blocks.shape[0] - 1 and before + blocks[b, i] <= target:
                before += blocks[b, i]
                b += 1
            rest = target - before
            p, end = b * PARTS, b * PARTS + PARTS - 1
            while p < end and parts[p, i] <= rest:
                rest -= parts[p, i]
                p += 1
            j, end = p * PART, p * PART + PART - 1
            term = _term(points, j, tile, i, glossy)
            while j < end and term <= rest:
                rest -= term
                j += 1
                term = _term(points, j, tile, i, glossy)
            if term > real(0):
                reach[ray] = _aim(points, j, to, low + i, grain, origins, directions, ray)
                for c in range(3):
                    worth[ray, c] = share * points.colour[c, j]
