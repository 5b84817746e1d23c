"""How the bands of a kernel come to Numba's threads: one record in memory that every kernel of the process reads.

A kernel runs its bands by itself where the record has no threads: in a process that was forked off after they were
started, where they do not exist any more and OpenMP would end the process. Numba's `workqueue` takes one caller at a
time and aborts at a second; there the first kernel has the threads, and others run by themselves meanwhile.

Threads spin for some microseconds between loops and then sleep. OpenMP's default is to spin for milliseconds, which
takes the core of the thread that is waited for where each has none of its own: beside a busy process, or several
processes at once (docs/frames).
"""

import contextlib
import ctypes
import os
from typing import Any

import llvmlite.binding
import numba
from llvmlite import ir
from numba.core import cgutils as untyped_cgutils
from numba.np.ufunc import parallel as untyped_parallel

from refgi.errors import InputError

cgutils: Any = untyped_cgutils
threading: Any = untyped_parallel

SYMBOL = "refgi_launcher"
SPINS = "3000"  # looks at what is waited for before a thread sleeps
BYTES = ir.IntType(8).as_pointer()
INT = ir.IntType(64)
PARALLEL_FOR, EXCLUSIVE, BUSY = range(3)  # fields of the record
RECORD = ir.LiteralStructType([BYTES, INT, INT])
CALLED = ir.FunctionType(ir.VoidType(), [BYTES] * 5 + [INT] * 3)  # `numba_parallel_for`


class Launcher(ctypes.Structure):
    """The record: the function that runs a worker on all threads, or null; whether it takes one caller at a time."""

    _fields_ = (("parallel_for", ctypes.c_void_p), ("exclusive", ctypes.c_int64), ("busy", ctypes.c_int64))


_launcher = Launcher()
_forked: list[int] = []  # processes that have lost the threads of the one they come from


def start_threads() -> None:
    """Start Numba's threads and make the record known to LLVM.

    Raises InputError if the threading layer that NUMBA_THREADING_LAYER asks for is not there.
    """
    if not _launcher.parallel_for and not _forked:
        if "OMP_WAIT_POLICY" not in os.environ:
            os.environ.setdefault("GOMP_SPINCOUNT", SPINS)  # read when OpenMP is loaded, which is now
        try:
            threading._launch_threads()
        except ValueError as error:
            layer = os.environ.get("NUMBA_THREADING_LAYER", "default")
            why = str(error).partition("\n")[0].rstrip(".")
            raise InputError(f"NUMBA_THREADING_LAYER: expected a threading layer that is installed, got {layer!r}: "
                             f"{why}", key="NUMBA_THREADING_LAYER") from error
        _launcher.exclusive = threading.threading_layer() == "workqueue"
        _launcher.parallel_for = llvmlite.binding.address_of_symbol("numba_parallel_for")
    llvmlite.binding.add_symbol(SYMBOL, ctypes.addressof(_launcher))


def thread_count() -> int:
    """Return on how many threads a kernel that is called now runs.

    Returns
    -------
    int
        1 in a process that was forked off after threads were started.
    """
    start_threads()
    return 1 if _forked else int(numba.get_num_threads())


def _lose_threads() -> None:
    """Note in a process just forked off that the threads of its parent are not there, if it had some."""
    if threading._is_initialized:
        _forked.append(os.getpid())
        _launcher.parallel_for = None


with contextlib.suppress(AttributeError):  # a platform without fork
    os.register_at_fork(after_in_child=_lose_threads)


def emit_launch(builder: Any, worker: Any, data: Any, several: Any, workers: Any) -> None:
    """Emit the call of a worker with the record of its bands: on all threads, or by this thread alone.

    `worker` takes four pointers, the last of them `data`, the record's address, and claims bands until none is left.
    `several`: whether there are several bands; `workers`: the number of threads.
    """
    launcher = cgutils.add_global_variable(builder.module, RECORD, SYMBOL) if (
        SYMBOL not in builder.module.globals) else builder.module.globals[SYMBOL]

    def field(i: int) -> Any:
        return cgutils.gep_inbounds(builder, launcher, 0, i)

    parallel_for = builder.load(field(PARALLEL_FOR))
    exclusive = builder.icmp_signed("!=", builder.load(field(EXCLUSIVE)), INT(0))
    there = cgutils.is_not_null(builder, parallel_for)
    wanted = builder.and_(builder.and_(several, there), builder.icmp_signed(">", workers, INT(1)))
    taken = cgutils.alloca_once_value(builder, ir.IntType(1)(0))
    with builder.if_then(builder.and_(wanted, exclusive)):
        before = builder.atomic_rmw("xchg", field(BUSY), INT(1), "acquire")
        builder.store(builder.icmp_signed("!=", before, INT(0)), taken)
    with builder.if_else(builder.and_(wanted, builder.not_(builder.load(taken)))) as (on_all, alone):
        with on_all:
            bases, steps, counts = (cgutils.alloca_once(builder, type_) for type_ in (BYTES, INT, INT))
            builder.store(BYTES(None), bases)
            builder.store(INT(1), steps)
            builder.store(workers, counts)
            pointers = [builder.bitcast(pointer, BYTES) for pointer in (worker, bases, counts, steps)]
            builder.call(builder.bitcast(parallel_for, CALLED.as_pointer()),
                         [*pointers, data, INT(0), INT(1), workers])
            with builder.if_then(exclusive):
                builder.store_atomic(INT(0), field(BUSY), "release", 8)
        with alone:
            builder.call(worker, [BYTES.as_pointer()(None), INT.as_pointer()(None), INT.as_pointer()(None), data])
