"""Direct light of one light source: irradiance at the receivers, and shadow-map visibility.

The shadow test compares with the receiver's own plane (a receiver-plane depth bias) in place of a constant bias. The
plane is the face's, whatever normal the cosine is taken with: above an interpolated one lies part of the face itself.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.errors import expect
from refgi.jit import kernel, prange, thread_count
from refgi.radiometry import DIRECTIONAL, FOR_FLOAT32, POINT, falloff_in_float64, incident_light
from refgi.rsm.buffers.gbuffer import GBuffer
from refgi.rsm.buffers.reflective import Rsm
from refgi.rsm.buffers.surfaces import row_view
from refgi.rsm.pool import plane
from refgi.rsm.raster.projection import ORTHOGRAPHIC, PARABOLOID, Projection, image_of_view, texel_coordinates
from refgi.scene.light import Lamp, light_of
from refgi.scene.model import Light, LightTable, SpotLight, light_table
from refgi.stages import stage
from refgi.types import Array

PLANE_BIAS = 0.1  # texels, also per unit of slope: how far above a receiver's plane its own surface may be stored
LARGEST_SLOPE = 10.0  # largest slope, depth per sideways distance, that the bias follows
NO_SHADOW = np.zeros((0, 0), np.bool_)


class ShadowMap(NamedTuple):
    """Depth and position of the nearest surface at each texel of a light's map."""

    depth: Array  # (T,) or (H, W) m
    position: Array  # (3, T) or (3, H, W) m
    bias: float  # m; negative: compare with the receiver's plane


class SurfacePoints(NamedTuple):
    """Receivers: surface points and their normals."""

    position: Array  # (3, h, w) m
    normal: Array  # (3, h, w) unit vectors
    covered: Array  # (h, w) bool


@stage("rsm.shadow_map_visibility", steps="refgi.rsm.buffers.steps.shadow_steps")
def shadow_map_visibility(
    position: Array, normal: Array, covered: Array, rsm: Rsm, bias: float | None = None, interpolated: bool = False
) -> Array:
    """Return which receivers a light reaches: the shadow-map test, one look-up at the nearest texel.

    normal (3, h, w): Unit normals of the pixels' faces.
    bias: A receiver is visible up to this far behind the stored depth, m: the published test. By default it is in
        shadow where the stored point lies above the receiver's own plane by more than a fraction of a texel.
    interpolated: Whether cosines are those of interpolated normals. These may face a light that the face is turned away
        from: such receivers are in shadow then, as they are for rays.
    -> (h, w) bool: True where the light arrives; false outside the map, which encloses all that the light reaches.

    Raises
    ------
    InputError
        If the bias is not finite and at least 0.

    Notes
    -----
    Shadow edges are as coarse as the map, without percentage-closer filtering (PCF). What blocks the light lies between
    it and the receiver, hence above the receiver's plane; a neighbouring point of the same surface does not, at any
    slope.
    """
    expect(bias is None or (math.isfinite(bias) and bias >= 0), "bias", "a finite number >= 0, m", bias)
    depth, map_position = rsm.resolve("depth", "position")
    shadow_map = ShadowMap(depth, map_position, -1.0 if bias is None else bias)
    return looked_up(SurfacePoints(position, normal, covered), rsm.projection, shadow_map, rsm.light, interpolated)


def looked_up(
    receivers: SurfacePoints, maps: Projection, shadow_map: ShadowMap, light: Light, interpolated: bool
) -> Array:
    """Return which receivers a light reaches by its map's depth (H, W), m, and positions (3, H, W), m."""
    visible = plane(receivers.covered.shape, np.bool_)
    depth, map_position, bias = shadow_map
    flat = ShadowMap(depth.reshape(-1), map_position.reshape(3, -1), bias)
    _shadow_lookup(maps, receivers, flat, thread_count(), visible)
    if interpolated:
        _hide_turned_away(light_table((light,)), receivers.position, receivers.normal, visible)
    return visible


@kernel(parallel=True)
def _hide_turned_away(lights: LightTable, position: Array, normal: Array, visible: Array) -> None:
    """Clear `visible` where the light is behind the face."""
    for row in prange(visible.shape[0]):
        receivers, factor = SurfacePoints(position, normal, visible), np.empty(visible.shape[1])
        if lights.kind[0] == DIRECTIONAL:
            _directional_factors(lights, receivers, row, visible[row], factor)
        else:
            _point_factors(lights, receivers, row, visible[row], factor)
        for x in range(len(factor)):
            visible[row, x] = factor[x] > 0.0


@kernel(parallel=True)
def _shadow_lookup(
    maps: Projection, receivers: SurfacePoints, shadow_map: ShadowMap, workers: int, visible: Array
) -> None:
    for worker in prange(workers):
        _shadow_lookup_rows(maps, receivers, shadow_map, worker, workers, visible)


@kernel
def _shadow_lookup_rows(
    maps: Projection, receivers: SurfacePoints, shadow_map: ShadowMap, first: int, step: int, visible: Array
) -> None:
    """Look up every `step`-th row: a whole row is projected first, in SIMD lanes, then what lies on a map is listed."""
    position, normal, covered = receivers.position, receivers.normal, receivers.covered
    width = visible.shape[1]
    nearest_texel, receiver_depth, above_plane = np.empty(width, np.int32), np.empty(width), np.empty(width)
    constant, relative = _largest_plane_bias(maps)
    for row in range(first, len(visible), step):
        _project_row(maps, position, row, nearest_texel, receiver_depth)
        for x in range(width):
            texel = max(nearest_texel[x], 0)
            # in the receivers' type, as the sum's parts are
            along = normal[0, row, x] * (shadow_map.position[0, texel] - position[0, row, x])
            down = normal[1, row, x] * (shadow_map.position[1, texel] - position[1, row, x])
            ahead = normal[2, row, x] * (shadow_map.position[2, texel] - position[2, row, x])
            above_plane[x] = 0.0 + along + np.float64(down) + np.float64(ahead)
        for x in range(width):
            if not covered[row, x] or nearest_texel[x] < 0:
                visible[row, x] = False
            elif shadow_map.bias >= 0.0:
                visible[row, x] = receiver_depth[x] <= shadow_map.depth[nearest_texel[x]] + shadow_map.bias
            elif receiver_depth[x] <= shadow_map.depth[nearest_texel[x]] or above_plane[x] <= 1e-6 * receiver_depth[x]:
                visible[row, x] = True
            elif above_plane[x] > constant + relative * receiver_depth[x]:  # most shadowed points: saves `_plane_bias`
                visible[row, x] = False
            else:
                point = position[0, row, x], position[1, row, x], position[2, row, x]
                facing = normal[0, row, x], normal[1, row, x], normal[2, row, x]
                plane_bias = _plane_bias(maps, nearest_texel[x] // (maps.height * maps.width), point, facing)
                visible[row, x] = above_plane[x] <= plane_bias + 1e-6 * receiver_depth[x]


@kernel
def _project_row(maps: Projection, position: Array, row: int, nearest_texel: Array, receiver_depth: Array) -> None:
    """Write the texel of the first map that sees each point, as `texel_of` does, or -1, and the point's depth."""
    half, width = (maps.half[0], maps.half[1]), np.int32(maps.width)
    curved, parallel = maps.kind == PARABOLOID, maps.kind == ORTHOGRAPHIC
    last_row = np.int32(len(maps.origin) * maps.height - 1)
    nearest_texel[:] = -1
    for m in range(len(maps.origin)):
        # read once: the compiler does not see that what is written lies elsewhere
        ox, oy, oz, rx, ry, rz, qx, qy, qz, fx, fy, fz = row_view(maps, m * maps.height)[0]
        for x in range(len(nearest_texel)):
            px, py, pz = position[0, row, x] - ox, position[1, row, x] - oy, position[2, row, x] - oz
            a, b, depth = rx * px + ry * py + rz * pz, qx * px + qy * py + qz * pz, fx * px + fy * py + fz * pz
            if curved:
                u, v, depth = image_of_view(PARABOLOID, a, b, depth)
            else:
                u = a if parallel else (a / depth if depth > 0.0 else np.nan)
                v = b if parallel else (b / depth if depth > 0.0 else np.nan)
            inside = (nearest_texel[x] < 0) & (abs(u) <= half[0]) & (abs(v) <= half[1])
            column, line = texel_coordinates(half, maps.height, maps.width, m, u if inside else 0.0,
                                             v if inside else 0.0)
            # int32, as no SIMD lanes of AVX2 turn float64 into int64
            texel = min(np.int32(line), last_row) * width + min(np.int32(column), width - np.int32(1))
            nearest_texel[x] = np.int32(texel) if inside else nearest_texel[x]
            receiver_depth[x] = depth if inside else receiver_depth[x]


@kernel
def _largest_plane_bias(maps: Projection) -> tuple[float, float]:
    """Return (a, b): the plane bias and what rounding adds are less than a + b depth, whatever the receiver's slope."""
    width = 2.0 * max(maps.half[0] / maps.width, maps.half[1] / maps.height)
    most = (1.0 + 1e-3) * PLANE_BIAS * (1.0 + LARGEST_SLOPE) * width
    if maps.kind == ORTHOGRAPHIC:
        return most, 2e-6
    if maps.kind == PARABOLOID:
        return 0.0, 2.0 * most + 2e-6
    return 0.0, most * math.sqrt(1.0 + maps.half[0] * maps.half[0] + maps.half[1] * maps.half[1]) + 2e-6


@kernel
def _plane_bias(maps: Projection, m: int, point: Any, facing: Any) -> Any:
    """Return the bias over a receiver's plane, m: a fraction of a texel that grows with the slope."""
    frame, origin = maps.frame, maps.origin
    dx, dy, dz = frame[m, 2, 0], frame[m, 2, 1], frame[m, 2, 2]
    width = 2.0 * max(maps.half[0] / maps.width, maps.half[1] / maps.height)
    if maps.kind != ORTHOGRAPHIC:
        dx, dy, dz = point[0] - origin[m, 0], point[1] - origin[m, 1], point[2] - origin[m, 2]
        distance = math.sqrt(dx * dx + dy * dy + dz * dz)
        dx, dy, dz = dx / distance, dy / distance, dz / distance
        width *= 2.0 * distance if maps.kind == PARABOLOID else distance
    cosine = abs(dx * facing[0] + dy * facing[1] + dz * facing[2])
    slope = math.sqrt(max(1.0 - cosine * cosine, 0.0)) / max(cosine, 1e-6)
    return PLANE_BIAS * width * (1.0 + min(slope, LARGEST_SLOPE))


def direct_irradiance(buffer: GBuffer, light: Light, visible: Array | None = None) -> Array:
    """Return the irradiance that a light gives directly: `lamp_irradiance` at a G-buffer's points.

    Parameters
    ----------
    buffer : GBuffer
        The receivers.
    light : Light
        The light.
    visible : (h, w) ndarray of bool, optional
        Where the light arrives; everywhere where absent.

    Returns
    -------
    (3, h, w) ndarray
        Irradiance, W/m^2, linear RGB. Excludes albedo/pi; zero where there is no surface.
    """
    position, normal, covered = buffer.resolve("position", "normal", "covered")
    return lamp_irradiance(position, normal, covered, light, visible)


@stage("rsm.direct_irradiance")
def irradiance_of_lamps(
    position: Array, normal: Array, covered: Array, visible: list[Array], lamps: list[Lamp]
) -> Array:
    """Sum the direct irradiance of all lamps: E = I(w) cos / d^2 (HSS Sec. 4; docs/radiometry).

    visible list of (h, w) bool: Where each lamp arrives.
    -> (3, h, w): Irradiance, W/m^2, linear RGB. Excludes albedo/pi; zero where there is no surface.
    """
    parts = [lamp_irradiance(position, normal, covered, light_of(lamp), reached)
             for lamp, reached in zip(lamps, visible, strict=True)]
    return parts[0] if len(parts) == 1 else np.asarray(sum(parts[1:], start=parts[0]))


@stage("rsm.lamp_irradiance")
def lamp_irradiance(
    position: Array, normal: Array, covered: Array, light: Light, visible: Array | None = None
) -> Array:
    """Compute the irradiance that a light gives directly: E = I(w) cos / d^2.

    visible (h, w) bool: Where the light arrives; everywhere where absent.
    -> (3, h, w): Irradiance, W/m^2, linear RGB. Excludes albedo/pi; zero where there is no surface.

    Notes
    -----
    Computed in float64 from the receivers as they are stored, and rounded once. What limits a narrow spot in float32
    is the rounding of positions: relative to the cone's radius, 6e-8 of the largest coordinate.
    """
    out = plane(position.shape, position.dtype)
    fill = _spot_irradiance if isinstance(light, SpotLight) else _irradiance
    fill(light_table((light,)), position, normal, covered, NO_SHADOW if visible is None else visible, out)
    return out


@kernel(parallel=True)
def _spot_irradiance(
    lights: LightTable, position: Array, normal: Array, covered: Array, visible: Array, out: Array
) -> None:
    width = covered.shape[1]
    for row in prange(covered.shape[0]):
        # a row of factors first: loops that write planes as well would be no SIMD lanes
        reached, doubtful, factor = np.empty(width, np.bool_), np.empty(width, np.bool_), np.empty(width)
        _reached(covered, visible, row, reached)
        receivers = SurfacePoints(position, normal, covered)
        _spot_factors(lights, receivers, row, out.itemsize == 4, reached, factor, doubtful)
        _scale(lights, row, factor, out)
        for x in range(width):
            if doubtful[x]:
                _irradiance_at(lights, receivers, row, x, out)


@kernel(parallel=True)
def _irradiance(
    lights: LightTable, position: Array, normal: Array, covered: Array, visible: Array, out: Array
) -> None:
    """Fill irradiance of a point or directional light."""
    width = covered.shape[1]
    for row in prange(covered.shape[0]):
        reached, factor = np.empty(width, np.bool_), np.empty(width)
        _reached(covered, visible, row, reached)
        if lights.kind[0] == POINT:
            _point_factors(lights, SurfacePoints(position, normal, covered), row, reached, factor)
        else:
            _directional_factors(lights, SurfacePoints(position, normal, covered), row, reached, factor)
        _scale(lights, row, factor, out)


@kernel
def _reached(covered: Array, visible: Array, row: int, reached: Array) -> None:
    for x in range(len(reached)):
        reached[x] = covered[row, x] if visible.size == 0 else covered[row, x] & visible[row, x]


@kernel
def _scale(lights: LightTable, row: int, factor: Array, out: Array) -> None:
    red, green, blue = lights.intensity[0, 0], lights.intensity[0, 1], lights.intensity[0, 2]
    for x in range(len(factor)):
        out[0, row, x], out[1, row, x], out[2, row, x] = red * factor[x], green * factor[x], blue * factor[x]


@kernel
def _spot_factors(
    lights: LightTable, receivers: SurfacePoints, row: int, in_float32: bool, reached: Array, factor: Array,
    doubtful: Array,
) -> None:
    """Fill factors of a spot's on-axis intensity, 1/m^2; at the edge of its cone float64 alone may be too little."""
    position, normal, _ = receivers
    px, py, pz = lights.position[0, 0], lights.position[0, 1], lights.position[0, 2]
    axis = lights.direction[0, 0], lights.direction[0, 1], lights.direction[0, 2]
    cone, plain = lights.cone[0], FOR_FLOAT32 if in_float32 else np.inf
    for x in range(len(factor)):
        dx, dy, dz = position[0, row, x] - px, position[1, row, x] - py, position[2, row, x] - pz
        square = dx * dx + dy * dy + dz * dz
        cosine = -(dx * normal[0, row, x] + dy * normal[1, row, x] + dz * normal[2, row, x])
        share, certain = falloff_in_float64((dx, dy, dz), axis, cone, plain)
        illuminated = reached[x] & (cosine > 0.0) & (square > 0.0)
        # E = I(w) cos / d^2, with a cosine times d
        factor[x] = share * cosine / (square * math.sqrt(square)) if illuminated else 0.0
        doubtful[x] = illuminated & (not certain)


@kernel
def _point_factors(
    lights: LightTable, receivers: SurfacePoints, row: int, reached: Array, factor: Array
) -> None:
    """Fill factors of a point light's intensity, 1/m^2."""
    position, normal, _ = receivers
    px, py, pz = lights.position[0, 0], lights.position[0, 1], lights.position[0, 2]
    for x in range(len(factor)):
        dx, dy, dz = position[0, row, x] - px, position[1, row, x] - py, position[2, row, x] - pz
        square = dx * dx + dy * dy + dz * dz
        cosine = -(dx * normal[0, row, x] + dy * normal[1, row, x] + dz * normal[2, row, x])
        illuminated = reached[x] & (cosine > 0.0) & (square > 0.0)
        # E = I cos / d^2, with a cosine times d
        factor[x] = cosine / (square * math.sqrt(square)) if illuminated else 0.0


@kernel
def _directional_factors(
    lights: LightTable, receivers: SurfacePoints, row: int, reached: Array, factor: Array
) -> None:
    """Fill the cosines that light from one direction arrives at."""
    normal = receivers.normal
    wx, wy, wz = -lights.direction[0, 0], -lights.direction[0, 1], -lights.direction[0, 2]
    for x in range(len(factor)):
        cosine = wx * normal[0, row, x] + wy * normal[1, row, x] + wz * normal[2, row, x]
        factor[x] = cosine if reached[x] & (cosine > 0.0) else 0.0


@kernel
def _irradiance_at(lights: LightTable, receivers: SurfacePoints, row: int, column: int, out: Array) -> None:
    position, normal, _ = receivers
    x, y, z = position[0, row, column], position[1, row, column], position[2, row, column]
    wx, wy, wz, _, er, eg, eb = incident_light(lights, 0, x, y, z)
    cosine = wx * normal[0, row, column] + wy * normal[1, row, column] + wz * normal[2, row, column]
    cosine = max(cosine, 0.0)
    # E = I(w) cos / d^2
    out[0, row, column], out[1, row, column], out[2, row, column] = er * cosine, eg * cosine, eb * cosine
