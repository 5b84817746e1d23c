"""Truth of glossy senders: error at equal time, time to relMSE 1e-2, and claimed over true variance, scene by scene.

Runs of one number of passes, which take about SECONDS, with seeds of their own; deviations are from the oracle that
tests/truth/glossy_references.npz holds. Each of its pixels stands REPEAT x REPEAT times: what a pass costs beside its
pixels counts as in a picture of 96 x 72. Photons that count for a pixel's footprint land in finer pixels than those of
the reference: what they are off by holds that too.
relMSE = mean over pixels and channels of (x - r)^2 / (r^2 + (0.1 mean r)^2),
and falls as 1 / time. What is claimed is summed with the same weights. Before and after a change:

    REFGI_PACKAGE=OTHER_CHECKOUT python -m benchmarks truth_glossy --out before
    python -m benchmarks truth_glossy --out after --against before/results.json
"""

import dataclasses
import math
import time
import warnings
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from benchmarks.harness import Row
from refgi.errors import RefgiWarning
from refgi.frame import Frame
from refgi.rays import Tracer
from refgi.scene import Scene
from refgi.truth import TruthResult, TruthSettings
from refgi.truth.truth import accumulate
from refgi.types import Array
from tests.truth.glossy_scenes import EXPONENTS, SCENES, frame, reference

SECONDS, QUICK_SECONDS = 2.0, 0.5  # a run
SEEDS, QUICK_SEEDS = 24, 6
TARGET = 1e-2
REPEAT, BLOCK = 4, 8  # pixels
GROUPS = 5  # of runs
MOST = 2**31 - 1  # samples


class View(NamedTuple):
    """A scene, its rays and a G-buffer."""

    scene: Scene
    tracer: Tracer
    position: Array  # (3, h, w)
    normal: Array  # (3, h, w)
    triangle_id: Array  # (h, w)

    @property
    def seen(self) -> Array:
        return np.asarray(self.triangle_id >= 0)


def rows(quick: bool) -> Iterator[Row]:
    seconds, seeds = (QUICK_SECONDS, QUICK_SEEDS) if quick else (SECONDS, SEEDS)
    for name in SCENES:
        view, expected = view_of(frame(name), REPEAT), repeated(reference(name), REPEAT)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RefgiWarning)
            settings = settings_for(view, seconds)
            runs = [timed(view, dataclasses.replace(settings, seed=1 + seed)) for seed in range(seeds)]
        yield from rows_of(f"{name}, P = {EXPONENTS[name]}", expected, view.seen, runs, seconds)


def repeated(plane: Array, times: int) -> Array:
    """Return each pixel `times` x `times` times."""
    return plane.repeat(times, axis=-2).repeat(times, axis=-1)


def view_of(found: Frame, times: int = 1) -> View:
    buffer = found.gbuffer
    return View(found.scene, found.tracer, *(repeated(np.asarray(plane), times)
                                             for plane in (buffer.position, buffer.normal, buffer.triangle_id)))


def settings_for(view: View, seconds: float) -> TruthSettings:
    """Return settings of as many passes as the default makes in a time."""
    found = accumulate(*view, TruthSettings(samples=MOST, seconds=seconds))
    return TruthSettings(samples=int(found.samples.max()))


def timed(view: View, settings: TruthSettings) -> tuple[float, TruthResult]:
    """Return how long a run takes, s, and what it finds."""
    started = time.perf_counter()
    found = accumulate(*view, settings)
    return time.perf_counter() - started, found


def weights(expected: Array, seen: Array) -> Array:
    """Return 1 / (r^2 + (0.1 mean r)^2) where a surface is seen, (3, h, w), 0 elsewhere."""
    mean = expected[:, seen].mean() if seen.any() else 0.0
    return np.asarray(seen / np.maximum(expected**2 + (0.1 * mean) ** 2, 1e-300))


def relative_mse(picture: Array, expected: Array, seen: Array) -> float:
    return float(((picture - expected) ** 2 * weights(expected, seen)).sum() / (3 * seen.sum()))


def in_blocks(picture: Array, seen: Array) -> Array:
    """Return means (3, n) over the blocks that see a surface."""
    row, column = (index // BLOCK for index in np.nonzero(seen))
    block = row * (seen.shape[1] // BLOCK + 1) + column
    counts = np.bincount(block)
    sums = np.stack([np.bincount(block, plane) for plane in picture[:, seen]])
    return np.asarray((sums / np.maximum(counts, 1))[:, counts > 0])


def rows_of(name: str, expected: Array, seen: Array, runs: list[tuple[float, TruthResult]],
            seconds: float) -> Iterator[Row]:
    took = float(np.median([t for t, _ in runs]))
    found = [result for _, result in runs]
    note = f"{len(runs)} runs of {found[0].passes} passes in {took:.2f} s"
    blocks = in_blocks(expected, seen)
    squares = np.mean([(in_blocks(result.mean, seen) - blocks) ** 2 for result in found])
    error = 100 * math.sqrt(squares * took / seconds) / expected[:, seen].mean()
    yield Row(f"{name}: error of a block of 8x8 in {seconds:g} s", error, "%", "", note)
    each = np.array([relative_mse(result.mean, expected, seen) for result in found])
    spread = each.std(ddof=1) / math.sqrt(len(each)) / each.mean()
    yield Row(f"{name}: time to relMSE {TARGET:g}", took * each.mean() / TARGET, "s", "", f"+- {spread:.0%}; {note}")
    for level, ratio, error in claimed_over_true(expected, seen, found):
        yield Row(f"{name}: claimed over true variance, {level}", ratio, "", "", f"+- {error:.2f}")


def claimed_over_true(expected: Array, seen: Array, found: list[TruthResult]) -> Iterator[tuple[str, float, float]]:
    """Yield level, ratio and its standard error: the median over GROUPS of runs of what they claim, over what is true.

    Not their mean: a rare large term enters both alike, whatever all other runs claim without it.
    """
    mean = expected[:, seen].mean()
    covered = found[0].block_pixels > 0
    levels = (("pixel", expected[:, seen], "mean", "variance_of_mean", seen),
              ("block", in_blocks(expected, seen), "block_mean", "block_variance", covered),
              ("picture", expected[:, seen].mean(axis=1, keepdims=True), "picture_mean", "picture_variance", None))
    for level, truth, value, variance, where in levels:
        weight = 1 / (truth**2 + (0.1 * mean) ** 2)
        got, stated = ([np.asarray(getattr(run, field))[:, where] if where is not None else getattr(run, field)[:, None]
                        for run in found] for field in (value, variance))
        true = np.array([((one - truth) ** 2 * weight).sum() for one in got])
        claimed = np.array([(one * weight).sum() for one in stated])
        typical = np.median([part.mean() for part in np.array_split(claimed, GROUPS)])
        spread = [values.std(ddof=1) / math.sqrt(len(found)) / middle
                  for values, middle in ((true, true.mean()), (claimed, claimed.mean()))]
        ratio = float(typical / true.mean())
        yield level, ratio, ratio * math.hypot(*spread)
