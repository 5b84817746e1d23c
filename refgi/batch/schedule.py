"""Jobs spread over processes of this machine or over machines, and what they will take.

A worker that dies, by the system or by a fault of compiled code, takes no other job along: on one machine those that
may have ended it run again, each in a process of its own; over machines dask gives its chunk to another one.
"""

import contextlib
import math
import time
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from importlib import import_module
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

from refgi.batch.jobs import Job, reference_settings, scene_at
from refgi.batch.outcome import failed, is_done, write_outcome
from refgi.batch.shared import Common, within
from refgi.batch.work import Chunk, forget, run_chunk
from refgi.bench.grid import TRUTH
from refgi.errors import InputError, RefgiError, RefgiWarning
from refgi.frame import Frame
from refgi.methods import METHODS
from refgi.processes import pool
from refgi.types import Tell

SECONDS_BETWEEN_LOOKS = 0.5
DIED = "its process died: out of memory, or a fault of compiled code"

Written = Callable[[], None]


def chunks_of(jobs: Sequence[Job], common: Common, workers: int) -> list[Chunk]:
    """Cut jobs into chunks: a frame each, parts of one if workers are more, a filter's frames in their order."""
    alone = [list(group) for _, group in groupby((job for job in jobs if job.temporal is None), lambda job: job.shot)]
    ways: dict[object, list[Job]] = {}
    for job in jobs:
        if job.temporal is not None:
            ways.setdefault((job.shot.scene, job.choice), []).append(job)
    parts = math.ceil(workers / max(1, len(alone) + len(ways)))
    cut = [group[part::parts] for group in alone for part in range(min(parts, len(group)))]
    return [Chunk(tuple(group), common) for group in (*cut, *ways.values())]


def run_here(chunks: Sequence[Chunk], tell: Tell, written: Written) -> None:
    """Do chunks in this process; `written` is called after each."""
    total, before = sum(len(chunk.jobs) for chunk in chunks), 0
    for chunk in chunks:
        run_chunk(chunk, within(tell, before / total, len(chunk.jobs) / total))
        before += len(chunk.jobs)
        written()
    forget()


def run_in_processes(chunks: Sequence[Chunk], workers: int, tell: Tell, written: Written) -> None:
    """Do chunks in several processes of this machine; `written` is called after each."""
    waiting = list(chunks)
    while waiting:
        try:
            with pool(workers) as processes:
                follow([(chunk, processes.submit(run_chunk, chunk)) for chunk in waiting], tell, written)
                return
        except BrokenExecutor:
            waiting = unfinished(waiting)
            for chunk in waiting[:workers]:  # in order: whoever worked was among the first
                _alone(chunk._replace(jobs=chunk.jobs[:1]))
            waiting = unfinished(waiting)


def follow(
    running: Sequence[tuple[Chunk, "Future[int]"]], tell: Tell, written: Written,
    died: Callable[[Chunk, BaseException], "Future[int] | None"] | None = None,
) -> None:
    """Wait for submitted chunks and say how many jobs are done; `died` gives what runs in place of one that ended."""
    of = {future: chunk for chunk, future in running}
    total = sum(len(chunk.jobs) for chunk in of.values())
    open_ = set(of)
    while open_:
        ended, open_ = wait(open_, SECONDS_BETWEEN_LOOKS, FIRST_COMPLETED)
        for future in ended:
            error = future.exception()
            if error is not None and died is None:
                raise error
            if error is not None and died is not None and (again := died(of[future], error)) is not None:
                of[again] = of[future]
                open_.add(again)
            written()
        left = sum(len(chunk.jobs) for chunk in unfinished([of[future] for future in open_]))
        tell(f"{total - left} of {total} jobs", (total - left) / max(1, total))


def unfinished(chunks: Sequence[Chunk]) -> list[Chunk]:
    """Return what is left of chunks, their jobs without a result, without those of which nothing is left."""
    left = [chunk._replace(jobs=tuple(job for job in chunk.jobs if not is_done(chunk.common.folder, job)))
            for chunk in chunks]
    return [chunk for chunk in left if chunk.jobs]


def fail_first(chunk: Chunk) -> None:
    """Write down that the first job of a chunk ended its process."""
    write_outcome(chunk.common.folder, failed(chunk.jobs[0], DIED))


def _alone(chunk: Chunk) -> None:
    try:
        with pool(1) as processes:
            processes.submit(run_chunk, chunk).result()
    except BrokenExecutor:
        fail_first(chunk)


SCHEME = "dask:"
SECONDS_TO_ANSWER = 10


def run_on_cluster(address: str, jobs: Sequence[Job], common: Common, tell: Tell, written: Written) -> None:
    """Do jobs on the workers of a scheduler such as ``tcp://10.0.0.1:8786``, which see all scenes and folders."""
    try:
        distributed: Any = import_module("distributed")
    except ImportError as error:
        raise InputError("--executor: expected the extra refgi[distributed], got none installed",
                         key="--executor") from error
    try:
        client = distributed.Client(address, timeout=SECONDS_TO_ANSWER)
    except (OSError, ValueError) as error:
        raise InputError(f"--executor: expected a scheduler at {address}, got {error}", key="--executor") from error
    with client:
        executor = client.get_executor(pure=False)

        def died(chunk: Chunk, error: BaseException) -> "Future[int] | None":
            if not isinstance(error, distributed.KilledWorker):
                raise error
            left = unfinished([chunk])
            if left:
                fail_first(left[0])
            left = unfinished(left)
            return executor.submit(run_chunk, left[0]) if left else None

        chunks = chunks_of(jobs, common, len(client.scheduler_info(n_workers=-1)["workers"]))
        follow([(chunk, executor.submit(run_chunk, chunk)) for chunk in map(absolute, chunks)], tell, written, died)


def absolute(chunk: Chunk) -> Chunk:
    """Return a chunk whose folders have the same names from wherever they are looked for."""
    common = chunk.common._replace(folder=chunk.common.folder.resolve(), store=chunk.common.store.resolve())
    return chunk._replace(common=common, working_folder=str(Path(chunk.working_folder).resolve()))


SIZES = (64, 128)  # pixels along a side


class Estimate(NamedTuple):
    """Time of the jobs of a batch, all threads at work on one after the other."""

    seconds: float  # of all jobs
    truth_seconds: float  # of the truths, one a frame


def estimate(jobs: Sequence[Job], common: Common, tell: Tell) -> Estimate:
    """Estimate the time of jobs by running each choice on each scene's first frame; without a picture it is 0."""
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
