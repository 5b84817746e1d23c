"""Lobes of glossy receivers from subsplats (Nichols and Wyman 2009, Sec. 3.3.1 and Eq. 2 with its rho_s).

Cells are of glossy pixels alone, exponent by exponent, so that what is upsampled never mixes two lobes; reflectances
are multiplied in pixel by pixel. Shared subsplats are refined by geometry, which knows nothing of highlights: the paper
says of them that only diffuse materials are properly handled. Lists of each light's own are refined by what the lobe
reflects of it, and catch highlights that are not narrower than a coarsest cell.
"""

from typing import TYPE_CHECKING

import numpy as np

from refgi.cluster.val import cluster_lights, glossy_under
from refgi.error_target.grid import Subsplats, top_level
from refgi.lights.selection import choose_lights
from refgi.pairs.glossy import glossy_radiance, shadowed_radiance
from refgi.pairs.shadow_rays import receivers
from refgi.rsm.buffers.leaving import GlossyPoints, glossy_points, spread_over_picture
from refgi.splat.multires.light_lists.per_light import covered_by, per_light_lobes
from refgi.splat.multires.multires import doubled, halved, light_areas
from refgi.splat.multires.refinement.criteria import discontinuities
from refgi.splat.multires.refinement.refine import refine
from refgi.splat.multires.settings import ByError, ByGeometry, ByIrradiance, MultiresSettings
from refgi.splat.multires.subsplats.upsample import upsample
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.frame import Frame
    from refgi.lights import PixelLights
    from refgi.rsm import GBuffer


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
        return spread_over_picture(points, _evaluated(frame, buffer, points, lights, footprint, settings, shape[1]),
                                   shape)
    total = np.zeros((3, *shape), points.position.dtype)
    for exponent in np.unique(points.exponent):
        some = GlossyPoints(*(np.ascontiguousarray(plane[..., points.exponent == exponent]) for plane in points))
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
    printed: dict[str, bool] = {"filter_all": "ams_filter_all" in settings.as_published,
                                "corner_rule": "ams_all_corners" not in settings.as_published}
    if isinstance(subsplats, ByIrradiance):
        start = None if subsplats.start is None else glossy_subsplats(buffer, points, subsplats.start)
        return per_light_lobes(points, shape, lights, subsplats, settings.effective_pairs, footprint, start, **printed)
    shared = glossy_subsplats(buffer, points, subsplats)
    place = np.searchsorted(points.pixel, shared.pixel)
    here = GlossyPoints(*(np.ascontiguousarray(plane[..., place]) for plane in points))._replace(
        specular=np.ones((3, len(place)), points.position.dtype))
    values = _evaluated(frame, buffer, here, lights, footprint, settings)
    return upsample(values, shared, covered_by(points, shape), subsplats.upsampling, **printed)


def glossy_subsplats(buffer: "GBuffer", points: GlossyPoints, settings: ByGeometry) -> Subsplats:
    """Refine cells of glossy pixels by geometry, once for all lights (Sec. 3.2 and 3.3), and return the leaves."""
    covered, criteria = covered_by(points, buffer.covered.shape), settings.criteria
    top = top_level(buffer.height, buffer.width, settings.coarsest)
    return refine(discontinuities(buffer, criteria, top, settings.finest), covered, criteria.diagonal,
                  criteria.traversal)


def _evaluated(
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
