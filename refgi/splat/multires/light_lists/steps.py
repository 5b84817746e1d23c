"""Lists of each light's own one step after the other: samples at quadrants, cells that they split, lists, pictures.

- pixels tuple of (h_l, w_l): Representative pixel of each cell of levels 0 to top, -1 without surface.
"""

import itertools
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from refgi.error_target.grid import Subsplats, representatives, top_level
from refgi.pairs.pixel_lights import PixelLights
from refgi.pairs.settings import PairSettings
from refgi.splat.multires.light_lists.lists import (
    CellTree,
    ReceiverTree,
    append_children,
    cell_tree,
    interior_cells,
    keep_split,
)
from refgi.splat.multires.light_lists.per_light import threshold_of
from refgi.splat.multires.refinement.steps import subsplats_of
from refgi.splat.multires.settings import Representative, Upsampling
from refgi.splat.multires.subsplats.evaluate import points_of, sum_at
from refgi.splat.multires.subsplats.steps import area_read, arrays_of
from refgi.splat.multires.subsplats.upsample import picture_of
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.rsm import GBuffer
    from refgi.splat.multires.settings import ByIrradiance
Levels = tuple[Array, ...]


@stage("multires.samples", kept=False)
def samples(
    position: Array, normal: Array, pixels: Levels, light_position: Array, light_normal: Array, flux: Array,
    lobe_flux: Array | None, lobe_axis: Array | None, lobe_exponent: Array | None, area: Array | None,
    pairs: PairSettings, representative: Representative,
) -> dict[int, Array]:
    """Sum the irradiance of each light alone at every cell (AMS Eq. 2; E-AMS-02).

    area (light,): Surface that each stands for, m^2, where the clamp reads it.
    representative: Whether a cell is its representative pixel, or its mean surface.
    -> dict of (light, rgb, h_l, w_l): Irradiance of each light, W/m^2, by level; 0 without surface.
    """
    made = {}
    for level, pixel in enumerate(pixels):
        row, column = np.nonzero(pixel >= 0)
        cells = Subsplats(np.full(len(row), level), row, column, pixel[row, column], (), pixels[0].shape)
        points, normals = points_of(position, normal, pixels[0] >= 0, cells, representative)
        made[level] = np.zeros((flux.shape[1], 3, *pixel.shape), position.dtype)
        for k in range(flux.shape[1]):
            only = (None if part is None else np.ascontiguousarray(part[..., k : k + 1]) for part in (
                light_position, light_normal, flux, lobe_flux, lobe_axis, lobe_exponent))
            made[level][k][:, row, column] = sum_at(points, normals, PixelLights._make((*only, 1, None, None, None)),
                                                    pairs, None if area is None else area[k : k + 1])
    return made


@stage("multires.splits", kept=False)
def splits(
    pixels: Levels, sampled: Levels, finest: int, threshold: float, form: Literal["relative", "absolute", "brightest"],
    start: tuple[Array, Array, Array] | None = None,
) -> dict[int, Array]:
    """Find the cells that each light splits: max - min of a channel over its quadrants exceeds T (AMS Sec. 3.3.1).

    sampled tuple of (light, 3, h_l, w_l): Irradiance of each light there, W/m^2.
    finest: Finest level.
    threshold: T in W/m^2, or the share that it is of this.
    form: Of the largest channel of the light's samples at the quadrants' level and above ("relative"), of none, or of
        the largest sum of all lights at the coarsest cells over their number.
    start tuple of (subsplat): Level, row and column of the list of all lights that each goes on to refine.
    -> dict of (light, h_l, w_l) bool: Whether the cell is split, by level; false where the list does not come to it.
    """
    top, covered = len(pixels) - 1, pixels[0] >= 0
    tree, count, real = cell_tree(covered, top, finest), len(sampled[0]), sampled[0].dtype
    refined = np.zeros(len(tree.level), np.bool_) if start is None else interior_cells(
        tree, subsplats_of(covered, *start, top))
    cells = ReceiverTree(tree.first, tree.roots, np.zeros((3, 0), real), np.zeros((3, 0), real), refined)
    offset, share = threshold_of(real.type, threshold, form, count, lambda: sampled[top].sum(axis=0))
    made = {level: np.zeros((count, *pixels[level].shape), np.bool_) for level in range(1, top + 1)}
    for k in range(count):
        light = np.zeros((3, len(tree.level)), real)
        for level in range(top + 1):
            here = tree.level == level
            light[:, here] = sampled[level][k][:, tree.row[here], tree.column[here]]
        for cell in _split_cells(cells, light, offset, share):
            made[int(tree.level[cell])][k, tree.row[cell], tree.column[cell]] = True
    return made


def _split_cells(cells: ReceiverTree, light: Array, offset: Any, share: Any) -> Array:
    """Return the cells of a tree that one light's list splits, level after level, by its light (3, n) at all."""
    cell, child = np.empty(len(cells.refined), np.int32), np.full(len(cells.refined), -1, np.int32)
    listed = np.empty_like(light)
    cell[: cells.roots] = np.arange(cells.roots)
    start, last, stop, largest = 0, 0, cells.roots, light.dtype.type(0)
    while last < stop:
        listed[:, last:stop] = light[:, cell[last:stop]]
        largest, end = max(largest, listed[:, last:stop].max()), stop
        if last > 0:
            end = keep_split(cells, cell, child, listed, start, last, offset + share * largest)
        start, last = last, end
        stop = append_children(cells.first, cell, start, last)
    return cell[:last][child[:last] >= 0]


@stage("multires.lists", kept=False)
def lists(pixels: Levels, sampled: Levels, split_levels: Levels) -> tuple[Array, Array, Array, Array, Array]:
    """List each light's subsplats: cells that are not split, but whose coarser cell is (AMS Sec. 3.3.1).

    sampled tuple of (light, 3, h_l, w_l): Irradiance of each light there, W/m^2.
    split_levels tuple of (light, h_l, w_l) bool: Cells of levels 1 to top that each light splits.
    -> first (light and one more) int64: Where each light's list begins, and the end.
    -> level (subsplat) uint8: Level: cell of 2^level pixels a side. Light by light, coarsest level first, row by row.
    -> row (subsplat) int32: Row in the grid of its level.
    -> column (subsplat) int32: Column in the grid of its level.
    -> irradiance (rgb, subsplat): Irradiance of its light there, W/m^2.
    """
    top = len(pixels) - 1
    tree = cell_tree(pixels[0] >= 0, top, 0)
    parent = np.repeat(np.arange(len(tree.level)), np.diff(tree.first))  # of all cells but the coarsest
    order = np.lexsort((tree.column, tree.row, -tree.level.astype(np.int64)))
    cells, light = [np.zeros(0, np.int64)], [np.zeros((3, 0), sampled[0].dtype)]
    for k in range(len(sampled[0])):
        split = _of_tree(tree, [np.zeros_like(pixels[0], np.bool_), *(one[k] for one in split_levels)])
        leaf = ~split
        leaf[tree.roots :] &= split[parent]
        cells.append(order[leaf[order]])
        light.append(_of_tree(tree, [one[k] for one in sampled])[:, cells[-1]])
    chosen = np.concatenate(cells)
    return (np.cumsum([len(one) for one in cells]), tree.level[chosen], tree.row[chosen], tree.column[chosen],
            np.concatenate(light, axis=1))


def _of_tree(tree: CellTree, planes: list[Array]) -> Array:
    """Return the values (..., n) that levels have at the cells of a tree."""
    made = np.empty((*planes[0].shape[:-2], len(tree.level)), planes[0].dtype)
    for level, plane in enumerate(planes):
        here = tree.level == level
        made[..., here] = plane[..., tree.row[here], tree.column[here]]
    return made


@stage("multires.sum_of_pictures", kept=False)
def sum_of_pictures(
    covered: Array, first: Array, level: Array, row: Array, column: Array, irradiance: Array, top: int,
    mode: Upsampling, filter_all: bool, corner_rule: bool,
) -> Array:
    """Upsample each light's subsplats by themselves, coarsest level first, and add (AMS Sec. 3.3.1, 3.5; E-AMS-09).

    first (N + 1,): Where each light's list begins.
    level, row, column (subsplat) int: The lists of all lights.
    irradiance (rgb, subsplat): Their light, W/m^2.
    mode: Filter from level to level.
    filter_all, corner_rule: Whether leaves are filtered too; whether a cell across a corner counts only beside one that
        counts.
    -> (rgb, h, w): Indirect irradiance, W/m^2; 0 without surface.
    """
    total = np.zeros((3, *covered.shape), irradiance.dtype)
    for begin, end in itertools.pairwise(first):
        listed = subsplats_of(covered, level[begin:end], row[begin:end], column[begin:end], top)
        total += picture_of(np.ascontiguousarray(irradiance[:, begin:end]), listed, covered, mode, filter_all,
                            corner_rule)
    return total


def per_light_steps(
    buffer: "GBuffer", lights: PixelLights, settings: "ByIrradiance", pairs: PairSettings,
    footprint: Array | None = None, start: Subsplats | None = None, *, filter_all: bool = False,
    corner_rule: bool = True,
) -> Array:
    """Return the picture of all lights, each from subsplats of its own, made by steps."""
    top = top_level(buffer.height, buffer.width, settings.coarsest)
    pixels = representatives(buffer.covered, top)
    sampled = tuple(samples(buffer.position, buffer.normal, pixels, *arrays_of(lights), area_read(footprint, pairs),
                            pairs, settings.representative).values())
    split = splits(pixels, sampled, settings.finest, settings.threshold, settings.form,
                   None if start is None else start[:3])
    listed = lists(pixels, sampled, tuple(split.values()))
    return sum_of_pictures(buffer.covered, *listed, top, settings.upsampling, filter_all, corner_rule)
