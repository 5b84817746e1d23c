"""Jobs spread over machines by dask.distributed, whose workers share the folder of the batch.

A worker that dies loses what it was at; dask gives its chunk to another one, which goes on after the jobs that have a
result. A job that ends several workers has failed.
"""

from collections.abc import Sequence

from refgi.batch.schedule import fail_first, follow, unfinished
from refgi.batch.shared import Tell
from refgi.batch.work import Chunk, run_chunk
from refgi.errors import InputError

SCHEME = "dask:"


def run_on_cluster(address: str, chunks: Sequence[Chunk], tell: Tell, written: "Written") -> None:
    """Do chunks on the workers of a scheduler.

    Parameters
    ----------
    address : str
        Of the scheduler, such as ``tcp://10.0.0.1:8786``.
    chunks : sequence of Chunk
        The jobs; their folders are there on every worker.
    tell : callable
        Called with (what runs, share done).
    written : callable
        Called after each chunk.

    Raises
    ------
    InputError
        If dask.distributed is not installed or nobody answers at the address.
    """
    pass
