"""Which emitters a camera sees: those inside its picture, on the side that faces the eye, with nothing between.

A method that gathers light from a picture knows no others. With only these as emitters the truth is what such a method
can reach at best; with no visibility between emitter and receiver besides, what it converges to.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.rays import MISS, Tracer, ray_offset
from refgi.rsm.raster.projection import Projection, texel_of
from refgi.truth.lit_points import LitPoints
from refgi.truth.paths import CHUNK, Paths, Shadows, dot, found
from refgi.truth.surfaces import Surfaces, face_normal, lift

Array = npt.NDArray[Any]


@kernel
def aim_at_eye(view: Projection, offset: float, y: tuple[float, float, float], g: tuple[float, float, float],
               rays: tuple[Array, Array, Array], ray: int) -> None:
    """Write the ray from a point to the eye.

    Parameters
    ----------
    view : Projection
        The camera's map.
    offset : float
        How far along g the ray starts, m.
    y : tuple of 3 floats
        The point, m.
    g : tuple of 3 floats
        Unit face normal on the side that emits.
    rays : tuple of 3 arrays
        Origins and directions (n, 3) and reach (n,), float32: filled at `ray`; the reach is 1, or 0 where the point
        lies outside the picture or that side faces away.
    ray : int
        Which ray.
    """
    origins, directions, reach = rays
    eye = (view.origin[0, 0], view.origin[0, 1], view.origin[0, 2])
    toward = (eye[0] - y[0], eye[1] - y[1], eye[2] - y[2])
    row, _, _ = texel_of(view, y[0], y[1], y[2])
    for c in range(3):
        origins[ray, c] = y[c] + offset * g[c]
        directions[ray, c] = toward[c] - offset * g[c]
    reach[ray] = 1 if dot(toward, g) > 0 and not np.isnan(row) else 0


def seen_points(tracer: Tracer, view: Projection, points: LitPoints) -> LitPoints:
    """Keep the lit points that a camera sees.

    Parameters
    ----------
    tracer : Tracer
        The scene's rays.
    view : Projection
        The camera's map.
    points : LitPoints
        Lit points.

    Returns
    -------
    LitPoints
        Those that are seen, in their order.
    """
    count = len(points.power)
    origins, directions = np.empty((count, 3), np.float32), np.empty((count, 3), np.float32)
    reach, blocked = np.empty(count, np.float32), np.empty(count, np.bool_)
    _aim_points(view, tracer.grain, points.position, points.facing, (origins, directions, reach))
    tracer.fill_occluded(origins, directions, reach, blocked)
    return LitPoints(*(part[..., ~blocked] for part in points))


@kernel
def _aim_points(view: Projection, grain: float, position: Array, facing: Array,
                rays: tuple[Array, Array, Array]) -> None:
    for i in range(position.shape[1]):
        y = (np.float64(position[0, i]), np.float64(position[1, i]), np.float64(position[2, i]))
        g = (np.float64(facing[0, i]), np.float64(facing[1, i]), np.float64(facing[2, i]))
        aim_at_eye(view, ray_offset(y[0], y[1], y[2], grain), y, g, rays, i)


@kernel(parallel=True)
def aim_paths(view: Projection, surfaces: Surfaces, grain: float, paths: Paths, rays: Shadows) -> None:
    """Write a ray to the eye from each surface that paths found.

    Parameters
    ----------
    view : Projection
        The camera's map.
    surfaces : Surfaces
        The scene.
    grain : float
        The tracer's: how far rays start above faces, m.
    paths : Paths
        What was found.
    rays : Shadows
        Origins, directions and reach are filled; the reach is 0 where nothing was found or it cannot be seen.
    """
    count = len(paths.reach)
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        _aim_paths(view, surfaces, grain, paths, rays, (chunk * CHUNK, min(count, chunk * CHUNK + CHUNK)))


@kernel
def _aim_paths(view: Projection, surfaces: Surfaces, grain: float, paths: Paths, rays: Shadows,
               span: tuple[int, int]) -> None:
    written = (rays.origin, rays.direction, rays.reach)
    for ray in range(span[0], span[1]):
        rays.reach[ray] = 0
        if paths.triangle_id[ray] != MISS:
            w, y = found(paths, ray)
            g = face_normal(surfaces, paths.triangle_id[ray], -w[0], -w[1], -w[2])  # where light leaves to the path
            aim_at_eye(view, lift(surfaces, paths.triangle_id[ray], y, g, grain), y, g, written, ray)
