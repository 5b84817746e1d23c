"""Planes of pixels in memory that is lent out again once no array holds it.

Pages that the system hands out anew must be cleared by it, one thread at a time, at about 0.2 ms a MB: more than what
most kernels here take to fill them. So the memory of an earlier frame's planes serves the next frame's.
"""

import math
import threading
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

PAGE = 4096  # bytes
SMALL = 1 << 18  # bytes; less than this is left to NumPy
KEPT = 1 << 28  # bytes that may wait for a next use; a frame of 1024 x 1024 pixels takes about 100 MB


class _Lender:
    """Blocks of memory that wait for a next use."""

    def __init__(self) -> None:
        self._idle: dict[int, list[Array]] = {}  # by size
        self._lock = threading.RLock()  # a block may come back in the midst of anything

    def take(self, size: int) -> Array:
        """Return a block of `size` bytes, its pages there."""
        with self._lock:
            waiting = self._idle.get(size)
            if waiting:
                return waiting.pop()
        block = np.empty(size, np.uint8)
        block[::PAGE] = 0  # pages first touched by several threads at once cost several times as much
        return block

    def give_back(self, block: Array) -> None:
        """Keep a block for its next use, unless there are enough."""
        with self._lock:
            if block.nbytes + sum(size * len(blocks) for size, blocks in self._idle.items()) > KEPT:
                self._idle.clear()
            self._idle.setdefault(block.nbytes, []).append(block)


class _Lease:
    """A block as NumPy sees it: the base of every array on it, alive as long as any of them."""

    def __init__(self, lender: _Lender, block: Array) -> None:
        self._lender, self._block = lender, block
        self.__array_interface__ = block.__array_interface__

    def __del__(self) -> None:
        self._lender.give_back(self._block)


_lender = _Lender()


def plane(shape: tuple[int, ...], dtype: npt.DTypeLike) -> Array:
    """Return an array whose content is yet to be written.

    Parameters
    ----------
    shape : tuple of int
        Its shape.
    dtype : dtype
        Its type.

    Returns
    -------
    ndarray
        C-contiguous, of any content. Each of its pages was touched before.
    """
    size = math.prod(shape) * np.dtype(dtype).itemsize
    if size < SMALL:
        return np.empty(shape, dtype)
    return np.asarray(_Lease(_lender, _lender.take(size))).view(dtype).reshape(shape)
