"""One trial of a threshold: which cells it splits, what is lit for that and what the picture would miss.

A cell is split where stopping would cost more than the threshold, as a sum over its pixels of two squares: of the light
its normals' interpolation loses (`interpolate`, times the light around), and of what light was seen to differ by from
the coarser level's interpolation, at its own pixel or half of that at its neighbours'.

Levels, and light once it is known, stay from trial to trial in the same memory.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange, threads
from refgi.pairs.irradiance import Receivers, add_lights
from refgi.pairs.packing import Packed
from refgi.pairs.tiles import put, taken
from refgi.rsm.memory import plane
from refgi.splat.multires.error_target.descent import assemble, begin, descend, misses
from refgi.splat.multires.error_target.interpolate import Level, blends
from refgi.splat.multires.error_target.near import NearLight
from refgi.stages import stage

Array = npt.NDArray[Any]

SQUARE = 32  # cells along a square within which lit pixels keep together


class Known:
    """Light at pixels, each evaluated when first asked for and never again.

    Parameters
    ----------
    receivers : Receivers
        The picture's points; contiguous.
    packed : Packed
        The lights.
    """

    def __init__(self, receivers: Receivers, packed: Packed) -> None:
        self._receivers, self._packed = receivers, packed
        self.has = np.zeros(receivers.covered.size, np.bool_)
        self.exact = plane(receivers.position.shape, receivers.position.dtype)  # (3, h, w), W/m^2, where it has any
        self._room, self._path = plane((self.has.size,), np.int64), _path()

    def light(self, pixel: Array) -> None:
        """Light pixels that were not yet; neighbours should follow each other."""
        if len(pixel):
            points, normals = taken(self._receivers.position, pixel), taken(self._receivers.normal, pixel)
            sums = np.zeros_like(points)
            add_lights(points, normals, self._packed, sums)
            put(self.exact, pixel, sums)
            self.has[pixel] = True

    def missing(self, split: Array, level: Level) -> Array:
        """Return the pixels that stand for children of split cells and were not lit; holds until the next call."""
        return self._room[: _list(split, level.covered, level.place, self.has, self._path, self._room)]

    def at(self, pixel: Array) -> Array:
        """Return the light of pixels that were lit, (3, n)."""
        return taken(self.exact, pixel)


class Trials:
    """Refinement of a picture by one threshold after the other.

    Parameters
    ----------
    known : Known
        What is lit so far.
    near : NearLight
        What no interpolation holds.
    levels : tuple of Level
        Surfaces, from level 0; two or more.
    """

    def __init__(self, known: Known, near: NearLight, levels: tuple[Level, ...]) -> None:
        self._known, self._levels, self._made = known, levels, blends(levels)
        self._values = known.exact, near.light, near.touched
        self._light = [plane((3, *level.covered.shape), known.exact.dtype) for level in levels[1:]]
        self.split = [np.zeros(levels[0].covered.shape, np.bool_), *(level.covered.copy() for level in levels[1:])]
        top = levels[-1]
        place = top.place[top.covered].astype(np.int64)
        known.light(place[~known.has[place]])
        begin(top.place, *self._values, self._light[-1])

    @stage("splat.trial")
    def run(self, worst: float) -> None:
        """Refine from the coarsest level down wherever stopping would cost more than `worst`^2, W^2/m^4."""
        for level in range(len(self._levels) - 2, 0, -1):
            here, blend, split = self._levels[level], self._made[level], self.split[level + 1]
            coarse, light = self._light[level], self._light[level - 1]
            self._known.light(self._known.missing(split, here))
            seen, surplus = plane(here.covered.shape, np.bool_), plane(here.covered.shape, light.dtype)
            with threads(here.crew):
                descend(coarse, blend.weight, blend.across, split, here.place, *self._values, light, seen, surplus)
                _choose(seen, light, surplus, self._made[level - 1].rest, 4.0**level, worst**2, self.split[level])

    def missed(self, pixel: Array) -> Array:
        """Return what the picture would differ by from the full sum at pixels that were lit, (3, n), W/m^2."""
        result = np.empty((3, len(pixel)), self._known.exact.dtype)
        blend = self._made[0]
        misses(pixel, self._light[0], blend.weight, blend.across, self.split[1], *self._values, result)
        return result

    def share_lit(self) -> float:
        """Return how many of the pixels the picture would have lit, of 1."""
        lit = np.count_nonzero(self._known.has) + len(self._known.missing(self.split[1], self._levels[0]))
        return float(lit) / max(1, int(np.count_nonzero(self._levels[0].covered)))

    def split_all(self) -> None:
        """Split every cell, for a picture without error."""
        for split in self.split[1:]:
            split[:] = True

    @stage("splat.assemble")
    def picture(self) -> Array:
        """Light what was split last, and return the picture, (3, h, w), W/m^2."""
        self._known.light(self._known.missing(self.split[1], self._levels[0]))
        result, blend = np.empty_like(self._known.exact), self._made[0]
        assemble(self._light[0], blend.weight, blend.across, self.split[1], self._levels[0].covered, *self._values,
                 result)
        return result


def _path() -> Array:
    """Return row and column within a square in the order of its cells: bits of the index by turns (Morton)."""
    index = np.arange(SQUARE * SQUARE)
    return np.stack([sum((index >> (2 * bit + odd) & 1) << bit for bit in range(SQUARE.bit_length() - 1))
                     for odd in (1, 0)])


@kernel
def _list(split: Array, covered: Array, place: Array, has: Array, path: Array, out: Array) -> int:
    """List the pixels of the children of split cells that are not lit; return how many."""
    count = 0
    for top in range(0, split.shape[0], SQUARE):
        for left in range(0, split.shape[1], SQUARE):
            for k in range(path.shape[1]):
                i, j = top + path[0, k], left + path[1, k]
                if i < split.shape[0] and j < split.shape[1] and split[i, j]:
                    count = _list_children(i, j, covered, place, has, count, out)
    return count


@kernel
def _list_children(i: int, j: int, covered: Array, place: Array, has: Array, count: int, out: Array) -> int:
    for y in range(2 * i, min(2 * i + 2, covered.shape[0])):
        for x in range(2 * j, min(2 * j + 2, covered.shape[1])):
            p = np.int64(place[y, x]) if place.size else y * covered.shape[1] + x
            if covered[y, x] and not has[p]:
                out[count] = p
                count += 1
    return count


@kernel(parallel=True)
def _choose(
    known: Array, light: Array, surplus: Array, rest: Array, pixels: float, most: float, split: Array
) -> None:
    """Split a known cell where normals, or light seen so far, promise more than `most` over its pixels, W^2/m^4."""
    height, width = known.shape
    for i in prange(height):
        for j in range(width):
            split[i, j] = False
            if not known[i, j]:
                continue
            bright, seen = 0.0, float(surplus[i, j])
            for y in range(max(i - 1, 0), min(i + 2, height)):
                for x in range(max(j - 1, 0), min(j + 2, width)):
                    red, green, blue = float(light[0, y, x]), float(light[1, y, x]), float(light[2, y, x])
                    bright = max(bright, red * red + green * green + blue * blue)
                    seen = max(seen, 0.25 * float(surplus[y, x]))
            split[i, j] = bright * float(rest[i, j]) + pixels * seen > most
