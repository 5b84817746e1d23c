"""Refinement one step after the other: mipmaps, discontinuous cells, states of cells, the list of subsplats."""

from typing import TYPE_CHECKING, Any

import numpy as np

from refgi.error_target.grid import START, Subsplats, element_count, layout, level_shape, level_views
from refgi.splat.multires.refinement.criteria import (
    depth_ranges,
    mark_curvatures,
    mark_depth_ranges,
    mark_depth_slopes,
    mark_normal_ranges,
    normal_ranges,
)
from refgi.splat.multires.refinement.derivatives import curvatures, depth_slopes
from refgi.splat.multires.refinement.refine import CellStates, classify_cells, depth_first, pass_by_pass
from refgi.splat.multires.settings import Chord, DepthRange, DepthSlope, Diagonal, Measure, NormalRange, Traversal
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.rsm import GBuffer
    from refgi.splat.multires.settings import Criteria
Levels = tuple[Array, ...]


@stage("multires.discontinuities", kept=False)
def discontinuities(
    top: int, finest: int, shape: tuple[int, int], depth_least: Levels | None = None,
    depth_largest: Levels | None = None, slope: Levels | None = None, normal_least: Levels | None = None,
    normal_largest: Levels | None = None, curvature: Levels | None = None, depth_threshold: float = 0.0,
    slope_threshold: float = 0.0, normal_threshold: float = 0.0, curvature_threshold: float = 0.0,
    depth_measure: Measure = "relative", slope_measure: Measure = "relative",
) -> dict[int, Array]:
    """Mark the cells that any test finds discontinuous (AMS Sec. 3.2, 3.3; E-AMS-07).

    top, finest: Coarsest and finest level.
    shape: Rows and columns of the picture.
    depth_least, depth_largest tuple of (h_l, w_l): Range of depths of levels 1 to `top`, m; None where there is no such
        test.
    slope tuple of (h_l, w_l): Steepest change of depth.
    normal_least, normal_largest tuple of (xyz, h_l, w_l): Range of the components of normals.
    curvature tuple of (h_l, w_l): Largest change between neighbouring normals.
    depth_threshold, slope_threshold, normal_threshold, curvature_threshold: Threshold of each test.
    depth_measure, slope_measure: What the threshold of a test of depths is a multiple of.
    -> dict of (h_l, w_l) bool: True where a test exceeds its threshold, by level.
    """
    sizes = layout(*shape, top, first=1)
    found = np.zeros(element_count(sizes), np.bool_)
    begin = int(sizes[finest + 1, START]) if finest < top else len(found)
    if begin < len(found):
        if depth_least is not None and depth_largest is not None:
            mark_depth_ranges(_joined(depth_least), _joined(depth_largest), DepthRange(depth_threshold, depth_measure),
                              sizes, found, begin)
        if slope is not None:
            mark_depth_slopes(_joined(slope), DepthSlope(slope_threshold, slope_measure), sizes, found, begin)
        if normal_least is not None and normal_largest is not None:
            mark_normal_ranges(_joined(normal_least), _joined(normal_largest), NormalRange(normal_threshold), found,
                               begin)
        if curvature is not None:
            mark_curvatures(_joined(curvature), Chord(curvature_threshold), found, begin)
    return dict(enumerate(level_views(found, sizes, first=1), start=1))


def _joined(levels: Levels) -> Array:
    """Return levels (..., h_l, w_l) one after the other, (c, n)."""
    return np.concatenate([one.reshape(-1, one.shape[-2] * one.shape[-1]) for one in levels], axis=1)


def discontinuity_steps(buffer: "GBuffer", criteria: "Criteria", top: int, finest: int = 0) -> Levels:
    """Return which cells of each level hold a discontinuity, made by steps."""
    covered = buffer.covered
    if top == 0:
        return (np.zeros(covered.shape, np.bool_),)
    found: dict[str, Any] = {}
    if criteria.depth is not None:
        mip = depth_ranges(buffer.depth, covered, top, criteria.rim)
        found |= {"depth_least": mip.low[1:], "depth_largest": mip.high[1:],
                  "depth_threshold": criteria.depth.threshold, "depth_measure": criteria.depth.measure}
    if criteria.normal is not None:
        mip = normal_ranges(buffer.normal, covered, top, criteria.rim, len(criteria.normal.components))
        found |= {"normal_least": mip.low[1:], "normal_largest": mip.high[1:],
                  "normal_threshold": criteria.normal.threshold}
    if criteria.derivative is not None:
        slope = criteria.derivative
        mip = depth_slopes(buffer.depth, covered, top, slope.measure != "absolute")
        found |= {"slope": mip.high[1:], "slope_threshold": slope.threshold, "slope_measure": slope.measure}
    if criteria.curvature is not None:
        mip = curvatures(buffer.normal, buffer.position, covered, top, criteria.curvature.name() == "rate")
        found |= {"curvature": mip.high[1:], "curvature_threshold": criteria.curvature.threshold}
    height, width = covered.shape
    return (np.zeros(covered.shape, np.bool_), *discontinuities(top, finest, (height, width), **found).values())


@stage("multires.states", kept=False)
def states(discontinuous: Levels, covered: Array, diagonal: Diagonal) -> dict[int, Array]:
    """Find which cells are refined, by their own need or across a corner (AMS Sec. 3.3, 5.2; E-AMS-10).

    discontinuous tuple of (h_l, w_l) bool: Discontinuous cells of levels 1 to top.
    diagonal: Neighbours across a corner that count.
    -> dict of (h_l, w_l) uint8: 0 no surface, 1 a subsplat may end here, 2 refined, by level.
    """
    cells = classify_cells((np.zeros_like(covered), *discontinuous), covered, diagonal)
    return dict(enumerate(level_views(cells.state, cells.sizes, first=1), start=1))


@stage("multires.subsplats", kept=False)
def subsplats(covered: Array, cell_states: Levels, traversal: Traversal) -> tuple[Array, Array, Array, Array]:
    """List the subsplats, depth first within the coarsest cells row by row (AMS Sec. 3.3; E-AMS-08, E-AMS-11).

    cell_states tuple of (h_l, w_l) uint8: States of the cells of levels 1 to top.
    traversal: Depth first, or pass by pass: the same list.
    -> level (subsplat) uint8: Level: cell of 2^level pixels a side. A cell's four follow top left, top right, bottom
        left, bottom right.
    -> row (subsplat) int32: Row in the grid of its level.
    -> column (subsplat) int32: Column in the grid of its level.
    -> pixel (subsplat) int64: Row * width + column of the pixel right and below of the cell's centre, or of the nearest
        that shows a surface, the first of several.
    """
    (height, width), top = covered.shape, len(cell_states)
    flat = np.concatenate([np.zeros(0, np.uint8), *(one.reshape(-1) for one in cell_states)])
    cells = CellStates(np.ascontiguousarray(covered), flat, layout(height, width, top, first=1),
                       layout(height, width, top))
    return (pass_by_pass(cells) if traversal == "list" else depth_first(cells))[:4]


def refine_steps(
    discontinuous: Levels, covered: Array, diagonal: Diagonal = "corner", traversal: Traversal = "single_pass"
) -> dict[str, Array]:
    """Return the list of subsplats, made by steps."""
    columns = subsplats(covered, tuple(states(discontinuous[1:], covered, diagonal).values()), traversal)
    return dict(zip(Subsplats._fields, columns, strict=False))


def subsplats_of(covered: Array, level: Array, row: Array, column: Array, top: int) -> Subsplats:
    """Return a list of subsplats of levels up to `top` with its masks; without pixels, which only points ask for."""
    leaf = tuple(np.zeros(level_shape(covered.shape[0], covered.shape[1], one), np.bool_) for one in range(top + 1))
    for k in range(len(level)):
        leaf[level[k]][row[k], column[k]] = True
    return Subsplats(level.astype(np.uint8), row, column, np.zeros(len(level), np.int64), leaf, covered.shape)
