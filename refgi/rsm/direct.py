"""Direct light: irradiance of one light at the receivers, and its shadows from the map's depth."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.radiometry import incident_light
from refgi.rsm.gbuffer import GBuffer
from refgi.rsm.projection import ORTHOGRAPHIC, PARABOLOID, Projection, texel_of
from refgi.rsm.reflective import Rsm
from refgi.scene.model import Light, LightTable, light_table
from refgi.stages import stage

Array = npt.NDArray[Any]

MARGIN = 0.1  # texels, also per unit of slope: how far above a receiver's plane its own surface may be stored
STEEPEST = 10.0  # largest slope, depth per sideways distance, that the margin follows
NO_SHADOW = np.zeros((0, 0), np.bool_)


class Stored(NamedTuple):
    """What a light's map tells about its nearest surface."""

    depth: Array  # (H, W) m
    position: Array  # (3, H, W) m
    bias: float  # m; negative: compare with the receiver's plane


@stage("rsm.shadow_map_visibility")
def shadow_map_visibility(
    position: Array, normal: Array, covered: Array, rsm: Rsm, bias: float | None = None
) -> Array:
    """Tell which receivers a light reaches, by the depth in its map.

    Parameters
    ----------
    position, normal : (3, h, w) ndarray
        Receivers, world space.
    covered : (h, w) ndarray of bool
        Where there is a receiver.
    rsm : Rsm
        The light's map.
    bias : float, optional
        A receiver counts as lit up to this far behind the stored depth, m: the published test. By default it is in
        shadow where the stored point lies above the receiver's own plane by more than a fraction of a texel.

    Returns
    -------
    (h, w) ndarray of bool
        True where lit; false outside the map, which encloses all that the light reaches.

    Raises
    ------
    InputError
        If the bias is not finite and at least 0.

    Notes
    -----
    One look-up, of the nearest texel: shadow edges are as coarse as the map. What blocks the light lies between it and
    the receiver, hence above the receiver's plane; a neighbouring point of the same surface does not, at any slope.
    """
    expect(bias is None or (math.isfinite(bias) and bias >= 0), "bias", "a finite number >= 0, m", bias)
    visible = np.zeros(covered.shape, np.bool_)
    stored = Stored(rsm.depth, rsm.position, -1.0 if bias is None else bias)
    _look_up(rsm.projection, position, normal, covered, stored, visible)
    return visible


@kernel(parallel=True)
def _look_up(
    maps: Projection, position: Array, normal: Array, covered: Array, stored: Stored, visible: Array
) -> None:
    for row in prange(covered.shape[0]):
        _look_up_row(maps, position, normal, covered, stored, row, visible)


@kernel
def _look_up_row(
    maps: Projection, position: Array, normal: Array, covered: Array, stored: Stored, row: int, visible: Array
) -> None:
    # a function of its own: what it is passed is counted once a row, not once a pixel by both threads
    for column in range(covered.shape[1]):
        if covered[row, column]:
            point = position[0, row, column], position[1, row, column], position[2, row, column]
            facing = normal[0, row, column], normal[1, row, column], normal[2, row, column]
            visible[row, column] = _reached(maps, stored, point, facing)


@kernel
def _reached(maps: Projection, stored: Stored, point: Any, facing: Any) -> Any:
    """Tell whether one receiver is lit."""
    row, column, far = texel_of(maps, point[0], point[1], point[2])
    if far != far:  # outside the map
        return False
    i, j = min(int(row), stored.depth.shape[0] - 1), min(int(column), stored.depth.shape[1] - 1)
    if stored.bias >= 0.0:
        return far <= stored.depth[i, j] + stored.bias
    if far <= stored.depth[i, j]:
        return True
    above = 0.0
    for axis in range(3):
        above += facing[axis] * (stored.position[axis, i, j] - point[axis])
    if above <= 1e-6 * far:  # most of what is lit: the margin is dear
        return True
    return above <= _margin(maps, i // maps.height, point, facing) + 1e-6 * far


@kernel
def _margin(maps: Projection, m: int, point: Any, facing: Any) -> Any:
    """Return the margin over a receiver's plane, m: a fraction of a texel that grows with the slope."""
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
    return MARGIN * width * (1.0 + min(slope, STEEPEST))


@stage("rsm.direct_irradiance")
def direct_irradiance(buffer: GBuffer, light: Light, visible: Array | None = None) -> Array:
    """Sum the irradiance that a light gives directly: E = I(w) cos / d^2.

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
    out = np.zeros_like(position)
    table = light_table((light,), buffer.dtype)
    _irradiance(table, position, normal, covered, NO_SHADOW if visible is None else visible, out)
    return out


@kernel(parallel=True)
def _irradiance(
    lights: LightTable, position: Array, normal: Array, covered: Array, visible: Array, out: Array
) -> None:
    real = position.dtype.type
    for row in prange(covered.shape[0]):
        for column in range(covered.shape[1]):
            if covered[row, column] and (visible.size == 0 or visible[row, column]):
                x, y, z = position[0, row, column], position[1, row, column], position[2, row, column]
                wx, wy, wz, _, er, eg, eb = incident_light(lights, 0, x, y, z)
                cosine = wx * normal[0, row, column] + wy * normal[1, row, column] + wz * normal[2, row, column]
                cosine = max(cosine, real(0.0))
                out[0, row, column], out[1, row, column], out[2, row, column] = er * cosine, eg * cosine, eb * cosine
