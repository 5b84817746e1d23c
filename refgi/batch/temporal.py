"""What only a sequence of frames shows: flicker and lag.

x_k is a method's picture of frame k, r_k the truth, v_k the variance of its mean; the truths of two frames have
different seeds, so that their noise is independent. Means are over the pixels with light in both frames, of the picture
or of the truth, and over all frames.

- flicker^2 = mean |(x_k - x_k-1) - (r_k - r_k-1)|^2: what changes beside what should. A perfect picture has
  mean (v_k + v_k-1) of it, the truth's own noise.
- lag d makes x_k nearest to r_k + d (r_k-1 - r_k): d = (mean (x_k - r_k)(r_k-1 - r_k) - v) / (mean (r_k-1 - r_k)^2 - w)
  with v = mean v_k and w = mean (v_k + v_k-1), which the noise of r adds to each mean. A light that grows steadily and
  is shown d frames late has the lag d, and a blend with the share a of the frame before a / (1 - a).
"""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.batch.jobs import Job
from refgi.batch.outcome import Outcome
from refgi.bench.grid import TRUTH
from refgi.bench.results import PathResult, known
from refgi.image import read_exr

Array = npt.NDArray[Any]

LEAST_CHANGE = 4.0  # of the truth from frame to frame over its noise, both squared, from which a lag can be told


class Still(NamedTuple):
    """One frame of a path."""

    picture: Array  # (3, h, w) W/m^2
    truth: Array
    variance: Array  # of the truth's mean
    covered: Array  # (h, w) bool, pixels with light


class OverTime(NamedTuple):
    """Figures of a sequence; nan where they cannot be told."""

    flicker: float  # over the truth's mean
    noise: float  # flicker of a perfect picture
    lag: float  # frames


def over_time(frames: Iterator[Still]) -> OverTime:
    """Judge a sequence of frames by that of the truth; two are held at a time.

    Flicker and its noise, and lag; nan for fewer than two frames, and a lag of nan where the light rests.
    """
    sums = np.zeros(6)  # of squared flicker, its noise, x - r along the change, v, squared change, r; a value each
    count, before = 0, None
    for still in frames:
        if before is not None:
            both = still.covered & before.covered
            sums += _sums(still, before, both)
            count += 3 * int(both.sum())
        before = still
    if count == 0 or sums[5] <= 0:
        return OverTime(math.nan, math.nan, math.nan)
    flicker, noise, along, own, change, mean = sums / count
    lag = (along - own) / (change - noise) if change > LEAST_CHANGE * noise else math.nan
    return OverTime(math.sqrt(flicker) / mean, math.sqrt(noise) / mean, lag)


def paths_of(folder: Path, jobs: Sequence[Job], outcomes: dict[str, Outcome]) -> tuple[PathResult, ...]:
    """Return the figures of each choice whose frames are all there; nothing for scenes at rest.

    The folder of the batch holds the pictures; `outcomes` are by name of the job.
    """
    ways: dict[Any, list[Job]] = {}
    for job in jobs:
        if job.shot.path is not None and job.choice.method != TRUTH:
            ways.setdefault((job.shot.scene, job.choice), []).append(job)
    return tuple(_path(folder, way) for way in ways.values()
                 if len(way) > 1 and all(job.name in outcomes and outcomes[job.name].run for job in way))


def _path(folder: Path, way: Sequence[Job]) -> PathResult:
    shot, choice = way[0].shot, way[0].choice
    figures = over_time(_still(folder, job) for job in way)
    return PathResult(scene=shot.scene, method=choice.method, changes=choice.changes, frames=len(way),
                      **{key: known(value) for key, value in figures._asdict().items()})


def _still(folder: Path, job: Job) -> Still:
    picture = read_exr(folder / job.picture)[0]
    truth = read_exr((folder / job.picture).with_name(f"{TRUTH}.exr"))[0]
    light, right, variance = (_rgb(planes, name) for planes, name in (
        (picture, "irradiance"), (truth, "irradiance"), (truth, "variance")))
    return Still(light, right, variance, ((light != 0) | (right != 0)).any(axis=0))


def _rgb(planes: dict[str, Array], name: str) -> Array:
    return np.stack([planes[f"{name}.{channel}"] for channel in "RGB"]).astype(np.float64)


def _sums(still: Still, before: Still, both: Array) -> Array:
    x, r, v = (plane[:, both] for plane in still[:3])
    x0, r0, v0 = (plane[:, both] for plane in before[:3])
    return np.array([(((x - x0) - (r - r0)) ** 2).sum(), (v + v0).sum(), ((x - r) * (r0 - r)).sum(), v.sum(),
                     ((r0 - r) ** 2).sum(), r.sum()])
