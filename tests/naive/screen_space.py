"""The picture of hierarchical screen-space illumination for every setting, by loops over texels and samples.

Of each frame it takes depths, normals, albedo and direct light; all else is made here and in `hssil`, `bitmask`,
`crown_points` and `reprojection`.
"""

import math

import numpy as np

from refgi.frame import Frame
from refgi.sssil.settings import Bitmask, Rays
from tests.naive import bitmask, crown_points, hssil, level_blur, reprojection
from tests.naive.crossings import LIFT, corners_of, face_normals, free
from tests.naive.val import dot


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
        found, _ = fetched(one_view(other, settings), other, *surfaces(frame), frame.gbuffer.covered,
                           cameras.depth_tolerance, cameras.normal_cosine)
        light = np.maximum(light, found)
    return light


def surfaces(frame):
    """Return positions and normals of the pixels."""
    return frame.gbuffer.resolve("position", "normal")


def fetched(light, source, position, normal, covered, depth_tolerance, normal_cosine, fetch="bilinear"):
    """Return what another view's picture holds of surface points, and the share of its texels that show them."""
    view, (depth, normal_there) = source.gbuffer.projection, source.gbuffer.resolve("depth", "normal")
    axes = (view.origin[0], *view.frame[0], view.half[1])
    found, weight = np.zeros(light.shape), np.zeros(covered.shape)
    for pixel in np.argwhere(covered):
        at = tuple(pixel)
        found[:, *at], weight[at] = reprojection.reproject(light, depth, normal_there, position[:, *at],
                                                           normal[:, *at], axes, depth_tolerance, normal_cosine,
                                                           fetch)
    return found, weight


def one_view(frame, settings):
    """Return the irradiance by what one camera sees."""
    buffer, printed, sampling = frame.gbuffer, settings.as_published, settings.sampling
    depth, normal, albedo = buffer.resolve("depth", "normal", "albedo")
    view = buffer.projection
    texels = hssil.first_texels(depth, normal, albedo * frame.direct / math.pi, view.frame[0], view.half,
                                "hss_tan_f" in printed)
    levels = [hssil.level(texels, sampling.first_level + i, settings.senders.downsample)
              for i in range(sampling.levels)]
    senders = levels
    if settings.senders.downsample == "resampled":
        senders = hssil.drawn(texels, levels, sampling.first_level, sampling.seed)
    shape = len(levels[0]), len(levels[0][0])
    # Sec. 3.2: the smallest r with which the crowns cover the picture, its diagonal over 2^K
    radius = max(1.0, math.hypot(*shape) / 2**sampling.levels) if sampling.radius is None else sampling.radius
    light = None
    for index in reversed(range(sampling.levels)):
        here = levels[index]
        added = np.zeros((3, len(here), len(here[0])))
        if settings.senders.only_level in (None, index):
            added = gathered(frame, here, index, settings, radius, senders[index])
            # receivers that all have the same samples have nothing to gain from each other's
            if settings.blur is not None and sampling.pattern not in ("fixed", "all"):
                added = level_blur.blurred(added, here, settings.blur.size, settings.blur.plane_tolerance,
                                            settings.blur.cosine)
            added *= 4.0**index if "hss_level_factor" in printed else 1.0
        light = added if light is None else added + upsampled(light, levels[index + 1], here, 2, settings)
    first = sampling.first_level
    return upsampled(light, levels[0], texels, 2**first, settings) if first else light


def upsampled(light, below, here, factor, settings):
    """Carry light to a finer level."""
    weights = settings.upsampling
    sigma, power = (weights.depth_sigma, weights.normal_power) if weights.name() == "bilateral" else (1.0, 1.0)
    return hssil.upsampled(light, below, here, factor, weights.name(), settings.senders.downsample != "average",
                           sigma, power)


def gathered(frame, texels, index, settings, radius, senders):
    """Return the light that the texels of a level receive from samples of it, `senders`."""
    sampling, kind = settings.sampling, settings.visibility
    number, shape = sampling.first_level + index, (len(texels), len(texels[0]))
    form, disc_pi = settings.senders.form_factor, "hss_disc_pi" in settings.as_published
    share = settings.senders.disc_share
    if isinstance(kind, Bitmask):
        light = bitmask.masked_light(
            as_arrays(texels), lambda *at: crown_points.slices(sampling, kind, radius, index, number, *at),
            kind.thickness * diagonal(frame), form, as_arrays(senders), share)
        return light / math.pi if disc_pi and form != "point" else light

    def around(row, column):
        if sampling.pattern == "all":
            return crown_points.every_texel(radius, index, shape)
        return crown_points.samples(sampling, radius, index, number, row, column)

    see = sight(frame, texels, senders) if isinstance(kind, Rays) else None
    return hssil.gathered(texels, around, form, disc_pi, see, senders, share)


def diagonal(frame):
    """Return the diagonal of the box of what the camera sees."""
    position = frame.gbuffer.position[:, frame.gbuffer.covered]
    return float(np.linalg.norm(np.ptp(position, axis=1)))


def as_arrays(texels):
    """Return a level as arrays."""
    def plane(key, none):
        return np.array([[none if texel is None else texel[key] for texel in row] for row in texels])

    return {"area": plane("area", 0.0),
            **{name: np.moveaxis(plane(key, np.zeros(3)), 2, 0)
               for name, key in (("position", "place"), ("normal", "normal"), ("radiance", "radiance"))}}


def sight(frame, *levels):
    """Return V of two texels of a level: a ray between the pixels whose surfaces they hold, off their triangles."""
    buffer, corners, ends = frame.gbuffer, corners_of(frame.scene.geometry), {}
    for texel in (texel for level in levels for row in level for texel in row if texel is not None):
        at = texel["pixel"]
        up = face_normals(frame.scene.geometry, buffer.triangle_id[at][None], buffer.normal[:, *at][None])[0]
        ends[at] = up, buffer.position[:, *at] + LIFT * up

    def see(receiver, sender):
        (up, start), (other_up, end) = ends[receiver["pixel"]], ends[sender["pixel"]]
        toward = sender["place"] - receiver["place"]
        if dot(up, toward) <= 0 or dot(other_up, toward) >= 0:
            return 0.0
        return float(free(corners, start[None], end[None])[0])

    return see
