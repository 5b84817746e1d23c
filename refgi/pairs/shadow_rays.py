"""A shadow ray for each pair of receiver and pixel light, and the sum of what is not blocked.

E(x) = sum_i Phi_i / pi <n_i.w> <n_x.-w> / r^2 V(x, x_i), and the same with a lobe (papers' Eq. 2 and 3, calibrated).
A ray is traced for each pair whose unshadowed term is not zero. Pairs are made in batches and never all held.

The points that rays light: where they lie, which way they face and where their shadow rays start.
"""

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.lobes import lobe_gap, lobe_norm, lobe_power
from refgi.rays import STEPS, Tracer, far_offset, ray_offset
from refgi.scene import Geometry
from refgi.stages import report_progress, stage

if TYPE_CHECKING:
    from refgi.pairs.pixel_lights import PixelLights

Array = npt.NDArray[Any]

ROUNDED = 2.0**-14  # of a point's coordinates: it is off its face by that at most, or not meant to lie on it
LIGHTS_AT_A_TIME = 1024
BATCH = 1 << 18  # pairs held at a time


class Receivers(NamedTuple):
    """The points whose irradiance is asked for, without the pixels that see nothing."""

    pixel: Array  # (r,) int64, flat index into the picture
    position: Array  # (3, r) float32, m
    normal: Array  # (3, r) float32: the G-buffer's
    facing: Array  # (3, r) float32: the face's normal on the same side
    origin: Array  # (3, r) float32: where rays start, lifted off the face, m


def receivers(geometry: Geometry, position: Array, normal: Array, triangle_id: Array, grain: float) -> Receivers:
    """Take the covered pixels of a G-buffer, or any choice of them, as receivers.

    Parameters
    ----------
    geometry : Geometry
        The triangles.
    position, normal : (3, h, w) or (3, n) ndarray
        The G-buffer's, world space.
    triangle_id : (h, w) or (n,) int ndarray
        Which triangle each pixel sees; -1 for none.
    grain : float
        The tracer's: rays start above the face by `ray_offset`, m.

    Returns
    -------
    Receivers
        In picture order; `pixel` counts through the given points.
    """
    pixel = np.flatnonzero(triangle_id.reshape(-1) >= 0)
    at = np.ascontiguousarray(position.reshape(3, -1)[:, pixel], np.float64)
    up = np.ascontiguousarray(normal.reshape(3, -1)[:, pixel], np.float64)
    corner = geometry.vertices[geometry.faces[triangle_id.reshape(-1)[pixel]]]
    face = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]).T
    face *= np.where((face * up).sum(axis=0) < 0, -1.0, 1.0) / np.linalg.norm(face, axis=0)
    # what the rasterizer's rounding moved off the face is taken back
    size = np.abs(at).sum(axis=0) + grain
    height = ((at - corner[:, 0].T) * face).sum(axis=0)
    lift = STEPS * size - np.where(np.abs(height) < ROUNDED * size, height, 0)
    return Receivers(pixel, *(np.ascontiguousarray(a, np.float32) for a in (at, up, face, at + lift * face)))


class Senders(NamedTuple):
    """Pixel lights for the kernel, in float64; without lobes the last four have no columns."""

    position: Array  # (3, n), m
    normal: Array  # (3, n)
    flux: Array  # (3, n), W
    lobe_flux: Array  # (3, n or 0), W
    lobe_axis: Array  # (3, n or 0)
    lobe_exponent: Array  # (n or 0,)
    lobe_norm: Array  # (n or 0,) 1/sr


@stage("shadowed.sum")
def shadowed_sum(
    tracer: Tracer, to: Receivers, lights: "PixelLights", *, visibility: bool = True, batch: int = BATCH
) -> Array:
    """Sum the irradiance of every pixel light at every receiver, each pair with its visibility.

    Parameters
    ----------
    tracer : Tracer
        The scene's rays.
    to : Receivers
        Receivers.
    lights : PixelLights
        The lights.
    visibility : bool
        Whether to trace the rays; without, every pair counts.
    batch : int
        Pairs held at a time; changes no bit of the result.

    Returns
    -------
    (3, r) ndarray of float64
        Irradiance, W/m^2.
    """
    senders, total = _senders(lights), np.zeros((3, len(to.pixel)))
    step = max(1, batch // LIGHTS_AT_A_TIME)
    for first in range(0, total.shape[1], step):
        last = min(first + step, total.shape[1])
        for light in range(0, senders.flux.shape[1], LIGHTS_AT_A_TIME):
            count = min(LIGHTS_AT_A_TIME, senders.flux.shape[1] - light)
            _add_lights(tracer, to, (first, last), senders, (light, light + count), visibility, total)
        report_progress(last / total.shape[1])
    return total


def _add_lights(tracer: Tracer, to: Receivers, receivers: tuple[int, int], senders: Senders, lights: tuple[int, int],
                visibility: bool, total: Array) -> None:
    count = lights[1] - lights[0]
    pairs = (receivers[1] - receivers[0]) * count
    origin, direction, worth = (np.empty((pairs, 3), np.float32) for _ in range(3))
    reach, blocked = np.empty(pairs, np.float32), np.empty(pairs, np.bool_)
    aim(to, receivers, senders, lights, tracer.grain, (origin, direction, reach, worth))
    if visibility:
        tracer.fill_occluded(origin, direction, reach, blocked)
    else:
        np.less_equal(reach, 0, out=blocked)
    add_free(total, receivers[0], receivers[1] - receivers[0], count, blocked, worth)


@kernel(parallel=True)
def aim(to: Receivers, receivers: tuple[int, int], senders: Senders, lights: tuple[int, int], grain: float,
        rays: tuple[Array, Array, Array, Array]) -> None:
    """Write the shadow ray of each pair of a block, and what the pair is worth.

    Parameters
    ----------
    to : Receivers
        Receivers.
    receivers : tuple of 2 ints
        First receiver of the block and one past the last.
    senders : Senders
        Pixel lights.
    lights : tuple of 2 ints
        First sender of the block and one past the last.
    grain : float
        The tracer's: segments end above the sender by `ray_offset` and `far_offset`, m.
    rays : tuple of 4 arrays
        Filled: origins, directions (n, 3), reach (n,), worth (n, 3) W/m^2, float32, light by light for each receiver;
        the reach is 0 where a pair has nothing to give.
    """
    count = lights[1] - lights[0]
    for i in prange(receivers[1] - receivers[0]):
        _aim_all(to, receivers[0] + i, senders, lights, grain, rays, i * count)


@kernel
def _aim_all(to: Receivers, r: int, senders: Senders, lights: tuple[int, int], grain: float,
             rays: tuple[Array, Array, Array, Array], ray: int) -> None:
    for k in range(lights[0], lights[1]):
        _aim(to, r, senders, k, grain, rays, ray + k - lights[0])


@kernel
def _aim(to: Receivers, r: int, senders: Senders, j: int, grain: float, rays: tuple[Array, Array, Array, Array],
         ray: int) -> None:
    origins, directions, reach, worth = rays
    reach[ray] = 0
    dx, dy = senders.position[0, j] - to.position[0, r], senders.position[1, j] - to.position[1, r]
    offset = (ray_offset(senders.position[0, j], senders.position[1, j], senders.position[2, j], grain)
              + far_offset(dx, dy, senders.position[2, j] - to.position[2, r]))
    r2, cos_x, cos_y, above = 0.0, 0.0, 0.0, 0.0
    for c in range(3):
        d = senders.position[c, j] - to.position[c, r]
        r2 += d * d
        cos_x += to.normal[c, r] * d
        cos_y -= senders.normal[c, j] * d
        above += to.facing[c, r] * d
        origins[ray, c] = to.origin[c, r]
        directions[ray, c] = senders.position[c, j] + offset * senders.normal[c, j] - to.origin[c, r]
    if cos_x <= 0 or cos_y <= 0 or above <= 0:
        return
    diffuse, lobe = cos_x * cos_y / (np.pi * r2 * r2), 0.0
    if senders.lobe_exponent.shape[0] > 0:
        lobe = _lobe(to, r, senders, j) * cos_x / (r2 * math.sqrt(r2))
    for c in range(3):
        worth[ray, c] = senders.flux[c, j] * diffuse
        if senders.lobe_exponent.shape[0] > 0:
            worth[ray, c] += senders.lobe_flux[c, j] * lobe
        if worth[ray, c] > 0:
            reach[ray] = 1


@kernel
def _lobe(to: Receivers, r: int, senders: Senders, j: int) -> Any:
    """Return c(P) <r.w>^P for the direction from sender j to receiver r (Eq. 3, normalised)."""
    dx, dy = to.position[0, r] - senders.position[0, j], to.position[1, r] - senders.position[1, j]
    dz = to.position[2, r] - senders.position[2, j]
    gap = lobe_gap(senders.lobe_axis[0, j], senders.lobe_axis[1, j], senders.lobe_axis[2, j], dx, dy, dz)
    return senders.lobe_norm[j] * lobe_power(gap, senders.lobe_exponent[j])


def _senders(lights: "PixelLights") -> Senders:
    arrays = (lights.position, lights.normal, lights.flux)
    position, normal, flux = (np.ascontiguousarray(array, np.float64) for array in arrays)
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
def add_free(sums: Array, first: int, receivers: int, per_receiver: int, blocked: Array, worth: Array) -> None:
    """Add to each receiver what its unblocked rays are worth, in their order.

    Parameters
    ----------
    sums : (3, r) float64 ndarray
        Added to.
    first : int
        Receiver of the first ray.
    receivers : int
        How many receivers the rays belong to.
    per_receiver : int
        Rays of each.
    blocked : (n,) bool ndarray
        Which rays are blocked.
    worth : (n, 3) float32 ndarray
        What each is worth, W/m^2.
    """
    for r in prange(receivers):
        for ray in range(r * per_receiver, (r + 1) * per_receiver):
            if not blocked[ray]:
                for c in range(3):
                    sums[c, first + r] += worth[ray, c]
