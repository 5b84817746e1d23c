"""Cost of a splatted picture: overdraw, fragments and memory traffic (SII Fig. 8, Sec. 6).

A fragment is a pair of light and pixel with B >= I_low; the parts of a light, diffuse and glossy, count by themselves.
On graphics hardware each fragment reads 72 bits of receiver (48 position, 24 normal), each sample of a gather 112 bits
of light (16 + 48 + 24 + 24), Sec. 6.
"""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from refgi.jit import kernel, prange
from refgi.pairs.irradiance import Receivers, checked, over_receivers
from refgi.pairs.pixel_lights import Range, Widening
from refgi.pairs.ranged_sum import LANES, reached
from refgi.splat.sii.lists import LightLists, listed_pairs
from refgi.splat.sii.settings import SiiSettings
from refgi.splat.sii.threshold import lobe_strength, with_reference_length
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.lights import PixelLights
    from refgi.rsm import Projection

FRAGMENT_BITS = 72
SAMPLE_BITS = 112


class Fragments(NamedTuple):
    """Counts of one picture."""

    overdraw: Array  # (h, w) int32: lights that count at a pixel
    of_light: Array  # (N,) int64: pixels at which a light counts
    evaluated: int  # pairs that the kernels evaluate

    @property
    def total(self) -> int:
        """All fragments."""
        return int(self.of_light.sum())

    @property
    def bits(self) -> int:
        """Bits read for the receivers, P O 72."""
        return FRAGMENT_BITS * self.total


def gather_bits(pixels: int, samples: int) -> int:
    """Return the bits that gathering reads, P S 112 for P pixels that take S texels each.

    >>> gather_bits(512 * 512, 308) // 8 // 2**20  # MB
    1078
    """
    return SAMPLE_BITS * pixels * samples


def fragments(
    receivers: Receivers, lights: "PixelLights", settings: SiiSettings, footprint: Array | None = None,
    projection: "Projection | None" = None,
) -> Fragments:
    """Count the pairs of light and pixel that `splat` keeps, and those it evaluates, of the arguments of `splat`.

    Overdraw and fragments depend on the threshold alone, pairs evaluated on the bound as well. Lobes are counted in
    float64: at the edge of their range a pair may count here and not in the sum, or the reverse.
    """
    packed = checked(receivers, lights, settings.pairs, footprint)
    overdraw, of_light, evaluated = np.zeros(receivers.covered.shape, np.int32), np.zeros(len(packed.shines), int), 0
    if settings.reach.cut is None:
        count = packed.terms
        overdraw[receivers.covered] = count
        pixels = int(np.count_nonzero(receivers.covered))
        return Fragments(overdraw, pixels * (packed.shines.astype(int) + packed.glossy), pixels * count)
    settings = with_reference_length(receivers, lights, settings)
    lists = LightLists(packed, settings, False, receivers.covered.shape[1], projection)

    parts: list[Any] = [(lists.of_diffuse, packed.shines, lists.diffuse, packed.diffuse, None, False)]
    if packed.lobes is not None:
        parts.append((lists.of_lobes, packed.glossy, lists.lobes, packed.lobes.lights, packed.lobes.widening, True))

    def add(here: Array, facing: Array, places: Array, _: Array) -> None:
        nonlocal evaluated
        anywhere = np.zeros_like(facing)  # a fragment may face away: no light lies behind receivers without normals
        for lists_of, chosen, reach, packed_lights, widening, glossy in parts:
            if reach is not None:
                for some, listed in lists_of(here, anywhere, places):
                    counts, total = np.zeros(listed.shape, np.uint8), np.zeros(len(places[some]), np.int32)
                    _count(np.ascontiguousarray(here[:, some]), reach, packed_lights, widening, glossy, listed, counts,
                           total)
                    overdraw.reshape(-1)[places[some]] += total
                    of_light[chosen] += counts.sum(axis=0, dtype=int)
                evaluated += sum(listed_pairs(listed, LANES, len(places[some]))
                                 for some, listed in lists_of(here, facing, places))

    over_receivers(receivers, packed, add)
    return Fragments(overdraw, of_light, evaluated)


@kernel(parallel=True)
def _count(
    position: Array, reach: Range, lights: Array, widening: Widening | None, glossy: bool, listed: Array, counts: Array,
    total: Array,
) -> None:
    for block in prange(len(listed)):
        for k in range(listed.shape[1]):
            if listed[block, k]:
                counts[block, k] = _count_one(position, block * LANES, reach, lights, widening, glossy, k, total)


@kernel
def _count_one(
    position: Array, first: int, reach: Range, lights: Array, widening: Widening | None, glossy: bool, k: int,
    total: Array,
) -> int:
    count, square = 0, reach.square[k] / reach.scale[k]
    exact = float(reach.square[k]) / float(reach.scale[k])
    px, py, pz, lx, ly, lz = lights[0, k], lights[1, k], lights[2, k], lights[3, k], lights[4, k], lights[5, k]
    for i in range(first, min(first + LANES, position.shape[1])):
        if glossy:
            counts = exact * lobe_strength(position, i, lights, widening, k) >= 1.0
        else:
            counts = reached(px - position[0, i], py - position[1, i], pz - position[2, i], lx, ly, lz, square)
        total[i] += counts
        count += counts
    return count
