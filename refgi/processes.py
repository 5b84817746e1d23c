"""Processes that work for this one."""

import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import Pipe, get_context
from multiprocessing.connection import Connection
from typing import Any


@contextmanager
def pool(workers: int, begin: Callable[[Any], None] | None = None, given: Any = None) -> Iterator[Executor]:
    """Start processes that end at once when this one does, however it ends, and when the block is left by an error.

    Each calls `begin` with what is `given` first.
    """
    reader, writer = Pipe(duplex=False)
    made = ProcessPoolExecutor(workers, get_context("spawn"), _begin, (reader, begin, given))
    try:
        yield made
    except BaseException:
        writer.close()
        raise
    finally:
        made.shutdown(cancel_futures=True)
        writer.close()
        reader.close()


def _begin(parent: Connection, begin: Callable[[Any], None] | None, given: Any) -> None:
    """End this process when the other end of a pipe is closed; leave interrupts to the process that holds it."""
    def watch() -> None:
        parent.poll(None)
        os._exit(1)

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=watch, daemon=True).start()
    if begin is not None:
        begin(given)
