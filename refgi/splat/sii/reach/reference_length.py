"""Reference length of a picture whose settings give none: under it the paper's cut keeps the paper's share of pairs.

I_low is "x % of I_0", an irradiance of an intensity: the paper's unit of length is missing, and with it how far splats
reach. Figure 8 shows how far they do: of 768 lights cut at 5 % a mean of 125 counts at a pixel. Here B of pairs of
lights and sampled pixels is sorted: the length is the one under which 5 % leave that share of them, in any unit.

B = I(w) / r^2 of a pair of light and receiver is what the threshold compares, in float64.
"""

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.pairs.irradiance import Receivers
from refgi.pairs.lobe_shape import CORRECTED, Widening, lobe_norm_factor
from refgi.pairs.loss import PAIRS, sample_for
from refgi.pairs.packing import Packed, pack
from refgi.pairs.pair_sum import pair_cosines
from refgi.pairs.settings import PairSettings
from refgi.scene.values import LARGEST
from refgi.splat.sii.reach.threshold import all_peaks
from refgi.splat.sii.settings import RelativeCut, SiiSettings
from refgi.stages import stage

if TYPE_CHECKING:
    from refgi.lights import PixelLights

Array = npt.NDArray[Any]

PAPER_OVERDRAW, PAPER_LIGHTS, PAPER_CUT = 125.0, 768, 0.05  # Figure 8
LEAST_SAMPLED = 64  # pixels, enough to count pairs by; of more lights than go with them every n-th is tested
LONGEST = 10.0  # diagonals of the sample: where not even that leaves as many pairs, next to nothing is cut


@kernel
def _diffuse_strength(position: Array, i: int, lights: Array, k: int) -> Any:
    """Return B / I_0 = cos / r^2 of packed diffuse light k at receiver i, 1/m^2; 0 behind the light."""
    dx, dy, dz = _difference(position, i, lights, k)
    square, cl, _ = pair_cosines(dx, dy, dz, lights[3, k], lights[4, k], lights[5, k], 0.0, 0.0, 0.0)
    return cl / (square * math.sqrt(square)) if cl > 0.0 else 0.0


@kernel
def lobe_strength(position: Array, i: int, lights: Array, widening: Widening | None, k: int) -> Any:
    """Return B / I_0 = cos^P / r^2 of packed lobe k at receiver i, 1/m^2; 0 behind light or lobe."""
    dx, dy, dz = _difference(position, i, lights, k)
    square, above, along = pair_cosines(dx, dy, dz, lights[3, k], lights[4, k], lights[5, k], lights[6, k],
                                        lights[7, k], lights[8, k])
    if above <= 0.0 or along <= 0.0:
        return 0.0
    r = math.sqrt(square)
    return _shape(along / r, r, float(lights[9, k]), widening, k) / square


@kernel
def _difference(position: Array, i: int, lights: Array, k: int) -> Any:
    """Return the vector from receiver i to packed light k in float64, m."""
    return (float(lights[0, k]) - float(position[0, i]), float(lights[1, k]) - float(position[1, i]),
            float(lights[2, k]) - float(position[2, i]))


@kernel
def _shape(cosine: float, r: float, exponent: float, widening: Widening | None, k: int) -> float:
    """Return I(w) / I_0 of a lobe."""
    if widening is None:
        return float(cosine**exponent)
    share = r / widening.distance if widening.slope == CORRECTED else 1.0 / (r * widening.distance)
    here = exponent * min(share, 1.0)
    theta = float(widening.cos_theta[k])
    norm = 1.0
    if widening.norm >= 0:
        norm = lobe_norm_factor(theta, here, widening.norm) / lobe_norm_factor(theta, exponent, widening.norm)
    return float(cosine**here * norm)


def with_reference_length(receivers: Receivers, lights: "PixelLights", settings: SiiSettings) -> SiiSettings:
    """Return settings whose relative cut has its reference length: that of the picture where they give none."""
    cut = settings.reach.cut
    if not isinstance(cut, RelativeCut) or cut.reference_length is not None:
        return settings
    length = reference_length(receivers, lights, settings.pairs)
    return dataclasses.replace(settings, reach=dataclasses.replace(settings.reach, cut=dataclasses.replace(
        cut, reference_length=length)))


@stage("sii.picture_length")
def reference_length(receivers: Receivers, lights: "PixelLights", pairs: PairSettings) -> float:
    """Return the length under which lights cut at 5 % count at 125 / 768 of the pixels on average.

    lights: Lights; those drawn without flux count as lights that reach nothing, as they do in the paper.
    -> float: Length, m; 1 where there is nothing to cut.
    """
    return picture_length(receivers, lights, pairs)


def picture_length(receivers: Receivers, lights: "PixelLights", pairs: PairSettings) -> float:
    """Return what `reference_length` does, unobserved."""
    packed = pack(lights, pairs, np.zeros(lights.flux.shape[1]), np.float64)
    position = sample_for(receivers, lights, least=LEAST_SAMPLED).position.astype(np.float64)
    step = 1 + lights.flux.shape[1] * LEAST_SAMPLED // PAIRS
    strength = strengths(packed, position, step)
    if strength.size == 0:
        return 1.0
    counted = round(PAPER_OVERDRAW / PAPER_LIGHTS * lights.drawn / step * position.shape[1])
    length = LONGEST * math.hypot(*np.ptp(np.concatenate([position, lights.position], axis=1), axis=1))
    positive = strength[strength > 0]  # partition takes long over equal numbers
    if 0 < counted <= len(positive):
        length = min(length, math.sqrt(PAPER_CUT / float(np.partition(positive, -counted)[-counted])))
    return min(max(length, 1 / LARGEST), LARGEST)


def strengths(packed: Packed, position: Array, step: int) -> Array:
    """Return B of pairs over the largest I_0, of every so many-th diffuse light and lobe and all places, 1/m^2."""
    diffuse, lobes = all_peaks(packed)
    brightest = max(diffuse.max(), lobes.max(initial=0.0))
    peaks, glossy = diffuse[:-1:step], lobes[::step]
    strength = np.zeros((len(peaks) + len(glossy), position.shape[1]))
    _diffuse_strengths(position, np.ascontiguousarray(packed.diffuse[:, :-1:step]), strength[: len(peaks)])
    if packed.lobes is not None:
        widening = packed.lobes.widening
        if widening is not None:
            widening = widening._replace(cos_theta=np.ascontiguousarray(widening.cos_theta[::step]))
        lights = np.ascontiguousarray(packed.lobes.lights[:, ::step])
        _lobe_strengths(position, lights, widening, strength[len(peaks) :])
    strength *= (np.concatenate([peaks, glossy]) / (brightest or 1.0))[:, None]
    return strength


@kernel(parallel=True)
def _diffuse_strengths(position: Array, lights: Array, strength: Array) -> None:
    for k in prange(strength.shape[0]):
        for i in range(strength.shape[1]):
            strength[k, i] = _diffuse_strength(position, i, lights, k)


@kernel(parallel=True)
def _lobe_strengths(position: Array, lights: Array, widening: Widening | None, strength: Array) -> None:
    for k in prange(strength.shape[0]):
        for i in range(strength.shape[1]):
            strength[k, i] = lobe_strength(position, i, lights, widening, k)
