"""Jobs spread over machines by dask.distributed, whose workers share the folder of the batch.

A worker that dies loses what it was at; dask gives its chunk to another one, which goes on after the jobs that have a
result. A job that ends several workers has failed.
"""

from collections.abc import Sequence
from concurrent.futures import Future
from importlib import import_module
from pathlib import Path
from typing import Any

from refgi.batch.jobs import Job
from refgi.batch.schedule import Written, chunks_of, fail_first, follow, unfinished
from refgi.batch.shared import Common, Tell
from refgi.batch.work import Chunk, run_chunk
from refgi.errors import InputError

SCHEME = "dask:"
SECONDS_TO_ANSWER = 10


def run_on_cluster(address: str, jobs: Sequence[Job], common: Common, tell: Tell, written: Written) -> None:
    """Do jobs, those of one frame side by side, on the workers of a scheduler, such as ``tcp://10.0.0.1:8786``.

    Scenes and folders are there on every worker; `written` is called after each chunk. InputError if dask.distributed
    is not installed or nobody answers at the address.
    """
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
