"""Slow literal twin of a sequence with temporal coherence (Soler et al. 2009, Sec. 3.3), pixel by pixel."""

import math

import numpy as np

from tests.naive.reprojection import place
from tests.naive.screen_space import fetched


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
    covered = frame.gbuffer.covered
    position, normal, speed = moved_back(frame, last.scene.geometry)
    where = position, normal, covered, settings.depth_tolerance, settings.normal_cosine, settings.fetch
    found, weight = fetched(before, last, *where)
    seen = fetched(np.stack([count] * 3), last, *where)[0][0]
    result = light.copy()
    for pixel in np.argwhere(covered):
        at = tuple(pixel)
        a, earlier = settings.weight, found[:, *at]
        if weight[at] == 0:
            entered = at_edge(last, before, position[:, *at], at)
            if entered is None or settings.entering_speed is None:
                continue
            earlier, moved = entered
            a *= math.exp(-moved / settings.entering_speed)
        elif settings.warm_up and settings.form == "recursive":
            a = min(a, seen[at] / (seen[at] + 1))
        if settings.clamp is not None:
            earlier = clamped(earlier, light, covered, at, settings.clamp, settings.clamp_radius)
        a *= math.exp(-speed[at] / settings.speed)
        result[:, *at] = a * earlier + (1 - a) * light[:, *at]
    return result, np.where(weight > 0, seen + 1, 1)


def at_edge(last, before, point, pixel):
    """Return the light at the edge next to a point outside the earlier picture, and how far it moved, in pixels."""
    view, (height, width) = last.gbuffer.projection, last.gbuffer.covered.shape
    seen = place(point, view.origin[0], *view.frame[0], view.half[1], height, width)
    if seen is None or (-0.5 <= seen[0] <= width - 0.5 and -0.5 <= seen[1] <= height - 0.5):
        return None
    i, j = (round(min(max(c, 0), most - 1)) for c, most in ((seen[1], height), (seen[0], width)))
    if not last.gbuffer.covered[i, j]:
        return None
    return before[:, i, j], math.hypot(seen[0] - pixel[1], seen[1] - pixel[0])


def clamped(earlier, light, covered, pixel, deviations, radius):
    """Bound light by mean and standard deviation of the new light in a square of pixels with a surface."""
    square = tuple(slice(max(0, c - radius), c + radius + 1) for c in pixel)
    around = light[:, *square][:, covered[square]]
    middle, spread = around.mean(axis=1), deviations * around.std(axis=1)
    return np.clip(earlier, middle - spread, middle + spread)


def moved_back(frame, before):
    """Return where each pixel's surface point was, its normal there, and how far it moved in pixels of this camera."""
    buffer, geometry = frame.gbuffer, frame.scene.geometry
    position, normal = (plane.astype(float) for plane in buffer.resolve("position", "normal"))
    speed = np.zeros(buffer.covered.shape)
    for pixel in np.argwhere(buffer.covered):
        at = tuple(pixel)
        corners = geometry.faces[buffer.triangle_id[at]]
        now, then = geometry.vertices[corners], before.vertices[corners]
        weights = barycentric(now, position[:, *at])
        back = position[:, *at] + weights @ (then - now)
        speed[at] = pixels_between(buffer.projection, position[:, *at], back)
        if geometry.vertex_normals is not None:
            turned_now, turned_then = (weights @ g.vertex_normals[corners] for g in (geometry, before))
        else:
            turned_now, turned_then = (np.cross(t[1] - t[0], t[2] - t[0]) for t in (now, then))
        side = math.copysign(1.0, turned_now @ normal[:, *at])
        position[:, *at], normal[:, *at] = back, side * turned_then / np.linalg.norm(turned_then)
    return position, normal, speed


def barycentric(corners, point):
    """Return the weights of a triangle's corners at a point of its plane."""
    (b, c), *_ = np.linalg.lstsq((corners[1:] - corners[0]).T, point - corners[0], rcond=None)
    return np.array([1 - b - c, b, c])


def pixels_between(view, one, other):
    """Return how far apart a picture shows two points."""
    axes = (view.origin[0], *view.frame[0], view.half[1], view.height, view.width)
    (x, y, _), (u, v, _) = place(one, *axes), place(other, *axes)
    return math.hypot(x - u, y - v)
