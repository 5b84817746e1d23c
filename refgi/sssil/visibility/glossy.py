"""Visibility of the samples of glossy receivers: shadow rays, and slices marched with a bitmask of the depth map.

With a bitmask the samples are those of the slices of `bitmask`, as many in each direction: what occludes has to be
marched past in all of them, so that none are drawn by importance.
"""

from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel, prange
from refgi.pairs.shadow_rays import RayReceivers
from refgi.rays import far_offset
from refgi.sssil.crown.form_factor import SampleForm, disc_texels
from refgi.sssil.crown.glossy import GlossyReceivers, glossy_transfer
from refgi.sssil.crown.pattern import level_key, pixel_key, row_key
from refgi.sssil.pyramid.view import Level
from refgi.sssil.settings import Bitmask, HssilSettings
from refgi.sssil.visibility.rays import Surfels
from refgi.sssil.visibility.slices import (
    PLANES,
    SliceCounts,
    direction,
    fill_slices,
    heights,
    pack,
    sector_mask,
    slice_counts,
    turn_of,
    visibility,
)
from refgi.types import Array


class SliceSamples(NamedTuple):
    """What slices are marched with on a level, in float64."""

    steps: SliceCounts
    receiving: Array  # (1, PLANES, n) receivers
    sending: Array  # (rows, PLANES, columns) texels
    thickness: float  # m
    key: Any  # uint32, of the level

    @property
    def per_receiver(self) -> int:
        """Samples of a receiver, occluders among them."""
        return self.steps.slices * self.steps.per_slice


def slice_samples(
    to: GlossyReceivers, level: Level, index: int, settings: HssilSettings, diagonal: float
) -> SliceSamples:
    """Return what slices are marched with: n receivers and the texels of a level, senders and occluders, packed.

    `index` is 0 for the first level; `diagonal` the scene's, m.
    """
    sampling, bitmask = settings.sampling, settings.visibility
    assert isinstance(bitmask, Bitmask)
    assert sampling.radius is not None
    steps = slice_counts(sampling, bitmask, index, float(sampling.radius))
    receiving, sending = np.zeros((1, PLANES, len(to.row))), np.zeros((level.shape[0], PLANES, level.shape[1]))
    pack(to.position[:, None], to.normal[:, None], np.zeros((3, 1, len(to.row))), np.zeros((1, len(to.row))), 1.0, 1,
         receiving)
    position, normal, radiance, area = (np.asarray(part, np.float64) for part in (
        level.position, level.normal, level.radiance, level.area))
    pack(position, normal, radiance, area, 1.0, 1, sending)
    return SliceSamples(steps, receiving, sending, float(bitmask.thickness * diagonal),
                        level_key(sampling.seed, level.number))


@kernel(parallel=True)
def march_samples(
    to: GlossyReceivers, first: int, last: int, level: Level, slices: SliceSamples, form: SampleForm,
    transfer: Array, sender: Array,
) -> None:
    """Fill transfer, times visibility, and sender of the samples of all slices; arguments as for `draw_samples`."""
    steps = slices.steps
    per_slice = steps.disc + steps.crown + steps.occluders
    for i in prange(last - first):
        offsets, length = np.empty((steps.slices, per_slice, 2), np.int32), np.empty(per_slice)
        weight = np.empty((steps.slices, per_slice))
        receiver = first + np.int64(i)
        turn, shift = turn_of(pixel_key(row_key(slices.key, to.row[receiver]), to.column[receiver]))
        fill_slices(steps, turn, shift, False, length, offsets, weight)
        for k in range(steps.slices):
            pair = (np.int64(i) * steps.slices + k) * per_slice
            _march(to, receiver, level, slices, offsets[k], weight[k], form, pair, transfer, sender)


@kernel
def _march(
    to: GlossyReceivers, i: Any, level: Level, slices: SliceSamples, offsets: Array, weight: Array,
    form: SampleForm, pair: Any, transfer: Array, sender: Array,
) -> None:
    """March one slice of a receiver, nearest samples first."""
    rows, columns = level.area.shape
    row, column = to.row[i] >> level.number, to.column[i] >> level.number
    mask, highest, receiver = np.uint32(0), 0.0, slices.receiving[0]
    for j in range(offsets.shape[0]):
        a, b = row + np.int64(offsets[j, 1]), column + np.int64(offsets[j, 0])
        transfer[pair + j], sender[pair + j] = 0.0, 0
        if 0 <= a < rows and 0 <= b < columns and not (a == row and b == column):
            dx, dy, dz, c = direction(receiver, i, slices.sending[a], b)
            front, back = heights(receiver, i, slices.sending[a], b, dx, dy, dz, c, slices.thickness)
            if weight[j] > 0.0:
                sender[pair + j] = a * columns + b
                transfer[pair + j] = visibility(front, highest, mask) * glossy_transfer(
                    to, i, level, a, b, weight[j], disc_texels(weight[j], form))
            highest = max(highest, front)
            mask = np.uint32(mask | sector_mask(back, front))


@kernel(parallel=True)
def fill_glossy_rays(
    to: RayReceivers, senders: Surfels, first: int, last: int, count: int, sender: Array, transfer: Array,
    origins: Array, directions: Array, reach: Array,
) -> None:
    """Fill the shadow ray of each sample, `count` of each of the receivers `first` to `last`.

    Clears the transfer where either end lies behind the plane of the other's triangle; what transfers nothing has no
    reach.
    """
    for i in prange(last - first):
        for j in range(count):
            _fill_ray(to, senders, first + np.int64(i), np.int64(i) * count + j, sender, transfer, origins, directions,
                      reach)


@kernel
def _fill_ray(
    to: RayReceivers, senders: Surfels, i: Any, ray: Any, sender: Array, transfer: Array, origins: Array,
    directions: Array, reach: Array,
) -> None:
    j = sender[ray]
    end, start = senders.origin, to.origin
    dx, dy, dz = (np.float64(end[0, j]) - start[0, i], np.float64(end[1, j]) - start[1, i],
                  np.float64(end[2, j]) - start[2, i])
    above = to.facing[0, i] * dx + to.facing[1, i] * dy + to.facing[2, i] * dz
    before = -(senders.facing[0, j] * dx + senders.facing[1, j] * dy + senders.facing[2, j] * dz)
    if above <= 0.0 or before <= 0.0:
        transfer[ray] = 0.0
    reach[ray] = 1.0 if transfer[ray] > 0.0 else 0.0
    far = far_offset(dx, dy, dz)
    for c in range(3):
        origins[ray, c] = to.origin[c, i]
        directions[ray, c] = senders.origin[c, j] - to.origin[c, i] + far * senders.facing[c, j]
