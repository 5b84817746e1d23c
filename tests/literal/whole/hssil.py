"""`HssilSettings` as arguments of refgi.literal.hssil: each frame's depths, normals, albedo and direct light in.

What the literal text has no word for: random numbers and slices past a bitmask (tests/naive), rays, printed factors.
"""

import math

import numpy as np

from refgi.frame import Frame
from refgi.literal import hssil as literal
from refgi.literal.hssil_crown import samples_at
from refgi.literal.temporal import reproject
from refgi.literal.upsampling import blur
from refgi.sssil.settings import Bitmask, Rays
from tests.naive import bitmask, crown_points
from tests.naive.crossings import LIFT, corners_of, face_normals, free
from tests.naive.draws import mix32


def picture(frame, settings):
    """Return the irradiance, (3, h, w): the maximum of this camera's light and of what further cameras found."""
    light = one_view(frame, settings)
    cameras = settings.cameras
    for camera in cameras.views:
        other = Frame(frame.scene.with_camera(eye=camera.eye, target=camera.target, up=camera.up, vfov=camera.vfov),
                      width=frame.width, height=frame.height, dtype=frame.dtype, shadows=frame.shadows,
                      rsm_resolution=frame.rsm_resolution)
        position, normal = frame.gbuffer.resolve("position", "normal")
        view, (depth, other_normal) = other.gbuffer.projection, other.gbuffer.resolve("depth", "normal")
        found, _ = reproject(one_view(other, settings), position, normal, frame.gbuffer.covered, view.origin,
                             view.frame, view.half, depth, other_normal, cameras.depth_tolerance,
                             cameras.normal_cosine, "bilinear")
        light = np.maximum(light, found)
    return light


def one_view(frame, settings):
    """Return the irradiance by what one camera sees: `literal.hssil`, with printed factors between its stages."""
    sampling, kind, how, printed = settings.sampling, settings.visibility, settings.senders, settings.as_published
    view, smooth, weights = frame.gbuffer.projection, settings.blur, settings.upsampling
    seen, first = frame.gbuffer.resolve("depth", "normal", "albedo"), sampling.first_level
    shapes = [tuple(-(-size >> first + k) for size in seen[0].shape) for k in range(sampling.levels)]
    # Sec. 3.2: the smallest r with which the crowns cover the picture, its diagonal over 2^K
    radius = max(1.0, math.hypot(*shapes[0]) / 2**sampling.levels) if sampling.radius is None else sampling.radius
    shares = [random_shares(sampling.seed, first + k, shape) for k, shape in enumerate(shapes)]
    levels, senders = literal.pyramid(*seen, frame.direct, view.frame, view.half, sampling.levels, first,
                                      how.downsample, shares)
    if "hss_tan_f" in printed:  # tan f = 2 t / (1 - t^2) for t = tan(f / 2)
        wide = 4 / np.prod(1 - view.half**2)
        levels, senders = ([(*one[:4], wide * one[4], one[5]) for one in some] for some in (levels, senders))
    own = []
    for k, (level, sender) in enumerate(zip(levels, senders, strict=True)):
        if how.only_level not in (None, k):
            own.append(np.zeros_like(level[0]))
            continue
        if isinstance(kind, Bitmask):
            light = masked(frame, settings, level, sender, radius, k)
        else:
            samples = crown_points.samples(sampling, radius, k, first + k, shapes[k])
            visible = sight(frame, level, sender, samples) if isinstance(kind, Rays) else None
            light = literal.crown_light(level, sender, samples, how.form_factor, how.disc_share, visible)
        # receivers that all have the same samples have nothing to gain from each other's
        if smooth is not None and sampling.pattern not in ("fixed", "all"):
            light = blur(light, level[0], level[2], level[1], smooth.size, smooth.plane_tolerance, smooth.cosine)
        less = math.pi if "hss_disc_pi" in printed and how.form_factor != "point" else 1.0
        own.append(light * (4.0**k if "hss_level_factor" in printed else 1.0) / less)
    likeness = (weights.depth_sigma, weights.normal_power) if weights.name() == "bilateral" else (0.0, 0.0)
    return literal.level_sum(own, levels, *seen[:2], first, weights.name(), *likeness, how.downsample != "average")


def random_shares(seed, number, shape):
    """Return the random number of each texel of a level that picks the place it sends from."""
    level = crown_points.level_key(seed, number)
    return np.array([[mix32(crown_points.pixel_key(crown_points.row_key(level, row), column) ^ 0x165667B1) / 2**32
                      for column in range(shape[1])] for row in range(shape[0])])


def masked(frame, settings, level, sender, radius, k):
    """Return the light of a level past the bitmask, whose surfaces are a share of what the camera sees thick."""
    sampling, kind, how = settings.sampling, settings.visibility, settings.senders
    extent = np.ptp(frame.gbuffer.position[:, frame.gbuffer.covered], axis=1)
    here, there = ({"position": one[0], "normal": one[2], "radiance": one[3], "area": one[4]}
                   for one in (level, sender))
    return bitmask.masked_light(
        here, lambda *at: crown_points.slices(sampling, kind, radius, k, sampling.first_level + k, *at),
        kind.thickness * float(np.linalg.norm(extent)), how.form_factor, there, how.disc_share)


def sight(frame, level, sender, samples):
    """Return V of receivers and samples: rays between the pixels whose surfaces they hold, off their triangles."""
    buffer, corners = frame.gbuffer, corners_of(frame.scene.geometry)
    i, j, texels = samples_at(level[1].shape, *samples)
    asked = (texels > 0) & (level[5][..., None] >= 0) & sender[3][:, i, j].any(axis=0)
    pixels = np.broadcast_to(level[5][..., None], asked.shape)[asked], sender[5][i, j][asked]
    triangles, normals, points = (array.reshape(*array.shape[:-2], -1) for array in (
        buffer.triangle_id, buffer.normal, buffer.position))
    up, other_up = (face_normals(frame.scene.geometry, triangles[one], normals[:, one].T) for one in pixels)
    toward = (sender[0][:, i, j] - level[0][..., None])[:, asked].T
    visible = np.zeros(asked.shape)
    faces = ((up * toward).sum(axis=1) > 0) & ((other_up * toward).sum(axis=1) < 0)
    start, end = (points[:, one].T + LIFT * normal for one, normal in zip(pixels, (up, other_up), strict=True))
    visible[asked] = faces & free(corners, start, end)
    return visible
