"""Hierarchical Screen-Space Indirect Illumination (Soler et al. 2009), for diffuse and glossy receivers.

Glossy pixels are receivers at full resolution on every level (`glossy`): on level k 4^k times as many sums as for
irradiance, whose receivers are its texels.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from refgi.diagnostics import is_due
from refgi.pairs.shadow_rays import receivers
from refgi.rsm.buffers.leaving import GlossyPoints, glossy_points, spread_over_picture
from refgi.rsm.raster.projection import Projection
from refgi.settings import replaced
from refgi.sssil.approximations import warn_of_few_samples
from refgi.sssil.bitmask import bitmask_gather
from refgi.sssil.blur import blur
from refgi.sssil.cameras import join_cameras
from refgi.sssil.crown import gather, level_factor
from refgi.sssil.form_factor import form_of
from refgi.sssil.glossy import Draws, draw_samples, fill_glossy_rays, glossy_receivers, march_samples, slice_samples
from refgi.sssil.levels import pyramid, sender_pyramid
from refgi.sssil.pattern import chosen_radius, every_texel, level_key, sample_weight, warn_short_reach
from refgi.sssil.rays import Traced, add_unoccluded, ray_gather, surfels_of
from refgi.sssil.settings import Bitmask, HssilSettings
from refgi.sssil.upsampling import Guide, upsample
from refgi.sssil.view import Level
from refgi.stages import report_progress, skip, stage, tally
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.frame import Frame


def hssil(frame: "Frame", settings: HssilSettings) -> Array:
    """Light what a camera sees by what it sees, near by at high and far away at low resolution.

    Parameters
    ----------
    frame : Frame
        Scene, camera and lights.
    settings : HssilSettings
        Sampling, levels, visibility and cameras.

    Returns
    -------
    (3, h, w) ndarray
        Indirect irradiance, W/m^2, linear RGB.
    """
    irradiance = one_view(frame, settings)
    if not settings.cameras.views:
        skip("sssil.cameras", "one camera")
        return irradiance
    # Sec. 5, discussion
    return join_cameras(frame, irradiance, settings.cameras, lambda other: one_view(other, settings))


class Seen(NamedTuple):
    """What a camera sees, the first level first, and what light between its texels is gathered with."""

    levels: list[Level]
    senders: list[Level]  # the same as senders
    settings: HssilSettings  # with a radius of crowns
    projection: Projection
    diagonal: float  # of the box of visible surfaces, m; 0 where no bitmask asks for it
    traced: Traced | None  # where rays are traced


def seen_by(frame: "Frame", settings: HssilSettings) -> Seen:
    """Return what a frame's camera sees."""
    levels = pyramid(frame, settings)  # Sec. 4, hierarchical maps
    senders = sender_pyramid(frame, levels, settings)
    settings = replaced(settings, {"sampling.radius": chosen_radius(levels[0].shape, settings.sampling)})
    diagonal = frame.visible_extent.diagonal if isinstance(settings.visibility, Bitmask) else 0.0
    traced = Traced(frame.gbuffer, frame.scene.geometry, frame.tracer) if settings.traces_rays else None
    return Seen(levels, senders, settings, frame.gbuffer.projection, diagonal, traced)


def one_view(frame: "Frame", settings: HssilSettings) -> Array:
    """Return the indirect irradiance (3, h, w), W/m^2, of what a camera sees by what this camera alone sees."""
    seen = seen_by(frame, settings)
    levels, settings = seen.levels, seen.settings
    if is_due("sssil.reach"):
        warn_short_reach(levels[0].shape, settings.sampling)
    warn_of_few_samples(levels, seen.senders, settings)
    irradiance = gather_level(seen, len(levels) - 1)
    for index in reversed(range(len(levels) - 1)):  # Sec. 3.2: starting from the smallest
        added = gather_level(seen, index)
        irradiance = upsample(irradiance, guide_of(levels[index + 1]), guide_of(levels[index]), settings, added)
    if levels[0].number == 0:
        skip("sssil.upsample", "light was gathered at full resolution")
        return irradiance
    depth, normal = frame.gbuffer.resolve("depth", "normal")
    return upsample(irradiance, guide_of(levels[0]), Guide(depth, normal), settings)


def gather_level(seen: Seen, index: int) -> Array:
    """Return the irradiance (3, h, w) of one level's texels by its samples, blurred where these differ by receiver."""
    level, senders, settings = seen.levels[index], seen.senders[index], seen.settings
    if settings.senders.only_level not in (None, index):
        return np.zeros_like(level.radiance)
    if isinstance(settings.visibility, Bitmask):
        irradiance = bitmask_gather(level, index, settings, seen.diagonal, senders)
    elif seen.traced is not None:
        irradiance = ray_gather(level, index, settings, seen.traced, senders)
    else:
        irradiance = gather(level, index, settings, senders)
    if settings.blur is None or settings.sampling.pattern in ("fixed", "all"):
        skip("sssil.blur", "none is asked for" if settings.blur is None else "all receivers share samples")
        return irradiance
    return blur(irradiance, level, settings.blur)


def guide_of(level: Level) -> Guide:
    """Return the guide (depths, normals) of joint bilateral upsampling to or from a level."""
    return Guide(level.depth, level.normal)


BATCH = 1 << 18  # pairs held at a time


def hssil_lobes(frame: "Frame", settings: HssilSettings) -> Array:
    """Return the radiance towards the eye, (3, h, w), that receivers' lobes make of what a camera sees.

    Whatever the pattern but "all", each pixel has samples of its own, and nothing is blurred.
    """
    lobes = view_lobes(frame, frame.glossy_points, settings)
    if not settings.cameras.views:
        return lobes
    eye = frame.scene.camera.eye

    def through(other: "Frame") -> Array:
        return view_lobes(other, glossy_points(other.gbuffer, other.materials, eye), settings)

    joined = join_cameras(frame, lobes, settings.cameras, through)
    glossy = np.zeros(joined.shape[1:], np.bool_)
    glossy.reshape(-1)[frame.glossy_points.pixel] = True
    return np.where(glossy, joined, joined.dtype.type(0.0))


def view_lobes(frame: "Frame", points: GlossyPoints, settings: HssilSettings) -> Array:
    """Return the lobes of some pixels of this camera, perhaps of another eye, by what it alone sees, (3, h, w)."""
    seen, total = seen_by(frame, settings), np.zeros(points.position.shape)
    for index, level in enumerate(seen.senders):
        if settings.senders.only_level in (None, index):
            total += glossy_level(points, level, index, seen.settings, seen.projection, seen.diagonal, seen.traced)
    radiance = (total * points.specular).astype(points.position.dtype)
    return spread_over_picture(points, radiance, (frame.height, frame.width))


@stage("sssil.glossy", kept=False)
def glossy_level(
    points: GlossyPoints, senders: Level, index: int, settings: HssilSettings, projection: Projection, diagonal: float,
    traced: Traced | None,
) -> Array:
    """Sum what lobes reflect of the samples of one level.

    index: 0 for the first level, whose inner disc is sampled as well.
    projection: Of the view whose level it is.
    diagonal: Of the scene, m, for a bitmask.
    traced: Of the same view, for rays.
    -> (3, n) float64: Radiance over the lobes' reflectance, W/m^2/sr.
    """
    to = glossy_receivers(points, projection)
    draws, slices = _draws(senders, index, settings), None
    if isinstance(settings.visibility, Bitmask):
        slices = slice_samples(to, senders, index, settings, diagonal)
    count = len(draws.weight) if slices is None else slices.per_receiver
    tally("pairs", lambda: len(points.pixel) * count)
    radiance = np.asarray(senders.radiance.reshape(3, -1), np.float64)
    total, step = np.zeros((3, len(points.pixel))), max(1, BATCH // max(count, 1))
    rays = None if traced is None else _Rays(traced, points, senders)
    form = form_of(settings.senders)
    transfer, sender = np.empty(step * count), np.empty(step * count, np.int64)
    blocked = np.zeros(step * count, np.bool_)
    for first in range(0, total.shape[1], step):
        last = min(first + step, total.shape[1])
        if slices is None:
            draw_samples(to, first, last, senders, draws, form, transfer, sender)
        else:
            march_samples(to, first, last, senders, slices, form, transfer, sender)
        if rays is not None:
            rays.trace(first, last, count, transfer, sender, blocked)
        add_unoccluded(radiance, first, last, count, blocked, transfer, sender, total)
        report_progress(last / total.shape[1])
    result: Array = total * level_factor(index, settings)
    return result


def _draws(level: Level, index: int, settings: HssilSettings) -> Draws:
    """Return how samples of a level are drawn; the radius of the settings is set."""
    sampling = settings.sampling
    assert sampling.radius is not None
    radius, key = float(sampling.radius), level_key(sampling.seed, level.number)
    if sampling.pattern == "all":
        every = every_texel(0.0 if index == 0 else radius, 2.0 * radius, level.shape)
        return Draws(0, radius, True, np.ones(len(every)), key, np.ascontiguousarray(every))
    inner, crown = sampling.counts(index)
    return Draws(inner, radius, sampling.density == "uniform", sample_weight(radius, inner, crown), key,
                 np.zeros((0, 2), np.int32))


class _Rays:
    """Shadow rays from glossy pixels to texels."""

    def __init__(self, traced: Traced, points: GlossyPoints, senders: Level) -> None:
        triangle_id = traced.buffer.triangle_id.reshape(-1)[points.pixel]
        self._tracer = traced.tracer
        self._to = receivers(traced.geometry, points.position, points.normal, triangle_id, traced.tracer.grain)
        self._from = surfels_of(senders, traced)

    def trace(self, first: int, last: int, count: int, transfer: Array, sender: Array, blocked: Array) -> None:
        """Fill which pairs of receivers `first` to `last` are blocked; pairs that transfer nothing are not traced."""
        size = (last - first) * count
        origin, direction = np.empty((size, 3), np.float32), np.empty((size, 3), np.float32)
        reach = np.empty(size, np.float32)
        fill_glossy_rays(self._to, self._from, first, last, count, sender, transfer, origin, direction, reach)
        self._tracer.fill_occluded(origin, direction, reach, blocked[:size])
