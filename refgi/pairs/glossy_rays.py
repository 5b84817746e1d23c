"""Radiance of glossy receivers by pixel lights with ray-traced visibility: the pairs of `shadow_rays`, times f_s."""

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.lobes import receiver_lobe
from refgi.pairs.shadow_rays import BATCH, Hidden, RayReceivers, Senders, summed
from refgi.rsm.buffers.glossy import GlossyPoints
from refgi.stages import stage

if TYPE_CHECKING:
    from refgi.pairs.pixel_lights import PixelLights
    from refgi.rays import Tracer

Array = npt.NDArray[Any]


@stage("pairs.glossy_rays")
def shadowed_radiance(
    tracer: "Tracer", to: RayReceivers, points: GlossyPoints, lights: "PixelLights", *, visibility: bool = True,
    batch: int = BATCH, hidden: Hidden | None = None,
) -> Array:
    """Sum the radiance that every receiver's lobe reflects towards the eye of the light that reaches it.

    points: The receivers with their lobes.
    visibility: Whether to trace the rays, none for a light that lies off the lobe; without, every pair counts.
    batch: Pairs held at a time; changes no bit of the result.
    hidden: As for `shadowed_sum`.
    -> (3, n) float64: W/m^2/sr.
    """
    return summed(tracer, to, lights, visibility, batch, hidden, partial(weigh_by_lobes, points))


@kernel(parallel=True)
def weigh_by_lobes(
    points: GlossyPoints, to: RayReceivers, receivers: tuple[int, int], senders: Senders, lights: tuple[int, int],
    reach: Array, contribution: Array,
) -> None:
    """Turn the irradiance of each pair, `contribution` (pairs, 3) of `fill_shadow_rays`, into radiance of the lobe.

    Pairs off the lobe give 0, and their `reach` (pairs,) is 0.
    """
    count = lights[1] - lights[0]
    for i in prange(receivers[1] - receivers[0]):
        for k in range(count):
            _weigh(points, to, receivers[0] + i, senders, lights[0] + k, reach, contribution, i * count + k)


@kernel
def _weigh(
    points: GlossyPoints, to: RayReceivers, r: int, senders: Senders, j: int, reach: Array, contribution: Array,
    ray: int,
) -> None:
    if reach[ray] <= 0:
        return
    mirror, position = points.mirrored, to.position
    lobe = receiver_lobe(
        np.float64(mirror[0, r]), np.float64(mirror[1, r]), np.float64(mirror[2, r]),
        senders.position[0, j] - position[0, r], senders.position[1, j] - position[1, r],
        senders.position[2, j] - position[2, r], np.float64(points.exponent[r]))
    reach[ray] = 0
    for c in range(3):
        # f_s I cos / r^2
        contribution[ray, c] = contribution[ray, c] * (points.specular[c, r] * lobe)
        if contribution[ray, c] > 0:
            reach[ray] = 1
