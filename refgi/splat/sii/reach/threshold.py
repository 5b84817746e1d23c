"""I_low, the irradiance below which a pair is left out, and the range it gives each light (E-SII-11, E-SII-15).

The paper sets I_low to "x % of I_0", an irradiance to an intensity. Here it is one irradiance for all lights,
I_low = x max I_0 / L_ref^2: dim lights reach less far, as Sec. 3.6 says they do. The intensity of an RGB light is its
largest channel.

`cut_loss` is the share of light that the threshold removes: the picture's sum at sampled pixels against the full one.
"""

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.diagnostics import is_due
from refgi.draws import RANGE, draws
from refgi.errors import expect
from refgi.pairs.irradiance import Receivers
from refgi.pairs.loss import light_at, lost_share, sample_for, warn_of_loss
from refgi.pairs.packing import Packed, pack
from refgi.pairs.pixel_lights import Range
from refgi.splat.sii.settings import AbsoluteCut, ReachSettings, RelativeCut, SiiSettings
from refgi.stages import stage

if TYPE_CHECKING:
    from refgi.lights import PixelLights

Array = npt.NDArray[Any]

LEAST_THRESHOLD = 1e-200  # W/m^2: any light over it is a number
DIFFUSE, GLOSSY = 0, 1  # parts of a light, which have each their own xi


def low_irradiance(lights: "PixelLights", settings: SiiSettings) -> float:
    """Return I_low = x max I_0 / L_ref^2, or the absolute one, W/m^2; 0 without lights or without a cut.

    The peak of a lobe is its flux times its norm. Settings without a reference length get one from
    `with_reference_length`. With `per_light_ilow` this is the I_low of the brightest light.
    """
    packed = pack(lights, settings.pairs, np.zeros(lights.flux.shape[1]), np.float64)
    return threshold(np.concatenate(all_peaks(packed)), settings.reach)


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
