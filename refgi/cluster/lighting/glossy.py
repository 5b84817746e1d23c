"""Lobes of glossy receivers under the visibility of area lights: L_s(x) = sum_m V_m(x) sum_i f_s I_i cos / r^2.

The pixel lights of an area light are summed one by one, each with f_s in its own direction; V is that of the area
light, as for irradiance. Every glossy pixel sums all lights: nothing is interleaved or blurred.
"""

from typing import TYPE_CHECKING

import numpy as np

from refgi.cluster.clustering.rectangle import AreaLights, VisibilityFunction
from refgi.cluster.lighting.clustered import asks_shading, places_with_light, visibility_by
from refgi.cluster.lighting.interleave import member_lights, some_lights
from refgi.errors import expect
from refgi.pairs.irradiance import as_receivers, block_order, checked, glossy_summed
from refgi.rsm.buffers.leaving import GlossyPoints
from refgi.stages import report_progress, stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.cluster.maps.shadow_maps import ShadowMaps
    from refgi.cluster.settings import ValSettings
    from refgi.lights import PixelLights
    from refgi.rays import Tracer


@stage("cluster.glossy")
def clustered_radiance(
    points: GlossyPoints, facing: Array, lights: "PixelLights", areas: AreaLights, maps: "ShadowMaps | None",
    settings: "ValSettings", footprint: Array | None = None, visibility_of: VisibilityFunction | None = None,
    rays: "Tracer | None" = None, width: int = 0,
) -> Array:
    """Sum the radiance that lobes make of every pixel light under the visibility of its area light.

    points: The n receivers; their dtype is that of the result.
    facing (3, n): Normals of the triangles that the points lie on; the points' own array where nothing is interpolated.
    areas: The area lights; `of` says which is whose.
    maps: Their shadow maps; not read without visibility or where `visibility_of` is there.
    visibility_of: As for `clustered_irradiance`.
    rays: As for `clustered_irradiance`.
    width: Of the picture that the points are pixels of; 0: neighbours follow each other already.
    -> (3, n): W/m^2/sr, linear RGB.

    Raises
    ------
    InputError
        As `clustered_irradiance`.
    """
    expect(len(areas.of) == lights.position.shape[1], "areas.of", f"one place for each of {lights.position.shape[1]} "
           "lights", len(areas.of))
    packed = checked(as_receivers(points), lights, settings.pairs, footprint)
    members = member_lights(packed, areas.of, len(areas.members), np.zeros(len(areas.of), np.int64), 1)
    visible_from = visibility_by(areas, maps, settings, visibility_of, rays)
    order = np.arange(len(points.pixel)) if width == 0 else block_order(points.pixel, width)
    here = GlossyPoints(*(np.ascontiguousarray(plane[..., order]) for plane in points))
    faces = np.ascontiguousarray(facing[:, order], here.position.dtype)
    sums, shading = np.zeros_like(here.position), asks_shading(visible_from, points.normal, facing)
    for m, (start, lobe_start) in enumerate(zip(members.start, members.lobe_start, strict=True)):
        some = some_lights(members.packed, start, lobe_start)
        if some.diffuse.shape[1] > 1 or some.lobes is not None:
            part = glossy_summed(here, some, (None, None))
            places = places_with_light(part)
            if len(places):
                beside = {"shading": here.normal[:, places]} if shading else {}
                visible = visible_from(m, here.position[:, places], faces[:, places], **beside)
                # Sec. 4: sum_m V_m L_m
                sums[:, places] += part[:, places] * np.asarray(visible, sums.dtype)
        report_progress((m + 1) / len(members.start))
    result = np.empty_like(sums)
    result[:, order] = sums
    return result
