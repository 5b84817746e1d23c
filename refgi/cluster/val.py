"""Real-time Indirect Illumination with Clustered Visibility (Dong, Grosch, Ritschel, Kautz and Seidel 2009)."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from refgi.cluster.adaptive import MOST_TEXELS, count_for_error, group_lights
from refgi.cluster.clustering.rectangle import AreaLights
from refgi.cluster.filters.pyramid import EIGHT
from refgi.cluster.lighting.blur import blur
from refgi.cluster.lighting.clustered import clustered_irradiance
from refgi.cluster.lighting.glossy import clustered_radiance
from refgi.cluster.lighting.shadows import MOST_KEPT, Shadows, kept_shadows
from refgi.cluster.maps.shadow_maps import ShadowMaps
from refgi.cluster.reference import reference_visibility
from refgi.cluster.settings import BY_MAPS, WITHOUT_MAPS, AdaptiveClusters, Clusters, Csm, ValSettings
from refgi.error_target.error_driven import error_driven
from refgi.error_target.near import shadowed_by_clusters
from refgi.jit import thread_count
from refgi.lights.selection import choose_lights, footprints, light_areas
from refgi.lights.settings import most_lights, with_clamp
from refgi.method import Extent
from refgi.pairs.estimates import report_sampling, warn_of_clamp
from refgi.pairs.irradiance import Receivers
from refgi.pairs.tiles import taken
from refgi.rsm import facing_normals
from refgi.rsm.buffers.leaving import GlossyPoints, spread_over_picture
from refgi.stages import counted_pixels, skip
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
    block = block_side(frame, settings)
    if block is None:
        skip("cluster.blur", "subsplats sum all lights")
        return light_subsplats(frame, lights, areas, maps, settings)
    light = light_pixels(frame, lights, areas, maps, settings, block)  # Sec. 4 and 6
    if block == 1 or settings.blur is None:
        skip("cluster.blur", "every pixel sums all lights" if block == 1 else "off in the settings")
        return light
    # Sec. 6, geometry-aware blur
    return blur(light, receivers_of(frame), block, settings.blur, frame.visible_extent)


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
    """Light n glossy receivers by pixel lights that are clustered already: radiance towards the eye, (3, n), W/m^2/sr.

    `triangle_id` (n,) is what each lies on, `maps` what each area light sees, `footprint` (N,) the surface each light
    stands for, m^2, `width` as for `clustered_radiance`.
    """
    facing = facing_normals(frame.scene.geometry, triangle_id[None], points.normal[:, None])[:, 0]
    return clustered_radiance(
        points, facing, lights, areas, maps, settings, footprint,
        reference_visibility(frame, lights, areas, maps, settings),
        rays=frame.tracer if settings.maps.behind == "raytrace" else None, width=width)


def light_pixels(
    frame: "Frame", lights: "PixelLights", areas: AreaLights, maps: ShadowMaps | None, settings: ValSettings, block: int
) -> Array:
    """Light every pixel by pixel lights that are clustered already: indirect irradiance (3, h, w), W/m^2, not blurred.

    `block` is the side of the blocks of pixels that share the lights out among themselves.
    """
    footprint = reported_footprints(frame, lights, settings)
    return clustered_irradiance(
        receivers_of(frame), frame.gbuffer.facing, lights, areas, maps, settings, footprint=footprint,
        visibility_of=reference_visibility(frame, lights, areas, maps, settings), interleaving=block,
        rays=frame.tracer if settings.maps.behind == "raytrace" else None)


def light_subsplats(
    frame: "Frame", lights: "PixelLights", areas: AreaLights, maps: ShadowMaps | None, settings: ValSettings
) -> Array:
    """Light subsplats by pixel lights that are clustered already, until the error is met: (3, h, w), W/m^2."""
    footprint = reported_footprints(frame, lights, settings)
    at = sum_at_pixels(frame, frame.gbuffer, lights, (areas, maps), settings, footprint,
                       kept_shadows(areas, maps, settings))
    return error_driven(frame.gbuffer, lights, settings.subsplats, settings.pairs, footprint, settings.lights.seed,
                        shadowed=shadowed_by_clusters(at)).irradiance


def reported_footprints(frame: "Frame", lights: "PixelLights", settings: ValSettings) -> Array | None:
    """Return the surface that each light stands for, (N,) m^2, once clamp and sampling are reported."""
    footprint = footprints(frame, settings.lights, settings.pairs)
    warn_of_clamp(receivers_of(frame), lights, settings.pairs, footprint, "val")
    report_sampling(frame, receivers_of(frame), lights, settings.pairs, footprint, "val")
    return footprint


def sum_at_pixels(
    frame: "Frame", buffer: "GBuffer", lights: "PixelLights", clustered: tuple[AreaLights, ShadowMaps | None],
    settings: ValSettings, footprint: Array | None, kept: Shadows | None = None,
) -> Callable[[Array], Array]:
    """Return a function from covered pixels (n flat indices) to the irradiance of all lights there, (3, n), W/m^2.

    `buffer` is what sees the pixels, `clustered` of `cluster_lights`, `kept` of `kept_shadows`.
    """
    areas, maps = clustered
    reference = reference_visibility(frame, lights, areas, maps, settings)
    position, normal, triangle_id = buffer.resolve("position", "normal", "triangle_id")

    def at(pixel: Array) -> Array:
        points, normals = taken(position, pixel)[:, None], taken(normal, pixel)[:, None]
        facing = facing_normals(frame.scene.geometry, triangle_id.reshape(-1)[None, pixel], normals)
        return clustered_irradiance(
            Receivers(points, normals, np.ones(points.shape[1:], np.bool_)), facing, lights, areas, maps, settings,
            footprint, reference, rays=frame.tracer if settings.maps.behind == "raytrace" else None, kept=kept)[:, 0]

    return at


def cluster_lights(
    frame: "Frame", lights: "PixelLights", settings: ValSettings
) -> tuple[AreaLights, ShadowMaps | None]:
    """Group pixel lights into as many area lights as asked for, or as an error asks for, and draw their maps.

    No maps (None) where nothing asks for them.
    """
    if isinstance(settings.clusters, AdaptiveClusters):
        chosen = count_for_error(frame, lights, settings, _areas_of_single(frame, settings))
        return chosen.areas, chosen.maps
    skip("cluster.adaptive", "the number of area lights is set")
    return group_lights(frame, lights, settings, settings.clusters.count, _areas_of_single(frame, settings))  # Sec. 5


def _areas_of_single(frame: "Frame", settings: ValSettings) -> Array | None:
    """Return the surface (N,), m^2, that each pixel light stands for where a cluster of one light has that size."""
    return None if settings.area.single_light == "point" else light_areas(frame, settings.lights)


def block_side(frame: "Frame", settings: ValSettings) -> int | None:
    """Return the side of the blocks of pixels that share the lights out; 1: each sums all; None: subsplats do.

    Without a clamp every pixel sums all, as no sample would meet the peaks of near pairs; and in small pictures, where
    lists of subsplats cost what they save.
    """
    if settings.interleaving.block is not None:
        return settings.interleaving.block
    by_maps = settings.visibility is None or isinstance(settings.visibility, BY_MAPS)
    if settings.pairs.clamp is None:
        skip("error_target.error_driven", "without a clamp every pixel sums all lights")
    elif by_maps and counted_pixels(frame.width * frame.height) <= FEW_PIXELS:
        skip("error_target.error_driven", f"up to {FEW_PIXELS:,} pixels each sums all lights")
    else:
        return None
    return 1


def receivers_of(frame: "Frame") -> Receivers:
    """Return the points that a frame's pixels see, with shading normals."""
    return Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))


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
    most = max(1, MOST_TEXELS // settings.maps.resolution**2)
    count = settings.clusters.count if isinstance(settings.clusters, Clusters) else most
    return min(count, most_lights(settings.lights, extent.maps, extent.texels))


def _filtered_bytes(csm: Csm, float_bytes: int) -> int:
    """Return the bytes of one filtered map for each of its texels."""
    channels = 4 * csm.terms + 2  # basis, basis-z, mean depth, and the depth itself
    if csm.prefilter == "brute":
        return channels * float_bytes
    basis = -(-2 * csm.terms // EIGHT) * EIGHT
    above = 2 * basis + 3  # basis, basis-z, mean, least and most depth: a third of the texels lies above the map's own
    return (1 + above // 3) * float_bytes
