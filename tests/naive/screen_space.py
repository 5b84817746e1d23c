"""The picture of hierarchical screen-space illumination for every setting, put together from refgi.literal.

Of each frame it takes depths, normals, albedo and direct light; all else is made here, in `bitmask` and `crown_points`.
"""

import math

import numpy as np

from refgi.frame import Frame
from refgi.literal import hssil_crown, hssil_levels
from refgi.literal.temporal import reproject
from refgi.literal.upsampling import bilinear, blur, upsample
from refgi.sssil.settings import Bitmask, Rays
from tests.naive import bitmask, crown_points
from tests.naive.crossings import LIFT, corners_of, face_normals, free
from tests.naive.draws import mix32

PLANES = ("position", "depth", "normal", "radiance", "area", "pixel")


def picture(frame, settings, placed=()):
    """Return the irradiance, (3, h, w): the maximum of this camera's light and of what further cameras found.

    `placed` are the cameras that `cameras.count` asks for.
    """
    light = one_view(frame, settings)
    cameras = settings.cameras
    for camera in (*cameras.views, *placed):
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
    """Return the irradiance by what one camera sees."""
    buffer, printed, sampling = frame.gbuffer, settings.as_published, settings.sampling
    seen, view = buffer.resolve("depth", "normal", "albedo"), buffer.projection
    levels, senders = levels_of((*seen, frame.direct, view.frame, view.half), settings)
    shape = levels[0]["depth"].shape
    # Sec. 3.2: the smallest r with which the crowns cover the picture, its diagonal over 2^K
    radius = max(1.0, math.hypot(*shape) / 2**sampling.levels) if sampling.radius is None else sampling.radius
    light = None
    for index in reversed(range(sampling.levels)):
        here = levels[index]
        added = np.zeros_like(here["position"])
        if settings.senders.only_level in (None, index):
            added = gathered(frame, here, index, settings, radius, senders[index])
            # receivers that all have the same samples have nothing to gain from each other's
            if settings.blur is not None and sampling.pattern not in ("fixed", "all"):
                added = blur(added, here["position"], here["normal"], here["depth"], settings.blur.size,
                             settings.blur.plane_tolerance, settings.blur.cosine)
            added *= 4.0**index if "hss_level_factor" in printed else 1.0
        light = added if light is None else added + carried(light, levels[index + 1], here["depth"], here["normal"],
                                                            settings)
    return light if sampling.first_level == 0 else carried(light, levels[0], *seen[:2], settings)


def levels_of(seen, settings):
    """Return levels as dicts of planes, of the settings' kind, and the same as senders."""
    sampling, mode, (shape, half) = settings.sampling, settings.senders.downsample, (seen[0].shape, seen[-1])
    first, numbers = sampling.first_level, range(sampling.first_level, sampling.first_level + sampling.levels)
    closest = [hssil_levels.first_level(*seen, first)]
    for number in numbers[1:]:
        closest.append(hssil_levels.coarser_level(*closest[-1], number, shape))
    made, senders = closest, closest
    if mode == "average":
        made = senders = [hssil_levels.first_mean(*seen, first)]
        for _ in numbers[1:]:
            made.append(hssil_levels.level_of_means(*made[-1]))
        made = senders = [(*means, nearest[5]) for means, nearest in zip(made, closest, strict=True)]
    elif mode == "closest_average":
        made = [hssil_levels.first_mean_radiance(*seen, first)]
        for number in numbers[1:]:
            made.append(hssil_levels.coarser_mean_radiance(*made[-1], number, shape))
        made = senders = [planes[:6] for planes in made]
    elif mode == "resampled":
        senders, side = [hssil_levels.first_level(*seen, 0)], 1 << first
        for number, planes in zip(numbers, closest, strict=True):
            u = random_shares(sampling.seed, number, planes[1].shape)
            senders.append(hssil_levels.resampled_level(planes, senders[-1], u, side))
            side = 2
        senders = senders[1:]
    # Eq. 3 prints tan f for tan(f / 2): tan f = 2 t / (1 - t^2)
    wide = 4 / np.prod(1 - half**2) if "hss_tan_f" in settings.as_published else 1.0
    return tuple([dict(zip(PLANES, (*planes[:4], wide * planes[4], planes[5]), strict=True)) for planes in some]
                 for some in (made, senders))


def random_shares(seed, number, shape):
    """Return the random number of each texel of a level that picks the place it sends from."""
    level = crown_points.level_key(seed, number)
    return np.array([[mix32(crown_points.pixel_key(crown_points.row_key(level, row), column) ^ 0x165667B1) / 2**32
                      for column in range(shape[1])] for row in range(shape[0])])


def carried(light, below, depth, normal, settings):
    """Carry light to a finer level."""
    weights = settings.upsampling
    factor = next(n for n in (2, 4, 8, 16, 32) if below["depth"].shape == tuple(-(-size // n) for size in depth.shape))
    if weights.name() == "bilateral":
        return upsample(light, below["depth"], below["normal"], depth, normal, factor, weights.depth_sigma,
                        weights.normal_power, settings.senders.downsample != "average")
    if weights.name() == "bilinear":
        return bilinear(light, below["depth"], depth, factor)
    row, column = np.indices(depth.shape) // factor
    return np.where(np.isfinite(depth), light[:, row, column], 0)


def gathered(frame, texels, index, settings, radius, senders):
    """Return the light that the texels of a level receive from samples of it, `senders`."""
    sampling, kind, form = settings.sampling, settings.visibility, settings.senders.form_factor
    number, shape = sampling.first_level + index, texels["depth"].shape
    less = math.pi if "hss_disc_pi" in settings.as_published and form != "point" else 1.0
    if isinstance(kind, Bitmask):
        return bitmask.masked_light(
            texels, lambda *at: crown_points.slices(sampling, kind, radius, index, number, *at),
            kind.thickness * diagonal(frame), form, senders, settings.senders.disc_share) / less
    i, j, weight = hssil_crown.samples_at(shape, *crown_points.samples(sampling, radius, index, number, shape))
    terms = (texels["position"][..., None], texels["normal"][..., None], senders["position"][:, i, j],
             senders["normal"][:, i, j])
    area = senders["area"][i, j]
    if form == "disc":
        share = hssil_crown.shared_disc_form_factor(*terms, area, weight, settings.senders.disc_share)
    elif form == "texel":
        share = weight * hssil_crown.disc_form_factor(*terms, area)
    else:
        share = hssil_crown.point_form_factor(*terms, area * weight)
    if isinstance(kind, Rays):
        share = share * sight(frame, (texels, senders), (i, j), share * senders["radiance"][:, i, j].any(axis=0) > 0)
    return (share * senders["radiance"][:, i, j]).sum(axis=-1) / less


def diagonal(frame):
    """Return the diagonal of the box of what the camera sees."""
    position = frame.gbuffer.position[:, frame.gbuffer.covered]
    return float(np.linalg.norm(np.ptp(position, axis=1)))


def sight(frame, levels, at, asked):
    """Return V of receivers and samples: rays between the pixels whose surfaces they hold, off their triangles."""
    buffer, corners = frame.gbuffer, corners_of(frame.scene.geometry)
    receiver, sender = (level["pixel"] for level in levels)
    pixels = np.broadcast_to(receiver[..., None], asked.shape)[asked], sender[at][asked]
    triangles, normals, points = (array.reshape(*array.shape[:-2], -1) for array in (
        buffer.triangle_id, buffer.normal, buffer.position))
    up, other_up = (face_normals(frame.scene.geometry, triangles[one], normals[:, one].T) for one in pixels)
    toward = (levels[1]["position"][:, *at] - levels[0]["position"][..., None])[:, asked].T
    visible = np.zeros(asked.shape)
    faces = ((up * toward).sum(axis=1) > 0) & ((other_up * toward).sum(axis=1) < 0)
    start, end = (points[:, one].T + LIFT * normal for one, normal in zip(pixels, (up, other_up), strict=True))
    visible[asked] = faces * free(corners, start, end)
    return visible
