"""Irradiance from subsplats that each light refines by its own irradiance (Nichols and Wyman 2009, Sec. 3.3.1).

Every light has a list of its own, is evaluated at its own subsplats and upsampled by itself: the weights of upsampling
depend on which cells are leaves, so layers of lights with different leaves cannot be summed before. Cells of the tree
follow level by level from the coarsest, children of a cell next to each other in Morton order.
"""

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.error_target.grid import Subsplats, level_shape, representatives, top_level
from refgi.jit import kernel, prange, thread_count, threads
from refgi.pairs.glossy_sum import receiver_lobes_of
from refgi.pairs.irradiance import Receivers, checked, glossy_radiance
from refgi.rsm.buffers.leaving import GlossyPoints
from refgi.splat.multires.evaluate import evaluate, representative_points
from refgi.splat.multires.light_lists import (
    ReceiverTree,
    SubsplatLists,
    empty_lists,
    read_leaves,
    refine_for_lights,
    single_lights,
)
from refgi.splat.multires.upsample import upsample
from refgi.stages import report_progress, stage, tally
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.lights import PixelLights
    from refgi.pairs.settings import PairSettings
    from refgi.rsm import GBuffer
    from refgi.splat.multires.settings import ByIrradiance


class CellTree(NamedTuple):
    """The n cells that show a surface, of levels `top` down to the finest."""

    first: Array  # (n + 1,) int32, children of cell k are first[k] to first[k + 1] - 1
    level: Array  # (n,) uint8
    row: Array  # (n,) int32, in the grid of its level
    column: Array  # (n,) int32
    pixel: Array  # (n,) int64, flat index of the pixel that stands for it
    mask: Array  # (n,) int32, its place in the masks of all levels one after the other
    roots: int  # cells of the coarsest level, which come first
    top: int
    shape: tuple[int, int]  # (h, w) of the picture


def cell_tree(covered: Array, top: int, finest: int) -> CellTree:
    """Return the tree of the cells of levels `top` to `finest`, or of `top` alone if `finest` is coarser."""
    representative = representatives(covered, top)
    least = min(finest, top)
    count = sum(int((pixels >= 0).sum()) for pixels in representative[least:])
    first, cells = np.empty(count + 1, np.int32), np.empty((4, count), np.int32)
    pixel = np.empty(count, np.int64)
    offsets = np.cumsum([0, *(pixels.size for pixels in representative)])
    row, column = np.nonzero(representative[top] >= 0)
    roots = done = len(row)
    masks = offsets[top] + row * representative[top].shape[1] + column
    cells[:, :roots] = np.full_like(row, top), row, column, masks
    pixel[:roots] = representative[top][row, column]
    begin = 0
    for level in range(top - 1, least - 1, -1):
        begin, done = done, _append_level(representative[level], level, int(offsets[level]), begin, done, first, cells,
                                          pixel)
    first[begin:] = count
    return CellTree(first, cells[0].astype(np.uint8), cells[1], cells[2], pixel, cells[3], roots, top, covered.shape)


def subsplats_of_leaves(tree: CellTree, cells: Array) -> Subsplats:
    """Return cells of the tree (every covered pixel in exactly one, depth first) as a list of subsplats."""
    sizes = [level_shape(*tree.shape, level) for level in range(tree.top + 1)]
    flat = np.zeros(sum(h * w for h, w in sizes), np.bool_)
    flat[tree.mask[cells]] = True
    ends = np.cumsum([h * w for h, w in sizes])
    leaf = tuple(flat[end - h * w : end].reshape(h, w) for (h, w), end in zip(sizes, ends, strict=True))
    return Subsplats(tree.level[cells], tree.row[cells], tree.column[cells], tree.pixel[cells], leaf, tree.shape)


def interior_cells(tree: CellTree, subsplats: Subsplats) -> Array:
    """Return which cells of the tree a list of subsplats refines, (n,) bool: those with leaves below them."""
    leaf = np.concatenate([mask.ravel() for mask in subsplats.leaf])[tree.mask]
    interior = np.zeros(len(leaf), np.bool_)
    _mark_interior(tree.first, leaf, tree.roots, interior)
    return interior


@kernel
def _append_level(
    pixels: Array, level: int, offset: int, begin: int, end: int, first: Array, cells: Array, pixel: Array
) -> int:
    """Append the children, at `level`, of the cells begin to end - 1; return where they end."""
    height, width = pixels.shape
    done = end
    for k in range(begin, end):
        first[k] = done
        for quadrant in range(4):
            i, j = 2 * cells[1, k] + quadrant // 2, 2 * cells[2, k] + quadrant % 2
            if i < height and j < width and pixels[i, j] >= 0:
                cells[0, done], cells[1, done], cells[2, done] = level, i, j
                cells[3, done] = offset + i * width + j
                pixel[done] = pixels[i, j]
                done += 1
    return done


@kernel
def _mark_interior(first: Array, leaf: Array, roots: int, interior: Array) -> None:
    interior[:roots] = ~leaf[:roots]
    for k in range(len(leaf)):
        for child in range(first[k], first[k + 1]):
            interior[child] = interior[k] and not leaf[child]


BATCH_BYTES = 1 << 28  # bytes for the lists of a batch of lights, unless one light for each thread needs more
SMALL_PICTURE = 1 << 18  # pixels up to which threads would wait for each other longer than they upsample one light


@stage("multires.per_light", steps="refgi.splat.multires.light_steps.per_light_steps")
def per_light(
    buffer: "GBuffer", lights: "PixelLights", settings: "ByIrradiance", pairs: "PairSettings",
    footprint: Array | None = None, start: Subsplats | None = None, *, filter_all: bool = False,
    corner_rule: bool = True,
) -> Array:
    """Sum the irradiance of every light at every pixel, each from subsplats of its own.

    start: A list for all lights, of the same picture and levels, that each one goes on to refine; the coarsest cells if
        absent.
    filter_all, corner_rule: As for `upsample`.
    -> (3, h, w): Irradiance, W/m^2, linear RGB, without albedo/pi and visibility.

    Raises `InputError` as `irradiance`.

    A cell is split where max - min of any channel over its quadrants, evaluated at their representatives (the paper
    does not say where), exceeds T: `threshold` itself, that share of the largest irradiance of this light at its
    samples of the quadrants' level and above, or that share of the largest sum of all lights at the coarsest cells,
    over N. The paper's T is the first; errors of N lights may add up to N T. A threshold of 0 splits
    every cell. Samples may miss a narrow highlight, or an edge: with `start`, the authors' plan for later (Sec. 6),
    what the geometry calls for is refined in any case, and light only adds to it.

    A Phong receiver weighs each light by its direction to the eye, which no irradiance holds; `per_light_lobes` refines
    lists for what its lobe reflects.

    Lights that need no split beyond the list they started from share its leaves; they are summed before they are
    upsampled, once. All sums are compensated, in the order of the lights.
    """
    tree, lists = _leaf_lists(buffer, lights, settings, pairs, footprint, start)
    return _upsampled(tree, lists, buffer.covered, buffer.dtype, settings, start, filter_all, corner_rule)


@stage("multires.per_light_lobes")
def per_light_lobes(
    points: GlossyPoints, shape: tuple[int, int], lights: "PixelLights", settings: "ByIrradiance",
    pairs: "PairSettings", footprint: Array | None = None, start: Subsplats | None = None, *,
    filter_all: bool = False, corner_rule: bool = True,
) -> Array:
    """Sum what the lobes of glossy pixels reflect of every light, each light from subsplats of its own.

    points: The glossy pixels; of those that share a cell one stands for all, whatever their exponents.
    shape: Height and width of the picture.
    settings: Levels, threshold and upsampling; cells are of glossy pixels alone.
    start: As for `per_light`; `representative` is the pixel.
    filter_all, corner_rule: As for `upsample`.
    -> (3, h, w): Radiance towards the eye over the lobe's reflectance, W/m^2/sr; 0 where no pixel is glossy.

    Raises `InputError` as `irradiance`.

    A cell is split where max - min of that radiance over its quadrants exceeds T. The quadrants are sampled at one
    point each: a highlight narrower than a coarsest cell may lie between them, and is lost (Sec. 3.3.1 says so).
    """
    covered = covered_by(points, shape)
    tree = cell_tree(covered, top_level(*shape, settings.coarsest), settings.finest)
    place = np.searchsorted(points.pixel, tree.pixel)
    some = points.at(place)._replace(specular=np.ones((3, len(place)), points.position.dtype))
    refined = np.zeros(len(tree.level), np.bool_) if start is None else interior_cells(tree, start)
    cells = ReceiverTree(tree.first, tree.roots, some.position, some.normal, refined,
                         receiver_lobes_of(some.mirrored, some.exponent))

    def at_roots() -> Array:
        return glossy_radiance(GlossyPoints(*(np.ascontiguousarray(plane[..., : tree.roots]) for plane in some)),
                               lights, pairs, footprint)

    lists = _each_light(cells, lights, settings, pairs, footprint, at_roots)
    return _upsampled(tree, lists, covered, points.position.dtype, settings, start, filter_all, corner_rule)


def covered_by(points: GlossyPoints, shape: tuple[int, int]) -> Array:
    """Return which pixels are glossy, (h, w) bool."""
    covered = np.zeros(shape, np.bool_)
    covered.reshape(-1)[points.pixel] = True
    return covered


def _upsampled(
    tree: CellTree, lists: Iterator[tuple[Array, Array]], covered: Array, dtype: npt.DTypeLike,
    settings: "ByIrradiance", start: Subsplats | None, filter_all: bool, corner_rule: bool,
) -> Array:
    """Return the sum of all lights' leaves, each upsampled."""
    picture = _CompensatedSum((3, *tree.shape), dtype)
    shared, shared_cells = _CompensatedSum((3, 0, 0), dtype), None

    thread_count = 1 if covered.size <= SMALL_PICTURE else None

    def add(values: Array, cells: Array) -> None:
        with threads(thread_count):
            subsplats = subsplats_of_leaves(tree, cells)
            picture.add(upsample(values, subsplats, covered, settings.upsampling, filter_all=filter_all,
                                 corner_rule=corner_rule))

    least = tree.roots if start is None else len(start.level)
    for cells, values in lists:
        if len(cells) > least:
            add(values, cells)
        elif shared_cells is None:
            shared, shared_cells = _CompensatedSum((3, 1, least), dtype), cells.copy()
        if len(cells) == least:
            shared.add(values[:, None])
    if shared_cells is not None:
        add(shared.total[:, 0], shared_cells)
    return picture.total


def per_light_counts(
    buffer: "GBuffer", lights: "PixelLights", settings: "ByIrradiance", pairs: "PairSettings",
    footprint: Array | None = None, start: Subsplats | None = None,
) -> Array:
    """Return the number of subsplats of all lights on each level, (top + 1,) int64 (Table 1); see `per_light`."""
    tree, lists = _leaf_lists(buffer, lights, settings, pairs, footprint, start)
    counts = np.zeros(tree.top + 1, np.int64)
    for cells, _ in lists:
        counts += np.bincount(tree.level[cells], minlength=tree.top + 1)
    return counts


class _CompensatedSum:
    """A sum of pictures, with what each addition rounds off added to the next (Kahan 1965)."""

    def __init__(self, shape: tuple[int, ...], dtype: npt.DTypeLike) -> None:
        self.total, self._compensation = np.zeros(shape, dtype), np.zeros(shape, dtype)

    def add(self, part: Array) -> None:
        """Add a picture, (3, h, w)."""
        _add_compensated(part, self.total, self._compensation)


def _leaf_lists(
    buffer: "GBuffer", lights: "PixelLights", settings: "ByIrradiance", pairs: "PairSettings",
    footprint: Array | None, start: Subsplats | None,
) -> tuple[CellTree, Iterator[tuple[Array, Array]]]:
    """Return the tree of all cells and, for each light, its leaves (n,) and their irradiance (3, n), W/m^2."""
    height, width = buffer.covered.shape
    tree = cell_tree(buffer.covered, top_level(height, width, settings.coarsest), settings.finest)
    everywhere = Subsplats(tree.level, tree.row, tree.column, tree.pixel, (), tree.shape)
    points, normals = representative_points(buffer, everywhere, settings.representative)
    refined = np.zeros(len(tree.level), np.bool_) if start is None else interior_cells(tree, start)
    cells = ReceiverTree(tree.first, tree.roots, points, normals, refined)
    roots = slice(cells.roots)
    return tree, _each_light(cells, lights, settings, pairs, footprint,
                             lambda: evaluate(points[:, roots], normals[:, roots], lights, pairs, footprint))


def _each_light(
    cells: ReceiverTree, lights: "PixelLights", settings: "ByIrradiance", pairs: "PairSettings",
    footprint: Array | None, at_roots: Callable[[], Array],
) -> Iterator[tuple[Array, Array]]:
    points, normals = cells.points, cells.normals
    receivers = Receivers(points[:, None], normals[:, None], np.ones((1, points.shape[1]), np.bool_))
    packed = checked(receivers, lights, pairs, footprint)
    lobe_clamp, widening = (None, None) if packed.lobes is None else packed.lobes[1:]
    lights_apart = single_lights(packed)
    threshold = threshold_of(points.dtype.type, settings.threshold, settings.form, lights.position.shape[1], at_roots)
    count = len(packed.shines)
    batch = _batch_lists(count, points)
    chosen, values = np.empty(points.shape[1], np.int32), np.empty_like(points)
    for begin in range(0, count, len(batch.entries)):
        lists = SubsplatLists(*(part[: count - begin] for part in batch))
        refine_for_lights(cells, lights_apart, packed.clamp, packed.spheres, lobe_clamp, widening, begin, threshold,
                          lists)
        tally("pairs", lists.entries.sum)
        for b in range(len(lists.entries)):
            found = read_leaves(cells.first, cells.roots, lists.cell[b], lists.child[b], lists.irradiance[b], chosen,
                                values)
            yield chosen[:found], np.ascontiguousarray(values[:, :found])
        report_progress(min(1.0, (begin + len(batch.entries)) / count))


def _batch_lists(lights: int, points: Array) -> SubsplatLists:
    """Return lists for as many lights as fit in BATCH_BYTES, and at least for one for each thread."""
    one = max(1, points.shape[1] * (8 + 3 * points.itemsize))
    count = min(max(BATCH_BYTES // one, thread_count()), max(lights, 1))
    return empty_lists(count, points.shape[1], points.dtype)


def threshold_of(
    real: Any, threshold: float, form: str, count: int, at_roots: Callable[[], Array]
) -> tuple[Any, Any]:
    """Return (a, b) of T = a + b times the largest irradiance of a light's samples, of `count` lights.

    `at_roots` returns the sum of all lights at the coarsest cells, (3, n).
    """
    value, zero = real(threshold), real(0.0)
    if value == 0:  # splits every cell, those whose quadrants are all equal too
        return real(-1.0), zero
    if form == "relative":
        return zero, value
    if form == "absolute":
        return value, zero
    return value * at_roots().max(initial=zero) / real(max(1, count)), zero


@kernel(parallel=True)
def _add_compensated(part: Array, total: Array, compensation: Array) -> None:
    for i in prange(part.shape[1]):
        for c in range(3):
            for j in range(part.shape[2]):
                added = part[c, i, j] - compensation[c, i, j]
                new = total[c, i, j] + added
                compensation[c, i, j] = (new - total[c, i, j]) - added
                total[c, i, j] = new
