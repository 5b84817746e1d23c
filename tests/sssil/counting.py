"""How many samples the method takes, found from the light that it returns."""

import math

import numpy as np

from refgi.settings import replaced
from refgi.sssil.crown import gather
from refgi.sssil.hssil import hssil
from refgi.sssil.view import Level
from refgi.stages import observe

DRAWS = 16  # of which texels are lit, in each of three channels
COUNTED = 0.02  # of a count: the spread of a variance over 3 x 16 draws and 1024 receivers


def reads_of_levels(frame, settings):
    """Return how many texels a picture reads at each level, the first one first: receivers times samples."""
    with observe(record=True) as log:
        hssil(frame, settings)
    runs = sorted((run.inputs for run in log.runs if run.name == "sssil.gather"), key=lambda inputs: inputs["index"])
    return [math.prod(one["level"].shape) * samples_counted(one["settings"], one["index"]) for one in runs]


def samples_counted(settings, index):
    """Return how many texels a receiver far from the rim reads, in the mean.

    Inside a sphere each pair has the same weight (cos cos' / r^2 = 1 / 4 R^2). Where half of the texels are lit, drawn
    at random, n of them give a sum of mean n / 2 and variance n / 4, so n is four times its squared mean over its
    variance, whatever the weight.
    """
    rng, radius = np.random.default_rng(index), settings.sampling.radius
    side = 2 * math.ceil(2 * radius) + 40
    place = rng.normal(size=(3, side, side))
    place /= np.linalg.norm(place, axis=0)
    middle = slice(side // 2 - 16, side // 2 + 16)
    settings = replaced(settings, {"senders.form_factor": "point"})
    found = np.concatenate([
        gather(Level(index, place, np.ones((side, side)), -place, rng.integers(0, 2, place.shape).astype(float),
                     np.ones((side, side)), np.zeros((side, side), np.int32)), index, settings)[:, middle, middle]
        for _ in range(DRAWS)])
    return float((found.mean(axis=0) ** 2).mean() / found.var(axis=0, ddof=1).mean())


def share_inside(ox, oy, low, high, n=64):
    """Return the share of texel (ox, oy) whose points lie [low, high) from the middle of texel (0, 0), by n x n."""
    at = (np.arange(n) + 0.5) / n - 0.5
    length = np.hypot(ox + at[None, :], oy + at[:, None])
    return ((length >= low) & (length < high)).mean()
