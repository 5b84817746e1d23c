"""Screen-space indirect illumination as a whole: levels, the light of their crowns, their sum (HSS Sec. 3, Fig. 4).

A level is its planes place, depth, normal, L, ds and kept pixel (`hssil_levels`), finest first; `first` is the number
of the finest, 0 that of the picture. Samples are offsets and weights of each level (`hssil_crown`).
"""

from typing import Any

import numpy as np

from refgi.literal import upsampling
from refgi.literal.hssil_crown import disc_form_factor, point_form_factor, samples_at, shared_disc_form_factor
from refgi.literal.hssil_levels import (
    coarser_level,
    coarser_mean_radiance,
    first_level,
    first_mean,
    first_mean_radiance,
    level_of_means,
    resampled_level,
)

Level = tuple[Any, Any, Any, Any, Any, Any]  # planes


def hssil(
    depth: Any, normal: Any, albedo: Any, irradiance: Any, frame: Any, half: Any, samples: Any, *, first: int,
    downsample: str, form: str, disc_share: float, window: Any, depth_sigma: float, normal_power: float,
    shares: Any = None, joined_by: str = "bilateral",
) -> Any:
    """Return E (3, h, w), W/m^2, of what the camera sees, lit by `irradiance` (HSS Sec. 3.2).

    `shares`: random numbers (h, w) of each level where senders are "resampled"; `window`: size, plane tolerance and
    least cosine of the blur, or None.
    """
    levels, senders = pyramid(depth, normal, albedo, irradiance, frame, half, len(samples), first, downsample, shares)
    own = [crown_light(*three, form, disc_share) for three in zip(levels, senders, samples, strict=True)]
    if window is not None:
        own = [upsampling.blur(light, level[0], level[2], level[1], *window)
               for light, level in zip(own, levels, strict=True)]
    return level_sum(own, levels, depth, normal, first, joined_by, depth_sigma, normal_power, downsample != "average")


def pyramid(
    depth: Any, normal: Any, albedo: Any, irradiance: Any, frame: Any, half: Any, count: int, first: int,
    downsample: str, shares: Any = None,
) -> tuple[Any, Any]:
    """Return levels, and the same as senders (HSS Sec. 3.1, 4).

    "closest" of finer texels, their "average", the "closest_average": the closest with the mean L of all, or
    "resampled": closest receivers and senders drawn by their flux.
    """
    seen, numbers = (depth, normal, albedo, irradiance, frame, half), range(first + 1, first + count)
    levels: list[Level] = [first_level(*seen, first)]
    for number in numbers:
        levels.append(coarser_level(*levels[-1], number, depth.shape))
    if downsample == "average":
        means = [first_mean(*seen, first)]
        for _ in numbers:
            means.append(level_of_means(*means[-1]))
        levels = [(*mean, level[5]) for mean, level in zip(means, levels, strict=True)]
    elif downsample == "closest_average":
        counted: list[tuple[*Level, Any]] = [first_mean_radiance(*seen, first)]
        for number in numbers:
            counted.append(coarser_mean_radiance(*counted[-1], number, depth.shape))
        levels = [level[:6] for level in counted]
    elif downsample == "resampled":
        senders = [resampled_level(levels[0], first_level(*seen, 0), shares[0], 1 << first)]
        for level, u in zip(levels[1:], shares[1:], strict=True):
            senders.append(resampled_level(level, senders[-1], u, 2))
        return levels, senders
    return levels, levels


def crown_light(level: Any, senders: Any, samples: Any, form: str, disc_share: float, seen: Any = None) -> Any:
    """Return E (3, h, w) that texels of a level receive from their samples; `seen` (h, w, n): V of these (HSS Eq. 1).

    A sample is a "point", the disc of one "texel" as often as it stands for, or a "disc" of a share of these.
    """
    i, j, texels = samples_at(level[1].shape, *samples)
    x, n = level[0][..., None], level[2][..., None]
    y, m, ds = senders[0][:, i, j], senders[2][:, i, j], senders[4][i, j]
    if form == "disc":
        received = shared_disc_form_factor(x, n, y, m, ds, texels, disc_share)
    elif form == "texel":
        received = texels * disc_form_factor(x, n, y, m, ds)
    else:
        received = point_form_factor(x, n, y, m, ds * texels)
    if seen is not None:
        received = received * seen
    # Eq. (1)
    return (received * senders[3][:, i, j]).sum(axis=-1)


def level_sum(
    own: Any, levels: Any, depth: Any, normal: Any, first: int, joined_by: str, depth_sigma: float,
    normal_power: float, nearest: bool,
) -> Any:
    """Return E (3, h, w) of the light of all levels: crowns do not overlap, so that levels add (HSS Sec. 3.2)."""
    def carried(light: Any, below: Any, z: Any, n: Any, factor: int) -> Any:
        if joined_by == "bilateral":
            return upsampling.upsample(light, below[1], below[2], z, n, factor, depth_sigma, normal_power, nearest)
        if joined_by == "bilinear":
            return upsampling.bilinear(light, below[1], z, factor)
        row, column = np.indices(z.shape) // factor
        return np.where(np.isfinite(z), light[:, row, column], 0)

    light = own[-1]
    for k in reversed(range(len(own) - 1)):
        light = own[k] + carried(light, levels[k + 1], levels[k][1], levels[k][2], 2)
    return carried(light, levels[0], depth, normal, 1 << first) if first > 0 else light
