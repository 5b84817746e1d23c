"""A sequence with temporal coherence (Soler et al. 2009, Sec. 3.3), put together from refgi.literal."""

import numpy as np

from refgi.literal.temporal import blend, clamp, entering, motion, reprojection


def filtered(frames, lights, settings):
    """Return F_i of frames with the light I_i as computed: F_i = a W(F_{i-1}) + (1 - a) I_i."""
    results, count = [lights[0]], np.ones(lights[0].shape[1:])
    for i in range(1, len(frames)):
        before = lights[i - 1] if settings.form == "printed" else results[-1]
        light, count = blended(frames[i], lights[i], frames[i - 1], before, count, settings)
        results.append(light)
    return results


def blended(frame, light, last, before, count, settings):
    """Blend the light of a frame with that of the frame before; return it and in how many frames points were found."""
    triangle_id, view = frame.gbuffer.triangle_id, last.gbuffer.projection
    position, normal, speed = moved_back(frame, last.scene.geometry)
    camera, (depth, last_normal) = (view.origin, view.frame, view.half), last.gbuffer.resolve("depth", "normal")
    earlier, weight, seen = reprojection(position, normal, triangle_id, *camera, depth, last_normal, before,
                                         settings.depth_tolerance, settings.normal_cosine, settings.fetch, count)
    share = None
    if settings.entering_speed is not None:
        earlier, share = entering(earlier, weight, position, triangle_id, *camera, depth, before,
                                  settings.entering_speed)
    if settings.clamp is not None:
        earlier = clamp(earlier, light, triangle_id, settings.clamp, settings.clamp_radius)
    counted = seen if settings.warm_up and settings.form == "recursive" else None
    result = blend(light, earlier, weight, settings.weight, settings.speed, counted, share, speed)[0]
    return np.where(triangle_id >= 0, result, light), np.where(weight > 0, seen + 1, 1)


def moved_back(frame, before):
    """Return where each pixel's surface point was, its normal there, and how far it moved in pixels of this camera."""
    buffer, geometry, view = frame.gbuffer, frame.scene.geometry, frame.gbuffer.projection
    position, normal = (plane.astype(float) for plane in buffer.resolve("position", "normal"))
    return motion(position, normal, buffer.triangle_id, geometry.faces, geometry.vertices, before.vertices,
                  view.origin, view.frame, view.half, geometry.vertex_normals, before.vertex_normals)
