"""Cells of light: a quadtree over each light's directions of what lobes of senders do with them, once a source.

A cell knows where its rays land (a ball), where lobes send them (an axis, and how far axes and lobes spread around it)
and how much flux that is. Cells are split where axes spread by more than a lobe is wide, the brightest first, so that
a curved or a sharp mirror has as many as it needs. Nothing of it enters an expectation: `refgi.truth.cell_picks` draws
cells by it, fresh rays find what is there, and every ray is divided by its density.

Symbols: P the lobes' exponent, w^2 = 1 / (P + 1) the square of a lobe's width, rad^2, s^2 the same with the axes' spread.
"""

import heapq
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.radiometry import DIRECTIONAL
from refgi.rays import Tracer
from refgi.scene import LightTable, Scene
from refgi.truth.light_grid import rays_through
from refgi.truth.light_square import LightSquares, light_squares
from refgi.truth.light_vertices import trace_light_vertices
from refgi.truth.surfaces import Surfaces

Array = npt.NDArray[Any]

FIRST_CELLS, MOST_CELLS = 1 << 12, 1 << 16  # before any is split by its spread; leaves at the most
FLAT = 0.5  # blur of a mirror's image of the light, in widths of its lobes, below which it counts as plane
ROWS = 14
TOPS = 1024  # cells that a receiver looks at before it goes into one
DEEPEST = 24  # level of the smallest cell: halved so often
SPLIT = 0.5  # half-angle of a cell's axes, in widths of its lobes, above which it is split
QUARTERS = np.array([[0.25, 0.25], [0.25, 0.75], [0.75, 0.25], [0.75, 0.75]])  # of a cell: its sample rays


class LobeCells(NamedTuple):
    """The quadtrees of all lights; node k < lights is the root of light k."""

    squares: LightSquares
    child: Array  # (n,) int32: first of four children, (0, 0), (0, 1), (1, 0), (1, 1) in the square; -1: a leaf
    corner: Array  # (n, 3) int32: column, row, level: the cell's corner is (column, row) / 2^level
    row: Array  # (n, ROWS) float32: centre (m), radius (m), axis, s^2, flux over pi (W/sr), face normal, thickness
    #             (m) across it, sine of the half-angle of face normals
    top: Array  # (t,) int32: cells that cover every square once, each small enough to be told from the others
    light: Array  # (t,) int32: of each of them
    is_top: Array  # (n,) bool
    columns: Array  # (ROWS, t) float32: `row` of the top cells, for SIMD lanes
    mirror: Array  # (n, 8) float64: a point and the normal of the plane that mirrors the light, exponent + 1 of what it
    #                sends by that, 1 where that may be used


class _Leaves(NamedTuple):
    """Cells of one light while the tree grows."""

    corner: Array  # (m, 3) int64
    centre: Array  # (m, 3)
    radius: Array  # (m,) m
    axis: Array  # (m, 3)
    spread: Array  # (m,) rad: half-angle of the axes' cone
    width: Array  # (m,) w^2, rad^2
    power: Array  # (m,) W/sr
    mixed: Array  # (m,) bool: some rays found a lobe, others none
    normal: Array  # (m, 3) mean face normal
    tilt: Array  # (m,) rad: half-angle of the cone of face normals
    thick: Array  # (m,) m: off the plane across that normal
    shading: Array  # (m, 3) mean shading normal
    bend: Array  # (m,) rad: half-angle of the cone of shading normals
    offset: Array  # (m,) m: off the plane across that normal


class _Source(NamedTuple):
    """Where rays come from, and what they meet."""

    scene: Scene
    tracer: Tracer
    surfaces: Surfaces
    lights: LightTable


def lobe_cells(scene: Scene, tracer: Tracer, surfaces: Surfaces, lights: LightTable) -> LobeCells:
    """Grow the trees of all lights, of which there is at least one; `surfaces` with the lobes that count."""
    parts = [_grown(_Source(scene, tracer, surfaces, lights), k) for k in range(len(scene.lights))]
    return _joined(light_squares(scene.lights, scene.geometry), parts)


def _grown(source: _Source, k: int) -> list[tuple[_Leaves, Array]]:
    """Return a light's cells level by level, each with which of them are split (bool)."""
    lights = len(source.scene.lights)
    base = max(1, int(np.log2(FIRST_CELLS / lights) / 2))
    left = MOST_CELLS // lights
    levels, corner = [], np.zeros((1, 3), np.int64)
    for level in range(DEEPEST + 1):
        leaves = _sampled(source, k, corner) if level >= base else _unsampled(corner)
        split = np.ones(len(corner), np.bool_)
        if level >= base:
            excess = (leaves.spread / SPLIT) ** 2 / leaves.width
            wanted = np.flatnonzero((leaves.power > 0) & ((excess > 1) | (leaves.mixed & (level < base + 2))))
            best = wanted[np.argsort(-leaves.power[wanted] * excess[wanted], kind="stable")][: max(0, left) // 4]
            split[:] = False
            split[best if level < DEEPEST else []] = True
            left -= 4 * int(split.sum())
        levels.append((leaves, split))
        if not split.any():
            break
        parents = corner[split]
        corner = np.repeat(parents, 4, axis=0) * [2, 2, 1] + [0, 0, 1]
        corner[:, :2] += np.tile([[0, 0], [0, 1], [1, 0], [1, 1]], (len(parents), 1))
    return levels


def _unsampled(corner: Array) -> _Leaves:
    m = len(corner)
    return _Leaves(corner, np.zeros((m, 3)), np.zeros(m), np.zeros((m, 3)), np.zeros(m), np.ones(m), np.zeros(m),
                   np.zeros(m, np.bool_), *(np.zeros((m, 3)), np.zeros(m), np.zeros(m)) * 2)


def _sampled(source: _Source, k: int, corner: Array) -> _Leaves:
    """Trace four rays through each cell and describe the lobes they find."""
    m, cells = len(corner), 2.0 ** corner[:, 2]
    square = ((corner[:, None, :2] + QUARTERS) / cells[:, None, None]).reshape(-1, 2)
    rays = rays_through(source.scene.lights[k], source.scene.geometry, square, 1)
    points = trace_light_vertices(source.tracer, source.surfaces, source.lights, k, rays, np.inf, lobes=True)
    power = points.power[4 * m :].reshape(m, 4).astype(np.float64)
    position, axis, facing, shading = (field[:, 4 * m :].T.reshape(m, 4, 3).astype(np.float64) for field in
                                       (points.position, points.axis, points.facing, points.normal))
    found, nothing = power > 0, np.zeros((m, 4))
    total, (centre, mean, normal, bent) = _means(power, position, axis, facing, shading)
    width = (power / (points.exponent[4 * m :].reshape(m, 4) + 1)).sum(axis=1) / np.where(total > 0, total, 1)
    # the rays span half of the cell
    return _Leaves(corner, centre, 2 * _radius(found, position, nothing, centre), mean,
                   2 * _spread(found, axis, nothing, mean), np.where(total > 0, width, 1), total / 4 / cells**2,
                   found.any(axis=1) & ~found.all(axis=1), normal, 2 * _spread(found, facing, nothing, normal),
                   2 * _thickness(found, position, nothing, centre, normal), bent,
                   2 * _spread(found, shading, nothing, bent), 2 * _thickness(found, position, nothing, centre, bent))


def _means(power: Array, position: Array, *directions: Array) -> tuple[Array, list[Array]]:
    """Return the power (m,) of groups of four, and their mean position and unit vectors, by power."""
    total = power.sum(axis=1)
    share = (power / np.where(total > 0, total, 1)[:, None])[..., None]
    means = [(share * field).sum(axis=1) for field in (position, *directions)]
    return total, means[:1] + [mean / np.maximum(np.linalg.norm(mean, axis=1), 1e-30)[:, None] for mean in means[1:]]


def _radius(found: Array, position: Array, radius: Array, centre: Array) -> Array:
    return np.where(found, np.linalg.norm(position - centre[:, None], axis=2) + radius, 0).max(axis=1)


def _spread(found: Array, direction: Array, spread: Array, mean: Array) -> Array:
    apart = np.linalg.norm(direction - mean[:, None], axis=2)  # twice the sine of half the angle
    return np.where(found, 2 * np.arcsin(np.minimum(0.5 * apart, 1)) + spread, 0).max(axis=1)


def _thickness(found: Array, position: Array, thick: Array, centre: Array, normal: Array) -> Array:
    off = np.abs(((position - centre[:, None]) * normal[:, None]).sum(axis=2))
    return np.where(found, off + thick, 0).max(axis=1)


def _joined(squares: LightSquares, parts: list[list[tuple[_Leaves, Array]]]) -> LobeCells:
    """Lay all trees out breadth first, and describe each split cell by its four."""
    depth = max(len(levels) for levels in parts)
    rows = [[levels[level] for levels in parts if level < len(levels)] for level in range(depth)]
    leaves = [_Leaves(*(np.concatenate(fields) for fields in zip(*(one[0] for one in row), strict=True))) for row in rows]
    split = [np.concatenate([one[1] for one in row]) for row in rows]
    starts = np.cumsum([0] + [len(one.corner) for one in leaves])
    for level in range(depth - 2, -1, -1):
        _describe(leaves[level], split[level], leaves[level + 1])
    child = np.full(starts[-1], -1, np.int32)
    for level in range(depth - 1):
        parents = starts[level] + np.flatnonzero(split[level])
        child[parents] = starts[level + 1] + 4 * np.arange(len(parents))
    whole = _Leaves(*(np.concatenate(fields) for fields in zip(*leaves, strict=True)))
    spread = np.minimum(whole.spread, 2) ** 2 + whole.width
    tilt = np.sin(np.minimum(whole.tilt, 0.5 * np.pi))
    row = np.column_stack([whole.centre, whole.radius, whole.axis, spread, whole.power, whole.normal, whole.thick, tilt])
    top, light = _tops(child, whole, len(parts))
    is_top = np.zeros(len(child), np.bool_)
    is_top[top] = True
    row = row.astype(np.float32)
    light_of = np.repeat(np.tile(np.arange(len(parts)), depth), np.ravel([[len(levels[level][0].corner) if level < len(levels) else 0 for levels in parts] for level in range(depth)]))
    return LobeCells(squares, child, whole.corner.astype(np.int32), row, top, light, is_top,
                     np.ascontiguousarray(row[top].T), _mirrors(squares, light_of, whole, child < 0))


def _tops(child: Array, cells: _Leaves, lights: int) -> tuple[Array, Array]:
    """Open the cell whose flux is the most spread out, until there are enough; in the order of the squares."""
    extent = max(float(np.ptp(cells.centre[cells.power > 0], axis=0).max(initial=0)), 1e-30)
    loose = cells.power * (np.minimum(cells.spread, 2) ** 2 + (cells.radius / extent) ** 2)
    heap = [(-loose[k], k, k) for k in range(lights)]
    done = []
    while heap and len(heap) + len(done) + 3 <= max(TOPS, lights):
        worst, node, k = heapq.heappop(heap)
        if child[node] < 0 or worst == 0:
            done.append((node, k))
            continue
        for c in range(child[node], child[node] + 4):
            heapq.heappush(heap, (-loose[c], c, k))
    done = sorted(((node, k) for node, k in [*done, *((node, k) for _, node, k in heap)]),
                  key=lambda found: (found[1], _along_curve(cells.corner[found[0]])))
    return np.array([node for node, _ in done], np.int32), np.array([k for _, k in done], np.int32)


def _along_curve(corner: Array) -> int:
    """Return where a cell lies on the Z-curve through the deepest cells."""
    column, line, level = (int(value) for value in corner)
    place = 0
    for bit in range(level - 1, -1, -1):
        place = 4 * place + 2 * (column >> bit & 1) + (line >> bit & 1)
    return place << 2 * (DEEPEST - level)


def _describe(cells: _Leaves, split: Array, children: _Leaves) -> None:
    """Fill what split cells know from their four children: a ball and cones around theirs."""
    four = _Leaves(*(field.reshape(-1, 4, *field.shape[1:]) for field in children))
    total, (centre, mean, normal, bent) = _means(four.power, four.centre, four.axis, four.normal, four.shading)
    bright = four.power > 0
    cells.centre[split], cells.axis[split], cells.power[split] = centre, mean, total
    cells.normal[split], cells.shading[split] = normal, bent
    cells.radius[split] = _radius(bright, four.centre, four.radius, centre)
    cells.spread[split] = _spread(bright, four.axis, four.spread, mean)
    cells.tilt[split] = _spread(bright, four.normal, four.tilt, normal)
    cells.bend[split] = _spread(bright, four.shading, four.bend, bent)
    off = four.thick + four.radius * np.minimum(1, np.linalg.norm(four.normal - normal[:, None], axis=2))
    cells.thick[split] = _thickness(bright, four.centre, off, centre, normal)
    off = four.offset + four.radius * np.minimum(1, np.linalg.norm(four.shading - bent[:, None], axis=2))
    cells.offset[split] = _thickness(bright, four.centre, off, centre, bent)
    cells.width[split] = (four.power * four.width).sum(axis=1) / np.where(total > 0, total, 1) + (total <= 0)


def _mirrors(squares: LightSquares, light: Array, cells: _Leaves, leaf: Array) -> Array:
    """Return the plane mirror that each cell nearly is; where it is not and has children, these are asked instead."""
    height = ((squares.origin[light] - cells.centre) * cells.shading).sum(axis=1)
    height[squares.kind[light] == DIRECTIONAL] = np.inf
    known = (cells.power > 0) & (height > 0)
    blur = (2 * cells.bend) ** 2 + (2 * cells.offset / np.where(known, height, 1)) ** 2
    usable = known & (leaf | (blur < FLAT**2 * cells.width))
    return np.column_stack([cells.centre, cells.shading, 1 / (cells.width + blur), usable])
