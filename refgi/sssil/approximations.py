"""What `hssil` approximates, in the order of its pipeline, the memory that it takes, and what few samples lose.

A level more at full resolution reaches as far as one fewer at half: what switches the resolution off keeps the reach.
A sample's disc is as large as what it stands for (Eq. 4), and a large disc near a receiver gives less than the texels
that it covers: few samples lose light at every receiver.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from refgi.diagnostics import asked
from refgi.jit import kernel, prange
from refgi.method import Approximation, Extent
from refgi.pairs.estimates import lost_share, warn_of_loss
from refgi.pairs.irradiance import Receivers
from refgi.pairs.sample import sample_pixels
from refgi.settings import replaced
from refgi.sssil.crown import level_factor
from refgi.sssil.form_factor import Facing, SampleForm, disc_texels, form_of, term
from refgi.sssil.pattern import PHASES, chosen_radius, reach, shared_offsets
from refgi.sssil.settings import MOST_LEVELS, MOST_SAMPLES, Bitmask, HssilSettings, Rays, SamplingSettings
from refgi.sssil.view import Level
from refgi.stages import stage
from refgi.types import Array

MANY = 1024  # samples where not every texel can be one


def _ignores_visibility(settings: HssilSettings) -> Mapping[str, Any]:
    return {"visibility": False} if settings.visibility is None else {}


def _by_rays(settings: HssilSettings, _: Mapping[str, Any]) -> HssilSettings:
    return replaced(settings, {"visibility": "rays"}) if isinstance(settings.visibility, Bitmask) else settings


def _points(settings: HssilSettings, _: Mapping[str, Any]) -> HssilSettings:
    return replaced(settings, {"senders.form_factor": "point"})


def _one_level(settings: HssilSettings, _: Mapping[str, Any]) -> HssilSettings:
    """Return settings of one level that covers the picture, with the samples of all levels."""
    sampling = settings.sampling
    if sampling.levels == 1:
        return settings
    return replaced(settings, {"levels": 1, "radius": None, "senders.only_level": None,
                               "samples": min(MOST_SAMPLES, sampling.samples * sampling.levels)})


def _averaged(settings: HssilSettings, _: Mapping[str, Any]) -> HssilSettings:
    return replaced(settings, {"downsample": "average"})


def _whole_picture(settings: HssilSettings, options: Mapping[str, Any]) -> HssilSettings:
    """Return settings with as many levels as reach across the picture."""
    sampling, radius = settings.sampling, settings.sampling.radius
    if radius is None:
        return settings
    diagonal = math.hypot(*(-(-options[side] >> sampling.first_level) for side in ("width", "height")))
    while reach(sampling, radius) < diagonal and sampling.levels < MOST_LEVELS:
        sampling = dataclasses.replace(sampling, levels=sampling.levels + 1)
    return dataclasses.replace(settings, sampling=sampling)


def _full_resolution(settings: HssilSettings, _: Mapping[str, Any]) -> HssilSettings:
    sampling = settings.sampling
    more = 0 if sampling.radius is None else sampling.first_level  # a radius that is not set covers the picture
    return replaced(settings, {"start": "full", "levels": min(MOST_LEVELS, sampling.levels + more)})


def _every_texel(settings: HssilSettings, _: Mapping[str, Any]) -> HssilSettings:
    if isinstance(settings.visibility, Bitmask):  # marches along slices, which the pattern "all" has not
        return replaced(settings, {"samples": max(MANY, settings.sampling.samples)})
    return replaced(settings, {"pattern": "all", "samples": 1, "seed": 0})


def _unblurred(settings: HssilSettings, _: Mapping[str, Any]) -> HssilSettings:
    return dataclasses.replace(settings, blur=None)


def _single_frame(options: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return options of a frame that is not the last of several."""
    return {key: value for key, value in options.items() if key != "still"}


APPROXIMATIONS = (
    Approximation("unseen senders", "only what the camera sees sends light",
                  limit=lambda _: {"emitters": "visible"}),
    Approximation("visibility", "nothing blocks indirect light, or a bitmask of the screen for rays", _by_rays,
                  limit=_ignores_visibility),
    Approximation("clamp", "a sender is a disc (Eq. 4) for a point (Eq. 3), whose light has no bound", _points),
    Approximation("levels", "coarser texels for pixels farther away", _one_level),
    Approximation("downsampling", "a coarse texel is one of four for their average", _averaged),
    Approximation("cut", "crowns end before the picture does", _whole_picture),
    Approximation("upsampling", "the first level is half or a quarter of the resolution", _full_resolution),
    Approximation("few samples", "S samples a level for all its texels", _every_texel),
    Approximation("blur", "the mean over texels of the same surface", _unblurred),
    Approximation("temporal", "the frames before are blended in; here of a resting scene", frame=_single_frame))


FLOATS = 11  # a texel: position, depth, normal, radiance, area
SENDER_FLOATS = 10  # a texel of drawn senders: the same but the depth
PIXEL_BYTES = 4  # and the pixel that it shows
PLANES, LIGHT_FLOATS = 9, 9  # of a texel of the level that is summed: as senders, its light blurred or not, that below
PADDING = 32  # lanes around a row of senders at least, for each of the phases into which columns are split
VIEW_FLOATS = 32  # of a pixel of a further view: its G-buffer, direct and indirect light, and temporaries
RAY_BYTES = 1 << 26  # rays that are held at a time
OFFSET_BYTES, SLICED_BYTES = 16, 32  # of a sample with its weight, and of one in a slice
CANDIDATE_BYTES = 104  # of a texel that may be among all around a receiver
LISTED_RAY_BYTES = 48  # of a sample of one receiver


def level_bytes(settings: HssilSettings, pixels: int, float_bytes: int) -> int:
    """Return the bytes of the levels of one picture: n from full resolution on are (4 - 4^(1 - n)) / 3 times the first.

    >>> from refgi.sssil.settings import SamplingSettings
    >>> level_bytes(HssilSettings(SamplingSettings(start="full", levels=1)), 100, 4)
    4800
    """
    sampling, downsample = settings.sampling, settings.senders.downsample
    floats = FLOATS + (downsample == "closest_average")
    numbers = range(sampling.first_level, sampling.first_level + sampling.levels)
    texels = [-(-pixels >> 2 * number) for number in numbers]
    drawn = [count for count, number in zip(texels, numbers, strict=True) if number > 0]  # pixels are their own senders
    senders = sum(drawn) * (SENDER_FLOATS * float_bytes + PIXEL_BYTES) if downsample == "resampled" else 0
    return sum(texels) * (floats * float_bytes + PIXEL_BYTES) + senders


def extra_bytes(settings: HssilSettings, extent: Extent) -> int:
    """Estimate the bytes that levels, samples and further cameras add to a picture, rather too many than too few."""
    size, float_bytes = extent.size, extent.float_bytes
    pixels = size[0] * size[1]
    columns, rows = (-(-side >> settings.sampling.first_level) for side in size)
    radius = chosen_radius((rows, columns), settings.sampling)
    phases = settings.sampling.tile if settings.sampling.pattern == "interleaved" else PHASES
    padded = columns + 2 * min(math.ceil(2 * radius), columns) + PADDING * phases
    view = level_bytes(settings, pixels, float_bytes)
    view += (PLANES * padded * (rows + 1) + LIGHT_FLOATS * columns * rows) * float_bytes
    further = VIEW_FLOATS * pixels * float_bytes if settings.cameras.views else 0
    samples = _sample_bytes(settings, rows, columns, radius)
    return view + further + samples + (RAY_BYTES if isinstance(settings.visibility, Rays) else 0)


def _sample_bytes(settings: HssilSettings, rows: int, columns: int, radius: float) -> int:
    """Return the memory of the first level's list of samples, the longest of all levels'."""
    sampling = settings.sampling
    if sampling.pattern == "all":
        reach = math.ceil(2 * radius)
        candidates = (2 * min(reach, rows) + 1) * (min(reach, columns) + 1)
        rays = 2 * LISTED_RAY_BYTES * candidates if isinstance(settings.visibility, Rays) else 0
        return CANDIDATE_BYTES * candidates + rays
    if sampling.pattern == "pixel":
        return 0
    if sampling.pattern == "fixed":
        rows = 1
    if isinstance(settings.visibility, Bitmask):  # half as many occluders as samples of the crown
        slices = settings.visibility.count(sampling.samples)
        return SLICED_BYTES * rows * (3 * sampling.samples // 2 + sampling.inner + 3 * slices)
    sets = sampling.tile**2 if sampling.pattern == "interleaved" else PHASES * rows
    return OFFSET_BYTES * sets * (sampling.samples + sampling.inner)


ENOUGH = 256  # samples that lose next to nothing
FEW = 32  # more lose 3 % at most (docs/methods/hssil.md), which is not worth an estimate
SAMPLED = 512  # texels of a level
LEAST_LOSS = 0.05  # share below which a loss gives no warning: at so few texels two draws differ by as much


@stage("sssil.sample_loss")
def sample_loss(levels: Sequence[Level], senders: Sequence[Level], settings: HssilSettings) -> float:
    """Return the share of the light that the settings' number of samples loses against `ENOUGH`; below 0 for a gain.

    levels: Receivers, the first level first.
    senders: The same levels as senders.
    settings: Sampling and form factor. Samples of each pixel's own are taken as interleaved ones.
    -> float: Of the light without visibility.
    """
    own = settings.sampling
    own = replaced(own, {"pattern": "interleaved"}) if own.pattern == "pixel" else own
    form = form_of(settings.senders)
    sums = np.zeros(2)
    for index, (level, sending) in enumerate(zip(levels, senders, strict=True)):
        if settings.senders.only_level not in (None, index):
            continue
        place = sample_pixels(Receivers(level.position, level.normal, np.isfinite(level.depth)), SAMPLED).place
        found = [_mean(place, level, sending, index, one, form)
                 for one in (own, replaced(own, {"samples": ENOUGH, "pattern": "interleaved"}))]
        sums += np.array(found) * level_factor(index, settings)
    return lost_share(float(sums[1]), float(sums[0]))


def _mean(
    place: Array, level: Level, senders: Level, index: int, sampling: SamplingSettings, form: SampleForm
) -> float:
    rows, columns = level.shape
    radius = chosen_radius((rows << index, columns << index), sampling)
    offsets, weight = shared_offsets(sampling, index, level.number, rows, radius, columns)
    sums = np.zeros(len(place))
    _sum_at(place, level.position, level.normal, senders.position, senders.normal, senders.area, senders.radiance,
            offsets, weight, form, sums)
    return float(sums.mean()) if len(sums) else 0.0


@kernel(parallel=True)
def _sum_at(
    place: Array, position: Array, normal: Array, sender: Array, facing: Array, area: Array, radiance: Array,
    offsets: Array, weight: Array, form: SampleForm, sums: Array,
) -> None:
    """Fill the light of the samples of some texels, all channels together, without pi."""
    for i in prange(len(place)):
        rows, columns = area.shape
        y, x = place[i] // columns, place[i] % columns
        of, at = offsets[y % offsets.shape[0], x % offsets.shape[1]], weight[y % weight.shape[0], x % weight.shape[1]]
        total = 0.0
        for j in range(at.size):
            a, b = y + of[j, 1], x + of[j, 0]
            if 0 <= a < rows and 0 <= b < columns and not (a == y and b == x):
                light = float(radiance[0, a, b]) + float(radiance[1, a, b]) + float(radiance[2, a, b])
                by = -float(area[a, b]) / math.pi
                # Eq. (1)
                total += light * term(
                    Facing(float(position[0, y, x]), float(position[1, y, x]), float(position[2, y, x]),
                           float(normal[0, y, x]), float(normal[1, y, x]), float(normal[2, y, x])),
                    Facing(float(sender[0, a, b]), float(sender[1, a, b]), float(sender[2, a, b]),
                           facing[0, a, b] * by, facing[1, a, b] * by, facing[2, a, b] * by),
                    at[j], disc_texels(at[j], form))
        sums[i] = total


def warn_of_few_samples(levels: Sequence[Level], senders: Sequence[Level], settings: HssilSettings) -> None:
    """Warn whoever collects diagnostics where few samples lose more than `LEAST_LOSS` of the light of a picture."""
    sampling = settings.sampling
    if sampling.pattern == "all" or sampling.samples > FEW or asked("sssil.sample_loss") is None:
        return
    share = sample_loss(levels, senders, settings)
    if share > LEAST_LOSS:
        fixed = " in one fixed set" if sampling.pattern == "fixed" else ""
        warn_of_loss(share, f"hssil: sampling.samples {sampling.samples}{fixed} in place of {ENOUGH}")
