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

from refgi.jit import kernel
from refgi.lobes import lobe_gap, lobe_power
from refgi.pairs.shadow_rays import RayReceivers
from refgi.radiometry import DIRECTIONAL
from refgi.truth.cell_walk import Found, column, fill_tops, found_at
from refgi.truth.lobe_cells import LobeCells
from refgi.truth.lobe_tree import LobeTree
from refgi.truth.paths import dot, row

Array = npt.NDArray[Any]

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
def point_of(rows: Array, i: int) -> tuple[float, float, float]:
    """Return column i of (3, n) as float64 scalars."""
    return np.float64(rows[0, i]), np.float64(rows[1, i]), np.float64(rows[2, i])
