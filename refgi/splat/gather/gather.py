"""Gathering from the reflective shadow map (Dachsbacher and Stamminger 2005), the baseline of SII Fig. 12.

Each pixel sums texels in a disc around its own place in the map. With `grid` the sum runs at a coarse grid of pixels
first; a pixel whose coarse neighbours resemble it in place and normal gets their interpolated light.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from refgi.diagnostics import SamplingError, asked, is_due
from refgi.lights.settings import RSM_RESOLUTION, VISIBILITY, changed
from refgi.method import Approximation
from refgi.pairs.estimates import LEAST_SAMPLED, error_of_halves, warn_of_loss, warn_of_sampling
from refgi.pairs.irradiance import Receivers
from refgi.pairs.sample import sample_pixels
from refgi.pairs.tiles import clear, receiving
from refgi.rsm.buffers.leaving import GlossyPoints, spread_over_picture
from refgi.scene.values import LARGEST
from refgi.settings import LAST_SEED, Settings, setting
from refgi.splat.gather.gather_sum import (
    GatherMap,
    SimilarityLimits,
    centers,
    coarse_pixels,
    disc_loss,
    disc_pattern,
    gather_discs,
    interpolate,
)
from refgi.stages import skip, stage, tally
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.frame import Frame
    from refgi.rsm import Rsm
    from refgi.rsm.buffers.extent import Extent

WIDEST = 1000.0  # map widths; any disc past sqrt 2 covers the whole map


@dataclasses.dataclass(frozen=True)
class DiscSettings(Settings):
    """The texels that a pixel sums."""

    SWITCHES: ClassVar[frozenset[str]] = frozenset({"rsm_weight_squared"})

    samples: int = setting(308, "texels in a disc", least=1, most=1 << 28)
    radius: float = setting(0.3, "of the disc; over sqrt 2: the whole map", above=0.0, most=WIDEST, unit="map widths")
    seed: int = setting(0, "of a shift of the samples; 0: none", least=0, most=LAST_SEED)
    offset: float = setting(0.0, "how far texels are moved back along their normals", least=-LARGEST, most=LARGEST,
                            unit="m", study=True)
    as_published: frozenset[str] = setting(frozenset(), "forms of the weights to use as printed", study=True)


@dataclasses.dataclass(frozen=True)
class Interpolation(Settings):
    """A coarse grid of pixels runs the sum; similar pixels interpolate between them."""

    NAME = "coarse"

    grid: int = setting(64, "coarse pixels along each side of the picture", least=1)
    least_cosine: float = setting(0.9, "least cosine between normals of similar pixels", least=-1.0, most=1.0)
    reach: float = setting(0.05, "largest distance of similar pixels, as a share of the scene's diagonal", least=0.0)


@dataclasses.dataclass(frozen=True)
class GatherSettings(Settings):
    """Settings of `gather`; the defaults are the papers' (308 samples, 64^2 sub-sampling, SII Fig. 12)."""

    disc: DiscSettings = setting(DiscSettings(), "texels that a pixel sums")
    interpolation: Interpolation | None = setting(
        Interpolation(), "screen-space interpolation; none: every pixel runs the sum")


PRESETS = {"paper": GatherSettings()}


class Gathered(NamedTuple):
    """Light by gathering, and how many pixels ran the sum."""

    irradiance: Array  # (3, h, w) W/m^2
    evaluated: int  # pixels that ran the sum
    covered: int  # pixels with a surface


def gather(frame: "Frame", settings: GatherSettings) -> Array:
    """Light every pixel by texels around its place in the reflective shadow maps.

    Parameters
    ----------
    frame : Frame
        The scene and its buffers.
    settings : GatherSettings
        Disc, samples and interpolation.

    Returns
    -------
    (3, h, w) ndarray
        Indirect irradiance, W/m^2, linear RGB, without visibility.
    """
    light = gather_counted(frame, settings).irradiance
    receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
    disc = settings.disc
    if is_due("gather.loss"):
        warn_of_loss(disc_loss(receivers, frame.rsms, disc.radius, disc.offset),
                     f"gather: disc.radius {disc.radius:g} of a map's width")
    found = asked("gather.sampling_error")
    if found is not None:
        found.sampling_error = gather_sampling_error(receivers, frame.rsms, disc)
        warn_of_sampling(found.sampling_error, "gather")
    return light


def gather_counted(frame: "Frame", settings: GatherSettings) -> Gathered:
    """Light every pixel as `gather` does and count the pixels that ran the sum."""
    buffer = frame.gbuffer
    receivers = Receivers(buffer.position, buffer.normal, buffer.covered)
    shown, covered = receiving(buffer.covered), int(np.count_nonzero(buffer.covered))
    coarsely, disc = settings.interpolation, settings.disc
    if coarsely is None or coarsely.grid >= max(frame.height, frame.width):
        skip("gather.coarse", "every pixel runs the sum")
        total = gather_irradiance(receivers._replace(covered=shown), frame.rsms, disc)
        clear(total, buffer.covered, shown)
        return Gathered(total, covered, covered)
    light = gather_coarsely(receivers, shown, frame.rsms, disc, coarsely, frame.visible_extent)
    return Gathered(*light, covered)


@stage("gather.coarse", steps="refgi.splat.gather.steps.coarse_steps")
def gather_coarsely(
    receivers: Receivers, shown: Array, rsms: "Sequence[Rsm]", disc: DiscSettings, coarsely: Interpolation,
    extent: "Extent",
) -> tuple[Array, int]:
    """Sum at coarse pixels and at those that are not like them; interpolate between the coarse ones elsewhere.

    shown (h, w) bool: Pixels that are computed.
    coarsely: The grid of coarse pixels.
    extent: Box of the visible surfaces, m.
    -> irradiance (3, h, w): Irradiance, W/m^2, linear RGB.
    -> evaluated int: Pixels that ran the sum.
    """
    coarse = coarse_pixels(shown.shape[0], shown.shape[1], coarsely.grid)
    first = np.zeros_like(shown)
    first[np.ix_(*coarse)] = True
    coarse_light = gather_irradiance(receivers._replace(covered=shown & first), rsms, disc)
    limits = SimilarityLimits(coarsely.least_cosine, coarsely.reach * extent.diagonal)
    result, interpolated = interpolate(receivers, coarse_light, coarse, limits)
    rest = receivers._replace(covered=shown & ~interpolated)
    total = result + gather_irradiance(rest, rsms, disc)
    clear(total, receivers.covered, shown)
    return total, int(np.count_nonzero(shown & first) + np.count_nonzero(rest.covered & ~first))


@stage("gather.irradiance", steps="refgi.splat.gather.steps.gather_steps")
def gather_irradiance(receivers: Receivers, rsms: "Sequence[Rsm]", disc: DiscSettings) -> Array:
    """Sum the irradiance of the texels in each receiver's disc.

    rsms: Reflective shadow maps, one a light; of glossy materials only the diffuse part is gathered.
    -> (3, h, w): Irradiance, W/m^2, linear RGB; 0 where there is no surface. Excludes the receiver's albedo/pi.

    E = (2 pi r_max^2 T / S) sum xi_1 E_t with T the texels of one map and E_t the light of one texel (Eq. 2), which
    has the mean of the full sum over the disc. The papers scale by hand. A receiver outside the map gathers
    where the straight way to the map's middle meets its border. Maps of several faces are one sheet: a disc runs on
    into the next face's rows.
    """
    position, normal, covered = receivers
    result = np.zeros_like(position)
    places = np.flatnonzero(covered)
    points, normals = (np.take(part.reshape(3, -1), places, axis=1) for part in (position, normal))
    total = np.zeros_like(points)
    for rsm in rsms:
        _gather_one(points, normals, rsm, disc, total)
    result.reshape(3, -1)[:, places] = total
    return result


@stage("gather.sampling_error")
def gather_sampling_error(receivers: Receivers, rsms: "Sequence[Rsm]", disc: DiscSettings) -> SamplingError | None:
    """Return how much the light of a picture depends on where the samples of its discs lie, from two halves of them.

    -> SamplingError: Of the light within the discs, at sampled pixels; None where there is none.
    """
    sample = sample_pixels(receivers, LEAST_SAMPLED)
    halves = np.zeros((2, *sample.position.shape), sample.position.dtype)
    for rsm in rsms:
        source, pattern, scale = disc_texels(rsm, disc, sample.position.dtype)
        middle = centers(rsm.projection, sample.position)
        # a Halton set's halves are its first and last points
        for part, total in zip(np.array_split(pattern, 2), halves, strict=True):
            gather_discs(sample.position, sample.normal, middle, source, part, scale, None, total)
    return error_of_halves(halves[0], halves[1], disc.samples, "samples of a disc")


def _gather_one(points: Array, normals: Array, rsm: "Rsm", disc: DiscSettings, total: Array) -> None:
    if rsm.lobe_flux is not None:
        skip("gather.lobes", "gathering takes the diffuse part alone")
    tally("pairs", lambda: points.shape[1] * disc.samples)
    source, pattern, scale = disc_texels(rsm, disc, points.dtype)
    gather_discs(points, normals, centers(rsm.projection, points), source, pattern, scale, None, total)


def disc_texels(rsm: "Rsm", disc: DiscSettings, dtype: np.dtype[Any]) -> tuple[GatherMap, Array, Any]:
    """Return a map's texels, the pattern of a disc on it and the scale of its sum, as `gather_discs` takes them.

    Texels and scale are of `dtype`.
    """
    height, width = rsm.projection.height, rsm.projection.width  # of one map
    pattern = disc_pattern(disc.samples, disc.seed, "rsm_weight_squared" in disc.as_published)
    scale = disc.radius**2 * height * width / (math.pi * disc.samples)
    pattern *= (disc.radius * height, disc.radius * width, 1.0)
    texels = (rsm.position - disc.offset * rsm.normal, rsm.normal, rsm.flux)
    source = GatherMap(*(np.ascontiguousarray(part, dtype) for part in texels))
    return source, pattern, dtype.type(scale)


WHOLE_MAP = 1.42  # map widths: more than sqrt 2
MANY = 1 << 15  # texels of a disc


def _whole_map(settings: GatherSettings, _: Mapping[str, Any]) -> GatherSettings:
    disc = dataclasses.replace(settings.disc, radius=max(WHOLE_MAP, settings.disc.radius))
    return dataclasses.replace(settings, disc=disc)


def _many(settings: GatherSettings, _: Mapping[str, Any]) -> GatherSettings:
    disc = dataclasses.replace(settings.disc, samples=max(MANY, settings.disc.samples), seed=0)
    return dataclasses.replace(settings, disc=disc)


APPROXIMATIONS = (
    VISIBILITY, RSM_RESOLUTION,
    Approximation("cut", "texels beyond a disc around the pixel's place in the map are left out", _whole_map),
    Approximation("few samples", f"S texels of the disc; off: {MANY}", _many),
    Approximation("upsampling", "pixels of a coarse grid are evaluated, similar ones interpolated",
                  changed(interpolation=None)))


def gather_lobes(frame: "Frame", settings: GatherSettings) -> Array:
    """Return the radiance towards the eye that receivers' lobes make of the texels in their discs.

    (3, h, w), W/m^2/sr, linear RGB, without visibility; 0 where there is no lobe. Every glossy pixel runs the sum, and
    none is interpolated.
    """
    points = frame.glossy_points
    return spread_over_picture(points, gather_glossy(points, frame.rsms, settings.disc), (frame.height, frame.width))


@stage("gather.glossy")
def gather_glossy(points: GlossyPoints, rsms: "tuple[Rsm, ...]", disc: DiscSettings) -> Array:
    """Sum the radiance that lobes make of the texels in each receiver's disc.

    rsms: Reflective shadow maps, one a light; of glossy materials only the diffuse part is gathered.
    -> (3, n): W/m^2/sr, linear RGB: the terms of `gather_irradiance`, each times f_s.
    """
    total = np.zeros_like(points.position)
    for rsm in rsms:
        tally("pairs", lambda: len(points.pixel) * disc.samples)
        source, pattern, scale = disc_texels(rsm, disc, points.position.dtype)
        gather_discs(points.position, points.normal, centers(rsm.projection, points.position), source, pattern, scale,
                     points, total)
    radiance: Array = total * points.specular
    return radiance
