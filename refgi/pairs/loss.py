"""Share of light that a setting removes from a picture, estimated from some of its pixels.

A clamp or a cut is a bias that no picture shows. The share it removes is that of two sums over the same lights, with
the setting and without, at pixels that are the same in every run. Without a clamp a few near pairs hold much of the
sum, so the share is as good as the sample: within 3 of 100 in the tests.
"""

import dataclasses
import warnings
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.diagnostics import is_due
from refgi.errors import RefgiWarning
from refgi.pairs.irradiance import Receivers, add_lights
from refgi.pairs.packing import pack
from refgi.pairs.settings import PairSettings
from refgi.pairs.tiles import nth_by_block, strip_starts, taken
from refgi.stages import stage

if TYPE_CHECKING:
    from refgi.pairs.pixel_lights import PixelLights

Array = npt.NDArray[Any]

PAIRS = 1 << 20  # about as many are summed: a millisecond's work
LEAST_SAMPLED = 2048  # pixels, however many lights there are
THINNED = 2048  # lights, where there are too many to sum in full
LEAST_LOSS = 0.02  # share of the light below which a loss gives no warning


class Sample(NamedTuple):
    """Some pixels of a picture."""

    place: Array  # (n,) int64, flat indices
    position: Array  # (3, n) m
    normal: Array  # (3, n)


def sample_pixels(receivers: Receivers, count: int) -> Sample:
    """Sample pixels with a surface from all over a picture, the same ones in every run.

    One out of each of `count` equal stretches of the picture's blocks, at van der Corput's place in it; all where there
    are fewer.
    """
    covered = np.asarray(receivers.covered, np.bool_)
    starts = strip_starts(covered)
    count = min(count, int(starts[-1]))
    ends = np.arange(count + 1) * starts[-1] // max(1, count)
    nth = ends[:-1] + (_van_der_corput(count) * np.diff(ends)).astype(np.int64)
    chosen = nth_by_block(covered, starts, nth)
    return Sample(chosen, *(taken(np.asarray(plane), chosen) for plane in (receivers.position, receivers.normal)))


def _van_der_corput(count: int) -> Array:
    index, value, digit = np.arange(count), np.zeros(count), 0.5
    while index.any():
        value, index, digit = value + digit * (index & 1), index >> 1, digit / 2
    return value


def sample_for(receivers: Receivers, lights: "PixelLights", *, least: int = LEAST_SAMPLED) -> Sample:
    """Sample about PAIRS / N pixels for N lights, at least `least`: few lights cost little and have high peaks."""
    return sample_pixels(receivers, max(least, PAIRS // max(1, lights.flux.shape[1])))


def thinned(lights: "PixelLights", footprint: Array | None) -> tuple["PixelLights", Array | None]:
    """Return one of every few lights, THINNED or more, and their areas: enough for the share of a loss."""
    step = max(1, lights.flux.shape[1] // THINNED)
    every = {name: value for name, value in lights._asdict().items() if name != "drawn" and value is not None}
    some: dict[str, Any] = {name: value[..., ::step] for name, value in every.items()}
    return lights._replace(**some), None if footprint is None else footprint[::step]


def light_at(
    sample: Sample, lights: "PixelLights", settings: PairSettings, footprint: Array | None = None
) -> float:
    """Return the mean irradiance (W/m^2) of all lights, uncut, over sampled pixels and channels; 0 for no pixels."""
    sums = np.zeros_like(sample.position)
    add_lights(sample.position, sample.normal, pack(lights, settings, footprint, sums.dtype), sums)
    return float(sums.mean(dtype=np.float64)) if sums.size else 0.0


@stage("pairs.clamp_loss")
def clamp_loss(
    receivers: Receivers, lights: "PixelLights", settings: PairSettings, footprint: Array | None = None
) -> float:
    """Return the share of the light that a clamp removes from a picture; below 0 where it adds some.

    settings: The clamp.
    -> float: Of the light without visibility.
    """
    sample = sample_for(receivers, lights)
    clamped = light_at(sample, lights, settings, footprint)
    return lost_share(light_at(sample, lights, dataclasses.replace(settings, clamp=None)), clamped)


def lost_share(whole: float, left: float) -> float:
    """Return 1 - left / whole, two sums in one unit; 0 where there is no light."""
    return 1 - left / whole if whole > 0 else 0.0


def warn_of_clamp(
    receivers: Receivers, lights: "PixelLights", settings: PairSettings, footprint: Array | None, method: str
) -> None:
    """Warn where the clamp of a method removes more than `LEAST_LOSS` of the light of a picture."""
    if settings.clamp is not None and settings.clamps and is_due("pairs.clamp_loss"):
        value = getattr(settings.clamp, "value", None)
        warn_of_loss(clamp_loss(receivers, lights, settings, footprint),
                     f"{method}: clamp {settings.clamp.name()!r}" + (f" of {value:g}" if value is not None else ""))


def warn_of_loss(share: float, setting: str) -> None:
    """Warn where `setting` (method, key and value) removes more than `LEAST_LOSS` of the light."""
    if share > LEAST_LOSS:
        warnings.warn(RefgiWarning(f"{setting} takes {100 * share:.0f} % of the indirect light"), stacklevel=3)
