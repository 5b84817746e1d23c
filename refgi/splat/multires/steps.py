"""Subsplats one step after the other: discontinuous cells, the list, points, Eq. 2 at them, levels of the picture.

- level, row, column (subsplat) int: The list of subsplats.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from refgi.error_target.grid import START, Subsplats, element_count, layout, level_shape, level_views
from refgi.pairs.pixel_lights import PixelLights
from refgi.pairs.settings import PairSettings
from refgi.splat.multires.criteria import mark, mipmap_of
from refgi.splat.multires.evaluate import points_of, sum_at
from refgi.splat.multires.refine import CellStates, classify_cells, depth_first, pass_by_pass
from refgi.splat.multires.settings import (
    Chord,
    DepthRange,
    DepthSlope,
    Diagonal,
    Measure,
    NormalRange,
    Representative,
    Traversal,
    Upsampling,
)
from refgi.splat.multires.upsample import (
    black_level,
    demo_level,
    filled_cells,
    interpolated_apart,
    of_own_subsplat,
    sorted_by_row,
    tent_level,
)
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
        for low, high, criterion in ((depth_least, depth_largest, DepthRange(depth_threshold, depth_measure)),
                                     (None, slope, DepthSlope(slope_threshold, slope_measure)),
                                     (normal_least, normal_largest, NormalRange(normal_threshold)),
                                     (None, curvature, Chord(curvature_threshold))):
            if high is not None:
                mark(None if low is None else _joined(low), _joined(high), criterion, sizes, found, begin)
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
    for name, key in (("depth", "depth"), ("normal", "normal"), ("derivative", "slope"), ("curvature", "curvature")):
        criterion = getattr(criteria, name)
        if criterion is not None:
            mip = mipmap_of(name, buffer, criteria, top)
            found |= {f"{key}_least": mip.low[1:], f"{key}_largest": mip.high[1:]} if mip.low else {key: mip.high[1:]}
            found |= {f"{key}_{part}": getattr(criterion, part) for part in ("threshold", "measure")
                      if hasattr(criterion, part)}
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


@stage("multires.points", kept=False)
def points(
    position: Array, normal: Array, covered: Array, level: Array, row: Array, column: Array, pixel: Array,
    representative: Representative,
) -> tuple[Array, Array]:
    """Find the point and normal that each subsplat is evaluated at (AMS Sec. 3.4; E-AMS-11).

    pixel (subsplat) int: Each one's representative.
    representative: Its representative pixel's, or the mean surface's.
    -> point (xyz, subsplat): Surface point, m.
    -> normal (xyz, subsplat): Its unit normal.
    """
    cells = Subsplats(level, row, column, pixel, (), covered.shape)
    return points_of(position, normal, covered, cells, representative)


def point_steps(
    buffer: "GBuffer", subsplats: Subsplats, representative: Representative = "pixel"
) -> tuple[Array, Array]:
    """Return points and normals of subsplats, made by a step."""
    return points(buffer.position, buffer.normal, buffer.covered, *subsplats[:4], representative)


@stage("multires.subsplat_irradiance", kept=False)
def subsplat_irradiance(
    point: Array, point_normal: Array, light_position: Array, light_normal: Array, flux: Array,
    lobe_flux: Array | None, lobe_axis: Array | None, lobe_exponent: Array | None, area: Array | None,
    pairs: PairSettings,
) -> Array:
    """Sum the irradiance of every pixel light at every subsplat, without albedo/pi (AMS Eq. 2; E-AMS-02).

    point (3, n): Surface points, m.
    point_normal (3, n): Unit normals.
    area (light,): Surface that each stands for, m^2, where the clamp reads it.
    -> (rgb, subsplat): Indirect irradiance, W/m^2.
    """
    lights = PixelLights(light_position, light_normal, flux, lobe_flux, lobe_axis, lobe_exponent, flux.shape[1])
    return sum_at(point, point_normal, lights, pairs, area)


def evaluate_steps(
    points: Array, normals: Array, lights: PixelLights, settings: PairSettings, footprint: Array | None = None,
    lightcuts: Any = None,
) -> Array:
    """Return the light at subsplats, made by a step that sums all lights."""
    del lightcuts  # change the sum by less than their error
    return subsplat_irradiance(points, normals, *arrays_of(lights), area_read(footprint, settings), settings)


def arrays_of(lights: PixelLights) -> tuple[Array, Array, Array, Array | None, Array | None, Array | None]:
    """Return what sums read of pixel lights."""
    return (lights.position, lights.normal, lights.flux, lights.lobe_flux, lights.lobe_axis, lights.lobe_exponent)


def area_read(footprint: Array | None, pairs: PairSettings) -> Array | None:
    """Return the surfaces that lights stand for where the clamp reads them."""
    return footprint if pairs.needs_footprints else None


@stage("multires.upsample_level", kept=False, each="level")
def upsample_level(
    covered: Array, level: Array, row: Array, column: Array, irradiance: Array, at: int, mode: Upsampling,
    filter_all: bool, corner_rule: bool, coarse: Array | None = None, coarse_known: Array | None = None,
) -> tuple[Array, Array]:
    """Make the light of a level from that of the level above and subsplats (AMS Sec. 3.5; E-AMS-09).

    irradiance (rgb, subsplat): Light at the subsplats, W/m^2.
    at: The level.
    mode: Weights (1, 2, 1) x (1, 2, 1) of the level itself ("tent"), or (1 - f, 1, f) / 2 on the coarser level
        ("demo").
    filter_all, corner_rule: Whether leaves are filtered too; whether a cell across a corner counts only beside one that
        counts.
    coarse (3, h', w'): Light of the level above, W/m^2; none above the coarsest.
    coarse_known (h', w') bool: Its cells with light.
    -> light (rgb, h_l, w_l): Indirect irradiance, W/m^2; 0 where the mask is false.
    -> known (h_l, w_l) bool: Cells with light: evaluated here or coarser, with surface.
    """
    top = max(int(level.max(initial=0)), at + (coarse is not None))
    listed, filled = subsplats_of(covered, level, row, column, top), filled_cells(covered, at)[at]
    above = black_level(filled, irradiance.dtype) if coarse is None or coarse_known is None else (coarse, coarse_known)
    if mode == "demo":
        return demo_level(irradiance, listed, at, above, filled, filter_all)
    return tent_level(irradiance, column, sorted_by_row(listed), at, above, filled, filter_all, corner_rule)


@stage("multires.upsample_at_once", kept=False)
def upsample_at_once(
    covered: Array, level: Array, row: Array, column: Array, irradiance: Array, top: int, mode: Upsampling
) -> Array:
    """Fill pixels from subsplats without levels (AMS Sec. 3.5, Fig. 7).

    irradiance (rgb, subsplat): Light at the subsplats, W/m^2.
    mode: Each pixel has the light of its subsplat ("nearest"), or the sum of all levels, each interpolated as if it
        were black where it holds nothing ("naive_bilinear").
    -> (rgb, h, w): Indirect irradiance, W/m^2; 0 without surface.
    """
    if mode == "nearest":
        return of_own_subsplat(irradiance, level, row, column, covered)
    return interpolated_apart(irradiance, subsplats_of(covered, level, row, column, top), covered)


def upsample_steps(
    values: Array, subsplats: Subsplats, covered: Array, mode: Upsampling = "tent", *, filter_all: bool = False,
    corner_rule: bool = True,
) -> Array:
    """Return the picture of subsplats, made level by level where the mode has levels."""
    listed = (covered, *subsplats[:3], values)
    if mode not in ("tent", "demo"):
        return upsample_at_once(*listed, subsplats.top, mode)
    above: tuple[Array, ...] = ()
    for level in range(subsplats.top, -1, -1):
        above = upsample_level(*listed, level, mode, filter_all, corner_rule, *above)
    return above[0]
