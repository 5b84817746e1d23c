"""Coarse transport for the choice of cameras: lit points, receivers of the picture, and what passes between them.

T_ij (W/m^2) is the irradiance that receiver i has from lit point j, Phi_j / pi cos_i cos_j / r^2 where nothing lies
between; Phi_j (W) is the flux that the surface around the point reflects.
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
MAP_RESOLUTION = 64  # texels along a side of the maps that lit points are drawn from


class Points(NamedTuple):
    """Places on surfaces."""

    position: Array  # (n, 3) float64, m
    normal: Array  # (n, 3) float64 unit vectors on the side that is lit or seen


def lit_points(frame: Frame, count: int = LIT_POINTS) -> tuple[Points, float]:
    """Return points on lit surfaces, of equal reflected flux.

    Parameters
    ----------
    frame : Frame
        The scene and its lights.
    count : int
        How many points.

    Returns
    -------
    points : Points
        The points, denser where more is reflected; none where nothing is lit.
    flux : float
        What each stands for, sum of the three channels, W.
    """
    maps = [reflective_shadow_map(frame.scene.geometry, frame.materials, light, MAP_RESOLUTION, frame.dtype)
            for light in frame.scene.lights]  # fmt: skip
    lights = choose_pixel_lights(maps, count=None, pattern="all")
    upto = np.cumsum(lights.flux.sum(axis=0, dtype=np.float64))
    if not upto.size or not upto[-1] > 0:
        return Points(np.zeros((0, 3)), np.zeros((0, 3))), 0.0
    chosen = np.searchsorted(upto, (np.arange(count) + 0.5) / count * upto[-1])
    return Points(*(plane.T[chosen].astype(np.float64) for plane in (lights.position, lights.normal))), upto[-1] / count


def seen_points(frame: Frame, count: int = RECEIVERS) -> Points:
    """Return surface points evenly spread over the picture.

    Parameters
    ----------
    frame : Frame
        Whose picture.
    count : int
        About how many pixels are looked through.

    Returns
    -------
    Points
        What they see, background left out.
    """
    height, width = frame.height, frame.width
    rows = min(height, max(1, round(math.sqrt(count * height / width))))
    columns = min(width, max(1, round(count / rows)))
    row, column = (((np.arange(n) + 0.5) * size / n).astype(np.int64) for n, size in ((rows, height), (columns, width)))
    position, normal, covered = frame.gbuffer.at((row[:, None] * width + column).ravel(), "position", "normal",
                                                 "covered")  # fmt: skip
    return Points(position.T[covered].astype(np.float64), normal.T[covered].astype(np.float64))


def transport(tracer: Tracer, to: Points, lit: Points, flux: float, nearest: float) -> Array:
    """Return what each receiver gets from each lit point.

    Parameters
    ----------
    tracer : Tracer
        What may lie between.
    to : Points
        Receivers.
    lit : Points
        Lit points.
    flux : float
        What each reflects, W.
    nearest : float
        Least distance that counts, m.

    Returns
    -------
    (receivers, lit points) ndarray of float64
        Irradiance, W/m^2.
    """
    way = lit.position - to.position[:, None]
    square = (way * way).sum(axis=2)
    cosines = np.maximum((way * to.normal[:, None]).sum(axis=2), 0) * np.maximum(-(way * lit.normal).sum(axis=2), 0)
    passed = np.divide(cosines, square * np.maximum(square, nearest**2), out=np.zeros_like(square), where=square > 0)
    i, j = np.nonzero(passed)
    passed[i, j] *= free(tracer, _lifted(tracer, to, i), _lifted(tracer, lit, j, way[i, j]))
    return np.asarray(flux / math.pi * passed)


class Views(NamedTuple):
    """Pictures of one size and field of view."""

    eye: Array  # (c, 3) m
    axes: Array  # (c, 3, 3) right, down, forward
    half: Array  # (2,) tangents of half the field of view, horizontal and vertical
    pixel: float  # width of a pixel at a depth of 1 m, m


def sight(tracer: Tracer, views: Views, points: Points, coarsest: float) -> Array:
    """Return how well each picture shows each point.

    Parameters
    ----------
    tracer : Tracer
        What may lie between.
    views : Views
        The pictures.
    points : Points
        The points.
    coarsest : float
        Length of a pixel on a surface that makes it half as good, m.

    Returns
    -------
    (c, n) ndarray of float64
        0 where a point is outside, faces away or is hidden; else 1 / (1 + (length / coarsest)^2) with the length of a
        pixel on the surface there, which grows with distance and towards grazing views.
    """
    way = points.position - views.eye[:, None]
    right, down, depth = np.moveaxis(np.einsum("cad,cnd->can", views.axes, way), 1, 0)
    inside = (depth > 0) & (np.abs(right) <= views.half[0] * depth) & (np.abs(down) <= views.half[1] * depth)
    facing = np.maximum(-(way * points.normal).sum(axis=2), 0)
    c, n = np.nonzero(inside & (facing > 0))
    facing, depth = facing[c, n] / np.linalg.norm(way[c, n], axis=1), depth[c, n]
    good = np.zeros(inside.shape)
    good[c, n] = 1 / (1 + (views.pixel * depth / (coarsest * facing)) ** 2)
    good[c, n] *= free(tracer, views.eye[c], _lifted(tracer, points, n, way[c, n]))
    return good


def _lifted(tracer: Tracer, points: Points, chosen: Array, way: Array | None = None) -> Array:
    """Return places off the surfaces of points, for rays that start there, or end there after a way."""
    position = points.position[chosen]
    offset = tracer.offsets(position) + (0 if way is None else STEPS * np.abs(way).sum(axis=1))
    return np.asarray(position + offset[:, None] * points.normal[chosen])


def free(tracer: Tracer, starts: Array, ends: Array) -> Array:
    """Tell between which pairs of places nothing lies.

    Parameters
    ----------
    tracer : Tracer
        What may lie between.
    starts, ends : (n, 3) ndarray
        The places, off any surface, m.

    Returns
    -------
    (n,) ndarray of bool
        True where nothing blocks, as the bare traversal has it: one ray in 10^7 slips between triangles.
    """
    blocked = np.zeros(len(starts), np.bool_)
    tracer.fill_occluded(np.ascontiguousarray(starts, np.float32), np.ascontiguousarray(ends - starts, np.float32),
                         np.ones(len(starts), np.float32), blocked)
    return ~blocked
