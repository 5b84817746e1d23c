"""Share of the light that few samples lose, estimated at some texels of each level.

A sample's disc is as large as what it stands for (Eq. 4), and a large disc near a receiver gives less than the texels
that it covers: few samples lose light at every receiver. The share is that of two sums at the same texels, by the
samples of the settings and by `ENOUGH`.
"""

import math
from collections.abc import Sequence

import numpy as np

from refgi.diagnostics import asked
from refgi.jit import kernel, prange
from refgi.pairs.estimates import lost_share, sample_pixels, warn_of_loss
from refgi.pairs.irradiance import Receivers
from refgi.settings import replaced
from refgi.sssil.crown.form_factor import Facing, SampleForm, disc_texels, form_of, term
from refgi.sssil.crown.gather import level_factor
from refgi.sssil.crown.pattern import shared_offsets
from refgi.sssil.crown.reach import chosen_radius
from refgi.sssil.pyramid.view import Level
from refgi.sssil.settings import HssilSettings, SamplingSettings
from refgi.stages import stage
from refgi.types import Array

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
