"""Lobes of senders: rays into cells of light, directions to mirror images of lights, and their share beside the rest.

The directions of hemisphere sampling rarely meet a lobe, and by then it is bright. So each receiver picks cells of
light besides (`refgi.truth.cell_walk`), and

- b: sends a fresh ray of the light through a random place of a cell, and connects what it finds, or
- c: sends a direction around the image of the light in the plane mirror that the cell is, and connects what it finds in
  this very cell to the light. The image's lobe is P (1 + r/d)^2 sharp: what x sees of a lobe turns with x and y both.

With r and d the distances from the point y to the receiver and to the light, g the face normal at y, p the chance of a
cell and W its measure, N directions (a), k_b and k_c picks put

    n_a = N <n_x.w> / pi F,   n_b = k_b ((1 - e) p_b / W + e / (lights W_light)),   n_c = k_c p_c D(w) F,

F = <g.-w> d^2 / (r^2 <g.l>), rays on a unit of the light's measure, and each adds the lobe's term over n_a + n_b + n_c
(the balance heuristic of multiple importance sampling). So no contribution is larger than what the best of them would
give: near a flat mirror n_c follows the lobe itself, however sharp it is.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.lobes import lobe_direction, lobe_gap, lobe_power
from refgi.pairs.shadow_rays import RayReceivers
from refgi.radiometry import DIRECTIONAL, incident_light, radiant_intensity
from refgi.rays import MISS, far_offset, ray_offset
from refgi.sampling import hash_bits
from refgi.scene import LightTable
from refgi.truth.cell_walk import (
    CHUNK,
    Found,
    Path,
    cell_at,
    column,
    fill_tops,
    found_at,
    found_up,
    go_down,
    next_top,
    on_face,
    plane_chance,
)
from refgi.truth.light_square import ray_through
from refgi.truth.lobe_cells import LobeCells
from refgi.truth.lobe_tree import LobeTree
from refgi.truth.next_event import aim_at_light, toward_light
from refgi.truth.paths import Paths, Shadows, dot, hit_point, paths_for, row
from refgi.truth.surfaces import (
    Surfaces,
    around,
    face_normal,
    height_above,
    lift,
    lobe_pattern,
    shading_normal,
)

Array = npt.NDArray[Any]

DEEPEST_GROUP = 128  # levels of the tree that a way down may have
EVEN = 1 / 16  # e: share of the rays of b that are even over the lights' directions


class Counts(NamedTuple):
    """Samples of each receiver in a pass."""

    directions: int  # N
    cells: int  # k_b
    mirrors: int  # k_c


class Beside(NamedTuple):
    """What the densities of a point depend on."""

    cells: LobeCells
    receivers: RayReceivers
    counts: Counts
    first: int  # receiver of the first ray
    hide: bool  # as in `refgi.truth.paths.Sides`


class Tops(NamedTuple):
    """What the top groups send one receiver."""

    receiver: Array  # (1,) int64: which; -1: none yet
    found: Array  # (t,) float32
    sums: Array  # (t + 1,) float64: of those before


class Picks(NamedTuple):
    """Rays of b from lights, or of c from receivers, with the cells that they were picked by."""

    paths: Paths
    light: Array  # (n,) int32
    cell: Array  # (n,) int32: of b
    density: Array  # (n,) float64: n_b
    mirror: Array  # (n,) int32
    mirror_chance: Array  # (n,) float64


def picks_for(count: int) -> Picks:
    """Allocate a batch."""
    light, cell, mirror = (np.empty(count, np.int32) for _ in range(3))
    return Picks(paths_for(count), light, cell, np.empty(count), mirror, np.empty(count))


@kernel
def near_density(directions: float, cos_x: float, image: float, sender: tuple[float, float, float]) -> Any:
    """Return (n_a + n_c) r^2; `image`: k_c p_c D. `sender`: <g.-w>, d^2 (1 for a directional light), <g.l>."""
    return (directions * cos_x / np.pi + image) * abs(sender[0]) * sender[1] / max(sender[2], 1e-30)


@kernel
def rays_beside(beside: Beside, k: int, found: Found, r: int, way: tuple[tuple[float, float, float], float, float],
                sender: tuple[float, float, float]) -> Any:
    """Return (n_a + n_b + n_c) r^2 at a point of cells `found`; `way`: unit vector to it, its cosine, its length."""
    w, cosine, length = way
    image = 0.0
    if found.mirror >= 0 and beside.counts.mirrors > 0:
        image = beside.counts.mirrors * found.mirror_chance * image_density(beside, k, found.mirror, r, w)
    far = even_density(beside.cells, k, found.cell, found.chance, beside.counts.cells)
    return near_density(beside.counts.directions, cosine, image, sender) + far * length * length


@kernel
def even_density(cells: LobeCells, k: int, leaf: int, chance: float, picks: int) -> Any:
    """Return n_b in a leaf that is picked with a probability of `chance`."""
    share = (1 - EVEN) * chance * 4.0 ** cells.corner[leaf, 2] + EVEN / len(cells.squares.kind)
    return picks * share / cells.squares.measure[k]


@kernel
def image_of(cells: LobeCells, k: int, mirror: Any, x: tuple[float, float, float]) -> Any:
    """Return unit vector from x to the image of light k in a cell's mirror, and exponent + 1 of its lobe; 0: none."""
    m, squares = cells.tree.mirror, cells.squares
    n = (m[mirror, 3], m[mirror, 4], m[mirror, 5])
    if squares.kind[k] == DIRECTIONAL:
        d = row(squares.frame[k], 2)
        twice = 2 * dot(n, d)
        return (twice * n[0] - d[0], twice * n[1] - d[1], twice * n[2] - d[2]), m[mirror, 6] if twice < 0 else 0.0
    o = row(squares.origin, k)
    height = (o[0] - m[mirror, 0]) * n[0] + (o[1] - m[mirror, 1]) * n[1] + (o[2] - m[mirror, 2]) * n[2]
    above = (x[0] - m[mirror, 0]) * n[0] + (x[1] - m[mirror, 1]) * n[1] + (x[2] - m[mirror, 2]) * n[2]
    v = (o[0] - 2 * height * n[0] - x[0], o[1] - 2 * height * n[1] - x[1], o[2] - 2 * height * n[2] - x[2])
    length = math.sqrt(dot(v, v))
    if height <= 0 or above <= 0 or length == 0:
        return (0.0, 0.0, 1.0), 0.0
    ratio = 1 + above / height  # 1 + r/d
    return (v[0] / length, v[1] / length, v[2] / length), m[mirror, 6] * ratio * ratio


@kernel
def image_density(beside: Beside, k: int, mirror: Any, r: int, w: tuple[float, float, float]) -> Any:
    """Return D(w), 1/sr."""
    u, sharpness = image_of(beside.cells, k, mirror, point_of(beside.receivers.position, r))
    if sharpness == 0:
        return 0.0
    gap = lobe_gap(u[0], u[1], u[2], w[0], w[1], w[2])
    return sharpness / (2 * np.pi) * lobe_power(gap, sharpness - 1)


@kernel(parallel=True)
def pick_cells(beside: Beside, span: tuple[int, int], seed: int, grain: float, picks: Picks) -> None:
    """Fill the rays of a span's receivers (first, one past the last): of each those of b, then those of c.

    `seed`: of a hash with the receiver's pixel. `grain`: the tracer's, m.
    """
    count = span[1] - span[0]
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        _pick_chunk(beside, span[0], (chunk * CHUNK, min(count, chunk * CHUNK + CHUNK)), seed, grain, picks)


@kernel
def _pick_chunk(beside: Beside, first: int, part: tuple[int, int], seed: int, grain: float, picks: Picks) -> None:
    tree, receivers, counts = beside.cells.tree, beside.receivers, beside.counts
    path = Path(np.empty(DEEPEST_GROUP, np.int64), np.empty(DEEPEST_GROUP), np.empty(DEEPEST_GROUP),
                np.empty(DEEPEST_GROUP))
    found, sums = np.empty(len(tree.top), np.float32), np.empty(len(tree.top) + 1)
    for i in range(part[0], part[1]):
        x, n = column(receivers.position, first + i), column(receivers.normal, first + i)
        word = hash_bits(np.uint32(receivers.pixel[first + i]) ^ np.uint32(seed))
        fill_tops(tree, x, n, found, sums)
        ray = i * (counts.cells + counts.mirrors)
        _pick_rays(beside, (x, n), word, grain, sums, path, ray, picks)
        _pick_images(beside, (x, n), first + i, word, sums, path, ray + counts.cells, picks)


@kernel
def _pick_rays(beside: Beside, receiver: tuple[Any, Any], word: Any, grain: float, sums: Array, path: Path, start: int,
               picks: Picks) -> None:
    (x, n), cells, count, total = receiver, beside.cells, beside.counts.cells, sums[len(sums) - 1]
    lights, shift = len(cells.squares.kind), _uniform(word ^ np.uint32(0x1B56C4E9))
    top, level = -1, 0
    for s in range(count):
        place, (u, v) = (s + shift) / count, _place(word, s)
        picks.paths.reach[start + s] = 0
        if place < EVEN:
            k = min(lights - 1, int(place / EVEN * lights))
            found = found_up(cells, cell_at(cells, k, u, v), x, n, sums)
            _send(cells, k, found, (u, v, grain), beside.counts, start + s, picks)
        elif total > 0:
            place = (place - EVEN) / (1 - EVEN) * total
            top, level = next_top(cells.tree, sums, place, top, level, path)
            while cells.tree.child[path.node[level]] >= 0 and path.chance[level] > 0:
                level = go_down(cells.tree, x, n, level, place, path)
            if path.chance[level] > 0:
                _send_into(cells, path, level, top, sums, (u, v, grain), beside.counts, start + s, picks)


@kernel
def _pick_images(beside: Beside, receiver: tuple[Any, Any], r: int, word: Any, sums: Array, path: Path, start: int,
                 picks: Picks) -> None:
    (x, n), tree, count, total = receiver, beside.cells.tree, beside.counts.mirrors, sums[len(sums) - 1]
    shift, top, level = _uniform(word ^ np.uint32(0x7FEB352D)), -1, 0
    for s in range(count):
        picks.paths.reach[start + s] = 0
        if total > 0:
            place = (s + shift) / count * total
            top, level = next_top(tree, sums, place, top, level, path)
            mirror = np.int64(tree.plane[top, 0])
            if mirror < 0:
                while tree.mirror[path.node[level], 7] == 0 and tree.child[path.node[level]] >= 0:
                    level = go_down(tree, x, n, level, place, path)
                mirror = path.node[level] if tree.mirror[path.node[level], 7] > 0 and path.chance[level] > 0 else mirror
            if mirror >= 0:
                _send_to_image(beside, mirror, r, _place(~word, s), start + s, picks)


@kernel
def _send_into(cells: LobeCells, path: Path, level: int, top: int, sums: Array, place: tuple[float, float, float],
               counts: Counts, ray: int, picks: Picks) -> None:
    """Write the ray of b through a place of the cell at the end of a path."""
    tree, mirror, chance = cells.tree, np.int64(cells.tree.plane[top, 0]), 0.0
    if mirror >= 0:
        chance = plane_chance(tree, top, sums)
    for above in range(level + 1 if mirror < 0 else 0):
        if mirror < 0 and tree.mirror[path.node[above], 7] > 0:
            mirror, chance = path.node[above], path.chance[above]
    rank = tree.lobe[path.node[level]]
    cell = np.int64(cells.node[rank])
    side = 2.0 ** -cells.corner[cell, 2]
    a, b = (cells.corner[cell, 0] + place[0]) * side, (cells.corner[cell, 1] + place[1]) * side
    found = Found(cell, path.chance[level], mirror, chance)
    _send(cells, cells.light[rank], found, (a, b, place[2]), counts, ray, picks)


@kernel
def _send(cells: LobeCells, k: int, found: Found, place: tuple[float, float, float], counts: Counts, ray: int,
          picks: Picks) -> None:
    """Write the ray of light k through a place of its square, just beyond the lamp: that may lie in a surface."""
    o, d = ray_through(cells.squares, k, place[0], place[1])
    beyond = ray_offset(o[0], o[1], o[2], place[2])
    for c in range(3):
        picks.paths.origin[ray, c], picks.paths.direction[ray, c] = o[c] + beyond * d[c], d[c]
    picks.paths.reach[ray], picks.light[ray] = np.inf, k
    picks.cell[ray] = found.cell
    picks.density[ray] = even_density(cells, k, found.cell, found.chance, counts.cells)
    picks.mirror[ray], picks.mirror_chance[ray] = found.mirror, found.mirror_chance


@kernel
def _send_to_image(beside: Beside, mirror: Any, r: int, place: tuple[float, float], ray: int, picks: Picks) -> None:
    """Write the direction of c around the image of a light in a mirror."""
    receivers, paths, cells = beside.receivers, picks.paths, beside.cells
    k = cells.light[cells.tree.lobe[mirror]]
    u, sharpness = image_of(cells, k, mirror, point_of(receivers.position, r))
    if sharpness == 0:
        return
    x, y, z = lobe_direction(place[0], place[1], sharpness - 1)
    w = around(u, x, y, z)
    picks.light[ray], picks.mirror[ray] = k, mirror
    if dot(point_of(receivers.facing, r), w) > 0 and dot(point_of(receivers.normal, r), w) > 0:
        paths.reach[ray], paths.travelled[ray] = np.inf, 0
        for c in range(3):
            paths.origin[ray, c], paths.direction[ray, c] = receivers.origin[c, r], w[c]


@kernel
def _place(word: Any, pick: int) -> tuple[float, float]:
    word = hash_bits(word + np.uint32(pick))
    return _uniform(word ^ np.uint32(0x68E31DA4)), _uniform(word ^ np.uint32(0xB5297A4D))


@kernel
def _uniform(word: Any) -> Any:
    return (hash_bits(word) + 0.5) * 2.0**-32


@kernel
def point_of(rows: Array, i: int) -> tuple[float, float, float]:
    """Return column i of (3, n) as float64 scalars."""
    return np.float64(rows[0, i]), np.float64(rows[1, i]), np.float64(rows[2, i])


@kernel(parallel=True)
def connect(beside: Beside, surfaces: Surfaces, lights: LightTable, grain: float, visibility: bool, picks: Picks,
            shadows: Shadows) -> None:
    """Write the shadow ray that is left of each pick, and what the lobe at the point that it found sends.

    From there to the receiver for b, one of no length without `visibility`; to the light for c. `shadows`: origins,
    directions, reach and contribution are filled; the reach is 0 where nothing arrives.
    """
    count = len(picks.light)
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        _connect_span(beside, surfaces, lights, grain, visibility, picks, shadows, chunk * CHUNK,
                      min(count, chunk * CHUNK + CHUNK))


@kernel
def _connect_span(beside: Beside, surfaces: Surfaces, lights: LightTable, grain: float, visibility: bool, picks: Picks,
                  shadows: Shadows, low: int, high: int) -> None:
    each, tops = beside.counts.cells + beside.counts.mirrors, tops_for(beside.cells.tree)
    for ray in range(low, high):
        shadows.reach[ray] = 0
        triangle, r = picks.paths.triangle_id[ray], beside.first + ray // each
        if picks.paths.reach[ray] > 0 and triangle != MISS and _has_lobe(surfaces, triangle):
            if ray % each < beside.counts.cells:
                _connect_to_receiver(beside, r, surfaces, lights, grain, visibility, picks, tops, shadows, ray)
            else:
                _connect_to_light(beside, r, surfaces, lights, grain, picks, tops, shadows, ray)


@kernel
def tops_for(tree: LobeTree) -> Tops:
    """Allocate what a receiver knows of the top groups."""
    return Tops(np.full(1, -1, np.int64), np.empty(len(tree.top), np.float32), np.empty(len(tree.top) + 1))


@kernel
def found_for(beside: Beside, k: int, y: tuple[float, float, float], g: tuple[float, float, float], r: int,
              tops: Tops) -> Found:
    """Return the cells that hold a point for receiver r, whose top groups are computed once."""
    x, n = column(beside.receivers.position, r), column(beside.receivers.normal, r)
    if tops.receiver[0] != r:
        fill_tops(beside.cells.tree, x, n, tops.found, tops.sums)
        tops.receiver[0] = r
    return found_at(beside.cells, k, y, g, x, n, tops.sums)


@kernel
def _connect_to_receiver(beside: Beside, r: int, surfaces: Surfaces, lights: LightTable, grain: float,
                         visibility: bool, picks: Picks, tops: Tops, shadows: Shadows, ray: int) -> None:
    triangle, k, receivers = picks.paths.triangle_id[ray], picks.light[ray], beside.receivers
    back, y = hit_point(picks.paths, ray)
    g = face_normal(surfaces, triangle, -back[0], -back[1], -back[2])
    height = height_above(surfaces, triangle, y, g)
    y = (y[0] - height * g[0], y[1] - height * g[1], y[2] - height * g[2])
    way, n = subtract(y, point_of(receivers.position, r)), point_of(receivers.normal, r)
    length = math.sqrt(dot(way, way))
    if length == 0 or dot(n, way) <= 0:
        return
    if beside.hide and (dot(g, way) >= 0 or dot(point_of(receivers.facing, r), way) <= 0):
        return
    w = (way[0] / length, way[1] / length, way[2] / length)
    toward, power = toward_light(lights, k, y), row(lights.intensity, k)
    if lights.kind[k] != DIRECTIONAL:
        power = radiant_intensity(lights, k, -toward[0], -toward[1], -toward[2])
    mirror, chance, image = np.int64(picks.mirror[ray]), picks.mirror_chance[ray], 0.0
    if beside.counts.mirrors > 0 and not on_face(beside.cells, picks.cell[ray], y, g):
        found = found_for(beside, k, y, g, r, tops)
        mirror, chance = found.mirror, found.mirror_chance
    if mirror >= 0 and beside.counts.mirrors > 0:
        image = beside.counts.mirrors * chance * image_density(beside, k, mirror, r, w)
    total = near_density(beside.counts.directions, dot(n, w), image, (-dot(g, w), dot(toward, toward), dot(g, back)))
    total += picks.density[ray] * length * length
    if _fill_lobe(surfaces, triangle, (y, g, back, w), dot(n, w), power, total, shadows, ray):
        offset = ray_offset(y[0], y[1], y[2], grain) + far_offset(way[0], way[1], way[2])
        for c in range(3):
            shadows.origin[ray, c] = receivers.origin[c, r]
            shadows.direction[ray, c] = y[c] + offset * g[c] - receivers.origin[c, r] if visibility else 0.0
        shadows.reach[ray] = 1


@kernel
def _connect_to_light(beside: Beside, r: int, surfaces: Surfaces, lights: LightTable, grain: float, picks: Picks,
                      tops: Tops, shadows: Shadows, ray: int) -> None:
    triangle, k, receivers = picks.paths.triangle_id[ray], picks.light[ray], beside.receivers
    back, y = hit_point(picks.paths, ray)
    toward = toward_light(lights, k, y)
    g = face_normal(surfaces, triangle, -toward[0], -toward[1], -toward[2])
    lx, ly, lz, far, red, green, blue = incident_light(lights, k, y[0], y[1], y[2])
    if dot(g, back) <= 0 or max(red, green, blue) <= 0:
        return
    found = found_for(beside, k, y, g, r, tops)
    if found.mirror != picks.mirror[ray]:
        return
    w, square = (-back[0], -back[1], -back[2]), dot(toward, toward)
    cosine = dot(point_of(receivers.normal, r), w)
    length = np.float64(picks.paths.travelled[ray]) + picks.paths.distance[ray]
    total = rays_beside(beside, k, found, r, (w, cosine, length), (dot(g, back), square, dot(g, (lx, ly, lz))))
    power = (red * square, green * square, blue * square)
    if _fill_lobe(surfaces, triangle, (y, g, (lx, ly, lz), w), cosine, power, total, shadows, ray):
        aim_at_light(lights, k, (y, g, toward), far, lift(surfaces, triangle, y, g, grain), grain, shadows, ray)


@kernel
def _has_lobe(surfaces: Surfaces, triangle: int) -> bool:
    glossy = row(surfaces.specular, surfaces.material_of_face[triangle])
    return max(glossy[0], glossy[1], glossy[2]) > 0


@kernel
def subtract(a: tuple[float, float, float], b: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel
def _fill_lobe(surfaces: Surfaces, triangle: int, sender: Any, cosine: float, power: Any, total: float,
               shadows: Shadows, ray: int) -> bool:
    """Fill rho I pattern <n_x.w> / (pi r^2) over all densities, `total` r^2; return whether that is light.

    `sender`: the point, its face normal, towards the light, and the direction from the receiver. `power`: I, W/sr.
    """
    y, g, light, w = sender
    material = surfaces.material_of_face[triangle]
    n, glossy = shading_normal(surfaces, triangle, y, g), row(surfaces.specular, material)
    pattern = lobe_pattern(surfaces, material, n, light, (-w[0], -w[1], -w[2]))
    most = 0.0
    for c in range(3):
        shadows.contribution[ray, c] = glossy[c] * power[c] * pattern * cosine / (np.pi * total) if total > 0 else 0.0
        most = max(most, shadows.contribution[ray, c])
    return most > 0
