"""Light at subsplats with visibility, one step after the other: by shadow rays, or under soft shadows of clusters.

- pixel (n,): Pixel of each subsplat.
"""

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from refgi.cluster.clustered import clustered_irradiance
from refgi.cluster.reference import reference_visibility
from refgi.cluster.val import cluster_lights
from refgi.error_target.grid import Subsplats
from refgi.pairs.irradiance import Receivers
from refgi.pairs.pixel_lights import PixelLights
from refgi.pairs.shadow_rays import RayReceivers, add_unoccluded, fill_shadow_rays, receivers, senders_of
from refgi.pairs.tiles import taken
from refgi.rays import Tracer
from refgi.rsm import facing_normals
from refgi.scene import Geometry
from refgi.splat.multires.subsplats.steps import arrays_of, points
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.cluster.settings import ValSettings
    from refgi.frame import Frame
    from refgi.rsm import GBuffer


@stage("multires.subsplat_facing", kept=False)
def subsplat_facing(
    vertices: Array, faces: Array, point_normal: Array, triangle_id: Array, pixel: Array
) -> Array:
    """Find the normal of the face that each subsplat's pixel sees (docs/conventions).

    vertices (n, 3): Vertices of the scene, m.
    faces (m, 3) int32: Its triangles.
    point_normal (3, n): Normals of the subsplats.
    -> (xyz, subsplat): Unit normal of the face, on the side of the subsplat's normal.
    """
    geometry = Geometry(vertices, faces, np.zeros(len(faces), np.int32))
    of = triangle_id.reshape(-1)[pixel]
    return receivers(geometry, np.zeros_like(point_normal), point_normal, of, 1.0).facing.astype(point_normal.dtype)


@stage("multires.lights_seen", kept=False)
def lights_seen(
    geometry: Geometry, point: Array, point_normal: Array, triangle_id: Array, pixel: Array, face_normal: Array,
    light_position: Array, light_normal: Array,
) -> Array:
    """Trace whether light reaches each subsplat from each pixel light (SII Eq. 2 with V).

    point (3, n): The subsplats, m.
    point_normal (3, n): Their unit normals.
    face_normal (3, n): Normals of the subsplats' faces.
    -> (light, subsplat) bool: True where the subsplat's point, its normal and its face look at the light, it at them,
        and nothing lies between.
    """
    tracer = Tracer(geometry)
    to = receivers(geometry, point, point_normal, triangle_id.reshape(-1)[pixel], tracer.grain)
    to = to._replace(facing=np.ascontiguousarray(face_normal, np.float32))
    count, flux = light_normal.shape[1], np.ones_like(light_normal)
    sent = PixelLights(light_position, light_normal, flux, None, None, None, count)
    origin, direction, reach, _ = _rays(to, sent, tracer.grain)  # where lobes fade out is no question of V
    blocked = np.ones(len(reach), np.bool_)
    tracer.fill_occluded(origin, direction, reach, blocked)
    return np.ascontiguousarray(~blocked.reshape(len(to.pixel), count).T)


def _rays(to: RayReceivers, lights: PixelLights, grain: float) -> tuple[Array, Array, Array, Array]:
    """Return origins and directions (n, 3), reach (n,) and contributions (n, 3) of all pairs, as the sum fills them."""
    senders, count = senders_of(lights), lights.flux.shape[1]
    pairs = len(to.pixel) * count
    origin, direction, contribution = (np.zeros((pairs, 3), np.float32) for _ in range(3))
    rays = origin, direction, np.zeros(pairs, np.float32), contribution
    fill_shadow_rays(to, (0, len(to.pixel)), senders, (0, count), grain, rays)
    return rays


@stage("multires.seen_irradiance", kept=False)
def seen_irradiance(
    point: Array, point_normal: Array, seen: Array, light_position: Array, light_normal: Array, flux: Array,
    lobe_flux: Array | None, lobe_axis: Array | None, lobe_exponent: Array | None,
) -> Array:
    """Sum the irradiance of the lights that each subsplat sees, without albedo/pi (AMS Eq. 2 with V; E-AMS-02).

    point (3, n): The subsplats, m.
    point_normal (3, n): Their unit normals.
    seen (light, n) bool: Which lights reach which.
    -> (rgb, subsplat): Indirect irradiance, W/m^2.
    """
    at, up = (np.ascontiguousarray(one, np.float32) for one in (point, point_normal))
    count, total = flux.shape[1], np.zeros((3, point.shape[1]))
    lights = PixelLights(light_position, light_normal, flux, lobe_flux, lobe_axis, lobe_exponent, count)
    given = _rays(RayReceivers(np.arange(at.shape[1]), at, up, up, at), lights, 1.0)[3]
    add_unoccluded(total, 0, at.shape[1], count, np.ascontiguousarray(~seen.T).reshape(-1), given)
    return total.astype(point.dtype)


def visible_steps(
    tracer: Tracer, geometry: Geometry, buffer: "GBuffer", subsplats: Subsplats, lights: PixelLights
) -> Array:
    """Return the light that reaches subsplats, made by steps."""
    del tracer  # of the same triangles
    ids, pixel = buffer.triangle_id, subsplats.pixel
    point, normal = points(buffer.position, buffer.normal, buffer.covered, *subsplats[:4], "pixel")
    facing = subsplat_facing(geometry.vertices, geometry.faces, normal, ids, pixel)
    blockers = dataclasses.replace(geometry, vertex_normals=None, colours=None)
    seen = lights_seen(blockers, point, normal, ids, pixel, facing, lights.position, lights.normal)
    return seen_irradiance(point, normal, seen, *arrays_of(lights))


@stage("multires.one_row", kept=False)
def one_row(position: Array, normal: Array, triangle_id: Array, pixel: Array) -> tuple[Array, Array, Array]:
    """Take the pixels of subsplats for a picture of one row (AMS Sec. 3.4; E-AMS-11).

    -> position (xyz, row, subsplat): Surface point, m.
    -> normal (xyz, row, subsplat): Its unit normal.
    -> triangle_id (row, subsplat) int32: Triangle that it lies on.
    """
    return (taken(position, pixel)[:, None], taken(normal, pixel)[:, None],
            np.ascontiguousarray(triangle_id.reshape(-1)[None, pixel]))


@stage("multires.of_row", kept=False)
def of_row(irradiance: Array) -> Array:
    """Return the light of a picture of one row to the list of subsplats (AMS Sec. 3.4).

    irradiance (3, 1, n): Irradiance of the row, W/m^2.
    -> (rgb, subsplat): Indirect irradiance, W/m^2.
    """
    return np.ascontiguousarray(irradiance[:, 0])


def shadowed_steps(
    frame: "Frame", buffer: "GBuffer", subsplats: Subsplats, lights: "PixelLights", settings: "ValSettings",
    footprint: Array | None = None,
) -> Array:
    """Return the light at subsplats under soft shadows, made by steps."""
    for extent in ("visible_extent", "illuminated_extent"):
        vars(frame).pop(extent, None)  # found anew, as steps of their own
    areas, maps = cluster_lights(frame, lights, settings)
    reference = reference_visibility(frame, lights, areas, maps, settings)
    position, normal, ids = one_row(buffer.position, buffer.normal, buffer.triangle_id, subsplats.pixel)
    facing = facing_normals(frame.scene.geometry, ids, normal)
    row = Receivers(position, normal, np.ones(ids.shape, np.bool_))
    return of_row(clustered_irradiance(row, facing, lights, areas, maps, settings, footprint, reference,
                                       rays=frame.tracer if settings.maps.behind == "raytrace" else None))
