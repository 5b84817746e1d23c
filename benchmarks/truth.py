"""Truth: rays per second inside the estimators against bare Embree, and time to a given error."""

import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from benchmarks.harness import Row, ratio
from refgi.frame import Frame
from refgi.rays import Tracer
from refgi.rays.embree import RunBackend
from refgi.scene import Geometry, load_scene
from refgi.truth import TruthSettings
from refgi.truth.passes import one_pass
from refgi.truth.result import add_pass, no_passes
from refgi.truth.settings import Estimator
from refgi.truth.task import Task
from refgi.truth.truth import task_of
from refgi.types import Array

ESTIMATORS: tuple[Estimator, ...] = ("hemisphere", "light", "combined")
TARGETS = (1e-2, 1e-3, 1e-4)
PIECE = 1 << 17  # rays a call of `run`


class Recorder(Tracer):
    """A tracer that keeps copies of the rays it is asked about."""

    def __init__(self, geometry: Geometry) -> None:
        super().__init__(geometry)
        self.nearest: list[tuple[Array, ...]] = []
        self.shadows: list[tuple[Array, ...]] = []

    def fill_closest(self, origins: Array, directions: Array, reach: Array, triangle_id: Array,
                     distance: Array) -> None:
        self.nearest.append(tuple(a[reach > 0].copy() for a in (origins, directions, reach)))
        super().fill_closest(origins, directions, reach, triangle_id, distance)

    def fill_occluded(self, origins: Array, directions: Array, reach: Array, blocked: Array) -> None:
        self.shadows.append(tuple(a[reach > 0].copy() for a in (origins, directions, reach)))
        super().fill_occluded(origins, directions, reach, blocked)


def rows(quick: bool) -> Iterator[Row]:
    size, scenes = (256, ("cornell_box",)) if quick else (512, ("cornell_box", "atrium:faces=100000"))
    for name in scenes:
        frame = Frame(load_scene(name), width=size, height=size)
        for estimator in ESTIMATORS:
            task = _task(frame, TruthSettings(estimator=estimator))
            yield _ray_rate(frame, task, name, 3 if quick else 5)
    frame = Frame(load_scene("cornell_box"), width=size, height=size)
    for estimator in ESTIMATORS:
        yield from _time_to_error(_task(frame, TruthSettings(estimator=estimator)), 4 if quick else 10)


def _task(frame: Frame, settings: TruthSettings) -> Task:
    buffer = frame.gbuffer
    return task_of(frame.scene, frame.tracer, buffer.position, buffer.normal, buffer.triangle_id, settings)


def _ray_rate(frame: Frame, task: Task, name: str, repeats: int) -> Row:
    """Time the rays of a pass alone, by embreex's run on two Python threads, against the whole pass."""
    recorder = Recorder(frame.scene.geometry)
    one_pass(task._replace(tracer=recorder), 0)
    scene = RunBackend(frame.scene.geometry.vertices, frame.scene.geometry.faces)._scene
    count = sum(len(batch[0]) for batch in (*recorder.nearest, *recorder.shadows))
    # contiguous pieces made beforehand, ids or hit flags alone: nothing but `run` is timed
    jobs = [(query, *(np.ascontiguousarray(part[i : i + PIECE]) for part in batch))
            for query, batches in (("INTERSECT", recorder.nearest), ("OCCLUDED", recorder.shadows))
            for batch in batches for i in range(0, len(batch[0]), PIECE)]
    pool = ThreadPoolExecutor(2)

    def bare() -> None:
        list(pool.map(lambda job: scene.run(job[1], job[2], dists=job[3], query=job[0]), jobs))

    found = ratio(bare, lambda: one_pass(task, 0), repeats)
    note = f"{count / found.seconds_b / 1e6:.1f} M rays/s, bare {count / found.seconds_a / 1e6:.1f}"
    return Row(f"{task.settings.estimator}, {name}: ray rate over bare embreex's", found.median, "", ">= 0.8", note)


def _time_to_error(task: Task, passes: int) -> Iterator[Row]:
    """Take relMSE from the spread of passes: it falls as 1 / passes, as the estimators are unbiased."""
    moments, seconds = no_passes(len(task.receivers.pixel)), []
    one_pass(task, passes)
    for number in range(passes):
        started = time.perf_counter()
        add_pass(moments, one_pass(task, number))
        seconds.append(time.perf_counter() - started)
    mean = moments.mean
    each = (moments.variance_of_mean * passes / (mean**2 + (0.1 * mean.mean()) ** 2)).mean()
    for target in TARGETS:
        aim = "<= 1" if (target, task.settings.estimator) == (1e-2, "combined") else ""
        needed = float(np.median(seconds) * each / target)
        yield Row(f"{task.settings.estimator}: time to relMSE {target:g}, all pixels", needed, "s", aim,
                  f"{each:.3g} a pass of {np.median(seconds):.2f} s")

