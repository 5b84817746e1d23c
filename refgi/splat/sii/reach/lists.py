"""Ranges of the lights of one picture, and light lists of its tiles by the chosen bound (SII Sec. 3.2, 3.4)."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.pairs.packing import Packed
from refgi.pairs.pixel_lights import Range
from refgi.pairs.ranged_sum import LANES
from refgi.skips import left_out
from refgi.splat.sii.reach.bins import list_lights, pack_solids
from refgi.splat.sii.reach.bounds import Solids, light_solids
from refgi.splat.sii.reach.screen_bounds import covered_pixels, screen_quads, tiles_of_pixels, tiles_of_quads
from refgi.splat.sii.reach.threshold import DIFFUSE, GLOSSY, all_peaks, light_range, threshold
from refgi.splat.sii.settings import FullBound, MeshBound, QuadBound, SiiSettings, TangentBound

if TYPE_CHECKING:
    from refgi.rsm import Projection

Array = npt.NDArray[Any]
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
        self._bound = FullBound() if outside else settings.reach.bound
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
        return light_solids(lights[:3], -lights[3:6], np.ones(len(square)), square, self._tangent)

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
            return listed & self._tiles_on_screen(places, solids) if self._on_screen else listed

        def outside() -> tuple[int, int]:
            listed = bounded()
            return int(np.count_nonzero(~listed)), listed.size

        whole = isinstance(bound, FullBound) or not left_out("sii.bounds", outside)
        yield EVERY, np.ones((_tiles(places), count), np.bool_) if whole else bounded()

    def _tiles_on_screen(self, places: Array, solids: Solids) -> Array:
        assert self._projection is not None
        if not isinstance(self._bound, MeshBound):
            return tiles_of_quads(screen_quads(self._projection, solids.position, np.sqrt(solids.square)), places,
                                  self._width)
        return np.stack([tiles_of_pixels(self._drawn(solids, k), places) for k in range(solids.position.shape[1])],
                        axis=1)

    def _drawn(self, solids: Solids, k: int) -> Array:
        assert self._projection is not None
        assert isinstance(self._bound, MeshBound)
        return covered_pixels(self._projection, solids, k, self._bound.faces, self._bound.inflate)


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
