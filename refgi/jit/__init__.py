"""Compile kernels: the project's one set of Numba options, loops on all threads, and the cache on disk.

Kernels are compiled with strict IEEE arithmetic: no fastmath, no contraction of multiply and add, division by zero
gives infinity instead of a branch. That costs little when pixels are the SIMD lanes, and it makes results equal to
the bit for every thread count and on every machine with the same arithmetic.

A kernel that is called from Python is optimised, made native and kept on disk. A kernel that is called from another
kernel is only lowered, and optimised by itself where it has loops; the rest happens as a part of its caller.
"""

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar, overload

import numba

from refgi.jit.bands import in_bands, most_threads, threads
from refgi.jit.cache import cache_root
from refgi.jit.dispatch import Kernel, by_type, has_wide_registers
from refgi.jit.launcher import thread_count

__all__ = ["Kernel", "by_type", "cache_root", "has_wide_registers", "kernel", "most_threads", "prange",
           "thread_count", "threads"]

P = ParamSpec("P")
R = TypeVar("R")

prange = numba.prange


@overload
def kernel(function: Callable[P, R], /) -> Callable[P, R]: ...
@overload
def kernel(*, parallel: bool = ...) -> Callable[[Callable[P, R]], Callable[P, R]]: ...


def kernel(function: Callable[..., Any] | None = None, /, *, parallel: bool = False) -> Any:
    """Compile a function on arrays with the project's one set of Numba options; it must not raise.

    Parameters
    ----------
    function : callable
        The function; absent when options are given.
    parallel : bool
        Run its loop over `prange`, with which it ends, on all threads. Each iteration owns what it writes.

    Returns
    -------
    callable
        The compiled function, with the signature of `function`.
    """

    def compile_later(plain: Callable[P, R]) -> Callable[P, R]:
        config: Any = numba.config
        if config.DISABLE_JIT:
            return plain
        return Kernel(plain, (lambda: in_bands(plain)) if parallel else None)

    return compile_later if function is None else compile_later(function)
