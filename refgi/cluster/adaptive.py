"""Number of area lights by a target error of visibility, which Dong et al. leave as future work (Sec. 8).

At some pixels all pixel lights are summed with a shadow ray for each and under the visibility of their area lights.
Area lights are doubled until the two are near enough to each other, and one step back is tried.
"""

import dataclasses
import math
import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from refgi.cluster.clustered import clustered_irradiance
from refgi.cluster.kmeans import clusters_of
from refgi.cluster.maps import ShadowMaps, shadow_maps
from refgi.cluster.occluders import ends_of
from refgi.cluster.rectangle import AreaLights, area_lights
from refgi.cluster.reference import reference_visibility, vpl_visibility
from refgi.cluster.settings import WITHOUT_MAPS, AdaptiveClusters
from refgi.errors import RefgiWarning, expect
from refgi.jit import threads
from refgi.lights.selection import footprints
from refgi.pairs.irradiance import Receivers
from refgi.rsm import facing_normals
from refgi.sampling import AREA_LIGHT_SAMPLES, draws
from refgi.stages import skip, stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.cluster.settings import ValSettings
    from refgi.frame import Frame
    from refgi.lights import PixelLights

SAMPLES = 2048  # pixels: what one in a thousand adds is seen
DEVIATIONS = 1.645  # standard errors from the estimate to its bound: 95 %
MOST_TEXELS = 1 << 28  # of all maps together: 1 GB in float32
BACK = 0.75  # of the area lights that were enough: the one step back


def group_lights(
    frame: "Frame", lights: "PixelLights", settings: "ValSettings", count: int, footprint: Array | None = None
) -> tuple[AreaLights, ShadowMaps | None]:
    """Group N pixel lights into M area lights and draw what each sees (Sec. 5, 6); no maps where none are read.

    `footprint` (N,) is each light's surface, m^2, where a cluster of one light is its footprint.
    """
    clusters = clusters_of(lights.position, lights.normal, count, settings.clusters, frame.illuminated_extent)
    areas = area_lights(lights, clusters, settings.area, footprint)
    if settings.visibility is None or isinstance(settings.visibility, WITHOUT_MAPS):
        chosen = "none" if settings.visibility is None else settings.visibility.name()
        skip("cluster.shadow_maps", f"visibility {chosen!r} reads none")
        return areas, None
    tracer = frame.tracer if settings.maps.renderer == "rays" else None
    ends = ends_of(frame, lights)
    return areas, shadow_maps(frame.scene.geometry, areas, settings.drawn_maps, frame.dtype, tracer, ends)


class Trial(NamedTuple):
    """What a number of area lights came to."""

    area_lights: int
    error: float  # RMSE over the mean, estimated
    bound: float  # what it is below, at 95 %


class Adaptive(NamedTuple):
    """The area lights that were enough."""

    areas: AreaLights
    maps: ShadowMaps | None
    error: float  # RMSE over the mean, estimated
    trail: tuple[Trial, ...]  # all that were tried, in their order


class Attempt(NamedTuple):
    """Area lights and what they came to."""

    trial: Trial
    areas: AreaLights
    maps: ShadowMaps | None


class PixelSamples(NamedTuple):
    """Pixels at which the light is known."""

    receivers: Receivers  # (3, 1, n) and (1, n)
    facing: Array  # (3, 1, n)
    exact: Array  # (3, n), W/m^2: with a shadow ray for each light
    footprint: Array | None  # (N,) m^2, of the lights, where the clamp asks for it
    share: float  # of the picture's surface that they are


@stage("cluster.adaptive", steps="inside")
def count_for_error(
    frame: "Frame", lights: "PixelLights", settings: "ValSettings", footprint: Array | None = None
) -> Adaptive:
    """Find how many area lights bring the error of visibility below a target.

    settings: `clusters.target_error`, and all that makes the visibility of an area light.
    footprint (light,): Surface area of each light, m^2, where a cluster of one light is its footprint.
    -> Adaptive: The fewest area lights tried whose error lies below the target at 95 %; where none does, those of least
        error.

    Raises
    ------
    InputError
        If the settings have no target.

    Notes
    -----
    The error is the RMSE over all channels between the irradiance under the visibility of area lights and that with a
    ray for each pixel light, over the mean of the latter, at up to 2048 pixels drawn with `settings.seed`; that of
    interleaving is no part of it. M is doubled from 1 to N, or as far as maps fit into 2^28 texels; then 3/4 of the
    M that was enough is tried. The error need not fall with every step, and at M = N that of the maps is left. What
    fewer than one pixel in 700 suffer, the singular light of a corner say, may be met by none of the samples.
    """
    kind = settings.clusters
    expect(isinstance(kind, AdaptiveClusters), "clusters", "adaptive", kind.name())
    assert isinstance(kind, AdaptiveClusters)
    samples = _samples(frame, lights, settings)
    total = lights.position.shape[1]

    def attempt(count: int) -> Attempt:
        areas, maps = group_lights(frame, lights, settings, count, footprint)
        light = clustered_irradiance(
            samples.receivers, samples.facing, lights, areas, maps, settings, samples.footprint,
            reference_visibility(frame, lights, areas, maps, settings),
            rays=frame.tracer if settings.maps.behind == "raytrace" else None)
        return Attempt(_estimate(light[:, 0], samples, count), areas, maps)

    most = max(1, min(total, MOST_TEXELS // settings.maps.resolution**2))
    best, trail = _double_and_step_back(attempt, most, kind.target_error)
    if best.trial.bound > kind.target_error:
        message = (f"no number of area lights tried has an error below {kind.target_error:g}: "
                f"{best.trial.area_lights} of {total} come nearest, with {best.trial.error:.3g}")
        warnings.warn(RefgiWarning(message), stacklevel=2)
    return Adaptive(best.areas, best.maps, best.trial.error, tuple(trail))


def _double_and_step_back(attempt: Callable[[int], Attempt], most: int, target: float) -> tuple[Attempt, list[Trial]]:
    """Double the area lights until they are enough, then try one step back; return the best and all trials."""
    best = attempt(1)
    trail, count = [best.trial], 1
    while trail[-1].bound > target and count < most:
        count = min(2 * count, most)
        latest = attempt(count)
        trail.append(latest.trial)
        best = latest if latest.trial.bound <= target or latest.trial.error < best.trial.error else best
    back = math.ceil(BACK * count)
    if trail[-1].bound <= target and (count + 1) // 2 < back < count:
        latest = attempt(back)
        trail.append(latest.trial)
        best = latest if latest.trial.bound <= target else best
    return best, trail


def _samples(frame: "Frame", lights: "PixelLights", settings: "ValSettings") -> PixelSamples:
    """Draw pixels, one from each of as many equal parts of the surface seen, and light them by rays."""
    position, normal, triangle_id, covered = frame.gbuffer.resolve("position", "normal", "triangle_id", "covered")
    surface = int(np.count_nonzero(covered))
    count = min(SAMPLES, surface)
    points, normals, seen = sampled_pixels(position, normal, triangle_id, draws(
        settings.lights.seed, AREA_LIGHT_SAMPLES, count))
    receivers = Receivers(points, normals, np.ones((1, count), np.bool_))
    facing = facing_normals(frame.scene.geometry, seen, normals)
    area = footprints(frame, settings.lights, settings.pairs)
    alone = clusters_of(lights.position, lights.normal, max(1, lights.position.shape[1]), settings.clusters,
                        frame.illuminated_extent)  # every light is its own cluster
    areas = area_lights(lights, alone, dataclasses.replace(settings.area, single_light="point"))
    with threads(1):  # a thousand clusters of one light each: waking threads would cost more than their work
        exact = clustered_irradiance(receivers, facing, lights, areas, None, settings, area,
                                     vpl_visibility(frame.tracer, lights, areas, "even"))
    return PixelSamples(receivers, facing, exact[:, 0], area, count / max(1, surface))


@stage("cluster.sampled_pixels", kept=False)
def sampled_pixels(position: Array, normal: Array, triangle_id: Array, shifts: Array) -> tuple[Array, Array, Array]:
    """Take one pixel of each of as many equal parts of the surface that is seen, row by row (docs/methods/val).

    shifts (sample,): Random numbers, places within the parts, [0, 1).
    -> position (3, one, sample): Surface points, m.
    -> normal (3, one, sample): Unit normals.
    -> triangle_id (one, sample) int: Which triangle each sees.
    """
    surface = np.flatnonzero(triangle_id >= 0)
    drawn = np.arange(len(shifts))
    if len(drawn) < len(surface):
        drawn = np.minimum(((drawn + shifts) * (len(surface) / len(drawn))).astype(np.int64), len(surface) - 1)
    at = surface[drawn]
    points, normals = (np.ascontiguousarray(plane.reshape(3, -1)[:, None, at]) for plane in (position, normal))
    return points, normals, np.ascontiguousarray(triangle_id.reshape(-1)[None, at])


def _estimate(made: Array, samples: PixelSamples, count: int) -> Trial:
    """Estimate the error of all pixels from that of the samples."""
    square = ((made.astype(np.float64) - samples.exact) ** 2).mean(axis=0)
    mean, n = float(samples.exact.mean(dtype=np.float64)) if samples.exact.size else 0.0, len(square)
    if not square.any():
        return Trial(count, 0.0, 0.0)
    if mean == 0.0:
        return Trial(count, math.inf, math.inf)
    # drawn without replacement: pixels that are all known leave nothing to guess
    deviation = math.sqrt((1.0 - samples.share) / n) * float(square.std(ddof=1)) if n > 1 else 0.0
    error = float(square.mean())
    return Trial(count, math.sqrt(error) / mean, math.sqrt(error + DEVIATIONS * deviation) / mean)
