"""Interleaved sampling: each pixel of a block of n x n sums one light of n^2 (Sec. 6; Segovia et al. 2006).

Pixel (x, y) takes the lights of subset (y mod n) n + x mod n, each of them n^2 times. Pixels of one subset are kept
together, so that those of a tile share their lights; so are the packed lights of each area light and subset.
"""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from refgi.cluster.settings import MOST_BLOCK
from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.pairs.irradiance import add_lights
from refgi.pairs.pair_sum import TILE, Clamp
from refgi.pairs.pixel_lights import Packed, PackedLobes, Widening
from refgi.pairs.tiles import BLOCK
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.cluster.settings import Assignment

RUNS = 3  # of lights next to each other that a pixel takes where they are assigned by cluster
FIRST, SIZE, SUBSET = 0, 1, 2  # rows of tiles


class Subsets(NamedTuple):
    """Pixels with a surface, those of a subset after each other, in tiles that hold one subset each."""

    places: Array  # (n,) int64: flat indices of the pixels
    start: Array  # (subsets + 1,) int64: first pixel of each subset, and how many there are
    tiles: Array  # (3, T) int64: first pixel of each tile, how many it has (1 to TILE), and its subset; by place


def subsets(covered: Array, side: int) -> Subsets:
    """Sort covered pixels, (h, w) bool, by the subset of lights that they sum, in blocks of side 1 to 64 pixels."""
    expect(1 <= side <= MOST_BLOCK, "interleaving", f"1 to {MOST_BLOCK} pixels", side)
    covered = np.ascontiguousarray(covered)
    counts = np.empty(side * side, np.int64)
    _count(covered, side, counts)
    start = np.append(0, np.cumsum(counts))
    places = np.empty(start[-1], np.int64)
    _fill(covered, side, start, places)
    tiles = -(-counts // TILE)
    subset = np.repeat(np.arange(len(counts)), tiles)
    first = start[subset] + (np.arange(len(subset)) - np.repeat(np.cumsum(tiles) - tiles, tiles)) * TILE
    every = np.stack([first, np.minimum(TILE, start[subset + 1] - first), subset])
    row, column = np.divmod(places[first], covered.shape[1])
    by_place = np.lexsort((column // (side * BLOCK), row // (side * BLOCK)))  # pixels are loaded once for all subsets
    return Subsets(places, start, np.take(every, by_place, axis=1))


def assigned_subsets(area_of: Array, side: int, assignment: "Assignment") -> Array:
    """Return which subset each light belongs to, (N,) int64, 0 to n^2 - 1, for area lights C(i), (N,), and side n.

    "index": i mod n^2; "cluster": lights sorted by area light, cut into equal runs, `RUNS` to each subset. [Dong09]
    Sec. 6 does not say which. By index a pixel meets a part of nearly every area light, and pays for the visibility of
    each; by cluster it meets two to four of 30. Runs that follow each other lie far apart in the block.
    """
    count, subset_count = len(area_of), side * side
    lights = np.arange(count)
    if assignment == "index":
        return lights % subset_count
    runs = min(RUNS, max(count // subset_count, 1)) * subset_count
    subset = np.empty(count, np.int64)
    subset[np.argsort(area_of, kind="stable")] = _dithered_order(side)[lights * runs // max(count, 1) % subset_count]
    return subset


def _dithered_order(side: int) -> Array:
    """Return the places of a block in the order of Bayer's dither: halves, quarters and so on cover it evenly."""
    y, x = np.mgrid[:side, :side]
    rank = np.zeros_like(x)
    for bit in range(MOST_BLOCK.bit_length() - 1):
        rank = rank << 2 | (x ^ y) >> bit << 1 & 2 | y >> bit & 1
    return np.argsort(rank, axis=None)


@kernel(parallel=True)
def _count(covered: Array, side: int, counts: Array) -> None:
    height, width = covered.shape
    for subset in prange(side * side):
        count = 0
        for row in range(np.int64(subset) // side, height, side):
            for column in range(np.int64(subset) % side, width, side):
                count += covered[row, column]
        counts[subset] = count


@kernel(parallel=True)
def _fill(covered: Array, side: int, start: Array, places: Array) -> None:
    height, width = covered.shape
    step = side * BLOCK
    for subset in prange(side * side):
        place = start[subset]
        for top in range(np.int64(subset) // side, height, step):
            for left in range(np.int64(subset) % side, width, step):
                for row in range(top, min(top + step, height), side):
                    for column in range(left, min(left + step, width), side):
                        if covered[row, column]:
                            places[place] = row * width + column
                            place += 1


@kernel(parallel=True)
def gather_pixels(plane: Array, parts: Subsets, values: Array) -> None:
    """Copy three channels of a picture, (3, h w), into the order of subsets, `values` (3, n)."""
    tiles, places = parts.tiles, parts.places
    for t in prange(tiles.shape[1]):
        for c in range(3):
            for i in range(tiles[FIRST, t], tiles[FIRST, t] + tiles[SIZE, t]):
                values[c, i] = plane[c, places[i]]


@kernel(parallel=True)
def scatter_pixels(values: Array, parts: Subsets, factor: Any, plane: Array) -> None:
    """Copy three channels (3, n), times a factor, from the order of subsets into a picture, (3, h w)."""
    tiles, places = parts.tiles, parts.places
    for t in prange(tiles.shape[1]):
        for c in range(3):
            for i in range(tiles[FIRST, t], tiles[FIRST, t] + tiles[SIZE, t]):
                plane[c, places[i]] = values[c, i] * factor


class MemberLights(NamedTuple):
    """Lights sorted by area light, then subset, then their own order."""

    packed: Packed
    start: Array  # (M, n^2 + 1) int64: first diffuse light of each subset of an area light, and one past its last
    lobe_start: Array  # (M, n^2 + 1) int64: the same of the lobes


def member_lights(packed: Packed, area_of: Array, count: int, subset: Array, subsets: int) -> MemberLights:
    """Sort packed lights by their area light C(i), (N,), one of M (`count`), and their subset, (N,), one of n^2."""
    key = np.asarray(area_of, np.int64) * subsets + subset
    order, start = _sorted(key[packed.shines], count, subsets)
    lobe_order, lobe_start = _sorted(key[packed.glossy], count, subsets)
    with_black = np.append(order, packed.diffuse.shape[1] - 1)
    return MemberLights(
        Packed(np.ascontiguousarray(packed.diffuse[:, with_black]),
               packed.clamp and packed.clamp._replace(softness=packed.clamp.softness[with_black]),
               None if packed.spheres is None else packed.spheres[order],
               None if packed.lobes is None else _lobes(packed.lobes, lobe_order), packed.shines, packed.glossy),
        start, lobe_start)


def add_members(
    position: Array, normal: Array, parts: Subsets, members: MemberLights, m: int, irradiance: Array
) -> None:
    """Add the lights of area light m, of any kind, to each subset's receivers; `irradiance` (3, n) is 0 before."""
    for subset, (first, last) in enumerate(zip(parts.start[:-1], parts.start[1:], strict=True)):
        ends = slice(subset, subset + 2)
        some = some_lights(members.packed, members.start[m, ends], members.lobe_start[m, ends])
        if first < last and (some.diffuse.shape[1] > 1 or some.lobes is not None):
            here, facing = (np.ascontiguousarray(values[:, first:last]) for values in (position, normal))
            sums = np.zeros_like(here)
            add_lights(here, facing, some, sums)
            irradiance[:, first:last] = sums


def _sorted(key: Array, count: int, subsets: int) -> tuple[Array, Array]:
    order = np.argsort(key, kind="stable")
    edges = np.searchsorted(key[order], np.arange(count * subsets + 1))
    rows = np.arange(count)[:, None] * subsets + np.arange(subsets + 1)
    return order, np.ascontiguousarray(edges[rows])


def _lobes(lobes: PackedLobes, chosen: Array) -> PackedLobes:
    widening: Widening | None = lobes.widening
    if widening is not None:
        widening = widening._replace(cos_theta=widening.cos_theta[chosen])
    clamp: Clamp = lobes.clamp._replace(softness=lobes.clamp.softness[chosen])
    return PackedLobes(np.ascontiguousarray(lobes.lights[:, chosen]), clamp, widening)


def some_lights(packed: Packed, diffuse: Array, lobes: Array) -> Packed:
    """Return the lights from one place to another: (first, one past the last) of the diffuse ones and of the lobes."""
    chosen = np.arange(*diffuse)
    with_black = np.append(chosen, packed.diffuse.shape[1] - 1)
    glossy = np.arange(*lobes)
    return Packed(np.ascontiguousarray(packed.diffuse[:, with_black]),
                  packed.clamp and packed.clamp._replace(softness=packed.clamp.softness[with_black]),
                  None if packed.spheres is None else packed.spheres[chosen],
                  None if packed.lobes is None or len(glossy) == 0 else _lobes(packed.lobes, glossy),
                  packed.shines, packed.glossy)
