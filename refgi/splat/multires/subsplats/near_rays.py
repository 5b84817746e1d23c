"""Shadow rays to every pixel light at the pixels of a picture, and what single pairs give nearby.

With a shadow ray for each pair, what pairs give beyond a bound has rays of its own (`refgi.error_target.near`).
"""

from typing import TYPE_CHECKING

import numpy as np

from refgi.error_target.near import SIDE, NearLight, PixelSum, near_light, nothing_near
from refgi.jit import kernel, prange
from refgi.pairs.irradiance import Receivers, checked
from refgi.pairs.settings import PairSettings
from refgi.pairs.shadow_rays import BATCH, RayReceivers, Senders, summed
from refgi.pairs.tiles import put, taken
from refgi.splat.multires.subsplats.evaluate import ray_receivers, visible_at
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.pairs.pixel_lights import PixelLights
    from refgi.rays import Tracer
    from refgi.rsm import GBuffer
    from refgi.scene import Geometry


def shadowed_by_rays(tracer: "Tracer", geometry: "Geometry", buffer: "GBuffer", lights: "PixelLights") -> PixelSum:
    """Return the sum of `vpl`: a shadow ray for each pair, pairs not clamped.

    `tracer`: the scene's rays. `geometry`: the triangles that the buffer's ids refer to. `lights`: N pixel lights.
    """

    def near(receivers: Receivers, most: float) -> NearLight:
        found, width = nothing_near(receivers), receivers.covered.shape[1]
        if most <= 0:
            return found
        pixel, peaks = _pixels_with_near_pairs(receivers, lights, most), Peaks(most)
        points = ray_receivers(tracer, geometry, buffer, pixel)
        values = summed(tracer, points, lights, True, BATCH, None, peaks.keep).astype(receivers.position.dtype)
        put(found.irradiance, pixel, values)
        found.has_near[pixel // width // SIDE, pixel % width // SIDE] = True
        return found._replace(pairs=peaks.pairs)

    return PixelSum(visible_at(tracer, geometry, buffer, lights), near)


class Peaks:
    """What pairs give beyond `most`, a bound of their strongest channel (W/m^2), not all they give; counts them."""

    def __init__(self, most: float) -> None:
        self._most, self.pairs = most, 0

    def keep(self, _to: RayReceivers, _receivers: tuple[int, int], _senders: Senders, _lights: tuple[int, int],
             reach: Array, contribution: Array) -> None:
        """Scale contributions (n, 3), W/m^2, to what exceeds the bound; clear the reach of pairs that keep below it."""
        _keep_excess(self._most, reach, contribution)
        self.pairs += int(np.count_nonzero(reach))


@kernel(parallel=True)
def _keep_excess(most: float, reach: Array, contribution: Array) -> None:
    for i in prange(len(reach)):
        strongest = max(contribution[i, 0], max(contribution[i, 1], contribution[i, 2]))
        beyond = reach[i] > 0 and strongest > most
        reach[i] = 1 if beyond else 0
        share = 1.0 - most / strongest if beyond else 0.0
        for c in range(3):
            contribution[i, c] *= share


def _pixels_with_near_pairs(receivers: Receivers, lights: "PixelLights", most: float) -> Array:
    """Return the covered pixels that some light, were nothing in between, gives more than a bound; all with lobes."""
    packed = checked(receivers, lights, PairSettings(clamp=None), None)
    if packed.lobes is not None:
        return np.flatnonzero(receivers.covered)
    near = near_light(receivers, packed, most)
    bright = np.repeat(np.repeat(near.has_near, SIDE, axis=0), SIDE, axis=1)
    bright = bright[: receivers.covered.shape[0], : receivers.covered.shape[1]] & receivers.covered
    pixel = np.flatnonzero(bright)
    return pixel[taken(near.irradiance, pixel).any(axis=0)]
