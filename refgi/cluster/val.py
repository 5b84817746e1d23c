"""Real-time Indirect Illumination with Clustered Visibility (Dong, Grosch, Ritschel, Kautz and Seidel 2009)."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from refgi.cluster.clustered import clustered_irradiance, clustered_radiance
from refgi.cluster.filters.pyramid import EIGHT
from refgi.cluster.geometry_blur import blur
from refgi.cluster.kmeans import clusters_of
from refgi.cluster.maps import ShadowMaps, shadow_maps
from refgi.cluster.occluders import ends_of
from refgi.cluster.rectangle import AreaLights, area_lights
from refgi.cluster.reference import reference_visibility
from refgi.cluster.settings import (
    BY_MAPS,
    LARGEST_MAP,
    WITHOUT_MAPS,
    BackProjection,
    Clusters,
    Csm,
    InterleavingSettings,
    Pcss,
    RaysRectangle,
    RaysVpls,
    ValSettings,
    Visibility,
)
from refgi.cluster.visibility.shadow import MOST_KEPT, Shadows, kept_shadows
from refgi.error_target.error_driven import error_driven
from refgi.error_target.near import shadowed_by_clusters
from refgi.jit import thread_count
from refgi.ledger import Ledger, account
from refgi.lights.selection import choose_lights, footprints
from refgi.lights.settings import (
    CLAMP,
    FINER,
    LIGHT_SAMPLING,
    MOST_LIGHTS,
    OPENNESS,
    RSM_RESOLUTION,
    VISIBILITY,
    most_lights,
    with_clamp,
)
from refgi.method import Approximation, Extent
from refgi.pairs.estimates import report_sampling, warn_of_clamp
from refgi.pairs.irradiance import Receivers, irradiance
from refgi.pairs.tiles import taken
from refgi.rsm import facing_normals
from refgi.rsm.buffers.leaving import GlossyPoints, spread_over_picture
from refgi.stages import counted_pixels, skip, stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.frame import Frame
    from refgi.lights import PixelLights
    from refgi.rsm import GBuffer

FEW_PIXELS = 1 << 16
LISTED_FLOATS = 24  # of a pixel, where receivers are gathered by lists: measured, and a fifth more


def val(frame: "Frame", settings: ValSettings) -> Array:
    """Light every pixel by pixel lights whose visibility is that of the area light they belong to.

    Parameters
    ----------
    frame : Frame
        The scene with its buffers.
    settings : ValSettings
        Which lights, how they are clustered and how an area light's visibility is found.

    Returns
    -------
    (3, h, w) ndarray
        Indirect irradiance, W/m^2, linear RGB.
    """
    settings = with_clamp(settings)
    lights = choose_lights(frame, settings.lights)  # Sec. 6, VPL generation
    areas, maps = cluster_lights(frame, lights, settings)
    block = block_side(frame.width * frame.height, settings)
    footprint = footprints(frame, settings.lights, settings.pairs)
    receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
    warn_of_clamp(receivers, lights, settings.pairs, footprint, "val")
    report_sampling(frame, receivers, lights, settings.pairs, footprint, "val")
    if block is None:
        skip("cluster.blur", "subsplats sum all lights")
        at = sum_at_pixels(frame, frame.gbuffer, lights, (areas, maps), settings, footprint,
                           kept_shadows(areas, maps, settings))
        return error_driven(frame.gbuffer, lights, settings.subsplats, settings.pairs, footprint, settings.lights.seed,
                            shadowed=shadowed_by_clusters(at)).irradiance
    light = clustered_irradiance(  # Sec. 4 and 6
        receivers, frame.gbuffer.facing, lights, areas, maps, settings, footprint,
        reference_visibility(frame, lights, areas, maps, settings), block,
        frame.tracer if settings.maps.behind == "raytrace" else None)
    if block == 1 or settings.blur is None:
        skip("cluster.blur", "every pixel sums all lights" if block == 1 else "off in the settings")
        return light
    return blur(light, receivers, block, settings.blur, frame.visible_extent)  # Sec. 6, geometry-aware blur


def val_lobes(frame: "Frame", settings: ValSettings) -> Array:
    """Return the radiance towards the eye that receivers' lobes make of the pixel lights of `val`.

    Parameters
    ----------
    frame : Frame
        The scene with its buffers.
    settings : ValSettings
        As for `val`.

    Returns
    -------
    (3, h, w) ndarray
        W/m^2/sr, linear RGB; 0 where there is no lobe.
    """
    settings = with_clamp(settings)
    lights = choose_lights(frame, settings.lights)
    areas, maps = cluster_lights(frame, lights, settings)
    points = frame.glossy_points
    radiance = glossy_under(frame, points, frame.gbuffer.triangle_id.reshape(-1)[points.pixel], lights, areas, maps,
                            settings, footprints(frame, settings.lights, settings.pairs), frame.width)
    return spread_over_picture(points, radiance, (frame.height, frame.width))


def glossy_under(
    frame: "Frame", points: GlossyPoints, triangle_id: Array, lights: "PixelLights", areas: AreaLights,
    maps: ShadowMaps | None, settings: ValSettings, footprint: Array | None, width: int = 0,
) -> Array:
    """Light n glossy receivers, on triangles (n,), by clustered pixel lights: radiance to the eye (3, n), W/m^2/sr."""
    facing = facing_normals(frame.scene.geometry, triangle_id[None], points.normal[:, None])[:, 0]
    return clustered_radiance(
        points, facing, lights, areas, maps, settings, footprint,
        reference_visibility(frame, lights, areas, maps, settings),
        rays=frame.tracer if settings.maps.behind == "raytrace" else None, width=width)


def sum_at_pixels(
    frame: "Frame", buffer: "GBuffer", lights: "PixelLights", clustered: tuple[AreaLights, ShadowMaps | None],
    settings: ValSettings, footprint: Array | None, kept: Shadows | None = None,
) -> Callable[[Array], Array]:
    """Return a function from covered pixels (n flat indices), which `buffer` sees, to all lights' irradiance (3, n)."""
    areas, maps = clustered
    reference = reference_visibility(frame, lights, areas, maps, settings)
    rays = frame.tracer if settings.maps.behind == "raytrace" else None
    position, normal, triangle_id = buffer.resolve("position", "normal", "triangle_id")

    def at(pixel: Array) -> Array:
        points, normals = taken(position, pixel)[:, None], taken(normal, pixel)[:, None]
        facing = facing_normals(frame.scene.geometry, triangle_id.reshape(-1)[None, pixel], normals)
        return clustered_irradiance(
            Receivers(points, normals, np.ones(points.shape[1:], np.bool_)), facing, lights, areas, maps, settings,
            footprint, reference, rays=rays, kept=kept)[:, 0]

    return at


def cluster_lights(
    frame: "Frame", lights: "PixelLights", settings: ValSettings
) -> tuple[AreaLights, ShadowMaps | None]:
    """Group N pixel lights into M area lights and draw what each sees (Sec. 5, 6); no maps where none are read."""
    clusters = clusters_of(lights.position, lights.normal, settings.clusters, frame.illuminated_extent)
    areas = area_lights(lights, clusters, settings.area)
    if settings.visibility is None or isinstance(settings.visibility, WITHOUT_MAPS):
        chosen = "none" if settings.visibility is None else settings.visibility.name()
        skip("cluster.shadow_maps", f"visibility {chosen!r} reads none")
        return areas, None
    tracer = frame.tracer if settings.maps.renderer == "rays" else None
    ends = ends_of(frame, lights)
    return areas, shadow_maps(frame.scene.geometry, areas, settings.drawn_maps, frame.dtype, tracer, ends)


def block_side(pixels: int, settings: ValSettings) -> int | None:
    """Return the side of the blocks of pixels that share the lights out; 1: each sums all; None: subsplats do.

    Without a clamp every pixel sums all, as no sample would meet the peaks of near pairs; and in small pictures, where
    lists of subsplats cost what they save.
    """
    if settings.interleaving.block is not None:
        return settings.interleaving.block
    by_maps = settings.visibility is None or isinstance(settings.visibility, BY_MAPS)
    if settings.pairs.clamp is None:
        skip("error_target.error_driven", "without a clamp every pixel sums all lights")
    elif by_maps and counted_pixels(pixels) <= FEW_PIXELS:
        skip("error_target.error_driven", f"up to {FEW_PIXELS:,} pixels each sums all lights")
    else:
        return None
    return 1


def extra_bytes(settings: ValSettings, extent: Extent) -> int:
    """Estimate the bytes that area lights add to a picture: shadow maps, and these filtered; rather too many."""
    size, float_bytes = extent.size, extent.float_bytes
    texels, count = settings.maps.resolution**2, _most_maps(settings, extent)
    sides = 2 if settings.maps.behind == "dual_paraboloid" else 1
    depth = 2 * count * sides * texels * float_bytes  # twice: maps on which there is nothing are dropped by a copy
    filtered = 0
    if isinstance(settings.visibility, Csm):
        keeps = settings.interleaving.block is None and count * texels <= MOST_KEPT
        at_once = count if keeps else min(count, thread_count() + 1)  # one of them is read from
        filtered = at_once * texels * _filtered_bytes(settings.visibility, float_bytes)
    return depth + filtered + size[0] * size[1] * LISTED_FLOATS * float_bytes


def _most_maps(settings: ValSettings, extent: Extent) -> int:
    if settings.visibility is None or isinstance(settings.visibility, WITHOUT_MAPS):
        return 0
    return min(settings.clusters.count, most_lights(settings.lights, extent.maps, extent.texels))


def _filtered_bytes(csm: Csm, float_bytes: int) -> int:
    """Return the bytes of one filtered map for each of its texels."""
    channels = 4 * csm.terms + 2  # basis, basis-z, mean depth, and the depth itself
    if csm.prefilter == "brute":
        return channels * float_bytes
    basis = -(-2 * csm.terms // EIGHT) * EIGHT
    above = 2 * basis + 3  # basis, basis-z, mean, least and most depth: a third of the texels lies above the map's own
    return (1 + above // 3) * float_bytes


def _seen_by(settings: ValSettings, visibility: Visibility) -> ValSettings:
    """Return settings with another kind of visibility and the same maps, whatever is best for that kind."""
    return dataclasses.replace(settings, maps=settings.drawn_maps, visibility=visibility)


def _each_light(settings: ValSettings, _: Mapping[str, Any]) -> ValSettings:
    if settings.visibility is None:
        return settings
    return dataclasses.replace(_seen_by(settings, RaysVpls()), clusters=Clusters(count=MOST_LIGHTS))


def _lights_of_clusters(settings: ValSettings, _: Mapping[str, Any]) -> ValSettings:
    return settings if settings.visibility in (None, RaysVpls()) else _seen_by(settings, RaysVpls())


def _rectangle(settings: ValSettings, _: Mapping[str, Any]) -> ValSettings:
    by_maps = isinstance(settings.visibility, (*BY_MAPS, BackProjection))
    return _seen_by(settings, RaysRectangle()) if by_maps else settings


def _finer_maps(settings: ValSettings, _: Mapping[str, Any]) -> ValSettings:
    """Return settings with finer maps where kernels read them: to project all of their texels back takes too long."""
    if not isinstance(settings.visibility, BY_MAPS):
        return settings
    resolution = min(LARGEST_MAP, FINER * settings.maps.resolution)
    return dataclasses.replace(settings, maps=dataclasses.replace(settings.maps, resolution=resolution))


def _all_blockers(settings: ValSettings, _: Mapping[str, Any]) -> ValSettings:
    return _seen_by(settings, BackProjection()) if isinstance(settings.visibility, BY_MAPS) else settings


def _tests_of_depth(settings: ValSettings, _: Mapping[str, Any]) -> ValSettings:
    return _seen_by(settings, Pcss()) if isinstance(settings.visibility, Csm) else settings


def _every_texel(settings: ValSettings, _: Mapping[str, Any]) -> ValSettings:
    if not isinstance(settings.visibility, Csm):
        return settings
    return dataclasses.replace(settings, visibility=dataclasses.replace(settings.visibility, prefilter="brute"))


def _every_pixel(settings: ValSettings, _: Mapping[str, Any]) -> ValSettings:
    return settings if settings.interleaving.block is not None else _all_at_each_pixel(settings)


def _without_blocks(settings: ValSettings, _: Mapping[str, Any]) -> ValSettings:
    return settings if settings.interleaving.block is None else _all_at_each_pixel(settings)


def _all_at_each_pixel(settings: ValSettings) -> ValSettings:
    return dataclasses.replace(settings, interleaving=InterleavingSettings(1), blur=None)


APPROXIMATIONS = (
    VISIBILITY._replace(limit=lambda settings: {} if settings.visibility is not None else {"visibility": False}),
    RSM_RESOLUTION,
    LIGHT_SAMPLING._replace(from_truth=lambda settings: settings.visibility is not None),
    OPENNESS, CLAMP,
    Approximation("clustering", "lights of a cluster share one visibility, by rays to all of them", _each_light),
    Approximation("rectangle", "the rectangle around a cluster for its lights, by rays", _lights_of_clusters),
    Approximation("single view", "what blocks is what the rectangle's centre sees: texels of one depth map",
                  _rectangle),
    Approximation("kernel", "tests of depth in one region of the map for all blockers that it holds", _all_blockers),
    Approximation("shadow map resolution", f"texels that such tests read; off: {FINER} along a side for each",
                  _finer_maps),
    Approximation("CSM series", "M terms and their bias for the test of depth", _tests_of_depth),
    Approximation("filter", "levels of a mip map for each texel of the region", _every_texel),
    Approximation("subsplats", "cells of many pixels are evaluated at one, to an error", _every_pixel),
    Approximation("interleaving", "a pixel sums one light of n x n, and the blur", _without_blocks))


@stage("cluster.ledger")
def val_ledger(frame: "Frame", settings: ValSettings) -> Ledger:
    """Account for the power of the lights under `val`.

    -> Ledger: Its lines sum to `emitted` but for the rounding of the frame's dtype.

    Notes
    -----
    `shadowed` is what the method's own soft shadows take. On the Cornell box at 512 x 512 it takes 2.6 times as long as
    the picture.
    """
    settings = with_clamp(settings)
    footprint = footprints(frame, settings.lights, settings.pairs)
    receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
    unblocked = irradiance(receivers, choose_lights(frame, settings.lights), settings.pairs, footprint)
    whole = dataclasses.replace(settings, interleaving=InterleavingSettings(block=1))
    picture = val(frame, settings)
    every = val(frame, whole) if whole != settings else picture
    return account(frame, settings.lights, settings.pairs, footprint, picture,
                   {"shadowed": unblocked - every, "interpolated": every - picture})
