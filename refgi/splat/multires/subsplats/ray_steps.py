"""Light at subsplats by shadow rays one step after the other: faces, what each subsplat sees, the sum of that."""

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.pairs.pixel_lights import PixelLights
from refgi.pairs.shadow_rays import RayReceivers, add_unoccluded, fill_shadow_rays, receivers, senders_of
from refgi.rays import Tracer
from refgi.scene import Geometry
from refgi.splat.multires.refinement.grid import Subsplats
from refgi.splat.multires.subsplats.steps import arrays_of, points
from refgi.stages import stage

if TYPE_CHECKING:
    from refgi.rsm import GBuffer

Array = npt.NDArray[Any]


@stage("multires.subsplat_facing", kept=False)
def subsplat_facing(
    vertices: Array, faces: Array, point_normal: Array, triangle_id: Array, pixel: Array
) -> Array:
    """Find the normal of the face that each subsplat's pixel sees (docs/conventions).

    vertices (n, 3): Vertices of the scene, m.
    faces (m, 3) int32: Its triangles.
    point_normal (3, n): Normals of the subsplats.
    pixel (n,): Pixel of each subsplat.
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
    pixel (n,): Pixel of each subsplat.
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
