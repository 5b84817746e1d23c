"""The range of pixel lights one step after the other: peaks, B, lengths, pairs that count, their sum (SII Sec. 3.4).

B = I(w) / r^2 is the irradiance that a light causes at most; the largest channel of its intensity counts. A pair counts
where B >= I_low, one irradiance for all lights; the parts of a light, diffuse and glossy, have each their own range.

- pairs: Norms of lobes.
- low (one,): I_low, W/m^2.
"""

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from refgi.pairs.irradiance import Receivers, summed
from refgi.pairs.pixel_lights import Packed, PixelLights
from refgi.pairs.settings import PairSettings
from refgi.splat.sii.bounds import appendix_ellipsoid, tangent_ellipsoid
from refgi.splat.sii.settings import AbsoluteCut, FullBound, ReachSettings, RelativeCut, SiiSettings
from refgi.splat.sii.sii import sum_in_range
from refgi.splat.sii.threshold import (
    DIFFUSE,
    GLOSSY,
    all_peaks,
    light_range,
    packed_in_float64,
    picture_length,
    threshold,
)
from refgi.splat.sii.threshold import strengths as packed_strengths
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.rsm import Projection

Parts = tuple[Array, Array | None]  # diffuse, glossy: None where no light is glossy


@stage("sii.peaks", kept=False)
def peaks(lights: PixelLights, pairs: PairSettings) -> Parts:
    """Compute I_0, the peak intensity of each part of each light (SII Sec. 3.4; E-SII-11).

    -> diffuse_peak (light,): Largest channel of I_0 of the diffuse part, W/sr; 0 without it.
    -> glossy_peak (light,): That of the lobe, W/sr; 0 without it.
    """
    packed = packed_in_float64(lights, pairs)
    diffuse, lobes = all_peaks(packed)
    return _of_parts(lights, packed, diffuse[:-1], lobes)


@stage("sii.strengths", kept=False)
def strengths(receivers: Receivers, lights: PixelLights, pairs: PairSettings) -> Parts:
    """Compute B, what each light causes at each pixel at most (SII Sec. 3.4; E-SII-11).

    -> diffuse_strength (light, h, w): I(w) / r^2 of the diffuse part, W/m^2, without the pixel's cosine; 0 without
        surface.
    -> glossy_strength (light, h, w): That of the lobe, W/m^2.
    """
    here = receivers.covered.reshape(-1)
    position = np.ascontiguousarray(np.asarray(receivers.position, np.float64).reshape(3, -1)[:, here])
    packed = packed_in_float64(lights, pairs)
    diffuse, lobes = all_peaks(packed)
    values = packed_strengths(packed, position, 1) * max(diffuse.max(), lobes.max(initial=0.0))
    whole = np.zeros((len(values), here.size))
    whole[:, here] = values
    whole = whole.reshape(-1, *receivers.covered.shape)
    return _of_parts(lights, packed, whole[: len(diffuse) - 1], whole[len(diffuse) - 1 :])


@stage("sii.reference_length", kept=False)
def reference_length(receivers: Receivers, lights: PixelLights, pairs: PairSettings) -> Array:
    """Find the length under which 5 % of the largest peak leave 125 of 768 pairs (SII Fig. 8; E-SII-11).

    lights: The lights; those drawn without flux count as well.
    -> (one,): sqrt(0.05 / b), m: b the k-th largest B over the largest I_0 of all pairs of part and pixel, k = 125/768
        of all pairs of drawn light and pixel, rounded; at most 10 diagonals of pixels and lights; 1 where nothing is
        lit.
    """
    return np.array([picture_length(receivers, lights, pairs)])


@stage("sii.low_irradiance", kept=False)
def low_irradiance(length: Array, diffuse_peak: Array, glossy_peak: Array | None, share: float) -> Array:
    """Compute I_low, a share of max I_0 over L^2 (SII Sec. 3.4; E-SII-11).

    length (one,): Reference length L, m.
    diffuse_peak, glossy_peak (light,): Peak intensities of the parts of lights, W/sr.
    share: Of the largest peak.
    -> (one,): Irradiance under which pairs are left out, W/m^2; 0 without lights.
    """
    peak = diffuse_peak if glossy_peak is None else np.concatenate([diffuse_peak, glossy_peak])
    return np.array([threshold(peak, ReachSettings(cut=RelativeCut(share, float(length[0]))))], diffuse_peak.dtype)


@stage("sii.squares", kept=False)
def squares(low: Array, length: Array, diffuse_peak: Array, glossy_peak: Array | None, share: float) -> Parts:  # noqa: ARG001
    """Compute R_0^2 = I_0 / I_low of each part of each light (SII Sec. 3.4; E-SII-11).

    length (one,): Reference length, m, of wrong ones.
    diffuse_peak, glossy_peak (light,): Peak intensities of the parts of lights, W/sr.
    share: Of the largest peak, of wrong ones.
    -> diffuse_square (light,): Square of the largest distance at which the diffuse part counts, m^2.
    -> glossy_square (light,): That of the lobe, m^2.
    """
    diffuse, glossy = (None if peak is None else light_range(
        peak, float(low[0]), ReachSettings(cut=None), part, diffuse_peak.dtype).square
        for part, peak in ((DIFFUSE, diffuse_peak), (GLOSSY, glossy_peak)))
    assert diffuse is not None
    return diffuse, glossy


@stage("sii.kept", kept=False)
def kept(low: Array, diffuse_strength: Array, glossy_strength: Array | None) -> Parts:
    """Find the pairs that count: B >= I_low (SII Sec. 3.4; E-SII-11).

    diffuse_strength, glossy_strength (light, h, w): B of the parts of lights, W/m^2.
    -> diffuse_kept (light, h, w) bool: True where the diffuse part counts; never where B is 0.
    -> glossy_kept (light, h, w) bool: True where the lobe counts.
    """
    diffuse, glossy = (None if one is None else (one >= low[0]) & (one > 0)
                       for one in (diffuse_strength, glossy_strength))
    assert diffuse is not None
    return diffuse, glossy


@stage("sii.range_sum", kept=False)
def range_sum(
    diffuse_kept: Array, glossy_kept: Array | None, receivers: Receivers, lights: PixelLights,  # noqa: ARG001
    footprint: Array | None, low: Array, pairs: PairSettings,
) -> Array:
    """Sum the irradiance of the pairs that count (SII Sec. 3.4; E-SII-11).

    diffuse_kept, glossy_kept (light, h, w) bool: Pairs that count, as a port may read them; here B is compared anew.
    -> (3, h, w): Indirect irradiance, W/m^2, without visibility and albedo/pi.
    """
    if low[0] <= 0:
        return summed(receivers, lights, pairs, footprint)
    settings = SiiSettings(pairs=pairs, reach=ReachSettings(cut=AbsoluteCut(float(low[0])), bound=FullBound()))
    return sum_in_range(receivers, lights, settings, footprint)


@stage("sii.other_ranges", kept=False)
def other_ranges(receivers: Receivers, lights: PixelLights, settings: SiiSettings, footprint: Array | None) -> Array:
    """Sum the irradiance of pairs within ranges that are drawn, or of each light alone (SII Sec. 3.4).

    -> (3, h, w): Indirect irradiance, W/m^2, without visibility and albedo/pi.
    """
    plain = dataclasses.replace(settings, reach=dataclasses.replace(settings.reach, bound=FullBound()))
    return sum_in_range(receivers, lights, plain, footprint)


@stage("sii.ellipsoids", kept=False)
def ellipsoids(exponent: Array) -> tuple[Array, ...]:
    """Bound the region where B >= I_low by ellipsoids of revolution (SII Eq. 7 and 8; E-SII-12, E-SII-13).

    exponent (shape,): Exponent n of cos^n; 1: diffuse.
    -> appendix_center (shape,): Centre along the axis of the one that is centred where the region is widest, in R_0.
    -> appendix_half_width (shape,): Its half axis along the axis, in R_0.
    -> appendix_height (shape,): Its half axis across, in R_0.
    -> tangent_center (shape,): Centre along the axis of the least wasteful one through the light, in R_0.
    -> tangent_half_width (shape,): Its half axis along the axis, in R_0.
    -> tangent_height (shape,): Its half axis across, in R_0.
    """
    return tuple(np.asarray(one, exponent.dtype) for one in (*appendix_ellipsoid(exponent),
                                                             *tangent_ellipsoid(exponent)))


def splat_steps(
    receivers: Receivers, lights: PixelLights, settings: SiiSettings, footprint: Array | None,
    projection: "Projection | None",  # noqa: ARG001 bounds change no bit
) -> Array:
    """Return the irradiance of the pairs in range, by steps."""
    cut, pairs = settings.reach.cut, settings.pairs
    if settings.reach.stochastic or (isinstance(cut, RelativeCut) and cut.as_published):
        return other_ranges(receivers, lights, settings, footprint)
    if isinstance(cut, RelativeCut):
        diffuse, glossy = peaks(lights, pairs)
        if cut.reference_length in (None, picture_length(receivers, lights, pairs)):
            length = reference_length(receivers, lights, pairs)
        else:
            length = np.array([cut.reference_length])
        low = low_irradiance(length, diffuse, glossy, cut.share)
        squares(low, length, diffuse, glossy, cut.share)
    else:
        assert isinstance(cut, AbsoluteCut)
        low = np.array([cut.irradiance])
    counted = kept(low, *strengths(receivers, lights, pairs))
    return range_sum(*counted, receivers, lights, footprint, low, pairs)


def _of_parts(lights: PixelLights, packed: Packed, diffuse: Array, lobes: Array) -> Parts:
    """Return values (K, ...) of packed parts as (N, ...): 0 for lights without that part."""
    made = []
    for chosen, value in ((packed.shines, diffuse), (packed.glossy, lobes)):
        whole = np.zeros((lights.flux.shape[1], *value.shape[1:]), lights.flux.dtype)
        whole[chosen] = value
        made.append(whole)
    return made[0], None if lights.lobe_flux is None else made[1]
