"""How much light lies outside the discs of texels that pixels gather from, told from some pixels and texels."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.pairs.irradiance import Receivers
from refgi.pairs.loss import lost_share, sample_pixels
from refgi.pairs.pair_sum import geometry_term
from refgi.splat.gathering.place import centers
from refgi.stages import stage

if TYPE_CHECKING:
    from refgi.rsm import Rsm

Array = npt.NDArray[Any]

TEXELS = 1024  # of each map
SAMPLED = 512  # pixels
CORNER = math.sqrt(2)  # map widths: a disc of that radius holds the whole map, wherever its centre lies


@stage("gather.loss")
def disc_loss(receivers: Receivers, rsms: "Sequence[Rsm]", radius: float, offset: float = 0.0) -> float:
    """Return the share of the light that comes from texels outside the pixels' discs.

    Parameters
    ----------
    receivers : Receivers
        The picture's points.
    rsms : sequence of Rsm
        Reflective shadow maps, one a light.
    radius : float
        Of the discs, map widths.
    offset : float
        By which texels are moved back along their normals, m.

    Returns
    -------
    float
        Of the diffuse light without visibility, at sampled pixels by sampled texels; 0 where a disc is the whole map.
    """
    if radius >= CORNER and all(rsm.projection.maps == 1 for rsm in rsms):
        return 0.0
    sample = sample_pixels(receivers, SAMPLED)
    position, normal = (plane.astype(np.float64) for plane in (sample.position, sample.normal))
    sums = np.zeros((2, position.shape[1]))
    for rsm in rsms:
        side = radius * np.array([[rsm.projection.height], [rsm.projection.width]])
        texel, lights = _texels(rsm, offset)
        _add_shares(position, normal, centers(rsm, sample.position) / side, lights, texel / side, sums)
    inside, whole = sums.sum(axis=1)
    return lost_share(float(whole), float(inside))


def _texels(rsm: "Rsm", offset: float) -> tuple[Array, Array]:
    """Return row and column of some texels, (2, N), and their position, reversed normal and flux, (7, N)."""
    from refgi.lights import choose_pixel_lights

    lights = choose_pixel_lights([rsm], count=TEXELS, pattern="halton")
    assert lights.texel is not None
    place = np.stack(np.divmod(lights.texel, rsm.projection.width)) + 0.5
    normal = np.asarray(lights.normal, np.float64)
    flux = lights.flux.sum(axis=0, dtype=np.float64)
    return place, np.concatenate([lights.position - offset * normal, -normal, flux[None]])


@kernel(parallel=True)
def _add_shares(position: Array, normal: Array, center: Array, lights: Array, texel: Array, sums: Array) -> None:
    """Add what lights inside the disc, and what all lights, give each pixel; places are in radii of the disc."""
    for i in prange(position.shape[1]):
        inside, whole = 0.0, 0.0
        for k in range(lights.shape[1]):
            term = lights[6, k] * geometry_term(
                lights[0, k] - position[0, i], lights[1, k] - position[1, i], lights[2, k] - position[2, i],
                lights[3, k], lights[4, k], lights[5, k], normal[0, i], normal[1, i], normal[2, i])
            whole += term
            if (texel[0, k] - center[0, i]) ** 2 + (texel[1, k] - center[1, i]) ** 2 <= 1.0:
                inside += term
        sums[0, i] += inside
        sums[1, i] += whole
