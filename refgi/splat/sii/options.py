"""What `sii` can do around its sum: buffers as published, a quarter of the pixels, compensation of its clamp.

`quantisation` (SII Sec. 4, 6): positions are half floats, directions 8 bits a component (4 x 8-bit textures), made unit
vectors again when read, flux 8 bits a channel, as shares of the largest of all lights and parts.

`half_resolution` (SII Table 3; no filter in the paper): a pixel takes the bilinear mean of the four blocks around it,
each times ``a = max(0, n . n_k)^8 (1 - |n . (x_k - x)| / |x_k - x|)^2``, x, n and x_k, n_k positions and normals of the
pixel and of a block's: the first factor for edges, the second for depth. A pixel that no block resembles is evaluated.

`compensation` (Novak, Engelhardt and Dachsbacher 2011): with the geometry term bounded to b lights lack the integral of
L max(0, G - b), from surfaces nearer than b^(-1/2), which mostly the same picture shows. Pixels are the senders of
level 0 of `hssil`, each with its direct light L and its area ds; what is off screen, hidden or slanted is missing.
"""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.pairs.irradiance import Receivers
from refgi.rsm.raster.projection import Projection
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.lights import PixelLights
    from refgi.splat.sii.settings import SiiSettings

LEAST_WEIGHT = 0.05  # of 1, sum of weights below which a pixel is evaluated by itself


@stage("sii.half_resolution")
def half_resolution(
    receivers: Receivers, evaluate: Callable[[Receivers], Array], *, joint: bool = True
) -> Array:
    """Evaluate light at a quarter of the pixels and interpolate it to all.

    evaluate: Gives the irradiance (3, h', w') of receivers of any height and width.
    joint: Weight blocks by position and normal; else by place on the screen only.
    -> (3, h, w): Irradiance, W/m^2; 0 where there is no surface.

    A block is evaluated at its first covered pixel, row by row. That pixel keeps its value, a constant stays that
    constant to the bit, and pixels without surface count nowhere.
    """
    position, normal, covered = (np.asarray(part) for part in receivers)
    chosen = _block_pixels(covered)
    flat = [part.reshape(*part.shape[:-2], -1) for part in (position, normal, covered)]
    blocks = Receivers(*(np.ascontiguousarray(part[..., chosen]) for part in flat))
    coarse = evaluate(blocks)
    result = np.zeros(position.shape, coarse.dtype)
    resolved = np.zeros(covered.shape, np.bool_)
    _interpolate(Receivers(position, normal, covered), blocks, chosen, coarse, joint, result, resolved)
    unresolved = np.flatnonzero(covered & ~resolved)
    if len(unresolved):
        here = Receivers(*(np.ascontiguousarray(part[..., unresolved][..., None, :]) for part in flat))
        result.reshape(3, -1)[:, unresolved] = evaluate(here)[:, 0]
    return result


def _block_pixels(covered: Array) -> Array:
    """Return the flat index of the first covered pixel of each block, (h', w') int64."""
    height, width = covered.shape
    padded = np.zeros((height + height % 2, width + width % 2), np.bool_)
    padded[:height, :width] = covered
    blocks = padded.reshape(len(padded) // 2, 2, -1, 2).transpose(0, 2, 1, 3)
    first = blocks.reshape(*blocks.shape[:2], 4).argmax(axis=2)
    rows, columns = (np.arange(size) * 2 for size in first.shape)
    return np.asarray((rows[:, None] + first // 2) * width + columns + first % 2)


@kernel(parallel=True)
def _interpolate(
    pixels: Receivers, blocks: Receivers, chosen: Array, coarse: Array, joint: bool, result: Array, resolved: Array
) -> None:
    for i in prange(resolved.shape[0]):
        _interpolate_row(pixels, blocks, chosen, coarse, joint, result, resolved, i)


@kernel
def _interpolate_row(
    pixels: Receivers, blocks: Receivers, chosen: Array, coarse: Array, joint: bool, result: Array, resolved: Array,
    i: int,
) -> None:
    """Fill the covered pixels of row i with the mean of up to four blocks, and mark those that have one."""
    real = coarse.dtype.type
    x, n, xk, nk = pixels.position, pixels.normal, blocks.position, blocks.normal
    height, width = chosen.shape
    top = i // 2
    for j in range(resolved.shape[1]):
        if not pixels.covered[i, j]:
            continue
        left = j // 2
        total, red, green, blue = real(0.0), real(0.0), real(0.0), real(0.0)
        most, p, q, r = real(0.0), real(0.0), real(0.0), real(0.0)
        for corner in range(1 if chosen[top, left] == i * resolved.shape[1] + j else 4):
            row, column = top + corner // 2, left + corner % 2
            weight = real(0.25 * (2 - i % 2 if corner < 2 else i % 2) * (j % 2 if corner % 2 else 2 - j % 2))
            if weight == real(0.0) or row >= height or column >= width or not blocks.covered[row, column]:
                continue
            if joint:
                weight *= _bilateral_weight(
                    xk[0, row, column] - x[0, i, j], xk[1, row, column] - x[1, i, j], xk[2, row, column] - x[2, i, j],
                    n[0, i, j], n[1, i, j], n[2, i, j], nk[0, row, column], nk[1, row, column], nk[2, row, column])
            a, b, c = coarse[0, row, column], coarse[1, row, column], coarse[2, row, column]
            # differences to p, q, r, the block of most weight: constants are exact, what hardly counts costs no digits
            if weight > most:
                red, green, blue = red + total * (p - a), green + total * (q - b), blue + total * (r - c)
                most, p, q, r = weight, a, b, c
            total += weight
            red, green, blue = red + weight * (a - p), green + weight * (b - q), blue + weight * (c - r)
        if total >= real(LEAST_WEIGHT):
            resolved[i, j] = True
            result[0, i, j] = p + red / total
            result[1, i, j] = q + green / total
            result[2, i, j] = r + blue / total


@kernel
def _bilateral_weight(dx: Any, dy: Any, dz: Any, nx: Any, ny: Any, nz: Any, mx: Any, my: Any, mz: Any) -> Any:
    """Return the bilateral weight a for a block's pixel d away, with normals n of the pixel and m of the block."""
    real = type(dx)
    one, zero = real(1.0), real(0.0)
    cosine = nx * mx + ny * my + nz * mz
    square = dx * dx + dy * dy + dz * dz
    if cosine <= zero:
        return zero
    sine = abs(dx * nx + dy * ny + dz * nz) / math.sqrt(square) if square > zero else zero
    flat = one - (sine if sine < one else one)
    power = cosine * cosine
    power *= power
    return power * power * (flat * flat)


STEPS = 255
LARGEST_HALF = 65504.0  # m


def as_stored(
    receivers: "Receivers", lights: "PixelLights", settings: "SiiSettings"
) -> "tuple[Receivers, PixelLights]":
    """Return receivers and lights as the settings store them."""
    if settings.quantisation == "none":
        return receivers, lights
    position, normal = stored_surface(receivers.position, receivers.normal)
    return receivers._replace(position=position, normal=normal), stored_lights(lights)


@stage("sii.stored_surface")
def stored_surface(position: Array, normal: Array) -> tuple[Array, Array]:
    """Round places to half floats and normals to 8 bits a component (SII Sec. 4).

    -> position (3, h, w): Surface points, m.
    -> normal (3, h, w): Unit normals; 0 without surface.
    """
    return half_floats(position), directions(normal)


@stage("sii.stored_lights")
def stored_lights(lights: "PixelLights") -> "PixelLights":
    """Round what is read of each light to half floats and 8 bits (SII Sec. 6).

    -> PixelLights: All of them, in the same order.
    """
    position, normal = half_floats(lights.position), directions(lights.normal)
    largest = lights.flux.max(initial=0)
    if lights.lobe_flux is not None and lights.lobe_axis is not None:
        largest = max(largest, lights.lobe_flux.max(initial=0))
        lights = lights._replace(lobe_flux=shares(lights.lobe_flux, largest), lobe_axis=directions(lights.lobe_axis))
    return lights._replace(position=position, normal=normal, flux=shares(lights.flux, largest))


def half_floats(position: Array) -> Array:
    """Return the nearest half floats, in the array's own dtype."""
    expect(bool((np.abs(position) <= LARGEST_HALF).all()), "quantisation", "'none' beyond 65504 m of the origin, "
           "where half floats end", "'published'")
    return position.astype(np.float16).astype(position.dtype)


def directions(vectors: Array) -> Array:
    """Return unit vectors (3, ...) of 8 bits a component, to 0.4 degrees; 0 stays 0."""
    bits = np.floor((vectors + 1) * (STEPS / 2) + 0.5) * (2 / STEPS) - 1
    length = np.sqrt((bits**2).sum(axis=0, keepdims=True))
    return np.asarray(np.where(vectors.any(axis=0), bits / length, 0), vectors.dtype)


def shares(flux: Array, largest: float) -> Array:
    """Return the nearest of 256 even shares of the largest flux, W."""
    if largest == 0:
        return flux
    return np.asarray(np.floor(flux / largest * STEPS + 0.5) * (largest / STEPS), flux.dtype)


@stage("sii.compensation")
def screen_compensation(
    depth: Array, normal: Array, albedo: Array, direct: Array, projection: Projection, bound: float
) -> Array:
    """Sum L ds max(0, G - b) over the pixels near each one.

    depth (h, w): Along the view direction, m; inf without surface.
    direct (3, h, w): Direct irradiance, W/m^2.
    projection: The camera's map.
    bound: b, 1/m^2.
    -> (3, h, w): Irradiance, W/m^2, linear RGB, without albedo/pi and visibility.
    """
    from refgi.sssil.levels import levels

    (pixels,) = levels(depth, normal, albedo, direct, projection, 0, 1)
    result = np.zeros_like(direct)
    _sum_near(pixels.position, pixels.depth, pixels.normal, pixels.radiance, pixels.area, float(bound),
              np.asarray(projection.half, np.float64), result)
    return result


@kernel(parallel=True)
def _sum_near(
    position: Array, depth: Array, normal: Array, radiance: Array, area: Array, bound: float, half: Array, result: Array
) -> None:
    height, width = depth.shape
    for i in prange(height):
        for j in range(width):
            if depth[i, j] < math.inf:
                rows = _within(i, height, float(depth[i, j]), float(half[1]), bound)
                columns = _within(j, width, float(depth[i, j]), float(half[0]), bound)
                _sum_one(position, normal, radiance, area, bound, i, j, rows, columns, result)


@kernel
def _within(index: Any, count: int, depth: float, half: float, bound: float) -> tuple[int, int]:
    """Return the first row or column, and one past the last, that may show a point nearer than b^(-1/2)."""
    reach = 1.0 / math.sqrt(bound)
    if depth <= reach:
        return 0, count
    # |x'/z' - x/z| <= (reach + |x/z| reach) / z', z' >= z - reach
    pixels = math.ceil(reach * (1.0 + half) / (depth - reach) * count / (2.0 * half)) + 1
    here = int(index)
    return max(0, here - pixels), min(count, here + pixels + 1)


@kernel
def _sum_one(
    position: Array, normal: Array, radiance: Array, area: Array, bound: float, i: Any, j: Any, rows: tuple[int, int],
    columns: tuple[int, int], result: Array,
) -> None:
    # L ds max(0, G - b), G = cos cos / r^2
    x, y, z = float(position[0, i, j]), float(position[1, i, j]), float(position[2, i, j])
    nx, ny, nz = float(normal[0, i, j]), float(normal[1, i, j]), float(normal[2, i, j])
    red, green, blue = 0.0, 0.0, 0.0
    for a in range(rows[0], rows[1]):
        for b in range(columns[0], columns[1]):
            dx, dy, dz = position[0, a, b] - x, position[1, a, b] - y, position[2, a, b] - z
            square = dx * dx + dy * dy + dz * dz
            cx = nx * dx + ny * dy + nz * dz
            cl = -(normal[0, a, b] * dx + normal[1, a, b] * dy + normal[2, a, b] * dz)
            if cx > 0.0 and cl > 0.0 and cx * cl > bound * square * square:
                share = area[a, b] * (cx * cl / (square * square) - bound)
                red += share * radiance[0, a, b]
                green += share * radiance[1, a, b]
                blue += share * radiance[2, a, b]
    result[0, i, j], result[1, i, j], result[2, i, j] = red, green, blue
