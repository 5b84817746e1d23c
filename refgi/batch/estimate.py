"""What a batch will take: each choice run on two small pictures, its time continued in a straight line of the pixels.

One run at each size comes before the timed one, for its kernels. What does not grow with the picture, RSMs above all,
is in the part that two sizes tell apart; noise of the clock never makes a time fall with the size.
"""

import contextlib
import time
import warnings
from collections.abc import Sequence
from typing import Any, NamedTuple

from refgi.batch.jobs import Job, reference_settings, scene_at
from refgi.batch.shared import Common, Tell
from refgi.bench.grid import TRUTH
from refgi.errors import RefgiError, RefgiWarning
from refgi.frame import Frame
from refgi.methods import METHODS

SIZES = (64, 128)  # pixels along a side


class Estimate(NamedTuple):
    """Time of the jobs of a batch, all threads at work on one after the other."""

    seconds: float  # of all jobs
    truth_seconds: float  # of the truths, one a frame


def estimate(jobs: Sequence[Job], common: Common, tell: Tell) -> Estimate:
    """Estimate the time of jobs by measuring each choice on the first frame of each scene.

    A choice that gives no picture there counts nothing.
    """
    known: dict[Any, float] = {}
    seconds, truths, seen = 0.0, 0.0, set()
    for number, job in enumerate(jobs):
        tell(f"estimating {job.label}", number / len(jobs))
        key = job.shot.scene, job.choice
        if key not in known:
            known[key] = _seconds(job, job.choice.method, job.choice.settings, common)
        seconds += known[key] * (len(job.seeds) + 1)
        if job.shot not in seen:
            seen.add(job.shot)
            settings = reference_settings(common.truth, job.shot)
            truth = job.shot.scene, TRUTH
            if truth not in known:
                known[truth] = _seconds(job, TRUTH, settings, common)
            truths += known[truth]
    return Estimate(seconds, truths)


def _seconds(job: Job, method: str, settings: Any, common: Common) -> float:
    scene = scene_at(job.shot)
    times = []
    with warnings.catch_warnings(), contextlib.suppress(RefgiError):
        warnings.simplefilter("ignore", RefgiWarning)
        for size in SIZES:
            for _ in range(2):
                frame = Frame(scene, width=size, height=size, **common.options)
                started = time.perf_counter()
                METHODS[method].made(frame, settings)
                seconds = time.perf_counter() - started
            times.append(seconds)
    if len(times) < len(SIZES):
        return 0.0
    pixels = scene.camera.width * scene.camera.height
    small, large = (size * size for size in SIZES)
    slope = max(0.0, (times[1] - times[0]) / (large - small))
    return max(0.0, times[1] + slope * (pixels - large))
