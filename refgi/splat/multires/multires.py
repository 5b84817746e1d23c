"""Adaptive multiresolution splatting (Nichols and Wyman 2009): the method, and lobes of glossy receivers.

For lobes (Sec. 3.3.1, Eq. 2 with its rho_s) cells are of glossy pixels alone, exponent by exponent, so that what is
upsampled never mixes two lobes; reflectances are multiplied in pixel by pixel. Shared subsplats are refined by
geometry, which knows nothing of highlights; lists of each light's own catch those not narrower than a coarsest cell.
"""

from typing import TYPE_CHECKING

import numpy as np

from refgi.cluster.val import cluster_lights, glossy_under
from refgi.cluster.val import extra_bytes as bytes_of_shadows
from refgi.error_target.error_driven import error_driven
from refgi.error_target.grid import Subsplats, top_level
from refgi.error_target.near import PixelSum, shadowed_by_clusters
from refgi.jit import most_threads
from refgi.lights.selection import choose_lights, drawn_from_maps, footprints, light_maps, occluded
from refgi.lights.settings import MapLights, most_lights
from refgi.lights.shares import demo_footprints
from refgi.method import Extent
from refgi.pairs.estimates import report_sampling, thinned, warn_of_clamp
from refgi.pairs.irradiance import Receivers, glossy_radiance
from refgi.pairs.lightcuts.cuts import for_lights
from refgi.pairs.lightcuts.tree import tree_bytes
from refgi.pairs.shadow_rays import receivers, shadowed_radiance
from refgi.rsm.buffers.leaving import GlossyPoints, glossy_points, spread_over_picture
from refgi.splat.multires.criteria import discontinuities
from refgi.splat.multires.evaluate import (
    evaluate,
    evaluate_shadowed,
    evaluate_visible,
    representative_points,
    shadowed_at,
    shadowed_by_rays,
)
from refgi.splat.multires.per_light import covered_by, per_light, per_light_lobes
from refgi.splat.multires.refine import refine
from refgi.splat.multires.settings import ByError, ByGeometry, ByIrradiance, MultiresSettings
from refgi.splat.multires.upsample import surface_detail, upsample
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.frame import Frame
    from refgi.lights import PixelLights
    from refgi.rsm import GBuffer


def multires(frame: "Frame", settings: MultiresSettings) -> Array:
    """Compute indirect irradiance from pixel lights that are evaluated at subsplats.

    Parameters
    ----------
    frame : Frame
        Scene, camera and buffers.
    settings : MultiresSettings
        Lights, refinement of subsplats and upsampling.

    Returns
    -------
    (3, h, w) ndarray
        Indirect irradiance, W/m^2, linear RGB, without visibility unless the settings ask for it.
    """
    lights = choose_lights(frame, settings.lights)  # Sec. 3.1
    footprint = light_areas(frame, lights, settings)
    buffer = doubled(frame) if settings.supersampled else frame.gbuffer  # Sec. 4: rendered at 2048^2 for 1024^2
    irradiance = _irradiance(frame, buffer, lights, footprint, settings)
    if settings.supersampled:
        irradiance = halved(irradiance, buffer.covered, frame.gbuffer.covered)
    return occluded(frame, irradiance, settings.ambient_occlusion, settings.lights.seed)


def _irradiance(
    frame: "Frame", buffer: "GBuffer", lights: "PixelLights", footprint: Array | None, settings: MultiresSettings
) -> Array:
    """Return the irradiance at the pixels of one G-buffer: steps 3 to 6 of the paper's overview, and Eq. 3."""
    subsplats, pairs = settings.subsplats, settings.effective_pairs
    _resolve_channels(buffer, subsplats)
    many = settings.may_cluster(lights.flux.shape[1])
    some = thinned(lights, footprint) if many else (lights, footprint)
    seen = frame.gbuffer  # its pixels are those of the frame's albedo and direct light, also where `buffer` is finer
    receivers = Receivers(seen.position, seen.normal, seen.covered)
    warn_of_clamp(receivers, some[0], pairs, some[1], "multires")
    report_sampling(frame, receivers, lights, pairs, footprint, "multires", all_summed=some[0] is lights)
    if isinstance(subsplats, ByError):
        irradiance = error_driven(buffer, lights, subsplats, pairs, footprint, settings.lights.seed,
                                  settings.lightcuts, _shadowed(frame, buffer, lights, footprint, settings)).irradiance
    elif isinstance(subsplats, ByIrradiance):
        start = None if subsplats.start is None else shared_subsplats(buffer, subsplats.start)  # Sec. 6
        irradiance = per_light(buffer, lights, subsplats, pairs, footprint, start, **_printed(settings))  # Sec. 3.3.1
    else:
        shared = shared_subsplats(buffer, subsplats)  # Sec. 3.2, 3.3
        values = _evaluated(frame, buffer, shared, lights, footprint, settings)  # Sec. 3.4
        irradiance = upsample(values, shared, buffer.covered, subsplats.upsampling, **_printed(settings))  # Sec. 3.5
        if "ams_rho_in_splat" in settings.as_published:  # the picture's albedo is multiplied in again later
            albedo = buffer.albedo
            irradiance = np.divide(irradiance, albedo, out=np.zeros_like(irradiance), where=albedo > 0)
    if settings.detail == 0:
        return irradiance
    eye = buffer.projection.origin
    return surface_detail(irradiance, buffer.position, buffer.normal, buffer.covered, eye, settings.detail)  # Eq. (3)


def _printed(settings: MultiresSettings) -> dict[str, bool]:
    return {"filter_all": "ams_filter_all" in settings.as_published,
            "corner_rule": "ams_all_corners" not in settings.as_published}


def _shadowed(
    frame: "Frame", buffer: "GBuffer", lights: "PixelLights", footprint: Array | None, settings: MultiresSettings
) -> PixelSum | None:
    """Return the sum of lights under the visibility that settings ask for, None without."""
    if settings.shadow_rays is not None:
        return shadowed_by_rays(frame.tracer, frame.scene.geometry, buffer, lights)
    if settings.shadows is not None:
        return shadowed_by_clusters(shadowed_at(frame, buffer, lights, settings.shadows, footprint, lists=True))
    return None


def _resolve_channels(buffer: "GBuffer", subsplats: ByGeometry | ByIrradiance | ByError) -> None:
    """Compute in one pass the channels that the steps need; depth only where a criterion uses it."""
    criteria = None if isinstance(subsplats, ByError) else subsplats.criteria
    uses_depth = criteria is not None and (criteria.depth, criteria.derivative) != (None, None)
    buffer.resolve("position", "normal", *(("depth",) if uses_depth else ()))


def shared_subsplats(buffer: "GBuffer", settings: ByGeometry) -> Subsplats:
    """Refine by geometry, once for all lights (Sec. 3.2 and 3.3).

    Parameters
    ----------
    buffer : GBuffer
        The camera's G-buffer.
    settings : ByGeometry
        Criteria, thresholds, coarsest and finest level.

    Returns
    -------
    Subsplats
        The leaves.
    """
    return _refined(buffer, buffer.covered, settings)


def _refined(buffer: "GBuffer", covered: Array, settings: ByGeometry) -> Subsplats:
    top, criteria = top_level(buffer.height, buffer.width, settings.coarsest), settings.criteria
    return refine(discontinuities(buffer, criteria, top, settings.finest), covered, criteria.diagonal,
                  criteria.traversal)


def _evaluated(
    frame: "Frame", buffer: "GBuffer", shared: Subsplats, lights: "PixelLights", footprint: Array | None,
    settings: MultiresSettings,
) -> Array:
    """Return the irradiance at the subsplats, (3, n), W/m^2; times their albedo if that is asked for as published."""
    subsplats = settings.subsplats
    assert isinstance(subsplats, ByGeometry)
    if settings.shadow_rays is not None:
        values = evaluate_visible(frame.tracer, frame.scene.geometry, buffer, shared, lights)
    elif settings.shadows is not None:
        values = evaluate_shadowed(frame, buffer, shared, lights, settings.shadows, footprint)
    else:
        points = representative_points(buffer, shared, subsplats.representative)
        values = evaluate(*points, lights, settings.effective_pairs, footprint,
                          for_lights(settings.lightcuts, lights))
    if "ams_rho_in_splat" in settings.as_published:
        values = values * buffer.albedo.reshape(3, -1)[:, shared.pixel]
    return values


def light_areas(frame: "Frame", lights: "PixelLights", settings: MultiresSettings) -> Array | None:
    """Return each light's surface, (N,) m^2, exact or as in the authors' demo; None where no clamp needs it."""
    if "ams_disc" not in settings.as_published:
        return footprints(frame, settings.lights, settings.effective_pairs)
    source = settings.lights.source
    maps = light_maps(frame, source) if isinstance(source, MapLights) else frame.rsms
    shares = [one.drawn for one in drawn_from_maps(maps, settings.lights)]
    return demo_footprints(lights, frame.scene.lights, shares)


def doubled(frame: "Frame") -> "GBuffer":
    """Return the camera's G-buffer at twice the width and height: four pixels for each of the frame's."""
    from refgi.rsm import gbuffer

    scene = frame.scene
    return gbuffer(scene.geometry, frame.materials, scene.camera, 2 * frame.width, 2 * frame.height, frame.dtype)


@stage("multires.halved", kept=False)
def halved(irradiance: Array, fine: Array, covered: Array) -> Array:
    """Shrink a picture of twice the width and height to means over what shows a surface (AMS Sec. 4).

    irradiance (3, 2 h, 2 w): Indirect irradiance of the larger picture, W/m^2.
    fine (2 h, 2 w) bool: Its pixels that show a surface.
    covered (h, w) bool: Pixels of the picture itself that show a surface.
    -> (3, h, w): Indirect irradiance, W/m^2; where none of four shows a surface but the pixel does, the mean of pixels
        around it.
    """
    height, width = covered.shape
    four = (3, height, 2, width, 2)
    covered_count = fine.reshape(four[1:]).sum(axis=(1, 3))
    mean = irradiance.reshape(four).sum(axis=(2, 4)) / np.maximum(covered_count, 1).astype(irradiance.dtype)
    halved: Array = np.where(covered, mean, irradiance.dtype.type(0))
    for i, j in zip(*np.nonzero(covered & (covered_count == 0)), strict=True):  # slivers: as the pixels around them
        window = np.s_[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2]
        has_surface = covered_count[window] > 0
        if has_surface.any():
            halved[:, i, j] = mean[:, *window][:, has_surface].mean(axis=1)
    return halved


def extra_bytes(settings: MultiresSettings, extent: Extent) -> int:
    """Estimate the bytes that shadows and lightcuts add to a picture.

    Rather too many than too few: as if every pixel were a subsplat.
    """
    count = most_lights(settings.lights, extent.maps, extent.texels)
    cuts = tree_bytes(count, extent.float_bytes, most_threads()) if settings.may_cluster(count) else 0
    return cuts + (0 if settings.shadows is None else bytes_of_shadows(settings.shadows, extent))


def multires_lobes(frame: "Frame", settings: MultiresSettings) -> Array:
    """Return the radiance towards the eye that receivers' lobes make of the pixel lights of `multires`.

    (3, h, w), W/m^2/sr, linear RGB, with the visibility that the settings ask for; 0 where there is no lobe. `detail`
    and `representative` are of irradiance alone; with subsplats "error" every glossy pixel sums all lights, which meets
    any target, and so it does not cluster them.
    """
    lights = choose_lights(frame, settings.lights)
    footprint = light_areas(frame, lights, settings)
    if not settings.supersampled:
        return _lobes(frame, frame.gbuffer, frame.glossy_points, lights, footprint, settings)
    double = doubled(frame)
    points = glossy_points(double, frame.materials, frame.scene.camera.eye)
    fine = _lobes(frame, double, points, lights, footprint, settings)
    covered = covered_by(frame.glossy_points, frame.gbuffer.covered.shape)
    return halved(fine, covered_by(points, fine.shape[1:]), covered)


def _lobes(
    frame: "Frame", buffer: "GBuffer", points: GlossyPoints, lights: "PixelLights", footprint: Array | None,
    settings: MultiresSettings,
) -> Array:
    """Return the lobes at the pixels of one G-buffer."""
    shape = buffer.covered.shape
    if isinstance(settings.subsplats, ByError):
        return spread_over_picture(points, _radiance_at(frame, buffer, points, lights, footprint, settings, shape[1]),
                                   shape)
    total = np.zeros((3, *shape), points.position.dtype)
    for exponent in np.unique(points.exponent):
        some = points.at(np.flatnonzero(points.exponent == exponent))
        whole = _of_one_exponent(frame, buffer, some, lights, footprint, settings)
        total.reshape(3, -1)[:, some.pixel] = whole.reshape(3, -1)[:, some.pixel] * some.specular
    return total


def _of_one_exponent(
    frame: "Frame", buffer: "GBuffer", points: GlossyPoints, lights: "PixelLights", footprint: Array | None,
    settings: MultiresSettings,
) -> Array:
    """Return the lobes over their reflectance, (3, h, w), of points that share an exponent."""
    subsplats, shape = settings.subsplats, buffer.covered.shape
    assert isinstance(subsplats, ByGeometry | ByIrradiance)
    if isinstance(subsplats, ByIrradiance):
        start = None if subsplats.start is None else glossy_subsplats(buffer, points, subsplats.start)
        return per_light_lobes(points, shape, lights, subsplats, settings.effective_pairs, footprint, start,
                               **_printed(settings))
    shared = glossy_subsplats(buffer, points, subsplats)
    place = np.searchsorted(points.pixel, shared.pixel)
    here = points.at(place)._replace(specular=np.ones((3, len(place)), points.position.dtype))
    values = _radiance_at(frame, buffer, here, lights, footprint, settings)
    return upsample(values, shared, covered_by(points, shape), subsplats.upsampling, **_printed(settings))


def glossy_subsplats(buffer: "GBuffer", points: GlossyPoints, settings: ByGeometry) -> Subsplats:
    """Refine cells of glossy pixels by geometry, once for all lights (Sec. 3.2 and 3.3), and return the leaves."""
    return _refined(buffer, covered_by(points, buffer.covered.shape), settings)


def _radiance_at(
    frame: "Frame", buffer: "GBuffer", here: GlossyPoints, lights: "PixelLights", footprint: Array | None,
    settings: MultiresSettings, width: int = 0,
) -> Array:
    """Return the radiance at some pixels, (3, n), in the dtype of the points; `width` as for `glossy_radiance`."""
    if settings.shadow_rays is None and settings.shadows is None:
        return glossy_radiance(here, lights, settings.effective_pairs, footprint, width)
    triangle_id = buffer.triangle_id.reshape(-1)[here.pixel]
    if settings.shadows is not None:
        areas, maps = cluster_lights(frame, lights, settings.shadows)
        return glossy_under(frame, here, triangle_id, lights, areas, maps, settings.shadows, footprint)
    to = receivers(frame.scene.geometry, here.position, here.normal, triangle_id, frame.tracer.grain)
    return shadowed_radiance(frame.tracer, to, here, lights).astype(here.position.dtype)
