"""Coarse light transport for camera placement: senders of equal flux, receivers of the picture, and irradiance.

T_ij (W/m^2) is the irradiance of receiver i from sender j, Phi_j / pi cos_i cos_j / r^2 where nothing lies between;
Phi_j (W) is the flux that the surface around the sender reflects.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.frame import Frame
from refgi.lights import choose_pixel_lights
from refgi.rays import STEPS, Tracer
from refgi.rsm import reflective_shadow_map

Array = npt.NDArray[Any]

LIT_POINTS, RECEIVERS = 256, 256  # by trial: at equal cost more candidates bring more light than more points
MAP_RESOLUTION = 64  # texels along a side of the maps that senders are drawn from


class Points(NamedTuple):
    """Places on surfaces."""

    position: Array  # (n, 3) float64, m
    normal: Array  # (n, 3) float64 unit vectors on the lit or the visible side


def equal_flux_points(frame: Frame, count: int = LIT_POINTS) -> tuple[Points, float]:
    """Return points of equal reflected flux on directly lit surfaces, and the flux of each.

    Points are denser where more is reflected; none where no light falls. The flux is the sum of the three channels, W.
    """
    maps = [reflective_shadow_map(frame.scene.geometry, frame.materials, light, MAP_RESOLUTION, frame.dtype)
            for light in frame.scene.lights]  # fmt: skip
    lights = choose_pixel_lights(maps, count=None, pattern="all")
    cumulative = np.cumsum(lights.flux.sum(axis=0, dtype=np.float64))
    total = float(cumulative[-1]) if cumulative.size else 0.0
    if not total > 0:
        return Points(np.zeros((0, 3)), np.zeros((0, 3))), 0.0
    chosen = np.searchsorted(cumulative, (np.arange(count) + 0.5) / count * total)
    return Points(*(plane.T[chosen].astype(np.float64) for plane in (lights.position, lights.normal))), total / count


def visible_points(frame: Frame, count: int = RECEIVERS) -> Points:
    """Return surface points evenly spread over the picture, of about `count` pixels, without background."""
    height, width = frame.height, frame.width
    rows = min(height, max(1, round(math.sqrt(count * height / width))))
    columns = min(width, max(1, round(count / rows)))
    row, column = (((np.arange(n) + 0.5) * size / n).astype(np.int64) for n, size in ((rows, height), (columns, width)))
    position, normal, covered = frame.gbuffer.at((row[:, None] * width + column).ravel(), "position", "normal",
                                                 "covered")  # fmt: skip
    return Points(position.T[covered].astype(np.float64), normal.T[covered].astype(np.float64))


def transport(tracer: Tracer, receivers: Points, senders: Points, flux: float, nearest: float) -> Array:
    """Return the irradiance of each receiver from each sender, T_ij, (receivers, senders) float64, W/m^2.

    `flux` is what each sender reflects, W; `nearest` the least distance in the denominator, m.
    """
    direction = senders.position - receivers.position[:, None]
    square = (direction * direction).sum(axis=2)
    cosines = np.maximum((direction * receivers.normal[:, None]).sum(axis=2), 0)
    cosines = cosines * np.maximum(-(direction * senders.normal).sum(axis=2), 0)
    below = square * np.maximum(square, nearest**2)
    transported = np.divide(cosines, below, out=np.zeros_like(square), where=square > 0)
    i, j = np.nonzero(transported)
    transported[i, j] *= unoccluded(tracer, _off_surface(tracer, receivers, i),
                                    _off_surface(tracer, senders, j, direction[i, j]))
    return np.asarray(flux / math.pi * transported)


class Views(NamedTuple):
    """Pictures of one size and field of view."""

    eye: Array  # (c, 3) m
    axes: Array  # (c, 3, 3) right, down, forward
    half: Array  # (2,) tangents of half the field of view, horizontal and vertical
    pixel: float  # width of a pixel at a depth of 1 m, m


def sampling_quality(tracer: Tracer, views: Views, points: Points, coarsest: float) -> Array:
    """Return how finely each picture samples each surface point, (c, n) float64.

    0 where a point is outside the picture, faces away or is occluded; else 1 / (1 + (length / coarsest)^2) with the
    length of a pixel on the surface there (m), which grows with distance and towards grazing views.
    """
    direction = points.position - views.eye[:, None]
    right, down, depth = np.moveaxis(np.einsum("cad,cnd->can", views.axes, direction), 1, 0)
    inside = (depth > 0) & (np.abs(right) <= views.half[0] * depth) & (np.abs(down) <= views.half[1] * depth)
    facing = np.maximum(-(direction * points.normal).sum(axis=2), 0)
    c, n = np.nonzero(inside & (facing > 0))
    facing, depth = facing[c, n] / np.linalg.norm(direction[c, n], axis=1), depth[c, n]
    quality = np.zeros(inside.shape)
    quality[c, n] = 1 / (1 + (views.pixel * depth / (coarsest * facing)) ** 2)
    quality[c, n] *= unoccluded(tracer, views.eye[c], _off_surface(tracer, points, n, direction[c, n]))
    return quality


def _off_surface(tracer: Tracer, points: Points, chosen: Array, direction: Array | None = None) -> Array:
    """Return places off the surfaces of points, for rays that start there, or end there along a direction."""
    position = points.position[chosen]
    offset = tracer.offsets(position) + (0 if direction is None else STEPS * np.abs(direction).sum(axis=1))
    return np.asarray(position + offset[:, None] * points.normal[chosen])


def unoccluded(tracer: Tracer, starts: Array, ends: Array) -> Array:
    """Return between which pairs of places (n, 3), off any surface, m, nothing lies: (n,) bool.

    By the bare traversal: one ray in 10^7 slips between triangles.
    """
    blocked = np.zeros(len(starts), np.bool_)
    tracer.fill_occluded(np.ascontiguousarray(starts, np.float32), np.ascontiguousarray(ends - starts, np.float32),
                         np.ones(len(starts), np.float32), blocked)
    return ~blocked
