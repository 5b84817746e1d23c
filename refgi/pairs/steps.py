"""Pixel lights and receivers one step after the other: one pair as kits hold it, faces, which lights are seen, sums.

A ray leaves the face, not the interpolated surface: what lies below the face of a receiver does not light it.
"""

import numpy as np

from refgi.pairs.irradiance import Receivers, summed
from refgi.pairs.pixel_lights import PixelLights
from refgi.pairs.settings import PairSettings
from refgi.pairs.shadow_rays import RayReceivers, Senders, add_unoccluded, fill_shadow_rays, receivers, senders_of
from refgi.rays import Tracer
from refgi.scene import Geometry
from refgi.stages import stage
from refgi.types import Array


@stage("pairs.pairs", kept=False)
def pairs(
    position: Array, normal: Array, light_position: Array, light_normal: Array, flux: Array,
    lobe_flux: Array | None = None, lobe_axis: Array | None = None, lobe_exponent: Array | None = None,
) -> Array:
    """Compute the irradiance of light k at receiver k alone (SII Eq. 2 and 3).

    position (3, row, receiver): Receivers, m.
    normal (3, row, receiver): Their unit normals.
    -> (3, row, pair): Irradiance, W/m^2; 0 where light and receiver coincide.
    """
    made, bare = np.zeros_like(position), PairSettings(clamp=None)
    for k in range(flux.shape[1]):
        one = slice(k, k + 1)
        lobe, axis, exponent = (None if part is None else part[..., one]
                                for part in (lobe_flux, lobe_axis, lobe_exponent))
        light = PixelLights(light_position[:, one], light_normal[:, one], flux[:, one], lobe, axis, exponent, 1)
        at = Receivers(position[..., one], normal[..., one], np.ones((1, 1), np.bool_))
        made[..., one] = summed(at, light, bare)
    return made


@stage("vpl.facing", kept=False)
def facing(vertices: Array, faces: Array, normal: Array, triangle_id: Array) -> Array:
    """Compute the normal of the triangle that each pixel sees, on the side of the pixel's normal (docs/conventions).

    -> (3, h, w): The face's unit normal; 0 without surface.
    """
    geometry = Geometry(vertices, faces, np.zeros(len(faces), np.int32), None)
    to = receivers(geometry, np.zeros_like(normal), normal, triangle_id, 1.0)
    return placed(to, to.facing, triangle_id.shape).astype(normal.dtype)


@stage("vpl.visible", kept=False)
def visible(
    geometry: Geometry, position: Array, normal: Array, triangle_id: Array, face_normal: Array, light_position: Array,
    light_normal: Array,
) -> Array:
    """Trace whether light reaches each pixel from each pixel light (docs/methods/vpl).

    geometry: What may block.
    face_normal (3, h, w): Unit normals of the triangles that pixels see, on the side of the pixels' normals.
    -> (light, h, w) bool: True where the normals of light and pixel and the pixel's face look at the other, whatever
        the lobe, and nothing lies between.
    """
    tracer = Tracer(geometry)
    to, senders, reach, rays = shadow_rays(geometry, tracer.grain, (position, normal, triangle_id), face_normal,
                                           light_position, light_normal)
    blocked = np.ones(len(reach), np.bool_)
    tracer.fill_occluded(*rays, reach, blocked)
    return placed(to, ~blocked.reshape(len(to.pixel), senders.flux.shape[1]).T, triangle_id.shape)


@stage("vpl.shadowed_sum", kept=False)
def shadowed_sum(
    position: Array, normal: Array, triangle_id: Array, seen: Array | None, light_position: Array, light_normal: Array,
    flux: Array, lobe_flux: Array | None = None, lobe_axis: Array | None = None, lobe_exponent: Array | None = None,
) -> Array:
    """Sum the irradiance of the visible pixel lights at every pixel, without albedo/pi (SII Eq. 2, 3).

    seen (light, h, w) bool: Whether a pixel sees a light; absent: all do.
    -> (3, h, w): Indirect irradiance, W/m^2; 0 without surface.
    """
    pixel = np.flatnonzero(triangle_id.reshape(-1) >= 0)
    at, up = (np.ascontiguousarray(plane.reshape(3, -1)[:, pixel], np.float32) for plane in (position, normal))
    to, count = RayReceivers(pixel, at, up, up, at), flux.shape[1]
    senders = senders_of(PixelLights(light_position, light_normal, flux, lobe_flux, lobe_axis, lobe_exponent, count))
    _, _, reach, light = filled_rays(to, senders, 1.0)
    blocked = reach == 0 if seen is None else ~seen.reshape(count, triangle_id.size)[:, pixel].T
    total = np.zeros((3, len(pixel)))
    add_unoccluded(total, 0, len(pixel), count, np.ascontiguousarray(blocked).reshape(-1), light)
    return placed(to, total, triangle_id.shape).astype(normal.dtype)


def shadow_rays(
    geometry: Geometry, grain: float, points: tuple[Array, Array, Array], face_normal: Array, light_position: Array,
    light_normal: Array,
) -> tuple[RayReceivers, Senders, Array, tuple[Array, Array]]:
    """Return receivers and senders, and reach, origins and directions of the rays of all pairs that face each other.

    `points`: position, normal and triangle ids. Light by light for each receiver; the reach of other pairs is 0.
    """
    to = receivers(geometry, *points, grain)
    to = to._replace(facing=np.ascontiguousarray(face_normal.reshape(3, -1)[:, to.pixel], np.float32))
    lights = PixelLights(light_position, light_normal, np.ones_like(light_normal), None, None, None,
                         light_normal.shape[1])
    senders = senders_of(lights)  # where lobes fade out is no question of visibility
    origin, direction, reach, _ = filled_rays(to, senders, grain)
    return to, senders, reach, (origin, direction)


def filled_rays(to: RayReceivers, senders: Senders, grain: float) -> tuple[Array, Array, Array, Array]:
    """Return origins, directions, reach and light of the rays of all pairs."""
    pairs = len(to.pixel) * senders.flux.shape[1]
    origin, direction, light = (np.zeros((pairs, 3), np.float32) for _ in range(3))
    reach = np.zeros(pairs, np.float32)
    fill_shadow_rays(to, (0, len(to.pixel)), senders, (0, senders.flux.shape[1]), grain,
                     (origin, direction, reach, light))
    return origin, direction, reach, light


def placed(to: RayReceivers, values: Array, shape: tuple[int, ...]) -> Array:
    """Return values (n, r) of receivers in the picture that they are pixels of, (n, h, w)."""
    whole = np.zeros((len(values), shape[0] * shape[1]), values.dtype)
    whole[:, to.pixel] = values
    return whole.reshape(len(values), *shape)
