"""Buffer pool for frame-sized arrays: memory is reused once no array refers to it.

The operating system clears new pages, one thread at a time, at about 0.2 ms a MB: more than most kernels here take to
fill them. So the memory of an earlier frame's buffers serves the next frame's.
"""

import math
import os
import threading

import numpy as np
import numpy.typing as npt

from refgi.types import Array

PAGE = 4096  # bytes
SMALL = 1 << 18  # bytes; smaller arrays are left to NumPy
STEPS = 5  # a block is up to 2^(1 - STEPS) larger than what is asked for


def most_idle() -> int:
    """Return how many bytes the pool keeps: a sixteenth of the machine's memory, 256 MB at least.

    A frame of 1024 x 1024 pixels takes about 100 MB, one of 4096 x 4096 sixteen times as much.
    """
    try:
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):  # a system that does not tell
        memory = 0
    return max(1 << 28, memory // 16)


MOST_IDLE = most_idle()


class _Pool:
    """Blocks of memory that wait for their next use."""

    def __init__(self) -> None:
        self._idle: dict[int, list[Array]] = {}  # by size
        self._lock = threading.RLock()  # a block may be released at any time

    def acquire(self, size: int) -> Array:
        """Return a block of `size` bytes, all its pages mapped."""
        with self._lock:
            idle = self._idle.get(size)
            if idle:
                return idle.pop()
        block = np.empty(size, np.uint8)
        block[::PAGE] = 0  # pages first touched by several threads at once cost several times as much
        return block

    def release(self, block: Array) -> None:
        """Keep a block for its next use; the pool is emptied first where it would grow too large."""
        with self._lock:
            if block.nbytes + sum(size * len(blocks) for size, blocks in self._idle.items()) > MOST_IDLE:
                self._idle.clear()
            self._idle.setdefault(block.nbytes, []).append(block)


class _PooledBlock:
    """A block as NumPy sees it: the base of every array on it, released with the last of them."""

    def __init__(self, pool: _Pool, block: Array) -> None:
        self._pool, self._block = pool, block
        self.__array_interface__ = block.__array_interface__

    def __del__(self) -> None:
        self._pool.release(self._block)


_pool = _Pool()


def plane(shape: tuple[int, ...], dtype: npt.DTypeLike) -> Array:
    """Allocate an uninitialised array from the pool; C-contiguous, of any content."""
    size = math.prod(shape) * np.dtype(dtype).itemsize
    if size < SMALL:
        return np.empty(shape, dtype)
    step = 1 << (size.bit_length() - STEPS)  # whole steps: lists that are a little longer or shorter in the next frame
    block = _pool.acquire(-(-size // step) * step)
    return np.asarray(_PooledBlock(_pool, block))[:size].view(dtype).reshape(shape)


def zeros(shape: tuple[int, ...], dtype: npt.DTypeLike) -> Array:
    """Allocate an array of zeros from the pool; C-contiguous."""
    array = plane(shape, dtype)
    array[...] = 0
    return array
