"""How a receiver finds its way in the cells of `refgi.truth.lobe_cells`, and with what probability.

A receiver looks at all top groups of the tree, and goes down from those that its picks fall into, child by child, by
what each may send it (`_expected`). Places of picks are evenly spaced with one random shift, in the order of the cells.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel
from refgi.truth.light_grid import place_of
from refgi.truth.lobe_cells import ROUND, LobeCells, cell_at
from refgi.truth.lobe_tree import LobeTree
from refgi.types import Array

CHUNK = 64  # receivers that one parallel iteration owns
SAME_FACE, OFF_FACE = 0.9, 0.04  # cosine of normals, and square of the sine off the plane, of points of one face
LEAST = np.float32(1e-30)  # m^2, against 0 / 0


class Receiver(NamedTuple):
    """What picks for a receiver depend on, float32."""

    x: Any  # place
    n: Any  # normal
    lobe: Any  # None, or of a glossy receiver (mx, my, mz, w^2): the mirrored view, and the square of the lobe's width


class Path(NamedTuple):
    """The way down to a pick, level by level from a top group."""

    node: Array  # (levels,) int64
    chance: Array
    low: Array  # where the group's places begin
    high: Array


class Found(NamedTuple):
    """The cells that hold a place of a light's square."""

    cell: Any  # int64
    chance: Any  # of the cell, when one is picked
    mirror: Any  # int64: the first group on the way down that mirrors the light; -1: none
    mirror_chance: Any


@kernel
def _not_zero(square: Any) -> Any:
    return square if square > LEAST else LEAST


@kernel
def _expected(cell: Any, x: Any, n: Any, lobe: Any) -> Any:
    """Return about what a cell sends a receiver without visibility: flux, cosine, lobes and distance, each widened.

    `cell`: a row of `LobeCells`. The rest: of a `Receiver`. All float32; free of branches.
    """
    cx, cy, cz, radius, ax, ay, az, spread, flux, gx, gy, gz, thick, tilt = cell
    zero, one, quarter = np.float32(0), np.float32(1), np.float32(0.25)
    dx, dy, dz = cx - x[0], cy - x[1], cz - x[2]
    size, square = _not_zero(radius * radius), _not_zero(dx * dx + dy * dy + dz * dz)
    inverse = one / np.sqrt(square)
    along, height = n[0] * gx + n[1] * gy + n[2] * gz, n[0] * dx + n[1] * dy + n[2] * dz
    # the highest point of the cell above the receiver's horizon, and the receiver above the cell's
    across = one - along * along
    cosine = (height + radius * np.sqrt(across if across > zero else zero) + thick * abs(along)) * inverse
    above = thick + tilt * (radius + square * inverse) - (gx * dx + gy * dy + gz * dz)
    cosine = cosine if cosine < one else one
    cosine = cosine if (cosine > zero) & (above > zero) else zero
    gap = one + (ax * dx + ay * dy + az * dz) * inverse
    width = spread + (size / square if size < square else one)
    fall = one / (one + quarter * (gap if gap > zero else zero) / width)
    fall *= fall
    sent = flux * cosine * (fall * fall) / (width * (square if square > size else size))
    if lobe is None:
        return sent
    gap = one - (lobe[0] * dx + lobe[1] * dy + lobe[2] * dz) * inverse
    width = lobe[3] + (size / square if size < square else one)
    fall = one / (one + quarter * (gap if gap > zero else zero) / width)
    fall *= fall
    return sent * (fall * fall) / width


@kernel
def _of_node(tree: LobeTree, node: Any, to: Receiver) -> Any:
    r = tree.row
    return _expected((r[node, 0], r[node, 1], r[node, 2], r[node, 3], r[node, 4], r[node, 5], r[node, 6], r[node, 7],
                      r[node, 8], r[node, 9], r[node, 10], r[node, 11], r[node, 12], r[node, 13]), to.x, to.n, to.lobe)


@kernel
def column(rows: Array, i: int) -> tuple[Any, Any, Any]:
    """Return column i of (3, n)."""
    return rows[0, i], rows[1, i], rows[2, i]


@kernel
def fill_tops(tree: LobeTree, to: Receiver, found: Array, sums: Array) -> Any:
    """Fill what each top group sends (t,), in SIMD lanes, and the sums (t + 1,) of those before; return the last."""
    c = tree.columns
    for t in range(len(found)):
        found[t] = _expected((c[0, t], c[1, t], c[2, t], c[3, t], c[4, t], c[5, t], c[6, t], c[7, t], c[8, t], c[9, t],
                              c[10, t], c[11, t], c[12, t], c[13, t]), to.x, to.n, to.lobe)
    sums[0] = total = 0.0
    for t in range(len(found)):
        total += found[t]
        sums[t + 1] = total
    return total


@kernel
def found_at(cells: LobeCells, k: int, y: tuple[float, float, float], g: tuple[float, float, float], to: Receiver,
             sums: Array) -> Found:
    """Return the cells that hold a point y of face normal g that light k reaches, for a receiver.

    `sums`: of `fill_tops`. Where an edge crosses the cell and its ray found another face, the mirror is that of the
    first neighbour on y's face.
    """
    a, b = place_of(cells.squares, k, y)
    if a < 0:
        return Found(np.int64(k), 0.0, np.int64(-1), 0.0)
    cell = cell_at(cells.child, k, a, b)
    own = found_up(cells, cell, to, sums)
    if on_face(cells, cell, y, g):
        return own
    side = math.ldexp(1.0, -cells.corner[cell, 2])
    for i in range(8):
        da, db = a + side * ROUND[i, 0], b + side * ROUND[i, 1]
        if 0 <= da < 1 and 0 <= db < 1:
            other = cell_at(cells.child, k, da, db)
            if on_face(cells, other, y, g):
                found = found_up(cells, other, to, sums)
                return Found(cell, own.chance, found.mirror, found.mirror_chance)
    return Found(cell, own.chance, np.int64(-1), 0.0)


@kernel
def on_face(cells: LobeCells, cell: int, y: tuple[float, float, float], g: tuple[float, float, float]) -> Any:
    """Return whether a cell's lobe lies on about the same face as a point y with face normal g."""
    if cells.rank[cell] < 0:
        return False
    r, node = cells.tree.row, cells.tree.single[cells.rank[cell]]
    d = (y[0] - r[node, 0], y[1] - r[node, 1], y[2] - r[node, 2])
    off = r[node, 9] * d[0] + r[node, 10] * d[1] + r[node, 11] * d[2]
    alike = r[node, 9] * g[0] + r[node, 10] * g[1] + r[node, 11] * g[2]
    return alike > SAME_FACE and off * off <= OFF_FACE * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2])


@kernel
def found_up(cells: LobeCells, cell: int, to: Receiver, sums: Array) -> Found:
    """Return a cell's chance, the product of its groups' shares on the way up, and its mirror's."""
    rank, mirror, chance, mirror_chance, tree = cells.rank[cell], np.int64(-1), 1.0, 1.0, cells.tree
    total = sums[len(sums) - 1]
    if rank < 0 or total <= 0:
        return Found(cell, 0.0, mirror, 0.0)
    node = np.int64(tree.single[rank])
    while tree.top_of[node] < 0:
        if tree.mirror[node, 7] > 0:
            mirror, mirror_chance = node, 1.0
        above, own = np.int64(tree.parent[node]), np.float64(_of_node(tree, node, to))
        whole = own + _of_node(tree, 2 * np.int64(tree.child[above]) + 1 - node, to)
        share = own / whole if own > 0 else 0.0
        chance, mirror_chance, node = chance * share, mirror_chance * share, above
    top = tree.top_of[node]
    share = (sums[top + 1] - sums[top]) / total
    if tree.plane[top, 0] >= 0:
        return Found(cell, chance * share, np.int64(tree.plane[top, 0]), plane_chance(tree, top, sums))
    return Found(cell, chance * share, mirror, mirror_chance * share if mirror >= 0 else 0.0)


@kernel
def plane_chance(tree: LobeTree, top: int, sums: Array) -> Any:
    """Return the chance of the plane around a top group."""
    return (sums[tree.plane[top, 2]] - sums[tree.plane[top, 1]]) / sums[len(sums) - 1]


@kernel
def top_at(sums: Array, place: float) -> int:
    """Return the top group that holds a place in [0, total): the last one that begins before and sends anything."""
    low, high = 0, len(sums) - 1  # sums[low] <= place < sums[high]
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if sums[middle] <= place else (low, middle)
    while low > 0 and sums[low + 1] <= sums[low]:
        low -= 1
    return low


@kernel
def next_top(tree: LobeTree, sums: Array, place: float, top: int, level: int, path: Path) -> tuple[int, int]:
    """Go on to the top group that holds a place; return it and the level that the way down goes on from."""
    if top < 0 or place >= path.high[0]:
        top, level = top_at(sums, place), 0
        path.node[0], path.low[0], path.high[0] = tree.top[top], sums[top], sums[top + 1]
        path.chance[0] = (sums[top + 1] - sums[top]) / sums[len(sums) - 1]
    while level > 0 and place >= path.high[level]:
        level -= 1
    return top, level


@kernel
def go_down(tree: LobeTree, to: Receiver, level: int, place: float, path: Path) -> int:
    """Go on to the child that holds a place; return its level."""
    first = np.int64(tree.child[path.node[level]])
    one, two = np.float64(_of_node(tree, first, to)), np.float64(_of_node(tree, first + 1, to))
    share = one / (one + two) if one + two > 0 else -1.0
    middle = path.low[level] + share * (path.high[level] - path.low[level])
    second = share < 1 and (place >= middle or share <= 0)
    path.node[level + 1] = first + 1 if second else first
    path.chance[level + 1] = path.chance[level] * (0.0 if share < 0 else 1 - share if second else share)
    path.low[level + 1] = middle if second else path.low[level]
    path.high[level + 1] = path.high[level] if second else middle
    return level + 1
