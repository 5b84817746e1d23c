"""--threads: how many threads compiled kernels run on."""

from contextlib import AbstractContextManager
from typing import Any

from refgi.errors import expect


def on_threads(count: int | None) -> AbstractContextManager[None]:
    """Run kernels on `count` threads inside the block.

    Parameters
    ----------
    count : int or None
        Threads; all where None.

    Returns
    -------
    context manager
        Restores the number at its end.

    Raises
    ------
    InputError
        If there are not so many.
    """
    import numba

    from refgi.jit import threads

    config: Any = numba.config
    most = config.NUMBA_NUM_THREADS
    expect(count is None or 1 <= count <= most, "--threads", f"1 to {most} (NUMBA_NUM_THREADS)", count)
    return threads(count)
