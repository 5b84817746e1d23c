"""Irradiance from subsplats that each light refines for itself, by its own light (Sec. 3.3.1).

Every light has a list of its own, is lit at its own subsplats and upsampled by itself: the weights of upsampling
depend on which cells are leaves, so levels of lights with different leaves cannot be added up before. Lights go in
batches, whose lists fit in a room of fixed size however many lights there are.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numba
import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange, threads
from refgi.pairs.irradiance import Receivers, checked
from refgi.splat.multires.light_lists.lists import Cells, Lists, leaves, refine_for_lights, room_for
from refgi.splat.multires.light_lists.one_light import separate
from refgi.splat.multires.light_lists.tree import Tree, above_leaves, cell_tree, cut
from refgi.splat.multires.refinement.grid import Subsplats, top_level
from refgi.splat.multires.subsplats.evaluate import at_subsplats, evaluate
from refgi.splat.multires.subsplats.upsample import upsample
from refgi.stages import report_progress, stage

if TYPE_CHECKING:
    from refgi.lights import PixelLights
    from refgi.rsm import GBuffer
    from refgi.splat.multires.settings import MultiresSettings

Array = npt.NDArray[Any]

ROOM = 1 << 28  # bytes for the lists of a batch of lights, unless one light for each thread needs more
SMALL_PICTURE = 1 << 18  # pixels up to which threads would wait for each other longer than they upsample one light


@stage("splat.per_light")
def per_light(
    buffer: "GBuffer", lights: "PixelLights", settings: "MultiresSettings", footprint: Array | None = None,
    start: Subsplats | None = None,
) -> Array:
    """Sum the irradiance of every light at every pixel, each from subsplats of its own.

    Parameters
    ----------
    buffer : GBuffer
        What the camera sees.
    lights : PixelLights
        Lights to sum, diffuse, glossy or both.
    settings : MultiresSettings
        Levels, threshold, upsampling, and how one light lights one receiver.
    footprint : (N,) ndarray, optional
        Surface area each light stands for, m^2; needed by the clamps "disc" and "sphere" alone.
    start : Subsplats, optional
        A list for all lights, of the same picture and levels, that each one goes on to refine; the coarsest cells if
        absent.

    Returns
    -------
    (3, h, w) ndarray
        Irradiance, W/m^2, linear RGB, without albedo/pi and visibility.

    Raises
    ------
    InputError
        As `irradiance`.

    Notes
    -----
    A cell is split where max - min of any channel over its quadrants, lit at the pixels that stand for these
    (the paper does not say where), exceeds T: `light_threshold` itself, that share of the largest irradiance that this
    light was seen to cause at the quadrants' level and above, or that share of the largest sum of all lights at the
    coarsest cells, over N. The paper's T is the first; errors of N lights may add up to N T. A threshold of 0 splits
    every cell. Samples may miss a narrow highlight, or an edge: with `start`, the authors' plan for later (Sec. 6),
    what the geometry calls for is refined in any case, and light only adds to it.

    Receivers are diffuse, as they are for every method: a Phong receiver weighs each light by its direction to the
    eye, which no irradiance holds. That would take the radiance towards the eye beside the irradiance, from here, from
    `Frame.radiance` and from the truth alike.

    Lights that need no split beyond the list they started from share its leaves; they are added up before they are
    upsampled, once. All sums are compensated, in the order of the lights.
    """
    tree, lists = _lists(buffer, lights, settings, footprint, start)
    filter_all = "ams_filter_all" in settings.as_published
    picture = _Sum((3, *tree.shape), buffer.dtype)
    shared, shared_cells = _Sum((3, 0, 0), buffer.dtype), None

    few = 1 if buffer.covered.size <= SMALL_PICTURE else None

    def add(values: Array, cells: Array) -> None:
        with threads(few):
            picture.add(upsample(values, cut(tree, cells), buffer.covered, settings.upsampling, filter_all=filter_all))

    least = tree.roots if start is None else len(start.level)
    for cells, values in lists:
        if len(cells) > least:
            add(values, cells)
        elif shared_cells is None:
            shared, shared_cells = _Sum((3, 1, least), buffer.dtype), cells.copy()
        if len(cells) == least:
            shared.add(values[:, None])
    if shared_cells is not None:
        add(shared.total[:, 0], shared_cells)
    return picture.total


def per_light_counts(
    buffer: "GBuffer", lights: "PixelLights", settings: "MultiresSettings", footprint: Array | None = None,
    start: Subsplats | None = None,
) -> Array:
    """Count the subsplats of all lights on each level (Table 1).

    Parameters
    ----------
    buffer : GBuffer
        What the camera sees.
    lights : PixelLights
        Lights.
    settings : MultiresSettings
        Levels, threshold, and how one light lights one receiver.
    footprint : (N,) ndarray, optional
        Surface area each light stands for, m^2.
    start : Subsplats, optional
        A list that each light goes on to refine.

    Returns
    -------
    (top + 1,) ndarray of int64
        Subsplats of levels 0 to the coarsest.
    """
    tree, lists = _lists(buffer, lights, settings, footprint, start)
    counts = np.zeros(tree.top + 1, np.int64)
    for cells, _ in lists:
        counts += np.bincount(tree.level[cells], minlength=tree.top + 1)
    return counts


class _Sum:
    """A sum of pictures, with what each addition rounds off added to the next (Kahan 1965)."""

    def __init__(self, shape: tuple[int, ...], dtype: npt.DTypeLike) -> None:
        self.total, self._lost = np.zeros(shape, dtype), np.zeros(shape, dtype)

    def add(self, part: Array) -> None:
        """Add a picture, (3, h, w)."""
        _add(part, self.total, self._lost)


def _lists(
    buffer: "GBuffer", lights: "PixelLights", settings: "MultiresSettings", footprint: Array | None,
    start: Subsplats | None,
) -> tuple[Tree, Iterator[tuple[Array, Array]]]:
    """Return all cells, and for each light its leaves among them and their irradiance, (n,) and (3, n)."""
    height, width = buffer.covered.shape
    tree = cell_tree(buffer.covered, top_level(height, width, settings.coarsest), settings.finest)
    everywhere = Subsplats(tree.level, tree.row, tree.column, tree.pixel, (), tree.shape)
    points, normals = at_subsplats(buffer, everywhere, settings.representative)
    refined = np.zeros(len(tree.level), np.bool_) if start is None else above_leaves(tree, start)
    cells = Cells(tree.first, tree.roots, points, normals, refined)
    return tree, _each_light(cells, lights, settings, footprint)


def _each_light(
    cells: Cells, lights: "PixelLights", settings: "MultiresSettings", footprint: Array | None
) -> Iterator[tuple[Array, Array]]:
    points, normals = cells.points, cells.normals
    receivers = Receivers(points[:, None], normals[:, None], np.ones((1, points.shape[1]), np.bool_))
    packed = checked(receivers, lights, settings.effective_pairs, footprint)
    lobe_clamp, widening = (None, None) if packed.lobes is None else packed.lobes[1:]
    one_by_one, threshold = separate(packed), _threshold(cells, lights, settings, footprint)
    count = len(packed.shines)
    room = _room(count, points)
    chosen, values = np.empty(points.shape[1], np.int32), np.empty_like(points)
    for begin in range(0, count, len(room.entries)):
        lists = Lists(*(part[: count - begin] for part in room))
        refine_for_lights(cells, one_by_one, packed.clamp, packed.spheres, lobe_clamp, widening, begin, threshold,
                          lists)
        for b in range(len(lists.entries)):
            found = leaves(cells.first, cells.roots, lists.cell[b], lists.child[b], lists.light[b], chosen, values)
            yield chosen[:found], np.ascontiguousarray(values[:, :found])
        report_progress(min(1.0, (begin + len(room.entries)) / count))


def _room(lights: int, points: Array) -> Lists:
    """Return room for as many lists as fit, and at least one for each thread."""
    one = max(1, points.shape[1] * (8 + 3 * points.itemsize))
    return room_for(min(max(ROOM // one, numba.get_num_threads()), max(lights, 1)), points.shape[1], points.dtype)


def _threshold(
    cells: Cells, lights: "PixelLights", settings: "MultiresSettings", footprint: Array | None
) -> tuple[Any, Any]:
    """Return (a, b) of T = a + b times the largest irradiance seen."""
    real = cells.points.dtype.type
    given, zero = real(settings.light_threshold), real(0.0)
    if given == 0:  # splits every cell, those whose quadrants are all alike too
        return real(-1.0), zero
    if settings.threshold_form == "relative":
        return zero, given
    if settings.threshold_form == "absolute":
        return given, zero
    roots = slice(cells.roots)
    sums = evaluate(cells.points[:, roots], cells.normals[:, roots], lights, settings.effective_pairs, footprint)
    return given * sums.max(initial=zero) / real(max(1, lights.position.shape[1])), zero


@kernel(parallel=True)
def _add(part: Array, total: Array, lost: Array) -> None:
    for i in prange(part.shape[1]):
        for c in range(3):
            for j in range(part.shape[2]):
                added = part[c, i, j] - lost[c, i, j]
                new = total[c, i, j] + added
                lost[c, i, j] = (new - total[c, i, j]) - added
                total[c, i, j] = new
