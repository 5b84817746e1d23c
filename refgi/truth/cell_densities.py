"""Lobes of senders: rays into cells of light, directions to mirror images of lights, and their share beside the rest.

The directions of hemisphere sampling rarely meet a lobe, and by then it is bright. So each receiver picks cells of
light besides (`refgi.truth.cell_walk`), and

- b: sends a fresh ray of the light through a random place of a cell, and connects what it finds, or
- c: sends a direction around the image of the light in the plane mirror that the cell is, and connects what it finds in
  this very cell to the light. The image's lobe is P (1 + r/d)^2 sharp: what x sees of a lobe turns with x and y both.

With r and d the distances from the point y to the receiver and to the light, g the face normal at y, p the chance of a
cell and W its measure, N directions (a), k_b and k_c picks put

    n_a = N D_a(w) F,   n_b = k_b ((1 - e) p_b / W + e / (lights W_light)),   n_c = k_c p_c D(w) F,

F = <g.-w> d^2 / (r^2 <g.l>), rays on a unit of the light's measure. D_a is <n_x.w> / pi, the density of hemisphere
sampling, or where a glossy receiver's reflection is asked for that of its lobe, (P_x + 1) / (2 pi) <m.w>^P_x, by which
its picks go as well. Each ray adds the lobe's term over n_a + n_b + n_c (the balance heuristic of multiple importance
sampling). So no contribution is larger than what the best of them would give: near a flat mirror n_c follows the lobe
itself, however sharp it is.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numba import types

from refgi.jit import by_type, kernel
from refgi.pairs.shadow_rays import RayReceivers
from refgi.radiometry import DIRECTIONAL, lobe_gap, lobe_power
from refgi.truth.cell_walk import Found, Receiver, column, fill_tops, found_at
from refgi.truth.lobe_cells import LobeCells, Lobes
from refgi.truth.lobe_tree import LobeTree
from refgi.truth.paths import Paths, dot, row
from refgi.types import Array

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
    lobes: Lobes | None  # of glossy receivers, where their reflection is asked for
    counts: Counts
    first: int  # receiver of the first ray
    hide: bool  # as in `refgi.truth.paths.Sides`


class Tops(NamedTuple):
    """What the top groups send one receiver."""

    receiver: Array  # (1,) int64: which; -1: none yet
    found: Array  # (t,) float32
    sums: Array  # (t + 1,) float64: of those before


def receiver_at(receivers: Any, lobes: Any, r: Any) -> Any:
    """Return receiver r as picks see it; `lobes` choose what is compiled."""
    return _plain(receivers, lobes, r) if lobes is None else _glossy(receivers, lobes, r)


def _plain(receivers: Any, lobes: Any, r: Any) -> Any:  # noqa: ARG001
    return Receiver(column(receivers.position, r), column(receivers.normal, r), None)


def _glossy(receivers: Any, lobes: Any, r: Any) -> Any:
    m, square = column(lobes.mirrored, r), np.float32(1 / (lobes.exponent[r] + 1))
    lobe = np.float32(m[0]), np.float32(m[1]), np.float32(m[2]), square
    return Receiver(column(receivers.position, r), column(receivers.normal, r), lobe)


@by_type(receiver_at)
def _by_type(receivers: Any, lobes: Any, r: Any) -> Any:  # noqa: ARG001
    return _plain if isinstance(lobes, types.NoneType) else _glossy


@kernel
def takes(lobes: Lobes | None, r: int) -> bool:
    """Return whether a receiver has picks: sharp lobes have directions alone."""
    return True if lobes is None else lobes.exponent[r] <= lobes.widest


@kernel
def direction_density(lobes: Lobes | None, r: int, w: tuple[float, float, float], cosine: float) -> Any:
    """Return D_a(w), 1/sr; `cosine`: <n_x.w>."""
    return cosine / np.pi if lobes is None else (lobes.exponent[r] + 1) / (2 * np.pi) * _of_lobe(lobes, r, w)


@kernel
def response(lobes: Lobes | None, r: int, w: tuple[float, float, float], cosine: float) -> Any:
    """Return what a receiver makes of radiance from w: <n_x.w>, times f_s / s of its lobe where asked for."""
    return cosine if lobes is None else cosine * (lobes.exponent[r] + 2) / (2 * np.pi) * _of_lobe(lobes, r, w)


@kernel
def _of_lobe(lobes: Lobes, r: int, w: tuple[float, float, float]) -> Any:
    """Return <m.w>^P."""
    m = column(lobes.mirrored, r)
    return lobe_power(lobe_gap(m[0], m[1], m[2], w[0], w[1], w[2]), lobes.exponent[r])


@kernel
def near_density(near: float, image: float, sender: tuple[float, float, float]) -> Any:
    """Return (n_a + n_c) r^2.

    `near`: N D_a. `image`: k_c p_c D. `sender`: <g.-w>, d^2 (1 for a directional light), <g.l>.
    """
    return (near + image) * abs(sender[0]) * sender[1] / max(sender[2], 1e-30)


@kernel
def rays_beside(beside: Beside, k: int, found: Found, r: int, way: tuple[tuple[float, float, float], float, float],
                sender: tuple[float, float, float]) -> Any:
    """Return (n_a + n_b + n_c) r^2 at a point of cells `found`; `way`: unit vector to it, its cosine, its length."""
    w, cosine, length = way
    image = 0.0
    if found.mirror >= 0 and beside.counts.mirrors > 0:
        image = beside.counts.mirrors * found.mirror_chance * image_density(beside, k, found.mirror, r, w)
    near = beside.counts.directions * direction_density(beside.lobes, r, w, cosine)
    far = even_density(beside.cells, k, found.cell, found.chance, beside.counts.cells)
    return near_density(near, image, sender) + far * length * length


@kernel
def share_beside(beside: Beside, tops: "Tops", k: int, hit: Any, paths: Paths, ray: int,
                 sender: tuple[float, float, float]) -> float:
    """Return the share of directions, n_a / (n_a + n_b + n_c), in the lobe at a point and face normal that one hit."""
    r = beside.first + ray // beside.counts.directions
    if not takes(beside.lobes, r):
        return 1.0
    w, cosine = row(paths.direction, ray), np.float64(paths.cosine[ray])
    near = near_density(beside.counts.directions * direction_density(beside.lobes, r, w, cosine), 0.0, sender)
    found = found_for(beside, k, hit[0], hit[1], r, tops)
    length = np.float64(paths.travelled[ray]) + paths.distance[ray]
    return near / rays_beside(beside, k, found, r, (w, cosine, length), sender) if near > 0 else 0.0


@kernel
def even_density(cells: LobeCells, k: int, leaf: int, chance: float, picks: int) -> Any:
    """Return n_b in a leaf that is picked with a probability of `chance`."""
    share = (1 - EVEN) * chance * math.ldexp(1.0, 2 * cells.corner[leaf, 2]) + EVEN / len(cells.squares.kind)
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
    to = receiver_at(beside.receivers, beside.lobes, r)
    if tops.receiver[0] != r:
        fill_tops(beside.cells.tree, to, tops.found, tops.sums)
        tops.receiver[0] = r
    return found_at(beside.cells, k, y, g, to, tops.sums)


@kernel
def point_of(rows: Array, i: int) -> tuple[float, float, float]:
    """Return column i of (3, n) as float64 scalars."""
    return np.float64(rows[0, i]), np.float64(rows[1, i]), np.float64(rows[2, i])
