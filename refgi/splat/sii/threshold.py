"""I_low, below which a pair is left out, the range it gives lights, and the length it refers to (E-SII-11, E-SII-15).

The paper sets I_low to "x % of I_0", an irradiance to an intensity. Here it is one irradiance for all lights, I_low =
x max I_0 / L_ref^2, of largest channels: dim lights reach less far, as Sec. 3.6 says. Without L_ref the length is the
one under which 5 % leave the share of pairs of Fig. 8, 125 of 768 lights at a pixel, among pairs of sampled pixels.
"""

import dataclasses
import inspect
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.diagnostics import is_due
from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.pairs.estimates import PAIRS, light_at, lost_share, sample_for, warn_of_loss
from refgi.pairs.irradiance import Receivers
from refgi.pairs.pair_sum import pair_cosines
from refgi.pairs.pixel_lights import CORRECTED, Packed, Range, Widening, lobe_norm_factor, pack
from refgi.pairs.settings import PairSettings
from refgi.rsm.pool import plane
from refgi.sampling import RANGE, draws
from refgi.scene.values import LARGEST
from refgi.splat.sii.settings import AbsoluteCut, ReachSettings, RelativeCut, SiiSettings
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.lights import PixelLights

LEAST_THRESHOLD = 1e-200  # W/m^2: any light over it is a number
DIFFUSE, GLOSSY = 0, 1  # parts of a light, which have each their own xi


def low_irradiance(lights: "PixelLights", settings: SiiSettings) -> float:
    """Return I_low = x max I_0 / L_ref^2, or the absolute one, W/m^2; 0 without lights or without a cut.

    The peak of a lobe is its flux times its norm. Settings without a reference length get one from
    `with_reference_length`. With `per_light_ilow` this is the I_low of the brightest light.
    """
    return threshold(np.concatenate(all_peaks(packed_in_float64(lights, settings.pairs))), settings.reach)


def packed_in_float64(lights: "PixelLights", pairs: PairSettings) -> Packed:
    """Return packed lights whose clamp, which no peak or range depends on, is of no area."""
    return pack(lights, pairs, np.zeros(lights.flux.shape[1]), np.float64)


def all_peaks(packed: Packed) -> tuple[Array, Array]:
    """Return I_0 (W/sr, largest channel, float64) of packed diffuse lights, the black one last, and of lobes."""
    lobes = np.zeros((3, 0)) if packed.lobes is None else packed.lobes.lights[10:13]
    return packed.diffuse[6:9].max(axis=0).astype(np.float64), lobes.max(axis=0).astype(np.float64)


def threshold(peak: Array, reach: ReachSettings) -> float:
    """Return I_low (W/m^2) for lights of these peak intensities (N,), W/sr."""
    if isinstance(reach.cut, AbsoluteCut):
        return reach.cut.irradiance or 0.0
    return 0.0 if reach.cut is None else reach.cut.share * float(peak.max(initial=0.0)) / _length(reach.cut) ** 2


def _length(cut: RelativeCut) -> float:
    length = cut.reference_length
    expect(length is not None, "reference_length", "a length for lights without receivers, m", length)
    assert length is not None
    return length


def light_range(
    peak: Array, low: float, reach: ReachSettings, part: int, dtype: npt.DTypeLike, outside: bool = False
) -> Range:
    """Return R_0^2 and xi of lights with these peak intensities (N,), W/sr.

    `low` is I_low (W/m^2, at least `LEAST_THRESHOLD`), `part` DIFFUSE or GLOSSY; `outside` sums what the cut removes.
    """
    square = peak / max(low, LEAST_THRESHOLD)
    if isinstance(reach.cut, RelativeCut) and "per_light_ilow" in reach.cut.as_published:
        # I_low = x I_0 of the light itself
        square = np.where(peak > 0, _length(reach.cut) ** 2 / reach.cut.share, 0.0)
    scale = np.ones(len(peak))
    if reach.stochastic:
        scale = 1.0 - draws(reach.seed, RANGE, len(peak), part)  # (0, 1]
    # far from the largest numbers, which are squared, and from 0, which xi must not round to
    square = np.minimum(square, math.sqrt(float(np.finfo(dtype).max)))
    return Range(square.astype(dtype), np.maximum(scale, 1e-30).astype(dtype), outside)


@stage("sii.cut_loss")
def cut_loss(
    light: Array, receivers: Receivers, lights: "PixelLights", settings: SiiSettings, footprint: Array | None = None
) -> float:
    """Return the share of the light that the threshold leaves out of a picture.

    light (3, h, w): The picture's irradiance, W/m^2.
    -> float: Of the light without visibility, at sampled pixels.
    """
    sample = sample_for(receivers, lights)
    cut = light.reshape(3, -1)[:, sample.place]
    whole = light_at(sample, lights, settings.pairs, footprint)
    return lost_share(whole, float(cut.mean(dtype=np.float64))) if cut.size else 0.0


def warn_of_cut(
    light: Array, receivers: Receivers, lights: "PixelLights", settings: SiiSettings, footprint: Array | None
) -> None:
    """Warn where the cut of `sii` removes more than `LEAST_LOSS` of the light of a picture.

    A stochastic cut removes none in the mean and gives no warning.
    """
    cut = settings.reach.cut
    if cut is None or settings.reach.stochastic or not is_due("sii.cut_loss"):
        return
    said = (f"irradiance {cut.irradiance:g} W/m^2" if isinstance(cut, AbsoluteCut) else
            f"share {cut.share:g} with reference_length {cut.reference_length:.3g} m")
    warn_of_loss(cut_loss(light, receivers, lights, settings, footprint), f"sii: reach.cut.{said}")


PAPER_OVERDRAW, PAPER_LIGHTS, PAPER_CUT = 125.0, 768, 0.05  # Figure 8
BITS = 44  # of a float64, below its exponent and 8 bits
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
    packed = packed_in_float64(lights, pairs)
    position = sample_for(receivers, lights, least=LEAST_SAMPLED).position.astype(np.float64)
    step = 1 + lights.flux.shape[1] * LEAST_SAMPLED // PAIRS
    strength = strengths(packed, position, step)
    if strength.size == 0:
        return 1.0
    counted = round(PAPER_OVERDRAW / PAPER_LIGHTS * lights.drawn / step * position.shape[1])
    length = LONGEST * math.hypot(*np.ptp(np.concatenate([position, lights.position], axis=1), axis=1))
    if 0 < counted <= np.count_nonzero(strength):
        length = min(length, math.sqrt(PAPER_CUT / nth_largest(strength.reshape(-1), counted)))
    return min(max(length, 1 / LARGEST), LARGEST)


picture_length: Callable[..., float] = inspect.unwrap(reference_length)  # unobserved


def nth_largest(values: Array, n: int) -> float:
    """Return the n-th largest of values (m,) >= 0, float64: bits of such numbers are ordered as they are.

    >>> nth_largest(np.array([0.0, 3.0, 2.0, 3.0]), 3)
    2.0
    """
    leading = values.view(np.int64) >> BITS
    from_above = np.cumsum(np.bincount(leading)[::-1])
    place = int(np.searchsorted(from_above, n))
    among = values[leading == len(from_above) - 1 - place]
    n -= int(from_above[place - 1]) if place else 0
    return float(np.partition(among, -n)[-n])


def strengths(packed: Packed, position: Array, step: int) -> Array:
    """Return B of pairs over the largest I_0, of every so many-th diffuse light and lobe and all places, 1/m^2."""
    diffuse, lobes = all_peaks(packed)
    brightest = max(diffuse.max(), lobes.max(initial=0.0))
    peaks, glossy = diffuse[:-1:step], lobes[::step]
    strength = plane((len(peaks) + len(glossy), position.shape[1]), np.float64)
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
