"""Ranges of a picture's lights, and lists of lights for tiles of receivers by the chosen bound (SII Sec. 3.2, 3.4).

A light is left out where the whole tile lies behind its surface, it behind the surfaces of all receivers, its solid
misses the tile's box, or the largest B that the box admits is below I_low, with a margin for rounding: lists may be
longer than need be, never shorter. Strips of tiles are tested first, then their parts. Symbols: d vector from the
solid's centre to the box's, q the half sides of the box; with the solid scaled to the unit ball, Q is the square of the
distance to the box's centre and S how far the box reaches towards the ball, times sqrt Q.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.pairs.pair_sum import TILE
from refgi.pairs.pixel_lights import Packed, Range
from refgi.pairs.ranged_sum import LANES
from refgi.pairs.tiles import extremes
from refgi.rsm.pool import plane
from refgi.skips import left_out
from refgi.splat.sii.bounds import (
    Solids,
    covered_pixels,
    inverse_depths,
    light_solids,
    screen_quads,
    tiles_of_pixels,
    tiles_of_quads,
)
from refgi.splat.sii.settings import FullBound, MeshBound, QuadBound, SiiSettings, TangentBound
from refgi.splat.sii.threshold import DIFFUSE, GLOSSY, all_peaks, light_range, threshold
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.rsm import Projection

MARGIN = 1e-3  # of the solids' axes: the pair test in float32 is off by less at any angle
ROUNDING = 32.0  # units of rounding that differences of squares may be off
PARTS, WIDE, WIDEST = TILE // LANES, 4 * TILE // LANES, 16 * TILE // LANES  # parts that are tested together
# rows of a packed solid
PLACE, BACK, SHIFT, AXIS, ACROSS, FLATNESS, BALL, SQUARE, SOLID_ROWS = 0, 3, 6, 9, 12, 13, 14, 15, 16


def pack_solids(solids: Solids, back: Array, *, hollow: bool = False, nearest: bool = False) -> Array:
    """Pack the solids of lights for the lists, (SOLID_ROWS, N), in the dtype of the reversed normals `back`, (3, N).

    Rows: position, reversed normal, centre less position, axis, 1 / h^2, 1 / w^2 - 1 / h^2, radius^2 of the half ball
    (0: none), R_0^2 to bound B with (else infinite). `hollow` leaves the ellipsoids aside: only what lies behind
    surfaces is left out. `nearest` bounds B by the box's nearest point too; for diffuse lights.
    """
    radius, ellipsoid = np.sqrt(solids.square), solids.ellipsoid
    packed = np.zeros((SOLID_ROWS, len(radius)))
    packed[PLACE:BACK], packed[BACK:SHIFT], packed[AXIS:ACROSS] = solids.position, back, solids.axis
    packed[SHIFT:AXIS] = solids.axis * radius * ellipsoid.center
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # an infinite solid is never found apart
        across, along = ((part * radius * (1 + MARGIN)) ** -2.0 for part in (ellipsoid.height, ellipsoid.half_width))
        packed[ACROSS], packed[FLATNESS] = (0.0, 0.0) if hollow else (across, along - across)
        packed[BALL] = 0.0 if solids.ball is None else (solids.ball * (1 + MARGIN)) ** 2
        packed[SQUARE] = solids.square * (1 + MARGIN) if nearest else np.inf
        return packed.astype(back.dtype)


@stage("sii.bins", kept=False)  # of receivers that are gathered anew
def list_lights(position: Array, normal: Array, solids: Array) -> Array:
    """List the lights whose bound may reach each tile of receivers.

    position, normal (3, n): Receivers, block by block.
    solids (SOLID_ROWS, light): The lights' bounds.
    -> (ceil(n / LANES), N) bool: Whether a light may count for some receiver of a tile.
    """
    listed = plane((-(-position.shape[1] // LANES), solids.shape[1]), np.bool_)
    _list(position, normal, solids, bool((solids[BALL] > 0).any()), listed)
    return listed


@kernel(parallel=True)
def _list(position: Array, normal: Array, solids: Array, balls: bool, listed: Array) -> None:
    count = len(listed)
    for strip in prange((count + WIDEST - 1) // WIDEST):
        first = strip * WIDEST
        here = min(WIDEST, count - first)
        listed[first : first + here] = False
        low, high = np.empty((WIDEST + 1, 6), position.dtype), np.empty((WIDEST + 1, 6), position.dtype)
        _bound_parts(position, normal, first * LANES, here, low, high)
        near = np.empty((3, *solids.shape), solids.dtype)
        chosen, passed = np.empty((3, solids.shape[1]), np.uint32), np.empty(solids.shape[1], np.bool_)
        found = _narrow(solids, solids.shape[1], None, low, high, 0, here, balls, passed, near[0], chosen[0])
        for a in range(0, here if found > 0 else 0, WIDE):
            wide = min(a + WIDE, here)
            some = _narrow(near[0], found, chosen[0], low, high, a, wide, balls, passed, near[1], chosen[1])
            for b in range(a, wide if some > 0 else a, PARTS):
                end = min(b + PARTS, wide)
                few = _narrow(near[1], some, chosen[1], low, high, b, end, balls, passed, near[2], chosen[2])
                for part in range(b, end if few > 0 else b):
                    _reach(near[2], few, low[part], high[part], balls, passed)
                    _scatter(listed[first + part], chosen[2], passed, few)


@kernel
def _bound_parts(position: Array, normal: Array, first: int, parts: int, low: Array, high: Array) -> None:
    """Bound each part of LANES receivers, from receiver `first` on."""
    for part in range(parts):
        start = first + part * LANES
        end = min(start + LANES, position.shape[1])
        for axis in range(3):
            low[part, axis], high[part, axis] = extremes(position, axis, start, end)
            low[part, 3 + axis], high[part, 3 + axis] = extremes(normal, axis, start, end)


@kernel
def _narrow(
    solids: Array, count: int, of: Array | None, low: Array, high: Array, first: int, last: int, balls: bool,
    passed: Array, near: Array, chosen: Array,
) -> int:
    """Copy those of `count` solids that may reach the boxes first to last - 1 to `near`; return how many there are.

    `chosen` is filled with which lights they are of, `of` says so for the solids; None: they are all there are. The
    last row of `low` and `high` is scratch.
    """
    row = len(low) - 1
    for axis in range(6):
        low[row, axis], high[row, axis] = low[first, axis], high[first, axis]
        for part in range(first + 1, last):
            low[row, axis] = min(low[row, axis], low[part, axis])
            high[row, axis] = max(high[row, axis], high[part, axis])
    _reach(solids, count, low[row], high[row], balls, passed)
    found = _compact(solids, count, passed, near, chosen)
    if of is not None:
        for i in range(found):
            chosen[i] = of[chosen[i]]
    return found


@kernel
def _compact(solids: Array, tested: int, passed: Array, near: Array, chosen: Array) -> int:
    """Copy those of the `tested` solids that passed to the front and return how many there are."""
    count = 0
    for k in range(tested):
        chosen[count] = k
        count += passed[k]
    for row in range(SOLID_ROWS):
        for i in range(count):
            near[row, i] = solids[row, chosen[i]]
    return count


@kernel
def _scatter(listed: Array, chosen: Array, passed: Array, count: int) -> None:
    for i in range(count):
        listed[chosen[i]] = passed[i]


@kernel
def _reach(solids: Array, count: int, low: Array, high: Array, balls: bool, passed: Array) -> None:
    """Fill `passed` for the first `count` lights: whether each may count inside a box."""
    real = solids.dtype.type
    zero, half, one = real(0.0), real(0.5), real(1.0)
    slack = real(ROUNDING) * real(np.finfo(solids.dtype).eps)
    ax, ay, az, bx, by, bz = low[0], low[1], low[2], high[0], high[1], high[2]
    ux, uy, uz, vx, vy, vz = low[3], low[4], low[5], high[3], high[4], high[5]
    qx, qy, qz = half * (bx - ax), half * (by - ay), half * (bz - az)
    for k in range(count):
        # light - receiver lies between e and f
        ex, ey, ez = solids[0, k] - bx, solids[1, k] - by, solids[2, k] - bz
        fx, fy, fz = solids[0, k] - ax, solids[1, k] - ay, solids[2, k] - az
        lx, ly, lz = solids[3, k], solids[4, k], solids[5, k]
        size = max(abs(ex), abs(fx)) + max(abs(ey), abs(fy)) + max(abs(ez), abs(fz))
        cl = max(ex * lx, fx * lx) + max(ey * ly, fy * ly) + max(ez * lz, fz * lz) + slack * size
        cx = (max(max(ex * ux, ex * vx), max(fx * ux, fx * vx)) + max(max(ey * uy, ey * vy), max(fy * uy, fy * vy))
              + max(max(ez * uz, ez * vz), max(fz * uz, fz * vz)))
        # B at most: the largest cosine at the nearest point
        gx, gy, gz = max(max(ex, -fx), zero), max(max(ey, -fy), zero), max(max(ez, -fz), zero)
        square = gx * gx + gy * gy + gz * gz
        b = solids[15, k] * (cl * (one / square))
        dx, dy, dz = half * (ex + fx) + solids[6, k], half * (ey + fy) + solids[7, k], half * (ez + fz) + solids[8, k]
        nx, ny, nz, across, flat = solids[9, k], solids[10, k], solids[11, k], solids[12, k], solids[13, k]
        s = dx * nx + dy * ny + dz * nz
        gradient = (abs(across * dx + flat * s * nx) * qx + abs(across * dy + flat * s * ny) * qy
                    + abs(across * dz + flat * s * nz) * qz)
        q = across * (dx * dx + dy * dy + dz * dz) + flat * (s * s)
        span = abs(dx) + abs(dy) + abs(dz)
        gap = q - gradient - slack * across * (span * (span + qx + qy + qz))
        apart = (gap > zero) & (gap * gap > q) & (q > one)
        faces = (cl > zero) & (cx + slack * size > zero)
        passed[k] = faces & ~(b * b < square) & (~apart | (balls & (square <= solids[14, k])))


Some = slice | Array

EVERY = slice(None)


class LightLists:
    """The range of all lights of a picture, and lists of lights for any of its receivers.

    `outside` sums what the cut loses: every light is then listed everywhere. `low` is I_low, W/m^2; `diffuse` and
    `lobes` the ranges of the packed diffuse lights (with the black one) and lobes, None where there are none.
    """

    def __init__(
        self, packed: Packed, settings: SiiSettings, outside: bool, width: int, projection: "Projection | None"
    ) -> None:
        everywhere = outside or packed.spheres is not None  # spheres reach over their horizon
        self._bound = FullBound() if everywhere else settings.reach.bound
        self._on_screen = isinstance(self._bound, QuadBound | MeshBound)
        if self._on_screen:
            expect(projection is not None, "projection", f"the camera's map for the bound {self._bound.name()!r}", None)
        self._tangent = isinstance(self._bound, TangentBound)
        self._packed, self._settings, self._width, self._projection = packed, settings, width, projection
        diffuse, glossy = all_peaks(packed)
        self.low = threshold(np.concatenate([diffuse, glossy]), settings.reach)
        dtype = packed.diffuse.dtype
        reach, low = settings.reach, self.low
        self.diffuse = light_range(diffuse, low, reach, DIFFUSE, dtype, outside) if len(diffuse) > 1 else None
        self.lobes = light_range(glossy, low, reach, GLOSSY, dtype, outside) if len(glossy) else None

    def of_diffuse(self, position: Array, normal: Array, places: Array) -> Iterator[tuple[Some, Array]]:
        """Yield receivers, and which diffuse lights may count for which tile of LANES of them, (ceil(n / LANES), M).

        All receivers come at once. For a mesh that loses pixels they come light by light, those where it is drawn.
        """
        return self._lists(position, normal, places, self._packed.diffuse[:, :-1], self.diffuse_solids(), nearest=True)

    def of_lobes(self, position: Array, normal: Array, places: Array) -> Iterator[tuple[Some, Array]]:
        """Yield receivers, and which lobes may count for which tile of LANES of them, (ceil(n / LANES), K)."""
        assert self._packed.lobes is not None
        return self._lists(position, normal, places, self._packed.lobes.lights, self.lobe_solids(), nearest=False)

    def diffuse_solids(self) -> Solids:
        """Return the bounds of the diffuse lights, without the black one."""
        assert self.diffuse is not None
        lights, square = self._packed.diffuse[:, :-1], _square(self.diffuse)[:-1]
        return light_solids(lights[:3], -lights[3:6], 1.0, square, self._tangent)

    def lobe_solids(self) -> Solids:
        """Return the bounds of the lobes."""
        assert self.lobes is not None
        assert self._packed.lobes is not None
        lights = self._packed.lobes.lights
        return light_solids(lights[:3], -lights[6:9], lights[9], _square(self.lobes), self._tangent,
                            self._settings.pairs.lobe.widening,
                            "sii_widening" in self._settings.pairs.as_published)

    def _lists(
        self, position: Array, normal: Array, places: Array, lights: Array, solids: Solids, nearest: bool
    ) -> Iterator[tuple[Some, Array]]:
        bound, count = self._bound, lights.shape[1]
        if isinstance(bound, MeshBound) and not bound.inflate:  # loses pixels: no other bound has its bits
            for k in range(count):
                some = np.flatnonzero(self._drawn(solids, k).reshape(-1)[places])
                listed = np.zeros((_tiles(some), count), np.bool_)
                listed[:, k] = True
                yield some, listed
            return

        def bounded() -> Array:
            packed = pack_solids(solids, lights[3:6], hollow=self._on_screen, nearest=nearest and self._tangent)
            listed = list_lights(position, normal, packed)
            return listed & self._tiles_on_screen(position, places, solids) if self._on_screen else listed

        def outside() -> tuple[int, int]:
            listed = bounded()
            return int(np.count_nonzero(~listed)), listed.size

        whole = isinstance(bound, FullBound) or not left_out("sii.bounds", outside)
        yield EVERY, np.ones((_tiles(places), count), np.bool_) if whole else bounded()

    def _tiles_on_screen(self, position: Array, places: Array, solids: Solids) -> Array:
        assert self._projection is not None
        if not isinstance(self._bound, MeshBound):
            return tiles_of_quads(screen_quads(self._projection, solids.position, np.sqrt(solids.square)), places,
                                  self._width)
        seen = inverse_depths(self._projection, position, places)  # Sec. 3.4: early depth test
        return np.stack([tiles_of_pixels(self._drawn(solids, k, seen), places)
                         for k in range(solids.position.shape[1])], axis=1)

    def _drawn(self, solids: Solids, k: int, seen: Array | None = None) -> Array:
        assert self._projection is not None
        assert isinstance(self._bound, MeshBound)
        return covered_pixels(self._projection, solids, k, self._bound.faces, self._bound.inflate, seen)


def listed_pairs(listed: Array, lanes: int, receivers: int) -> int:
    """Return how many pairs of listed light and receiver there are, in tiles of `lanes` receivers."""
    sizes = np.minimum(lanes, receivers - lanes * np.arange(len(listed)))
    return int((np.count_nonzero(listed, axis=1) * sizes).sum())


def _tiles(places: Array) -> int:
    return -(-len(places) // LANES)


def _square(reach: Range) -> Array:
    """Return R_0^2 / xi."""
    square: Array = reach.square.astype(np.float64) / reach.scale
    return square
