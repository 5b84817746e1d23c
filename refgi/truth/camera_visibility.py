"""Visibility of emitters to the camera: inside its picture, on the side that faces the eye, with nothing between.

A screen-space method knows no other emitters. With only these the truth is what such a method can reach at best; with
no visibility between emitter and receiver besides, its limit.
"""


import numpy as np

from refgi.jit import kernel, prange
from refgi.rays import MISS, Tracer, ray_offset
from refgi.rsm.raster.projection import Projection, texel_of
from refgi.truth.light_vertices import LightVertices
from refgi.truth.paths import CHUNK, Paths, Shadows, dot, hit_point
from refgi.truth.surfaces import Surfaces, face_normal, lift
from refgi.truth.task import Task, shadow_batch
from refgi.types import Array


@kernel
def aim_at_eye(view: Projection, offset: float, y: tuple[float, float, float], g: tuple[float, float, float],
               rays: tuple[Array, Array, Array], ray: int) -> None:
    """Write the ray from a point to the eye.

    `offset`: how far along g the ray starts, m. `y`: the point, m. `g`: unit face normal on the side that emits.
    `rays`: origins and directions (n, 3) and reach (n,), float32: filled at `ray`; the reach is 1, or 0 where the point
    lies outside the picture or that side faces away.
    """
    origins, directions, reach = rays
    eye = (view.origin[0, 0], view.origin[0, 1], view.origin[0, 2])
    toward = (eye[0] - y[0], eye[1] - y[1], eye[2] - y[2])
    row, _, _ = texel_of(view, y[0], y[1], y[2])
    for c in range(3):
        origins[ray, c] = y[c] + offset * g[c]
        directions[ray, c] = toward[c] - offset * g[c]
    reach[ray] = 1 if dot(toward, g) > 0 and not np.isnan(row) else 0


def visible_vertices(tracer: Tracer, view: Projection, points: LightVertices) -> LightVertices:
    """Return the light vertices that are visible to a camera.

    Result: the visible ones, in their order.
    """
    count = len(points.power)
    origins, directions = np.empty((count, 3), np.float32), np.empty((count, 3), np.float32)
    reach, blocked = np.empty(count, np.float32), np.empty(count, np.bool_)
    _aim_points(view, tracer.grain, points.position, points.facing, (origins, directions, reach))
    tracer.fill_occluded(origins, directions, reach, blocked)
    return LightVertices(*(part[..., ~blocked] for part in points))


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

    `grain`: the tracer's: how far rays start above faces, m. `rays`: origins, directions and reach are filled; the
    reach is 0 where nothing was hit or it cannot be visible.
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
            _, y = hit_point(paths, ray)
            g = face_normal(surfaces, paths.triangle_id[ray], y[0] - view.origin[0, 0], y[1] - view.origin[0, 1],
                            y[2] - view.origin[0, 2])  # on the eye's side; `leaves` asks whether that is the light's
            aim_at_eye(view, lift(surfaces, paths.triangle_id[ray], y, g, grain), y, g, written, ray)


def hidden_from_camera(task: Task, paths: Paths) -> Array | None:
    """Return which paths end at points that the camera does not see; None where that does not matter."""
    if task.view is None:
        return None
    rays = shadow_batch(len(paths.reach))
    aim_paths(task.view, task.surfaces, task.tracer.grain, paths, rays)
    task.tracer.fill_occluded(rays.origin, rays.direction, rays.reach, rays.blocked)
    return rays.blocked
