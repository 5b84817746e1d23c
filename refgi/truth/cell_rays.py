"""Rays that receivers pick by cells of light: of lights into cells, and towards images of lights.

Symbols: as in `refgi.truth.cell_densities`.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel, prange
from refgi.radiometry import lobe_direction
from refgi.rays import ray_offset
from refgi.sampling import hash_bits, uniform
from refgi.truth.cell_densities import EVEN, Beside, Counts, even_density, image_of, point_of, receiver_at, takes
from refgi.truth.cell_walk import (
    CHUNK,
    Found,
    Path,
    Receiver,
    fill_tops,
    found_up,
    go_down,
    next_top,
    plane_chance,
)
from refgi.truth.light_grid import ray_through
from refgi.truth.lobe_cells import LobeCells, cell_at
from refgi.truth.paths import Paths, dot, paths_for
from refgi.truth.surfaces import around
from refgi.types import Array

DEEPEST_GROUP = 128  # levels of the tree that a way down may have


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
        to = receiver_at(receivers, beside.lobes, first + i)
        word = hash_bits(np.uint32(receivers.pixel[first + i]) ^ np.uint32(seed))
        ray = i * (counts.cells + counts.mirrors)
        if not takes(beside.lobes, first + i):
            picks.paths.reach[ray : ray + counts.cells + counts.mirrors] = 0
            continue
        fill_tops(tree, to, found, sums)
        _pick_rays(beside, to, word, grain, sums, path, ray, picks)
        _pick_images(beside, to, first + i, word, sums, path, ray + counts.cells, picks)


@kernel
def _pick_rays(beside: Beside, to: Receiver, word: Any, grain: float, sums: Array, path: Path, start: int,
               picks: Picks) -> None:
    cells, count, total = beside.cells, beside.counts.cells, sums[len(sums) - 1]
    lights, shift = len(cells.squares.kind), uniform(word ^ np.uint32(0x1B56C4E9))
    top, level = -1, 0
    for s in range(count):
        place, (u, v) = (s + shift) / count, _place(word, s)
        picks.paths.reach[start + s] = 0
        if place < EVEN:
            k = min(lights - 1, int(place / EVEN * lights))
            found = found_up(cells, cell_at(cells.child, k, u, v), to, sums)
            _send(cells, k, found, (u, v, grain), beside.counts, start + s, picks)
        elif total > 0:
            place = (place - EVEN) / (1 - EVEN) * total
            top, level = next_top(cells.tree, sums, place, top, level, path)
            while cells.tree.child[path.node[level]] >= 0 and path.chance[level] > 0:
                level = go_down(cells.tree, to, level, place, path)
            if path.chance[level] > 0:
                _send_into(cells, path, level, top, sums, (u, v, grain), beside.counts, start + s, picks)


@kernel
def _pick_images(beside: Beside, to: Receiver, r: int, word: Any, sums: Array, path: Path, start: int,
                 picks: Picks) -> None:
    tree, count, total = beside.cells.tree, beside.counts.mirrors, sums[len(sums) - 1]
    shift, top, level = uniform(word ^ np.uint32(0x7FEB352D)), -1, 0
    for s in range(count):
        picks.paths.reach[start + s] = 0
        if total > 0:
            place = (s + shift) / count * total
            top, level = next_top(tree, sums, place, top, level, path)
            mirror = np.int64(tree.plane[top, 0])
            if mirror < 0:
                while tree.mirror[path.node[level], 7] == 0 and tree.child[path.node[level]] >= 0:
                    level = go_down(tree, to, level, place, path)
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
    side = math.ldexp(1.0, -cells.corner[cell, 2])
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
    return uniform(word ^ np.uint32(0x68E31DA4)), uniform(word ^ np.uint32(0xB5297A4D))
