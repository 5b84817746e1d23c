"""Lobes of senders, from the light's side: each receiver picks cells of light and sends a fresh ray into each.

A receiver walks down the quadtree of `refgi.truth.lobe_cells` by what each cell may send it, and the ray of a pick
lands anywhere in its cell; a share of the picks is even over all directions. With p the probability of a cell and W its
measure, k picks put

    n_b = k ((1 - e) p / W + e / (lights W_light))

rays on a unit of the light's measure, and N cosine-distributed directions of the receiver put n_a = N <n_x.w> <g.w> d^2 /
(pi r^2 <g.l>) there. Both add the lobe's term over n_a + n_b (the balance heuristic of multiple importance sampling):
no single contribution is more than what either alone would give.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.pairs.shadow_rays import RayReceivers
from refgi.radiometry import DIRECTIONAL, radiant_intensity
from refgi.rays import MISS, far_offset, ray_offset
from refgi.sampling import hash_bits
from refgi.scene import LightTable
from refgi.truth.light_square import place_of, ray_through
from refgi.truth.lobe_cells import DEEPEST, LobeCells
from refgi.truth.paths import Shadows, dot, row
from refgi.truth.surfaces import Surfaces, face_normal, height_above, lobe_pattern, shading_normal

Array = npt.NDArray[Any]

CHUNK = 64  # receivers that one parallel iteration owns
LEAST = np.float32(1e-30)  # m^2, against 0 / 0
EVEN = 1 / 16  # share of the picks that are even over a light's directions


class CellRays(NamedTuple):
    """Rays from lights into picked cells, k for each receiver."""

    origin: Array  # (n, 3) float32, m
    direction: Array  # (n, 3) float32
    reach: Array  # (n,) float32; 0: no pick
    triangle_id: Array  # (n,) int32
    distance: Array  # (n,) float32
    light: Array  # (n,) int32
    density: Array  # (n,) float64: n_b


class Path(NamedTuple):
    """The way down to a pick, level by level."""

    node: Array
    chance: Array
    share: Array  # (levels, 4) of each child
    edge: Array  # (levels, 5): where each child begins and ends among places; the last below 0 until they are known


def cell_rays(count: int) -> CellRays:
    """Allocate a batch."""
    return CellRays(np.empty((count, 3), np.float32), np.empty((count, 3), np.float32), np.empty(count, np.float32),
                    np.empty(count, np.int32), np.empty(count, np.float32), np.empty(count, np.int32), np.empty(count))


@kernel
def _expected(cell: Any, x: Any, n: Any) -> Any:
    """Return about what a cell sends a receiver without visibility: flux, cosine, lobe and distance, each widened.

    `cell`: a row of `LobeCells`. `x`, `n`: place and normal. All float32; free of branches.
    """
    cx, cy, cz, radius, ax, ay, az, spread, flux, gx, gy, gz, thick, tilt = cell
    zero, one, quarter = np.float32(0), np.float32(1), np.float32(0.25)
    dx, dy, dz = cx - x[0], cy - x[1], cz - x[2]
    size, square = radius * radius + LEAST, dx * dx + dy * dy + dz * dz + LEAST
    inverse = one / np.sqrt(square)
    along, height = n[0] * gx + n[1] * gy + n[2] * gz, n[0] * dx + n[1] * dy + n[2] * dz
    # the highest point of the cell above the receiver's horizon, and the receiver above the cell's
    across = one - along * along
    cosine = (height + radius * np.sqrt(across if across > zero else zero) + thick * abs(along)) * inverse
    above = thick + tilt * (radius + square * inverse) - (gx * dx + gy * dy + gz * dz)
    cosine = cosine if cosine < one else one
    cosine = cosine if (cosine > zero) & (above > zero) else zero
    gap = one + (ax * dx + ay * dy + az * dz) * inverse
    width = spread + size / square
    fall = one / (one + quarter * (gap if gap > zero else zero) / width)
    fall *= fall
    return flux * cosine * (fall * fall) / (width * (square if square > size else size))


@kernel
def _of_node(cells: LobeCells, node: int, x: Any, n: Any) -> Any:
    r = cells.row
    return _expected((r[node, 0], r[node, 1], r[node, 2], r[node, 3], r[node, 4], r[node, 5], r[node, 6], r[node, 7],
                      r[node, 8], r[node, 9], r[node, 10], r[node, 11], r[node, 12], r[node, 13]), x, n)


@kernel
def _fill_tops(cells: LobeCells, x: Any, n: Any, found: Array) -> float:
    """Fill what each top cell sends, in SIMD lanes; return the sum, in their order."""
    c = cells.columns
    for t in range(len(found)):
        found[t] = _expected((c[0, t], c[1, t], c[2, t], c[3, t], c[4, t], c[5, t], c[6, t], c[7, t], c[8, t], c[9, t],
                              c[10, t], c[11, t], c[12, t], c[13, t]), x, n)
    total = 0.0
    for t in range(len(found)):
        total += found[t]
    return total


@kernel(parallel=True)
def fill_totals(cells: LobeCells, receivers: RayReceivers, totals: Array) -> None:
    """Fill what all cells send each receiver, (r,) float64: the same in every pass."""
    for chunk in prange((len(totals) + CHUNK - 1) // CHUNK):
        found = np.empty(len(cells.top), np.float32)
        for r in range(chunk * CHUNK, min(len(totals), chunk * CHUNK + CHUNK)):
            totals[r] = _fill_tops(cells, _column(receivers.position, r), _column(receivers.normal, r), found)


@kernel
def density_at(cells: LobeCells, k: int, y: tuple[float, float, float], receivers: RayReceivers, r: int, total: float,
               picks: int) -> float:
    """Return n_b at a point y that light k reaches, for receiver r, `total` of `fill_totals`."""
    a, b = place_of(cells.squares, k, y)
    return _density(cells, k, a, b, _column(receivers.position, r), _column(receivers.normal, r), total,
                    picks) if a >= 0 else 0.0


@kernel
def _density(cells: LobeCells, k: int, a: float, b: float, x: Any, n: Any, total: float, picks: int) -> float:
    node, chance = k, 1.0
    while True:
        if cells.is_top[node]:
            chance = _of_node(cells, node, x, n) / total if total > 0 else 0.0
        if cells.child[node] < 0 or chance <= 0:
            return _shared_density(cells, k, node, chance, picks)
        above, first, a, b = node, cells.child[node], 2 * a, 2 * b
        node = first + 2 * int(a) + int(b)
        a, b = a - int(a), b - int(b)
        if chance < 1.0 or cells.is_top[above]:
            whole = 0.0
            for sibling in range(4):
                whole += _of_node(cells, first + sibling, x, n)
            chance = chance * (_of_node(cells, node, x, n) / whole) if whole > 0 else 0.0


@kernel
def _shared_density(cells: LobeCells, k: int, leaf: int, chance: float, picks: int) -> float:
    """Return n_b in a leaf that is picked with a probability of `chance`."""
    level = (1 - EVEN) * chance * 4.0 ** cells.corner[leaf, 2] + EVEN / len(cells.squares.kind)
    return picks * level / cells.squares.measure[k]


@kernel(parallel=True)
def pick_cells(cells: LobeCells, receivers: RayReceivers, span: tuple[int, int], sampling: tuple[int, int, float],
               rays: CellRays) -> None:
    """Fill the rays of a span's receivers, each one's picks evenly spaced over what its cells send.

    `span`: first receiver and one past the last. `sampling`: picks of each; seed of a hash with the receiver's pixel;
    the tracer's grain, m.
    """
    count = span[1] - span[0]
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        _pick_chunk(cells, receivers, span[0], (chunk * CHUNK, min(count, chunk * CHUNK + CHUNK)), sampling, rays)


@kernel
def _pick_chunk(cells: LobeCells, receivers: RayReceivers, first: int, part: tuple[int, int],
                sampling: tuple[int, int, float], rays: CellRays) -> None:
    depth = DEEPEST + 2
    path = Path(np.empty(depth, np.int64), np.empty(depth), np.empty((depth, 4)), np.empty((depth, 5)))
    picks, found, lights = sampling[0], np.empty(len(cells.top), np.float32), len(cells.squares.kind)
    for i in range(part[0], part[1]):
        x, n = _column(receivers.position, first + i), _column(receivers.normal, first + i)
        word = hash_bits(np.uint32(receivers.pixel[first + i]) ^ np.uint32(sampling[1]))
        shift, s, total = _uniform(word ^ np.uint32(0x1B56C4E9)), 0, _fill_tops(cells, x, n, found)
        while s < picks and (s + shift) < EVEN * picks:
            u, v = _place(word, s)
            k = min(lights - 1, int((s + shift) / (EVEN * picks) * lights))
            rays.density[i * picks + s] = _density(cells, k, u, v, x, n, total, picks)
            _send(cells, k, u, v, sampling[2], i * picks + s, rays)
            s += 1
        for ray in range(i * picks + s, i * picks + picks):
            rays.reach[ray] = 0
        if total > 0:
            _walk(cells, x, n, (found, total), (word, shift, s), sampling, i * picks, path, rays)


@kernel
def _walk(cells: LobeCells, x: Any, n: Any, tops: tuple[Array, float], start: tuple[Any, float, int],
          sampling: tuple[int, int, float], first: int, path: Path, rays: CellRays) -> None:
    """Find the leaf of every pick in turn: places rise, and neighbours share most of the way."""
    (found, total), (word, shift, s), picks = tops, start, sampling[0]
    top, level, end = -1, 0, 0.0
    for pick in range(s, picks):
        place = ((pick + shift) / picks - EVEN) / (1 - EVEN) * total
        while top < 0 or (place >= end and top < len(found) - 1):
            top += 1
            path.edge[0, 0], level, end = end, 0, end + found[top]
            path.node[0], path.chance[0], path.edge[0, 4] = cells.top[top], found[top] / total, -1.0
        while level > 0 and place >= path.edge[level - 1, path.node[level] - cells.child[path.node[level - 1]] + 1]:
            level -= 1
        while cells.child[path.node[level]] >= 0 and path.chance[level] > 0:
            level = _down(cells, x, n, level, place, total, path)
        if path.chance[level] > 0:
            leaf, (u, v) = path.node[level], _place(word, pick)
            side = 2.0 ** -cells.corner[leaf, 2]
            rays.density[first + pick] = _shared_density(cells, cells.light[top], leaf, path.chance[level], picks)
            _send(cells, cells.light[top], (cells.corner[leaf, 0] + u) * side, (cells.corner[leaf, 1] + v) * side,
                  sampling[2], first + pick, rays)


@kernel
def _down(cells: LobeCells, x: Any, n: Any, level: int, place: float, total: float, path: Path) -> int:
    """Go on to the child that holds a place; return its level."""
    if path.edge[level, 4] < 0:
        first, whole = cells.child[path.node[level]], 0.0
        for c in range(4):
            path.share[level, c] = _of_node(cells, first + c, x, n)
            whole += path.share[level, c]
        for c in range(4):
            path.share[level, c] = path.share[level, c] / whole if whole > 0 else 0.0
            path.edge[level, c + 1] = path.edge[level, c] + total * path.chance[level] * path.share[level, c]
    c = 0
    while c < 3 and place >= path.edge[level, c + 1]:
        c += 1
    while c > 0 and path.share[level, c] <= 0:
        c -= 1  # rounding at the end: the last that may be picked
    path.node[level + 1], path.edge[level + 1, 4] = cells.child[path.node[level]] + c, -1.0
    path.chance[level + 1], path.edge[level + 1, 0] = path.chance[level] * path.share[level, c], path.edge[level, c]
    return level + 1


@kernel
def _send(cells: LobeCells, k: int, a: float, b: float, grain: float, ray: int, rays: CellRays) -> None:
    """Write the ray of light k through a point of its square, just beyond the lamp: that may lie in a surface."""
    o, d = ray_through(cells.squares, k, a, b)
    beyond = ray_offset(o[0], o[1], o[2], grain)
    for c in range(3):
        rays.origin[ray, c], rays.direction[ray, c] = o[c] + beyond * d[c], d[c]
    rays.light[ray], rays.reach[ray] = k, np.inf


@kernel
def _place(word: Any, pick: int) -> tuple[float, float]:
    word = hash_bits(word + np.uint32(pick))
    return _uniform(word ^ np.uint32(0x68E31DA4)), _uniform(word ^ np.uint32(0xB5297A4D))


@kernel
def _uniform(word: Any) -> Any:
    return (hash_bits(word) + 0.5) * 2.0**-32


@kernel
def _column(rows: Array, i: int) -> tuple[Any, Any, Any]:
    return rows[0, i], rows[1, i], rows[2, i]


@kernel
def point_of(rows: Array, i: int) -> tuple[float, float, float]:
    """Return column i of (3, n) as float64 scalars."""
    return np.float64(rows[0, i]), np.float64(rows[1, i]), np.float64(rows[2, i])


@kernel(parallel=True)
def connect_lobes(surfaces: Surfaces, lights: LightTable, receivers: RayReceivers, first: int, counts: tuple[int, int],
                  grain: float, rays: CellRays, shadows: Shadows) -> None:
    """Write the shadow ray from where each ray landed to its receiver, and what the lobe there sends it.

    `first`: receiver of the first ray. `counts`: picks of each receiver, and its cosine-distributed directions. `grain`:
    the tracer's, m. `shadows`: origins, directions, reach and contribution are filled; reach 0 where nothing arrives.
    """
    count = len(rays.reach)
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        for ray in range(chunk * CHUNK, min(count, chunk * CHUNK + CHUNK)):
            _connect(surfaces, lights, receivers, first + ray // counts[0], counts[1], grain, rays, shadows, ray)


@kernel
def _connect(surfaces: Surfaces, lights: LightTable, receivers: RayReceivers, r: int, directions: int, grain: float,
             rays: CellRays, shadows: Shadows, ray: int) -> None:
    shadows.reach[ray] = 0
    triangle = rays.triangle_id[ray]
    if rays.reach[ray] == 0 or triangle == MISS:
        return
    material, k = surfaces.material_of_face[triangle], rays.light[ray]
    glossy = row(surfaces.specular, material)
    if max(glossy[0], glossy[1], glossy[2]) <= 0:
        return
    t, o, d = np.float64(rays.distance[ray]), row(rays.origin, ray), row(rays.direction, ray)
    y = (o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2])
    g = face_normal(surfaces, triangle, d[0], d[1], d[2])
    height = height_above(surfaces, triangle, y, g)
    y = (y[0] - height * g[0], y[1] - height * g[1], y[2] - height * g[2])
    x, n_x = point_of(receivers.position, r), point_of(receivers.normal, r)
    way = (x[0] - y[0], x[1] - y[1], x[2] - y[2])
    square = dot(way, way)
    if square <= 0 or dot(g, way) <= 0 or dot(point_of(receivers.facing, r), way) >= 0 or dot(n_x, way) >= 0:
        return
    w = (way[0] / math.sqrt(square), way[1] / math.sqrt(square), way[2] / math.sqrt(square))
    pattern = lobe_pattern(surfaces, material, shading_normal(surfaces, triangle, y, g), (-d[0], -d[1], -d[2]), w)
    if lights.kind[k] == DIRECTIONAL:
        power, apart = (lights.intensity[k, 0], lights.intensity[k, 1], lights.intensity[k, 2]), 1.0
    else:
        power = radiant_intensity(lights, k, d[0], d[1], d[2])
        apart = (y[0] - lights.position[k, 0]) ** 2 + (y[1] - lights.position[k, 1]) ** 2
        apart += (y[2] - lights.position[k, 2]) ** 2
    # rho I pattern cos / (pi r^2) over n_a + n_b, both times r^2
    near = directions_density(directions, -dot(n_x, w), dot(g, w), apart, -dot(g, d))
    factor = pattern * -dot(n_x, w) / (np.pi * (near + rays.density[ray] * square))
    most = 0.0
    for c in range(3):
        shadows.contribution[ray, c] = glossy[c] * power[c] * factor
        most = max(most, shadows.contribution[ray, c])
    if most > 0:
        offset = ray_offset(y[0], y[1], y[2], grain) + far_offset(way[0], way[1], way[2])
        for c in range(3):
            shadows.origin[ray, c] = receivers.origin[c, r]
            shadows.direction[ray, c] = y[c] + offset * g[c] - receivers.origin[c, r]
        shadows.reach[ray] = 1


@kernel
def directions_density(directions: float, cos_x: float, cos_out: float, square: float, cos_in: float) -> float:
    """Return n_a r^2 of cosine-distributed directions: how many fall on a unit of the light's measure, times r^2.

    `cos_out`, `cos_in`: face normal to the receiver and to the light. `square`: d^2, m^2; 1 for a directional light.
    """
    return directions * cos_x * cos_out * square / (np.pi * max(cos_in, 1e-30))
