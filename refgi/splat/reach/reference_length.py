"""The reference length of a picture whose settings give none: the length under which the paper's cut is the paper's.

I_low is "x % of I_0", an irradiance of an intensity: the paper's unit of length is missing, and with it how far splats
reach. Figure 8 tells how far they do: of 768 lights cut at 5 % a mean of 125 counts at a pixel. Here B of pairs of
lights and sampled pixels is sorted: the length is the one under which 5 % leave that share of them, in any unit.
"""

import dataclasses
import math
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.pairs.irradiance import Receivers
from refgi.pairs.lobe_shape import Widening
from refgi.pairs.loss import sample_for
from refgi.pairs.packing import pack
from refgi.scene.values import LARGEST
from refgi.splat.reach.strength import diffuse_strength, lobe_strength
from refgi.splat.reach.threshold import all_peaks
from refgi.splat.settings import SplatSettings
from refgi.stages import stage

if TYPE_CHECKING:
    from refgi.rsm import PixelLights

Array = npt.NDArray[Any]
S = TypeVar("S", bound=SplatSettings)

PAPER_OVERDRAW, PAPER_LIGHTS, PAPER_CUT = 125.0, 768, 0.05  # Figure 8
LEAST_SAMPLED = 64  # pixels: enough to count pairs by
LONGEST = 10.0  # diagonals of the sample: where not even that leaves as many pairs, next to nothing is cut


def with_reference_length(receivers: Receivers, lights: "PixelLights", settings: S) -> S:
    """Return settings whose cut is in full: with the reference length of a picture where they need one and give none.

    Parameters
    ----------
    receivers : Receivers
        The picture's points.
    lights : PixelLights
        Its lights.
    settings : SplatSettings
        Any.

    Returns
    -------
    SplatSettings
        The same, or with a `reference_length`.
    """
    if settings.reference_length is not None or settings.irradiance_low is not None or not settings.cuts:
        return settings
    return dataclasses.replace(settings, reference_length=reference_length(receivers, lights, settings))


@stage("splat.reference_length")
def reference_length(receivers: Receivers, lights: "PixelLights", settings: SplatSettings) -> float:
    """Return the length under which lights cut at 5 % count at 125 / 768 of the pixels on average.

    Parameters
    ----------
    receivers : Receivers
        The picture's points.
    lights : PixelLights
        Lights; those drawn without flux count as lights that reach nothing, as they do in the paper.
    settings : SplatSettings
        Offset, norms and widening.

    Returns
    -------
    float
        Length, m; 1 where there is nothing to cut.
    """
    packed = pack(lights, settings, np.zeros(lights.flux.shape[1]), np.float64)
    sample = sample_for(receivers, lights, least=LEAST_SAMPLED)
    position = sample.position.astype(np.float64)
    peaks = np.concatenate([part[: len(part) - last] for part, last in zip(all_peaks(packed), (1, 0), strict=True)])
    if position.size == 0 or peaks.size == 0:
        return 1.0
    strength = np.zeros((len(peaks), position.shape[1]))
    diffuse = packed.diffuse.shape[1] - 1
    _diffuse_strengths(position, packed.diffuse, strength[:diffuse])
    if packed.lobes is not None:
        _lobe_strengths(position, packed.lobes.lights, packed.lobes.widening, strength[diffuse:])
    strength *= peaks[:, None] / peaks.max()
    counted = round(PAPER_OVERDRAW / PAPER_LIGHTS * lights.drawn * position.shape[1])
    least = 0.0
    if 0 < counted <= strength.size:
        least = float(np.partition(strength.reshape(-1), -counted)[-counted])
    longest = LONGEST * math.hypot(*np.ptp(np.concatenate([position, lights.position], axis=1), axis=1))
    length = min(longest, math.sqrt(PAPER_CUT / least)) if least > 0 else longest
    return min(max(length, 1 / LARGEST), LARGEST)


@kernel(parallel=True)
def _diffuse_strengths(position: Array, lights: Array, strength: Array) -> None:
    for k in prange(strength.shape[0]):
        for i in range(strength.shape[1]):
            strength[k, i] = diffuse_strength(position, i, lights, k)


@kernel(parallel=True)
def _lobe_strengths(position: Array, lights: Array, widening: Widening | None, strength: Array) -> None:
    for k in prange(strength.shape[0]):
        for i in range(strength.shape[1]):
            strength[k, i] = lobe_strength(position, i, lights, widening, k)
