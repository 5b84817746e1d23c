"""Jobs spread over processes of this machine, so that a process keeps to a frame and what its jobs share.

A worker that dies, by the system or by a fault of compiled code, takes no other job along: the jobs that may have ended
it run again, each in a process of its own, and one that ends that too has failed.
"""

import math
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from itertools import groupby
from multiprocessing import Pipe, get_context
from multiprocessing.connection import Connection

from refgi.batch.jobs import Job
from refgi.batch.outcome import failed, is_done, write_outcome
from refgi.batch.shared import Common, Tell, within
from refgi.batch.work import Chunk, forget, run_chunk

SECONDS_BETWEEN_LOOKS = 0.5
DIED = "its process died: out of memory, or a fault of compiled code"

Written = Callable[[], None]


def chunks_of(jobs: Sequence[Job], common: Common, workers: int) -> list[Chunk]:
    """Cut jobs, those of one frame side by side, into chunks: a frame each, or parts of one each if workers are more.

    All frames of one method behind a temporal filter are one chunk, in the order of frames.
    """
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
            with _pool(workers) as pool:
                follow([(chunk, pool.submit(run_chunk, chunk)) for chunk in waiting], tell, written)
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
    """Wait for submitted chunks and say how many jobs are done; `written` is called after each.

    `died` is called with a chunk and what ended it; gives what runs in its place, or None where nothing is left of it.
    Without it, what ended a chunk is raised.
    """
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
        with _pool(1) as pool:
            pool.submit(run_chunk, chunk).result()
    except BrokenExecutor:
        fail_first(chunk)


@contextmanager
def _pool(workers: int) -> Iterator[Executor]:
    """Start processes that end at once when this one does, however it ends, and when the block is left by an error."""
    reader, writer = Pipe(duplex=False)
    pool = ProcessPoolExecutor(workers, get_context("spawn"), _end_with, (reader,))
    try:
        yield pool
    except BaseException:
        writer.close()
        raise
    finally:
        pool.shutdown(cancel_futures=True)
        writer.close()
        reader.close()


def _end_with(parent: Connection) -> None:
    """End this process when the other end of a pipe is closed; leave interrupts to the process that holds it."""
    def watch() -> None:
        parent.poll(None)
        os._exit(1)

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=watch, daemon=True).start()
