"""Directions of receivers, shared out to blocks of pixels by what a pilot finds.

What the bound leaves to directions lies near lit surfaces: in corners nearly all of its variance, elsewhere nothing.
A pilot sends two directions from every second receiver, twice; the difference tells the standard deviation s of each
block of 8 x 8 pixels, averaged with its neighbours'. A block then gets n = N s / rms(s) directions, as a power of two:
least error for so many rays, N of them where the deviation is that of the whole picture, and fewer on average. The
pilot depends on scene, receivers and settings alone, not on the seed, and no receiver is left without directions:
passes stay independent and unbiased whatever it found.
"""

import numpy as np

from refgi.pairs.shadow_rays import RayReceivers
from refgi.truth.passes import add_directions, directions_reach
from refgi.truth.result import blocks_of
from refgi.truth.task import Group, Task
from refgi.types import Array

PILOT, EVERY = 2, 2  # directions of each half, of every second receiver
FEWEST, MOST = 0.125, 8.0  # of N


def directions_shared_out(task: Task) -> tuple[Group, ...]:
    """Return groups of receivers with as many directions each; none where all have the same.

    Only where directions are short: there the light side has nearly all light.
    """
    count, pixel = task.settings.directions_per_pass, task.receivers.pixel
    if task.lobes is not None or not count or not len(pixel) or np.isinf(directions_reach(task)):
        return ()
    sampled = task._replace(receivers=_some(task.receivers, np.arange(0, len(pixel), EVERY)))
    halves = np.zeros((2, 3, len(sampled.receivers.pixel)))
    for half, words in zip(halves, np.random.SeedSequence(0).generate_state(8).reshape(2, 4), strict=True):
        add_directions(sampled, PILOT, words, half)
    block, grid = blocks_of(pixel, task.shape)
    sums = [_with_neighbours(np.bincount(block[::EVERY], weights, grid[0] * grid[1]).reshape(grid))
            for weights in (((halves[0] - halves[1]) ** 2).mean(axis=0), None)]
    deviation = np.sqrt(sums[0] / np.maximum(sums[1], 1)).ravel()[block]
    rms = np.sqrt((deviation**2).mean())
    share = np.clip(deviation / rms, FEWEST, MOST) if rms > 0 else np.full(len(block), FEWEST)
    counts = 2 ** np.rint(np.log2(np.maximum(count * share, 1))).astype(np.int64)
    return tuple(Group(int(n), chosen, _some(task.receivers, chosen))
                 for n in np.unique(counts) for chosen in (np.flatnonzero(counts == n),))


def _some(receivers: RayReceivers, chosen: Array) -> RayReceivers:
    return RayReceivers(*(np.ascontiguousarray(field[..., chosen]) for field in receivers))


def _with_neighbours(values: Array) -> Array:
    """Return the sum over each value and the eight around it."""
    wide = np.pad(values.astype(np.float64), 1)
    rows, columns = values.shape
    return np.asarray(sum(wide[i : i + rows, j : j + columns] for i in range(3) for j in range(3)))
