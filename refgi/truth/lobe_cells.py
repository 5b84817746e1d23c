"""What lobes of receivers need, and cells of light: what lobes of senders do with each light's directions, once a task.

L_s = int f_s(w, w_o) L(w) <n.w> dw with f_s = s (P + 2) / (2 pi) <m.w>^P, m the direction to the eye mirrored about n.

- Diffuse reflection: multiple importance sampling by the power heuristic, n_a^2 / (n_a^2 + n_b^2) for directions, the
  rest for light vertices. n_b counts rays that are spread evenly.
- Lobes: directions and cells of light, by the balance heuristic (`refgi.truth.cell_densities`); directions alone
  where P is above `WIDE` and Q / `BLURRED`, as they are then no wider than what they are to meet.
- Lobes that are left to photons (the sharpest; with caustics all mirror-like ones): photons, where P is lower than Q by
  `BLURRED` or more; else the receiver's directions alone.

Each light's square is cut into cells, as a quadtree: more where lobes send light apart by more than they are wide, the
brightest first. One ray tells what a cell holds; those with a lobe are sorted into a tree (`LobeTree`), along which
receivers find those that may shine on them. Nothing of it enters an expectation: `refgi.truth.cell_rays` draws cells by
it, fresh rays find what is there, and every ray is divided by its density.

Symbols: P the receiver's exponent, Q a sender's, w^2 = 1 / (Q + 1) the square of its width, rad^2; n_a and n_b how many
samples of a pass the directions of the receiver and the rays of a light put on a unit of area at the sender,
A = r^2 n_a / n_b.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel
from refgi.rays import MISS, Tracer
from refgi.scene import DirectionalLight, Light, LightTable, Scene, material_table
from refgi.truth.light_grid import LightSquares, light_squares, rays_through
from refgi.truth.light_vertices import closest_of, light_vertices
from refgi.truth.lobe_tree import Lobe, LobeTree, tree_of
from refgi.truth.surfaces import Surfaces, surfaces
from refgi.types import Array

BLURRED = 4.0  # times the receiver's exponent: senders' lobes as sharp as that, or sharper, come by photons
WIDE = 60.0  # exponent of receivers up to which, or to 1 / BLURRED of the sharpest sender's, they pick cells
SHARPEST_VERTEX = 1e7  # exponent above which a receiver takes nothing from light vertices, whose places are float32


class Lobes(NamedTuple):
    """Lobes of receivers, in their order."""

    mirrored: Array  # (3, r) float64: m
    specular: Array  # (3, r) float64: reflectance of the lobe
    exponent: Array  # (r,) float64: P
    surfaces: Surfaces  # with every lobe, those of photons among them
    photon_exponent: float  # lobes of senders from here on are left to photons; inf: none
    widest: float  # exponent of receivers up to which they pick cells of light


def glossy_triangles(scene: Scene, position: Array, normal: Array, triangle_id: Array) -> Array:
    """Return which triangle each pixel sees, without those that no lobe of reflects towards the eye.

    `position`, `normal` (3, h, w): the G-buffer's. Returns (h, w) int: -1 where there is no lobe, or the normal faces
    away from the eye.
    """
    table = material_table(scene.materials)
    glossy = (table.specular > 0).any(axis=1) & (table.ior == 0)
    seen = triangle_id >= 0
    toward_eye = np.asarray(scene.camera.eye, np.float64)[:, None, None] - position
    seen &= glossy[scene.geometry.material_of_face[np.where(seen, triangle_id, 0)]]
    seen &= (toward_eye * normal).sum(axis=0) > 0
    return np.where(seen, triangle_id, -1).astype(np.int32)


def lobes_of(scene: Scene, pixel: Array, position: Array, normal: Array, triangle_id: Array,
             photon_exponent: float) -> Lobes:
    """Return the lobes of receivers.

    `pixel` (r,): flat indices into the picture. `position`, `normal` (3, h, w), `triangle_id` (h, w): the G-buffer's.
    `photon_exponent`: of the lobes that are left to photons.
    """
    at, n = (plane.reshape(3, -1)[:, pixel].astype(np.float64) for plane in (position, normal))
    w_o = np.asarray(scene.camera.eye, np.float64)[:, None] - at
    w_o /= np.linalg.norm(w_o, axis=0)
    n /= np.linalg.norm(n, axis=0)
    mirrored = 2 * (n * w_o).sum(axis=0) * n - w_o
    material = scene.geometry.material_of_face[triangle_id.reshape(-1)[pixel]]
    table = material_table(scene.materials)
    by_cells = table.specular.any(axis=1) & (table.ior == 0) & (table.exponent < photon_exponent)
    sharpest = table.exponent[by_cells].max(initial=0.0)
    return Lobes(np.ascontiguousarray(mirrored / np.linalg.norm(mirrored, axis=0)),
                 np.ascontiguousarray(table.specular[material].T.astype(np.float64)),
                 np.ascontiguousarray(table.exponent[material], np.float64), surfaces(scene), photon_exponent,
                 min(SHARPEST_VERTEX, max(WIDE, sharpest / BLURRED)))


def subset_of(lobes: Lobes, chosen: Array) -> Lobes:
    """Return some of the receivers' lobes."""
    return lobes._replace(mirrored=np.ascontiguousarray(lobes.mirrored[:, chosen]),
                          specular=np.ascontiguousarray(lobes.specular[:, chosen]), exponent=lobes.exponent[chosen])


@kernel
def density_on_axis(exponent: float, directions: float) -> float:
    """Return D = c N (P + 1) / (2 pi), c = max(1, sqrt(P) / 6): what N directions count on a lobe's axis, 1/sr.

    c = 1 is their density. By trial more for sharp lobes, over which what they see hardly varies: directions then have
    next to no variance, and any light vertex adds to it.
    """
    return max(1.0, math.sqrt(exponent) / 6) * directions * (exponent + 1) / (2 * math.pi)


@kernel
def comes_by_photons(exponent: float, sender: float) -> bool:
    """Return whether what a lobe sends that is left to photons reaches a receiver by them: else by its directions.

    `exponent`: P. `sender`: Q.
    """
    return bool(sender >= BLURRED * exponent)


def meets_photons(lobes: Lobes) -> bool:
    """Return whether some sender's lobe reaches some receiver by photons."""
    sharp = lobes.surfaces.exponent[lobes.surfaces.specular.any(axis=1)].max(initial=0.0)
    least = lobes.exponent.min(initial=np.inf)
    return bool(sharp >= lobes.photon_exponent and sharp >= BLURRED * least)


FIRST_CELLS, MOST_CELLS = 1 << 12, 1 << 16  # before any is split by its lobes; at the most
DEEPEST = 20  # level of the smallest cell: halved so often
SPLIT = 0.5  # half-angle of what a cell sends apart, in widths of its lobe, above which it is split
FINE = 0.02  # rad: a flat cell is small enough at that, however sharp its lobe
EDGE = 0.7  # rad: normals of neighbouring cells that differ by more belong to two faces
PLACES = np.array([[0.5, 0.5], [0.01, 0.01], [0.01, 0.99], [0.99, 0.01], [0.99, 0.99]])  # in a cell: its rays
HALF_DIAGONAL = 0.75  # of a cell, in square roots of its measure
EDGE_LEVELS = 2  # how often cells that hold an edge are halved on its account
GRAZING = 0.05  # cosine below which a cell's footprint grows no more
ROUND = np.array([(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)], np.float64)  # neighbours
GUARD, MOST_GUARDS = 0.1, 0.25  # brightness of dark cells beside lit ones, of theirs; what all have at most, of all


class LobeCells(NamedTuple):
    """The cells of all lights; node k < lights is the root of light k."""

    squares: LightSquares
    child: Array  # (n,) int32: first of four children, (0, 0), (0, 1), (1, 0), (1, 1) in the square; -1: a cell
    corner: Array  # (n, 3) int32: column, row, level: the cell's corner is (column, row) / 2^level
    rank: Array  # (n,) int32: place among the tree's cells; -1: no lobe was found
    node: Array  # (cells,) int32: of each of them
    light: Array  # (cells,) int32
    tree: LobeTree


class _Source(NamedTuple):
    """Where rays come from, and what they meet."""

    scene: Scene
    tracer: Tracer
    surfaces: Surfaces
    lights: LightTable


class _Level(NamedTuple):
    """Cells of one light and one size."""

    corner: Array  # (m, 3) int64
    lobe: Lobe
    split: Array  # (m,) bool


def lobe_cells(scene: Scene, tracer: Tracer, surfaces: Surfaces, lights: LightTable) -> LobeCells | None:
    """Cut the squares of all lights, of which there is at least one; None where no ray finds a lobe.

    `surfaces`: with the lobes that count.
    """
    source = _Source(scene, tracer, surfaces, lights)
    levels = [(k, level) for k in range(len(scene.lights)) for level in _grown(source, k)]
    levels.sort(key=lambda found: int(found[1].corner[0, 2]))  # roots first
    light = np.repeat([k for k, _ in levels], [len(level.split) for _, level in levels])
    corner, split = (np.concatenate(parts) for parts in
                     zip(*((level.corner, level.split) for _, level in levels), strict=True))
    starts = {(k, int(level.corner[0, 2])): start for (k, level), start in
              zip(levels, np.cumsum([0] + [len(level.split) for _, level in levels]), strict=False)}
    child = np.full(len(split), -1, np.int32)
    parents = np.flatnonzero(split)
    below = np.array([starts[light[node], corner[node, 2] + 1] for node in parents], np.int64)
    first = np.concatenate([[0], np.flatnonzero(np.diff(below)) + 1]) if len(below) else np.zeros(0, np.int64)
    within = np.arange(len(parents)) - np.repeat(first, np.diff(np.append(first, len(parents))))
    child[parents] = below + 4 * within
    lobes = Lobe(*(np.concatenate(fields) for fields in zip(*(level.lobe for _, level in levels), strict=True)))
    _guard(child, corner, light, lobes)
    lit = np.flatnonzero(~split & (lobes.power > 0))
    if not len(lit):
        return None
    order, tree = tree_of(Lobe(*(field[lit] for field in lobes)))
    node = lit[order]
    rank = np.full(len(split), -1, np.int32)
    rank[node] = np.arange(len(node))
    return LobeCells(light_squares(scene.lights, scene.geometry), child, corner.astype(np.int32), rank,
                     node.astype(np.int32), light[node].astype(np.int32), tree)


def _guard(child: Array, corner: Array, light: Array, lobes: Lobe) -> None:
    """Give dark cells that touch lit ones a faint copy of the brightest of these, in place.

    A lobe may reach into a cell between its rays: what it sends from there would be met by chance alone.
    """
    power = np.where(child < 0, lobes.power, 0)
    beside = _brightest_beside(child, corner, light, power * 4.0 ** corner[:, 2])
    dark = np.flatnonzero(beside >= 0)
    lit = beside[dark]
    larger = 2.0 ** (corner[lit, 2] - corner[dark, 2])
    for field in lobes:
        field[dark] = field[lit]
    given, most = GUARD * power[lit] * larger**2, MOST_GUARDS * power.sum()
    lobes.power[dark] = given * (most / max(most, given.sum(), 1e-300))


@kernel
def _brightest_beside(child: Array, corner: Array, light: Array, brightness: Array) -> Array:
    """Return the brightest lit cell that touches each dark one; -1: none, or not a dark cell."""
    best = np.full(len(child), -1, np.int64)
    for cell in range(len(child)):
        side = math.ldexp(1.0, -corner[cell, 2])
        for i in range(8 if child[cell] < 0 else 0):
            a, b = (corner[cell, 0] + 0.5 + ROUND[i, 0]) * side, (corner[cell, 1] + 0.5 + ROUND[i, 1]) * side
            if 0 <= a < 1 and 0 <= b < 1:
                other = cell_at(child, light[cell], a, b)
                lit, dark = (cell, other) if brightness[cell] > 0 else (other, cell)
                # a smaller cell there may lie further in; where it touches, it finds this one
                if corner[other, 2] <= corner[cell, 2] and brightness[lit] > 0 and brightness[dark] <= 0 and (
                        best[dark] < 0 or brightness[lit] > brightness[best[dark]]):
                    best[dark] = lit
    return best


@kernel
def cell_at(child: Array, k: int, a: float, b: float) -> Any:
    """Return the cell of light k that holds a place of its square."""
    cell = np.int64(k)
    while child[cell] >= 0:
        i, j = int(2 * a), int(2 * b)
        cell, a, b = np.int64(child[cell] + 2 * i + j), 2 * a - i, 2 * b - j
    return cell


def _grown(source: _Source, k: int) -> list[_Level]:
    """Return a light's cells, size by size."""
    lights = len(source.scene.lights)
    base, left = max(1, int(np.log2(FIRST_CELLS / lights) / 2)), MOST_CELLS // lights
    levels: list[_Level] = []
    corner: Array = np.zeros((1, 3), np.int64)
    for level in range(DEEPEST + 1):
        if level < base:
            lobe, split = Lobe.dark(len(corner)), np.ones(len(corner), np.bool_)
        else:
            lobe, excess, edge = _sampled(source, k, corner)
            excess = np.where(edge & (level < base + EDGE_LEVELS), np.maximum(excess, 2), excess)
            wanted = np.flatnonzero(excess > 1) if level < DEEPEST else np.zeros(0, np.int64)
            worth = np.maximum(lobe.power, lobe.power.mean() * edge) * excess
            best = wanted[np.argsort(-worth[wanted], kind="stable")][: max(0, left) // 4]
            split = np.zeros(len(corner), np.bool_)
            split[best] = True
            left -= 4 * len(best)
        levels.append(_Level(corner, lobe, split))
        if not split.any():
            break
        parents = corner[split]
        corner = np.repeat(parents, 4, axis=0) * [2, 2, 1] + [0, 0, 1]
        corner[:, :2] += np.tile([[0, 0], [0, 1], [1, 0], [1, 1]], (len(parents), 1))
    return levels


def _sampled(source: _Source, k: int, corner: Array) -> tuple[Lobe, Array, Array]:
    """Trace rays through the middle and near the corners of each cell.

    Returns what its middle finds, by how much that calls for smaller cells, and (m,) bool whether an edge crosses it.
    """
    light, m = source.scene.lights[k], len(corner)
    square = ((corner[:, None, :2] + PLACES) / 2.0 ** corner[:, None, 2:]).transpose(1, 0, 2).reshape(-1, 2)
    rays = rays_through(light, source.scene.geometry, square, 1)
    triangle, distance = closest_of(source.tracer, rays)
    distance[triangle == MISS] = 0
    points = light_vertices(source.surfaces, source.lights, k, rays, (triangle, distance), np.inf, lobes=True)
    position, axis, facing, normal = (field.T.reshape(5, m, 3).astype(np.float64) for field in
                                      (points.position, points.axis, points.facing, points.normal))
    power = points.power.reshape(5, m)
    share = 0.25 ** corner[:, 2]
    angle = HALF_DIAGONAL * np.sqrt(rays.measure * share)  # m for a directional light
    width = 1 / (points.exponent[:m].astype(np.float64) + 1)
    cosine = np.maximum(-(facing[0] * rays.directions[:m]).sum(axis=1), GRAZING)
    parallel = isinstance(light, DirectionalLight)
    radius = angle / cosine if parallel else angle * distance[:m] / cosine
    edge = _on_edge(position, facing, power > 0)
    turn = _apart(normal[0], normal[1:])
    bend = np.maximum(_bend(source.surfaces, triangle[:m], radius),
                      np.where((power[1:] > 0) & (turn < EDGE), turn, 0).max(axis=0))
    angle = np.zeros(m) if parallel else angle
    excess = np.maximum(2 * bend, np.where(angle > FINE, angle, 0)) / (SPLIT * np.sqrt(width))
    lobe = Lobe(position[0], radius, axis[0], angle + 2 * bend, width, power[0] * share, facing[0],
                np.minimum(bend, 1), 1e-6 * radius, normal[0], bend, radius * np.sin(_apart(facing[0], normal[0])),
                _heights(light, position[0], normal[0]), np.full(m, k, np.float64))
    return lobe, excess, edge


def _on_edge(position: Array, facing: Array, found: Array) -> Array:
    """Return which cells do not lie on one face: their corners (1 to 4) off the plane of their middle (0), or dark."""
    apart = position[1:] - position[0]
    off = np.abs((apart * facing[0]).sum(axis=2)) > 0.5 * np.linalg.norm(apart, axis=2)
    off |= _apart(facing[0], facing[1:]) > EDGE
    return np.asarray(((found[0] & off) | (found[1:] != found[0])).any(axis=0))


def _bend(surfaces: Surfaces, triangle: Array, radius: Array) -> Array:
    """Return by how much, rad, an interpolated normal turns within a footprint; 0 on flat faces."""
    if not len(surfaces.normals):
        return np.zeros(len(triangle))
    corners = surfaces.faces[np.maximum(triangle, 0)]
    v, n = surfaces.vertices[corners], surfaces.normals[corners]
    n = n / np.maximum(np.linalg.norm(n, axis=2), 1e-30)[..., None]
    sides = np.maximum(np.linalg.norm(v - np.roll(v, 1, axis=1), axis=2), 1e-30)
    turn = 2 * np.arcsin(np.minimum(0.5 * np.linalg.norm(n - np.roll(n, 1, axis=1), axis=2), 1))
    return np.asarray(np.minimum((turn / sides).max(axis=1) * radius, np.pi / 2))


def _apart(one: Array, other: Array) -> Array:
    """Return the angle between unit vectors."""
    return np.asarray(2 * np.arcsin(np.minimum(0.5 * np.linalg.norm(one - other, axis=-1), 1)))


def _heights(light: Light, position: Array, normal: Array) -> Array:
    """Return how far a light lies above the plane that mirrors it, m; its cosine for a directional one, times inf."""
    if isinstance(light, DirectionalLight):
        return np.where(normal @ np.asarray(light.direction, np.float64) < 0, np.inf, -np.inf)
    return np.asarray(((np.asarray(light.position, np.float64) - position) * normal).sum(axis=1))
