"""What a sum of pixel lights is off by, estimated at some pixels: light that a setting removes, error of sampling.

The share that a clamp or cut removes is that of two sums over the same lights at the same pixels. The error of sampling
is seen by halves of the lights: each, doubled, is an estimate of the picture, so half of their difference is one of the
error of both together; a light so near that it decides the error is seen only where a sampled pixel is near it. Where
all lights are far from what is seen halves agree on too little: what lit pixels send to each other bounds the light.
"""

import dataclasses
import math
import warnings
from typing import TYPE_CHECKING

import numpy as np

from refgi.diagnostics import SamplingError, asked, is_due
from refgi.errors import RefgiWarning
from refgi.pairs.irradiance import Receivers, add_lights
from refgi.pairs.pixel_lights import pack
from refgi.pairs.sample import LOOKED, Sample, sample_peaks, sample_pixels
from refgi.pairs.settings import STRONGEST_CLAMP, DiscClamp, GeometryClamp, PairSettings
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.frame import Frame
    from refgi.pairs.pixel_lights import PixelLights
    from refgi.scene import Camera

SHARP = 1e5  # exponent from which on lobes may vanish; wider ones that are missed show as sampling error
LEAST_REACHING = 0.01  # lobes that reach a receiver, in the mean


def vanishing(lights: "PixelLights") -> Array:
    """Return which lights have lobes that reach fewer than `LEAST_REACHING` of the receivers, (N,) bool."""
    if lights.lobe_flux is None or lights.lobe_exponent is None:
        return np.zeros(lights.flux.shape[1], np.bool_)
    sharp: Array = lights.lobe_flux.any(axis=0) & (lights.lobe_exponent >= SHARP)
    for exponent in np.unique(lights.lobe_exponent[sharp]):
        same = sharp & (lights.lobe_exponent == exponent)
        if 2.0 * np.count_nonzero(same) >= LEAST_REACHING * (float(exponent) + 1.0):
            sharp &= ~same
    return sharp


def warn_of_mirrors(frame: "Frame", lights: "PixelLights", method: str) -> None:
    """Warn whoever collects diagnostics of lights whose lobes vanish, with the materials that they lie on."""
    if lights.lobe_flux is None or lights.lobe_exponent is None or asked("pairs.mirrors") is None:
        return
    gone = vanishing(lights)
    if gone.any():
        real, exponents = lights.lobe_exponent.dtype.type, set(lights.lobe_exponent[gone].tolist())
        names = [material.name for material in frame.scene.materials
                 if material.is_glossy and not material.is_dielectric and float(real(material.exponent)) in exponents]
        flux = lights.lobe_flux[:, gone].sum(dtype=np.float64)
        share = flux / (lights.flux.sum(dtype=np.float64) + lights.lobe_flux.sum(dtype=np.float64))
        warnings.warn(RefgiWarning(
            f"{method}: the lobes of {len(names)} material(s), {', '.join(map(repr, names))}, are too sharp (exponent "
            f"{min(exponents):g} or more) for {np.count_nonzero(gone)} pixel lights, which reach fewer than 1 receiver "
            f"in {1 / LEAST_REACHING:.0f}: {100 * share:.0f} % of the flux of {len(gone)} lights vanishes or lights "
            "single pixels"), stacklevel=3)


PAIRS = 1 << 20  # about as many are summed: a millisecond's work
ALL_PAIRS = 1 << 24  # up to which all pixels that are looked at are summed, and none are searched for
LEAST_SAMPLED = 2048  # pixels, however many lights there are
THINNED = 2048  # lights, where there are too many to sum in full
UNREACHED = GeometryClamp(STRONGEST_CLAMP)  # a bound in place of no clamp: one kernel less to compile
LEAST_LOSS = 0.02  # share of the light below which a loss gives no warning


def pixels_for(lights: "PixelLights", least: int = LEAST_SAMPLED) -> int:
    """Return about PAIRS / N pixels to sample for N lights, at least `least`: few cost little and have high peaks."""
    return max(least, PAIRS // max(1, int(lights.flux.shape[1])))


def sample_for(receivers: Receivers, lights: "PixelLights", *, least: int = LEAST_SAMPLED) -> Sample:
    """Sample as many pixels as `pixels_for` says."""
    return sample_pixels(receivers, pixels_for(lights, least))


def thinned(
    lights: "PixelLights", footprint: Array | None, least: int = THINNED
) -> tuple["PixelLights", Array | None]:
    """Return one of every few lights, `least` or more, and their areas: enough for the share of a loss."""
    some = slice(None, None, max(1, lights.flux.shape[1] // least))
    return lights.selected(some), None if footprint is None else footprint[some]


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
    return lost_share(light_at(sample, lights, dataclasses.replace(settings, clamp=UNREACHED)), clamped)


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


LEAST_ERROR = 0.2  # share of the light from which a sampling error gives a warning
SENDERS = 1024  # pixels that send light to each other
MANY = 1 << 15  # lights, of which one of every few stands for all
GRAZING = 0.02  # least cosine of a pixel's surface
FEW_SAMPLED = 256  # pixels, where a picture does not sum all of its lights
QUANTILE = 1.645  # of the normal distribution, 95 of 100
RUNS = 64  # of sampled pixels that follow each other


@stage("pairs.sampling_error")
def sampling_error(
    receivers: Receivers, lights: "PixelLights", settings: PairSettings, footprint: Array | None = None,
    least: int = LEAST_SAMPLED,
) -> SamplingError | None:
    """Return how much a picture's light depends on which lights were drawn.

    least: Pixels to sample at least.
    -> SamplingError: Of the light without visibility; None where every texel is a light, or there is no light.
    """
    if lights.half is None:
        return None
    packed = pack(lights, settings, footprint, np.asarray(receivers.position).dtype)
    every = LOOKED * lights.flux.shape[1] <= ALL_PAIRS
    sample = sample_pixels(receivers, LOOKED) if every else sample_peaks(receivers, packed, pixels_for(lights, least))
    halves = []
    for second in (False, True):
        sums = np.zeros_like(sample.position)
        add_lights(sample.position, sample.normal, packed.part(lights.half == second), sums)
        halves.append(sums)
    return error_of_halves(halves[0], halves[1], lights.drawn, weight=sample.weight)


def error_of_halves(
    first: Array, second: Array, samples: int, of: str = "pixel lights", weight: Array | None = None
) -> SamplingError | None:
    """Return the error of the sum of two halves (3, n) of a picture's light, not doubled; None where there is none.

    It is |2 first - 2 second| / 2 over the mean of first + second; `samples` counts both halves, `weight` (n,) says how
    many pixels each stands for; neighbours follow each other. For its bound, squares are those of m normal numbers, in
    this draw and in others: the root of a ratio of two chi-squares over m, by Fisher's z. m is Kish's effective number
    of pixels, and of runs of pixels by what is common to each.

    >>> error_of_halves(np.array([[1.0, 2.0]]), np.array([[2.0, 1.0]]), 8)[:2]
    (0.3333333333333333, 0.0)
    """
    share = np.full(first.shape[1], 1.0) if weight is None else weight
    share = share / max(share.sum(), 1e-300)
    whole = float(((first + second).mean(axis=0, dtype=np.float64) * share).sum())
    if whole <= 0:
        return None
    off = np.subtract(first, second, dtype=np.float64)
    parts = (off**2).mean(axis=0) * share
    first_of_run = np.unique(np.arange(RUNS) * len(share) // RUNS)
    sums = np.add.reduceat(np.concatenate([off * share, share[None]]), first_of_run, axis=1)
    common = (sums[:-1] ** 2).mean(axis=0) / sums[-1]
    pixel, spread = math.sqrt(parts.sum()) / whole, math.sqrt((parts**2).sum() + (common**2).sum())
    most = pixel * math.exp(QUANTILE * spread / parts.sum()) if pixel > 0 else 0.0
    return SamplingError(pixel, abs(float((off.mean(axis=0) * share).sum())) / whole, most, samples, of)


@stage("pairs.seen_light")
def seen_light(camera: "Camera", albedo: Array, direct: Array, receivers: Receivers, lights: "PixelLights") -> float:
    """Return the light that visible surfaces under direct light send to each other, over that of all pixel lights.

    direct (3, h, w): Direct irradiance, W/m^2.
    -> float: Both without visibility and at the same sampled pixels; 0 without any light, inf where pixel lights alone
        have none. Pixels send as discs, which rather lowers their light.
    """
    sample = sample_pixels(receivers, SENDERS)
    some, _ = thinned(lights, None, MANY)
    share = some.flux.shape[1] / max(1, lights.flux.shape[1])
    whole = light_at(sample, some, PairSettings(clamp=UNREACHED)) / (share or 1.0)
    area = _areas(camera, direct.shape[1], sample) * (np.count_nonzero(receivers.covered) / max(1, len(sample.place)))
    reflected = [plane.reshape(3, -1)[:, sample.place] for plane in (albedo, direct)]
    sent = lights._replace(position=sample.position, normal=sample.normal, flux=reflected[0] * reflected[1] * area,
                           lobe_flux=None, lobe_axis=None, lobe_exponent=None, texel=None, map_index=None, half=None)
    seen = light_at(sample, sent, PairSettings(clamp=DiscClamp()), area)
    return seen / whole if whole > 0 else math.inf if seen > 0 else 0.0


def _areas(camera: "Camera", rows: int, sample: Sample) -> Array:
    """Return the surface (n,), m^2, that each pixel of a picture of so many rows shows."""
    ahead = np.subtract(camera.target, camera.eye)
    ray = sample.position - np.asarray(camera.eye, sample.position.dtype)[:, None]
    depth = (ray.T @ (ahead / np.linalg.norm(ahead))).astype(ray.dtype)
    height = np.maximum(np.abs((ray * sample.normal).sum(axis=0)), GRAZING * depth)
    pixel = ray.dtype.type((2 * math.tan(camera.vfov / 2) / rows) ** 2)
    # in the plane of the eye a pixel shows nothing
    return np.asarray(np.divide(pixel * depth**3, height, out=np.zeros_like(depth), where=(depth > 0) & (height > 0)))


def report_sampling(
    frame: "Frame", receivers: Receivers, lights: "PixelLights", settings: PairSettings, footprint: Array | None,
    method: str, *, all_summed: bool = True,
) -> None:
    """Tell whoever collects diagnostics of a method's sampling error, and warn where it is more than `LEAST_ERROR`.

    Also warn of lobes that no receiver meets.
    """
    warn_of_mirrors(frame, lights, method)
    found = asked("pairs.sampling_error")
    if found is not None:
        few = not all_summed and lights.lobe_flux is None  # clusters stand for diffuse lights alone
        stated = sampling_error(receivers, lights, settings, footprint, FEW_SAMPLED if few else LEAST_SAMPLED)
        found.sampling_error = with_seen_light(stated, frame, receivers, lights)
        warn_of_sampling(found.sampling_error, method)


def with_seen_light(
    stated: SamplingError | None, frame: "Frame", receivers: Receivers, lights: "PixelLights"
) -> SamplingError | None:
    """Return a sampling error that is no less than what lights lack of the light of visible surfaces.

    Warns where none that was drawn has flux, which a picture alone does not tell from a scene without indirect light.
    """
    if stated is None:
        if lights.drawn and not lights.flux.any() and math.isinf(_seen_light(frame, receivers, lights)):
            warnings.warn(RefgiWarning(f"sampling error: none of {lights.drawn:,} pixel lights has flux, but surfaces "
                                       "that are seen light each other; more of them bring light"), stacklevel=3)
        return None
    lacking = _seen_light(frame, receivers, lights) - 1
    return stated._replace(pixel=max(stated.pixel, lacking), mean=max(stated.mean, lacking),
                           most=max(stated.most, lacking))


def _seen_light(frame: "Frame", receivers: Receivers, lights: "PixelLights") -> float:
    return seen_light(frame.scene.camera, frame.sent_albedo, frame.direct, receivers, lights)


def warn_of_sampling(error: SamplingError | None, method: str) -> None:
    """Warn where a method's sampling error is more than `LEAST_ERROR`."""
    if error is not None and error.pixel > LEAST_ERROR:
        warnings.warn(RefgiWarning(f"{method}: {error.statement}; more {error.of} lower it"), stacklevel=3)
