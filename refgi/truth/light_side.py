"""The light side: each receiver picks lit points in proportion to what they would give it unshadowed.

For receiver x and sender i the unshadowed term is p_i min(q_i <n_x.w> / r^2, b_i), with the sender's pattern q. A
receiver sums the terms in blocks of 32, places its picks evenly over the total with one random shift (systematic
sampling), finds the point that each falls on, and sends it a shadow ray. A pick stands for total / picks, so what
remains random is visibility and colour. Sums, prefix sums and comparisons run in float32 in one order everywhere.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.sampling import hash_bits
from refgi.truth.lit_points import BLOCK, LitPoints
from refgi.truth.surfaces import Receivers

Array = npt.NDArray[Any]

TILE = 256  # receivers that one parallel iteration owns: the SIMD lanes
TINY = np.float32(1e-18)  # m^2; smaller squared distances count as this one, so that no 0 / 0 arises


@kernel
def _term(points: LitPoints, j: int, dx: Any, dy: Any, dz: Any, cos_x: Any) -> Any:
    """Return the bounded term of a glossy or diffuse sender; d = y - x, cos_x = <n_x.d> not normalised."""
    real = np.float32
    r2 = max(dx * dx + dy * dy + dz * dz, TINY)
    along = -(points.axis[0, j] * dx + points.axis[1, j] * dy + points.axis[2, j] * dz)
    above = -(points.normal[0, j] * dx + points.normal[1, j] * dy + points.normal[2, j] * dz)
    if along <= real(0) or above <= real(0) or cos_x <= real(0):
        return real(0)
    r = np.sqrt(r2)
    pattern = points.peak[j] * real((along / r) ** points.exponent[j])
    return points.power[j] * min(pattern * cos_x / (r * r2), points.bound[j])


@kernel
def _add_glossy(sums: Array, b: int, points: LitPoints, to: Receivers, low: int, count: int) -> None:
    for j in range(b * BLOCK, b * BLOCK + BLOCK):
        for i in range(count):
            dx = points.position[0, j] - to.position[0, low + i]
            dy = points.position[1, j] - to.position[1, low + i]
            dz = points.position[2, j] - to.position[2, low + i]
            cos_x = to.normal[0, low + i] * dx + to.normal[1, low + i] * dy + to.normal[2, low + i] * dz
            sums[b, i] += _term(points, j, dx, dy, dz, cos_x)


@kernel
def _add_diffuse(sums: Array, b: int, points: LitPoints, to: Receivers, low: int, count: int) -> None:
    """Add one block of senders without lobes: the same terms, free of branches and powers."""
    zero = np.float32(0)
    for j in range(b * BLOCK, b * BLOCK + BLOCK):
        px, py, pz = points.position[0, j], points.position[1, j], points.position[2, j]
        nx, ny, nz = points.axis[0, j], points.axis[1, j], points.axis[2, j]
        power, bound = points.power[j], points.bound[j]
        for i in range(count):
            dx, dy, dz = px - to.position[0, low + i], py - to.position[1, low + i], pz - to.position[2, low + i]
            r2 = dx * dx + dy * dy + dz * dz
            r2 = r2 if r2 > TINY else TINY
            cos_x = to.normal[0, low + i] * dx + to.normal[1, low + i] * dy + to.normal[2, low + i] * dz
            cos_y = -(nx * dx + ny * dy + nz * dz)
            cos_x = cos_x if cos_x > zero else zero
            cos_y = cos_y if cos_y > zero else zero
            geometry = cos_x * cos_y / (r2 * r2)
            sums[b, i] += power * (geometry if geometry < bound else bound)


@kernel
def _terms_of_block(terms: Array, b: int, points: LitPoints, to: Receivers, r: int, glossy: bool) -> None:
    """Fill the terms of one block for one receiver, bit for bit those that were summed."""
    zero = np.float32(0)
    for k in range(BLOCK):
        j = b * BLOCK + k
        dx, dy, dz = (points.position[0, j] - to.position[0, r], points.position[1, j] - to.position[1, r],
                      points.position[2, j] - to.position[2, r])
        cos_x = to.normal[0, r] * dx + to.normal[1, r] * dy + to.normal[2, r] * dz
        if glossy:
            terms[k] = _term(points, j, dx, dy, dz, cos_x)
        else:
            r2 = dx * dx + dy * dy + dz * dz
            r2 = r2 if r2 > TINY else TINY
            cos_y = -(points.axis[0, j] * dx + points.axis[1, j] * dy + points.axis[2, j] * dz)
            cos_x = cos_x if cos_x > zero else zero
            cos_y = cos_y if cos_y > zero else zero
            geometry = cos_x * cos_y / (r2 * r2)
            bound = points.bound[j]
            terms[k] = points.power[j] * (geometry if geometry < bound else bound)


@kernel
def _aim(points: LitPoints, j: int, to: Receivers, r: int, offset: Any, origin: Array, direction: Array) -> Any:
    """Write the shadow segment to a picked point and return its reach: 1, or 0 where a face is seen from behind."""
    real = np.float32
    from_x, from_y = real(0), real(0)
    for c in range(3):
        origin[c] = to.origin[c, r]
        direction[c] = points.position[c, j] + offset * points.facing[c, j] - to.origin[c, r]
        toward = points.position[c, j] - to.position[c, r]
        from_x += to.facing[c, r] * toward
        from_y -= points.facing[c, j] * toward
    return real(1) if from_x > real(0) and from_y > real(0) else real(0)


@kernel(parallel=True)
def pick(points: LitPoints, to: Receivers, span: tuple[int, int], picks: int, seed: int, glossy: bool, offset: Any,
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
    offset : float32
        How far segments end above the sender's face, m.
    rays : tuple of 4 arrays
        Filled: origins, directions (n, 3), reach (n,), worth (n, 3) W/m^2; n = picks x receivers, float32.
    """
    origins, directions, reach, worth = rays
    first, last = span
    blocks = len(points.power) // BLOCK
    real = np.float32
    for tile in prange((last - first + TILE - 1) // TILE):
        low = first + tile * TILE
        count = min(TILE, last - low)
        sums = np.zeros((blocks, TILE), np.float32)
        terms = np.empty(BLOCK, np.float32)
        for b in range(blocks):
            if glossy:
                _add_glossy(sums, b, points, to, low, count)
            else:
                _add_diffuse(sums, b, points, to, low, count)
        for i in range(count):
            r = low + i
            total = real(0)
            for b in range(blocks):
                total += sums[b, i]
            shift = real(hash_bits(np.uint32(to.pixel[r]) ^ np.uint32(seed)) >> np.uint32(8)) * real(2.0**-24)
            share = total / real(picks)
            b, opened = 0, -1
            before, inside, k = real(0), real(0), 0  # sums before block b, and within it before term k
            for s in range(picks):
                ray = (r - first) * picks + s
                reach[ray] = real(0)
                target = (real(s) + shift) * share
                while b < blocks - 1 and before + sums[b, i] <= target:
                    before += sums[b, i]
                    b += 1
                if sums[b, i] == real(0):
                    continue
                if opened != b:
                    _terms_of_block(terms, b, points, to, r, glossy)
                    opened, inside, k = b, real(0), 0
                while k < BLOCK - 1 and before + (inside + terms[k]) <= target:
                    inside += terms[k]
                    k += 1
                if terms[k] > real(0):
                    j = b * BLOCK + k
                    reach[ray] = _aim(points, j, to, r, offset, origins[ray], directions[ray])
                    for c in range(3):
                        worth[ray, c] = share * points.colour[c, j]


@kernel(parallel=True)
def add_free(sums: Array, first: int, receivers: int, per_receiver: int, blocked: Array, worth: Array) -> None:
    """Add to each receiver what its unblocked rays are worth, in their order.

    Parameters
    ----------
    sums : (3, r) float64 ndarray
        Added to.
    first : int
        Receiver of the first ray.
    receivers : int
        How many receivers the rays belong to.
    per_receiver : int
        Rays of each.
    blocked : (n,) bool ndarray
        Which rays are blocked.
    worth : (n, 3) float32 ndarray
        What each is worth, W/m^2.
    """
    for r in prange(receivers):
        for ray in range(r * per_receiver, (r + 1) * per_receiver):
            if not blocked[ray]:
                for c in range(3):
                    sums[c, first + r] += worth[ray, c]
