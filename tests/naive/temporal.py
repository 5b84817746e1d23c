"""Slow literal twin of a sequence with temporal coherence (Soler et al. 2009, Sec. 3.3), pixel by pixel."""

import math

import numpy as np

from tests.naive.reprojection import place
from tests.naive.screen_space import fetched


def filtered(frames, lights, settings):
    """Return F_i of frames with the light I_i as computed: F_i = a W(F_{i-1}) + (1 - a) I_i."""
    results = [lights[0]]
    for i in range(1, len(frames)):
        before = lights[i - 1] if settings.form == "printed" else results[-1]
        results.append(blended(frames[i], lights[i], frames[i - 1], before, settings))
    return results


def blended(frame, light, last, before, settings):
    """Blend the light of a frame with that of the frame before; a falls with the speed of surfaces that moved."""
    position, normal, speed = moved_back(frame, last.scene.geometry)
    found, weight = fetched(before, last, position, normal, frame.gbuffer.covered, settings.depth_tolerance,
                            settings.normal_cosine, settings.fetch)
    a = np.where(weight > 0, settings.weight * np.exp(-speed / settings.speed), 0.0)
    return a * found + (1 - a) * light


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
