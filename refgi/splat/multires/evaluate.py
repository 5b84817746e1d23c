"""Irradiance at subsplats: the sum of Eq. 2 over all pixel lights (VPLs), with visibility or without.

Without visibility the pairs are those of `irradiance` at every pixel (Nichols and Wyman 2009, Sec. 3.4). With a shadow
ray each they are those of `vpl`: the picture converges to `vpl` as subsplats become fine, and to path tracing as lights
become many. With the soft shadows of clusters it converges to `val`.
"""

import inspect
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from refgi.cluster.val import cluster_lights, sum_at_pixels
from refgi.cluster.visibility.shadow import kept_shadows
from refgi.error_target.grid import Subsplats
from refgi.error_target.near import SIDE, NearLight, PixelSum, near_light, nothing_near
from refgi.jit import kernel, prange
from refgi.pairs.irradiance import PAIRS_AT_ONCE, Receivers, add_lights, checked
from refgi.pairs.pair_sum import TILE
from refgi.pairs.settings import AutoLightcuts, Lightcuts, PairSettings
from refgi.pairs.shadow_rays import BATCH, RayReceivers, Senders, receivers, shadowed_sum, summed
from refgi.pairs.tiles import put, taken
from refgi.scene import Geometry
from refgi.splat.multires.settings import Representative
from refgi.stages import report_progress, stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.cluster.settings import ValSettings
    from refgi.frame import Frame
    from refgi.pairs.pixel_lights import PixelLights
    from refgi.rays import Tracer
    from refgi.rsm import GBuffer


@stage("multires.representative_points", steps="refgi.splat.multires.steps.point_steps")
def representative_points(
    buffer: "GBuffer", subsplats: Subsplats, representative: Representative = "pixel"
) -> tuple[Array, Array]:
    """Return the point at which each subsplat is evaluated.

    representative: Position and normal of the cell's representative pixel, or the mean over the cell's surface.
    -> points (3, n): World space, m.
    -> normals (3, n): Unit normals there.
    """
    position, normal = buffer.resolve("position", "normal")
    return points_of(position, normal, buffer.covered, subsplats, representative)


def points_of(
    position: Array, normal: Array, covered: Array, subsplats: Subsplats, representative: Representative
) -> tuple[Array, Array]:
    """Return points and normals of `representative_points` from the channels (3, h, w), (3, h, w) and (h, w)."""
    points, normals = taken(position, subsplats.pixel), taken(normal, subsplats.pixel)
    if representative == "mean":
        cells = np.stack([subsplats.level, subsplats.row, subsplats.column]).astype(np.int64)
        _average(position, normal, covered, cells, points, normals)
    return points, normals


@stage("multires.evaluate", steps="refgi.splat.multires.steps.evaluate_steps")
def evaluate(
    points: Array, normals: Array, lights: "PixelLights", settings: PairSettings, footprint: Array | None = None,
    lightcuts: AutoLightcuts | Lightcuts | None = None,
) -> Array:
    """Sum the irradiance of every pixel light at some points (Eq. 2).

    points (3, n): World space, m; neighbours should follow each other.
    normals (3, n): Unit normals there.
    lightcuts: Sum diffuse lights by clusters, to an error; "auto": where that is estimated to take less time.
    -> (3, n): Irradiance, W/m^2, linear RGB: that of `irradiance` at the same points, to the bit; with lightcuts within
        their error.

    Raises `InputError` as `irradiance`.

    Eq. 2 prints the vector to the light from the wrong end, both BRDFs and a pi. Here a light holds the flux it
    reflects, and the receiver's albedo/pi is multiplied in after upsampling, pixel by pixel.
    """
    count = points.shape[1]
    receivers = Receivers(points[:, None], normals[:, None], np.ones((1, count), np.bool_))
    packed = checked(receivers, lights, settings, footprint, lightcuts)
    result = np.zeros_like(points)
    step = max(1 << 14, PAIRS_AT_ONCE // max(1, len(packed.shines)) // TILE * TILE)
    for first in range(0, count, step):
        part = slice(first, first + step)
        sums = np.zeros_like(np.ascontiguousarray(points[:, part]))
        # Eq. (2)
        add_lights(np.ascontiguousarray(points[:, part]), np.ascontiguousarray(normals[:, part]), packed, sums)
        result[:, part] = sums
        report_progress(min(1.0, (first + step) / count))
    return result


sum_at: Callable[..., Array] = inspect.unwrap(evaluate)  # unobserved


@kernel(parallel=True)
def _average(position: Array, normal: Array, covered: Array, cells: Array, points: Array, normals: Array) -> None:
    for k in prange(cells.shape[1]):
        _average_cell(position, normal, covered, cells, points, normals, k)


@kernel
def _average_cell(
    position: Array, normal: Array, covered: Array, cells: Array, points: Array, normals: Array, k: int
) -> None:
    height, width = covered.shape
    level, row, column = cells[0, k], cells[1, k], cells[2, k]
    x, y, z, p, q, r, count = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0
    for i in range(row << level, min((row + 1) << level, height)):
        for j in range(column << level, min((column + 1) << level, width)):
            if covered[i, j]:
                x, y, z = x + position[0, i, j], y + position[1, i, j], z + position[2, i, j]
                p, q, r = p + normal[0, i, j], q + normal[1, i, j], r + normal[2, i, j]
                count += 1
    length = np.sqrt(p * p + q * q + r * r)
    if count <= 1 or length == 0:  # opposite normals have no mean: the pixel's stays
        return
    points[0, k], points[1, k], points[2, k] = x / count, y / count, z / count
    normals[0, k], normals[1, k], normals[2, k] = p / length, q / length, r / length


@stage("multires.evaluate_visible", steps="refgi.splat.multires.light_steps.visible_steps")
def evaluate_visible(
    tracer: "Tracer", geometry: Geometry, buffer: "GBuffer", subsplats: Subsplats, lights: "PixelLights"
) -> Array:
    """Sum the irradiance that reaches each subsplat's representative pixel from every pixel light, by shadow rays.

    geometry: The triangles that the G-buffer's ids refer to.
    -> (3, n): Irradiance, W/m^2, linear RGB, in the buffer's dtype: that of `vpl` for the same lights, to the bit.
        Excludes the receiver's albedo/pi.

    Pairs are calibrated and not clamped, summed in float64: the code of `vpl`. Settings that change a pair (clamps,
    offsets, lobes' norms and widening, published forms) and means over a cell, which lie on no triangle, have no
    counterpart here.
    """
    return visible_at(tracer, geometry, buffer, lights)(subsplats.pixel)


def visible_at(
    tracer: "Tracer", geometry: Geometry, buffer: "GBuffer", lights: "PixelLights"
) -> Callable[[Array], Array]:
    """Return a function from covered pixels (n flat indices) to what `evaluate_visible` gives them, (3, n), W/m^2."""

    def at(pixel: Array) -> Array:
        points = ray_receivers(tracer, geometry, buffer, pixel)
        return shadowed_sum(tracer, points, lights).astype(buffer.position.dtype)

    return at


def ray_receivers(tracer: "Tracer", geometry: Geometry, buffer: "GBuffer", pixel: Array) -> RayReceivers:
    """Return covered pixels (n flat indices) of a G-buffer as receivers of shadow rays."""
    position, normal, triangle_id = buffer.resolve("position", "normal", "triangle_id")
    return receivers(geometry, taken(position, pixel), taken(normal, pixel), triangle_id.reshape(-1)[pixel],
                     tracer.grain)


@stage("multires.evaluate_shadowed", steps="refgi.splat.multires.light_steps.shadowed_steps")
def evaluate_shadowed(
    frame: "Frame", buffer: "GBuffer", subsplats: Subsplats, lights: "PixelLights", settings: "ValSettings",
    footprint: Array | None = None,
) -> Array:
    """Sum the irradiance of every pixel light under the soft shadow of its cluster, at representative pixels.

    frame: The scene, in which clusters cast shadows.
    -> (3, n): Irradiance, W/m^2, linear RGB: that of `val` at the same pixels, to the bit. Excludes the receiver's
        albedo/pi.

    Shadow maps hold what can block between the lights of `frame` and the surfaces in its view (Dong et al. 2009, Sec. 4
    to 6).
    """
    return shadowed_at(frame, buffer, lights, settings, footprint)(subsplats.pixel)


def shadowed_at(
    frame: "Frame", buffer: "GBuffer", lights: "PixelLights", settings: "ValSettings",
    footprint: Array | None = None, lists: bool = False,
) -> Callable[[Array], Array]:
    """Return a function from covered pixels (n flat indices) to what `evaluate_shadowed` gives them, (3, n), W/m^2.

    Lights are clustered, and maps drawn, once; for `lists` of pixels, many of them, maps are filtered once as well.
    """
    clustered = cluster_lights(frame, lights, settings)
    kept = kept_shadows(*clustered, settings) if lists else None
    return sum_at_pixels(frame, buffer, lights, clustered, settings, footprint, kept)


def shadowed_by_rays(tracer: "Tracer", geometry: "Geometry", buffer: "GBuffer", lights: "PixelLights") -> PixelSum:
    """Return the sum of `vpl`: a shadow ray for each pair, pairs not clamped.

    `tracer`: the scene's rays. `geometry`: the triangles that the buffer's ids refer to. `lights`: N pixel lights.
    """

    def near(receivers: Receivers, most: float) -> NearLight:
        found, width, pairs = nothing_near(receivers), receivers.covered.shape[1], 0
        if most <= 0:
            return found

        def keep_excess(_to: RayReceivers, _receivers: tuple[int, int], _senders: Senders, _lights: tuple[int, int],
                        reach: Array, contribution: Array) -> None:
            nonlocal pairs
            _keep_excess(most, reach, contribution)
            pairs += int(np.count_nonzero(reach))

        pixel = _pixels_with_near_pairs(receivers, lights, most)
        points = ray_receivers(tracer, geometry, buffer, pixel)
        values = summed(tracer, points, lights, True, BATCH, None, keep_excess).astype(receivers.position.dtype)
        put(found.irradiance, pixel, values)
        found.has_near[pixel // width // SIDE, pixel % width // SIDE] = True
        return found._replace(pairs=pairs)

    return PixelSum(visible_at(tracer, geometry, buffer, lights), near)


@kernel(parallel=True)
def _keep_excess(most: float, reach: Array, contribution: Array) -> None:
    """Scale contributions (n, 3), W/m^2, to what their strongest channel has over a bound; clear the others' reach."""
    for i in prange(len(reach)):
        strongest = max(contribution[i, 0], max(contribution[i, 1], contribution[i, 2]))
        beyond = reach[i] > 0 and strongest > most
        reach[i] = 1 if beyond else 0
        share = 1.0 - most / strongest if beyond else 0.0
        for c in range(3):
            contribution[i, c] *= share


def _pixels_with_near_pairs(receivers: Receivers, lights: "PixelLights", most: float) -> Array:
    """Return the covered pixels that some light, were nothing in between, gives more than a bound; all with lobes."""
    packed = checked(receivers, lights, PairSettings(clamp=None), None)
    if packed.lobes is not None:
        return np.flatnonzero(receivers.covered)
    near = near_light(receivers, packed, most)
    bright = np.repeat(np.repeat(near.has_near, SIDE, axis=0), SIDE, axis=1)
    bright = bright[: receivers.covered.shape[0], : receivers.covered.shape[1]] & receivers.covered
    pixel = np.flatnonzero(bright)
    return pixel[taken(near.irradiance, pixel).any(axis=0)]
