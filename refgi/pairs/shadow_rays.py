"""Pixel lights with ray-traced visibility: one shadow ray for each pair (SII Eq. 2 and 3, calibrated).

    E(x) = sum_i Phi_i / pi <n_i . w> <n_x . -w> / r^2 V(x, x_i),

the same with a lobe, and the radiance of receivers' lobes. A ray is traced for each pair whose unshadowed term is not
0, in batches. That a light lies below the receiver's face is part of V. Symbols: d vector from receiver to light, c_l
and c_x cosines of light and receiver, not divided by the length of d, V visibility.
"""

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel, prange
from refgi.pairs.pair_sum import pair_cosines
from refgi.pairs.pixel_lights import PixelLights, with_dark_lobes
from refgi.radiometry import lobe_gap, lobe_norm, lobe_power, receiver_lobe
from refgi.rays import STEPS, Tracer, far_offset, ray_offset
from refgi.rsm.buffers.leaving import GlossyPoints
from refgi.scene import Geometry
from refgi.skips import left_out
from refgi.stages import report_progress, stage, tally
from refgi.types import Array

ROUNDED = 2.0**-14  # of a point's coordinates: it is off its face by that at most, or not meant to lie on it
LIGHTS_AT_A_TIME = 1024
BATCH = 1 << 18  # pairs held at a time


class RayReceivers(NamedTuple):
    """Points to light by shadow rays, without the pixels that see no surface."""

    pixel: Array  # (r,) int64, flat index into the picture
    position: Array  # (3, r) float32, m
    normal: Array  # (3, r) float32: the G-buffer's
    facing: Array  # (3, r) float32: the face's normal on the same side
    origin: Array  # (3, r) float32: where rays start, lifted off the face, m


def receivers(geometry: Geometry, position: Array, normal: Array, triangle_id: Array, grain: float) -> RayReceivers:
    """Return the covered pixels of a G-buffer, or any choice of them, as receivers of shadow rays.

    In picture order, of (3, h, w) or (3, n); `pixel` counts through the given points. Rays start above the face by
    `ray_offset` with the tracer's `grain`, m.
    """
    pixel = np.flatnonzero(triangle_id.reshape(-1) >= 0)
    at = np.ascontiguousarray(position.reshape(3, -1)[:, pixel], np.float64)
    up = np.ascontiguousarray(normal.reshape(3, -1)[:, pixel], np.float64)
    corner = geometry.vertices[geometry.faces[triangle_id.reshape(-1)[pixel]]]
    face = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]).T
    face *= np.where((face * up).sum(axis=0) < 0, -1.0, 1.0) / np.linalg.norm(face, axis=0)
    # undo what the rasterizer's rounding moved off the face
    size = np.abs(at).sum(axis=0) + grain
    height = ((at - corner[:, 0].T) * face).sum(axis=0)
    lift = STEPS * size - np.where(np.abs(height) < ROUNDED * size, height, 0)
    return RayReceivers(pixel, *(np.ascontiguousarray(a, np.float32) for a in (at, up, face, at + lift * face)))


class Senders(NamedTuple):
    """Pixel lights for the kernel, in float64; without lobes the last four have no columns."""

    position: Array  # (3, n), m
    normal: Array  # (3, n)
    flux: Array  # (3, n), W
    lobe_flux: Array  # (3, n or 0), W
    lobe_axis: Array  # (3, n or 0)
    lobe_exponent: Array  # (n or 0,)
    lobe_norm: Array  # (n or 0,) 1/sr


Hidden = Callable[[RayReceivers, tuple[int, int], Senders, tuple[int, int], Array, Array], None]
Weigh = Hidden


@stage("pairs.shadowed_sum")
def shadowed_sum(
    tracer: Tracer, to: RayReceivers, lights: PixelLights, *, visibility: bool = True, batch: int = BATCH,
    hidden: Hidden | None = None,
) -> Array:
    """Sum the irradiance of every pixel light at every receiver, each pair with its visibility.

    visibility: Whether to trace the rays; without, every pair counts, below the receiver's face as well.
    batch: Pairs held at a time; changes no bit of the result.
    hidden: Fills which pairs are blocked, in place of rays: called with the receivers, first and one past the last of
        them, the senders, first and one past the last of those, the pairs' reach and what it fills.
    -> (3, r) float64: Irradiance, W/m^2.
    """
    return summed(tracer, to, lights, visibility, batch, hidden, None)


def summed(tracer: Tracer, to: RayReceivers, lights: PixelLights, visibility: bool, batch: int,
           hidden: Hidden | None, weigh: Weigh | None) -> Array:
    """Sum what every pair gives that nothing blocks, (3, r) float64; arguments as for `shadowed_sum`.

    `weigh`, called as `hidden`, changes contributions, W/m^2, and clears the reach of pairs that are left without any.
    """
    senders, total = senders_of(lights), np.zeros((3, len(to.pixel)))
    to = to if visibility else to._replace(facing=to.normal)  # no face hides anything
    step = max(1, batch // LIGHTS_AT_A_TIME)
    for first in range(0, total.shape[1], step):
        last = min(first + step, total.shape[1])
        for light in range(0, senders.flux.shape[1], LIGHTS_AT_A_TIME):
            count = min(LIGHTS_AT_A_TIME, senders.flux.shape[1] - light)
            _add_lights(tracer, to, (first, last), senders, (light, light + count), visibility, hidden, weigh, total)
        report_progress(last / total.shape[1])
    return total


def _add_lights(tracer: Tracer, to: RayReceivers, receivers: tuple[int, int], senders: Senders,
                lights: tuple[int, int], visibility: bool, hidden: Hidden | None, weigh: Weigh | None,
                total: Array) -> None:
    count = lights[1] - lights[0]
    pairs = (receivers[1] - receivers[0]) * count
    tally("pairs", lambda: pairs)
    origin, direction, contribution = (np.empty((pairs, 3), np.float32) for _ in range(3))
    reach, occluded = np.empty(pairs, np.float32), np.empty(pairs, np.bool_)
    fill_shadow_rays(to, receivers, senders, lights, tracer.grain, (origin, direction, reach, contribution))
    if weigh is not None:
        weigh(to, receivers, senders, lights, reach, contribution)
    if not left_out("pairs.shadow_rays", lambda: (pairs - np.count_nonzero(reach), pairs)):
        contribution[reach == 0], reach[:] = 0, 1
    if visibility and hidden is not None:
        hidden(to, receivers, senders, lights, reach, occluded)
    elif visibility:
        tracer.fill_occluded(origin, direction, reach, occluded)
    else:
        np.less_equal(reach, 0, out=occluded)
    add_unoccluded(total, receivers[0], receivers[1] - receivers[0], count, occluded, contribution)


@kernel(parallel=True)
def fill_shadow_rays(to: RayReceivers, receivers: tuple[int, int], senders: Senders, lights: tuple[int, int],
                     grain: float, rays: tuple[Array, Array, Array, Array]) -> None:
    """Fill the shadow ray of each pair of a block of receivers and lights (first, one past the last) and its light.

    `rays` are origins and directions (n, 3), reach (n,) and contribution (n, 3), W/m^2, float32, light by light for
    each receiver. Segments end above the sender by `ray_offset(grain)` and `far_offset`, m; the reach is 0 where a
    pair contributes nothing.
    """
    count = lights[1] - lights[0]
    for i in prange(receivers[1] - receivers[0]):
        for k in range(count):
            _fill_ray(to, receivers[0] + i, senders, lights[0] + k, grain, rays, i * count + k)


@kernel
def _fill_ray(to: RayReceivers, r: int, senders: Senders, j: int, grain: float,
              rays: tuple[Array, Array, Array, Array], ray: int) -> None:
    origins, directions, reach, contribution = rays
    reach[ray] = 0
    dx, dy = senders.position[0, j] - to.position[0, r], senders.position[1, j] - to.position[1, r]
    dz = senders.position[2, j] - to.position[2, r]
    offset = (ray_offset(senders.position[0, j], senders.position[1, j], senders.position[2, j], grain)
              + far_offset(dx, dy, dz))
    for c in range(3):
        origins[ray, c] = to.origin[c, r]
        directions[ray, c] = senders.position[c, j] + offset * senders.normal[c, j] - to.origin[c, r]
    square, cl, cx = pair_cosines(dx, dy, dz, -senders.normal[0, j], -senders.normal[1, j], -senders.normal[2, j],
                                  to.normal[0, r], to.normal[1, r], to.normal[2, r])
    above = to.facing[0, r] * dx + to.facing[1, r] * dy + to.facing[2, r] * dz
    if cx <= 0 or cl <= 0 or above <= 0:
        return
    # Eq. (2)
    diffuse, lobe = cx * cl / (np.pi * square * square), 0.0
    if senders.lobe_exponent.shape[0] > 0:
        lobe = _lobe(to, r, senders, j) * cx / (square * math.sqrt(square))
    for c in range(3):
        contribution[ray, c] = senders.flux[c, j] * diffuse
        if senders.lobe_exponent.shape[0] > 0:
            contribution[ray, c] += senders.lobe_flux[c, j] * lobe
        if contribution[ray, c] > 0:
            reach[ray] = 1


@kernel
def _lobe(to: RayReceivers, r: int, senders: Senders, j: int) -> Any:
    """Return c(P) <r.w>^P for the direction from sender j to receiver r (Eq. 3, normalised)."""
    dx, dy = to.position[0, r] - senders.position[0, j], to.position[1, r] - senders.position[1, j]
    dz = to.position[2, r] - senders.position[2, j]
    gap = lobe_gap(senders.lobe_axis[0, j], senders.lobe_axis[1, j], senders.lobe_axis[2, j], dx, dy, dz)
    # Eq. (3)
    return senders.lobe_norm[j] * lobe_power(gap, senders.lobe_exponent[j])


def senders_of(lights: PixelLights) -> Senders:
    """Return pixel lights as the kernels read them."""
    arrays = (lights.position, lights.normal, lights.flux)
    position, normal, flux = (np.ascontiguousarray(array, np.float64) for array in arrays)
    count = flux.shape[1]
    if lights.lobe_flux is None and not left_out("pairs.lobes", lambda: (count, count)):
        lights = with_dark_lobes(lights)
    if lights.lobe_flux is None or lights.lobe_axis is None or lights.lobe_exponent is None:
        return Senders(position, normal, flux, np.zeros((3, 0)), np.zeros((3, 0)), np.zeros(0), np.zeros(0))
    axis = np.array(lights.lobe_axis, np.float64, order="C")
    exponent = np.ascontiguousarray(lights.lobe_exponent, np.float64)
    length = np.sqrt((axis * axis).sum(axis=0))
    axis /= np.where(length > 0, length, 1.0)  # lights without a lobe have no axis
    norm = np.empty_like(exponent)
    _fill_norms((normal * axis).sum(axis=0), exponent, norm)
    return Senders(position, normal, flux, np.ascontiguousarray(lights.lobe_flux, np.float64), axis, exponent, norm)


@kernel
def _fill_norms(cos_theta: Array, exponent: Array, norm: Array) -> None:
    for k in range(len(norm)):
        norm[k] = lobe_norm(cos_theta[k], exponent[k])


@kernel(parallel=True)
def add_unoccluded(
    sums: Array, first: int, receivers: int, per_receiver: int, occluded: Array, contribution: Array
) -> None:
    """Add to each receiver the contributions (n, 3), W/m^2, of its unoccluded rays, in their order.

    `sums` (3, r) is float64; `first` is the receiver of the first ray, and each receiver has `per_receiver` rays.
    """
    for r in prange(receivers):
        for ray in range(r * per_receiver, (r + 1) * per_receiver):
            if not occluded[ray]:
                for c in range(3):
                    sums[c, first + r] += contribution[ray, c]


@stage("pairs.glossy_rays")
def shadowed_radiance(
    tracer: Tracer, to: RayReceivers, points: GlossyPoints, lights: PixelLights, *, visibility: bool = True,
    batch: int = BATCH, hidden: Hidden | None = None,
) -> Array:
    """Sum the radiance that every receiver's lobe reflects towards the eye of the light that reaches it.

    points: The receivers with their lobes.
    visibility: Whether to trace the rays, none for a light that lies off the lobe; without, every pair counts.
    batch: Pairs held at a time; changes no bit of the result.
    hidden: As for `shadowed_sum`.
    -> (3, n) float64: W/m^2/sr.
    """
    return summed(tracer, to, lights, visibility, batch, hidden, partial(weigh_by_lobes, points))


@kernel(parallel=True)
def weigh_by_lobes(
    points: GlossyPoints, to: RayReceivers, receivers: tuple[int, int], senders: Senders, lights: tuple[int, int],
    reach: Array, contribution: Array,
) -> None:
    """Turn the irradiance of each pair, `contribution` (pairs, 3) of `fill_shadow_rays`, into radiance of the lobe.

    Pairs off the lobe give 0, and their `reach` (pairs,) is 0.
    """
    count = lights[1] - lights[0]
    for i in prange(receivers[1] - receivers[0]):
        for k in range(count):
            _weigh(points, to, receivers[0] + i, senders, lights[0] + k, reach, contribution, i * count + k)


@kernel
def _weigh(
    points: GlossyPoints, to: RayReceivers, r: int, senders: Senders, j: int, reach: Array, contribution: Array,
    ray: int,
) -> None:
    if reach[ray] <= 0:
        return
    mirror, position = points.mirrored, to.position
    lobe = receiver_lobe(
        np.float64(mirror[0, r]), np.float64(mirror[1, r]), np.float64(mirror[2, r]),
        senders.position[0, j] - position[0, r], senders.position[1, j] - position[1, r],
        senders.position[2, j] - position[2, r], np.float64(points.exponent[r]))
    reach[ray] = 0
    for c in range(3):
        # f_s I cos / r^2
        contribution[ray, c] = contribution[ray, c] * (points.specular[c, r] * lobe)
        if contribution[ray, c] > 0:
            reach[ray] = 1
