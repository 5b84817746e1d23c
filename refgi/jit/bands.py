"""Run the loop of a parallel kernel in bands, on all threads.

A parallel kernel ends with `for i in prange(n)`, each iteration of which owns what it writes, so the result has the
same bits for every number of threads. Numba's own parallel loops compile their body twice and take 0.65 s more each.
Here the loop becomes a serial kernel `band(first, last, ...)` that is compiled once, and a small worker, the same for
every kernel, claims band after band until none is left.
"""

import ast
import copy
import inspect
import textwrap
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numba
from llvmlite import ir
from numba import types
from numba.core import cgutils as untyped_cgutils
from numba.extending import intrinsic

from refgi.jit.dispatch import Kernel
from refgi.jit.launcher import BYTES, INT, emit_launch, start_threads, thread_count

cgutils: Any = untyped_cgutils

BANDS_PER_THREAD = 4  # so that a thread with cheap iterations takes over some of one with dear ones
FIRST, LAST, LAUNCH, BAND, COUNTED = "first_", "last_", "launch_", "band_", "count_"  # names in the functions made

NEXT, COUNT, SIZE, FAILED, FIRST_ARGUMENT = range(5)  # fields of the record that threads share


@contextmanager
def threads(count: int | None) -> Iterator[None]:
    """Run parallel kernels on `count` threads inside the block (None: leave as is).

    Parameters
    ----------
    count : int or None
        Threads, 1 to the number Numba started with.
    """
    before = thread_count()
    try:
        if count is not None:
            numba.set_num_threads(count)
        yield
    finally:
        numba.set_num_threads(before)


def most_threads() -> int:
    """Return on how many threads kernels of this process can run.

    Returns
    -------
    int
        As many as Numba started with.
    """
    config: Any = numba.config
    return int(config.NUMBA_NUM_THREADS)


def in_bands(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function of the same parameters that does what a parallel kernel says, by calls of serial kernels.

    It counts the iterations and launches a kernel on bands of them. Raises TypeError unless `function` has one loop
    over `prange` and ends with it.
    """
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    ast.increment_lineno(tree, function.__code__.co_firstlineno - 1)
    plain: Any = tree.body[0]
    loop = plain.body[-1]
    if not _is_parallel(loop) or sum(map(_is_parallel, ast.walk(plain))) != 1:
        raise TypeError(f"{function.__qualname__}: a parallel kernel has one loop over prange and ends with it")
    names = [argument.arg for argument in plain.args.args]
    given = ast.Tuple([ast.Name(name, ast.Load()) for name in names], ast.Load())
    before, count = plain.body[:-1], loop.iter.args[0]
    loop.iter = ast.parse(f"range({FIRST}, {LAST})", mode="eval").body
    whole = ast.parse(f"{LAUNCH}({BAND}, {COUNTED}({', '.join(names)}), {ast.unparse(given)})").body
    functions = [_define(BAND, [FIRST, LAST, *names], [*before, loop]),
                 _define(COUNTED, names, [*before, ast.Return(count)]),
                 _define(function.__name__, names, whole)]
    module = ast.fix_missing_locations(ast.Module(functions, []))
    cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
    known = function.__globals__ | {name: cell.cell_contents for name, cell in cells}
    exec(compile(module, function.__code__.co_filename, "exec"), known)
    for made in functions:
        known[made.name].__module__ = function.__module__
    result: Callable[..., Any] = known[function.__name__]
    result.__defaults__, result.__qualname__ = function.__defaults__, function.__qualname__
    known[LAUNCH], known[BAND], known[COUNTED] = launch, Kernel(known[BAND]), Kernel(known[COUNTED])
    return result


def _is_parallel(node: ast.AST) -> bool:
    return isinstance(node, ast.For) and isinstance(node.iter, ast.Call) and ast.unparse(node.iter.func) == "prange"


def _define(name: str, parameters: list[str], body: list[Any]) -> Any:
    made: Any = ast.parse(f"def {name}({', '.join(parameters)}): pass").body[0]
    made.body = copy.deepcopy(body)
    return made


def _launch(_: Any, function: Any, count: Any, arguments: Any) -> Any:
    """Type and emit a call of `function(first, last, *arguments)` for bands that make up 0 to `count`."""
    kept = tuple(map(types.unliteral, arguments.types))
    result = function.dispatcher.lowered((types.intp, types.intp, *kept))

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        start_threads()
        context.active_code_library._reload_init.add(start_threads)
        context.add_linking_libs([result.library])
        record = ir.LiteralStructType([INT, INT, INT, INT, *map(context.get_value_type, kept)])
        shared = cgutils.alloca_once(builder, record)
        _, count, packed = values
        wanted = context.cast(builder, count, signature.args[1], types.intp)
        workers = builder.call(cgutils.get_or_insert_function(builder.module, ir.FunctionType(INT, []),
                                                              "get_num_threads"), [])
        size = _size_of_bands(builder, wanted, workers)
        fields = [INT(0), wanted, size, INT(0)]
        for i, (given, type_) in enumerate(zip(arguments.types, kept, strict=True)):
            fields.append(context.cast(builder, builder.extract_value(packed, i), given, type_))
        for i, value in enumerate(fields):
            builder.store(value, cgutils.gep_inbounds(builder, shared, 0, i))
        worker = _worker(context, builder, record, result.fndesc)
        emit_launch(builder, worker, builder.bitcast(shared, BYTES), builder.icmp_signed("<", size, wanted), workers)
        failed = builder.load(cgutils.gep_inbounds(builder, shared, 0, FAILED))
        with builder.if_then(builder.icmp_signed("!=", failed, INT(0)), likely=False):
            context.call_conv.return_user_exc(builder, MemoryError, ("a kernel failed in one of its bands",))
        return context.get_dummy_value()

    return types.none(function, count, arguments), generate


launch: Any = intrinsic(_launch)


def _size_of_bands(builder: Any, count: Any, workers: Any) -> Any:
    """Emit the iterations of a band: all on one thread, else a share of a thread's part, 1 at least."""
    parts = builder.mul(workers, INT(BANDS_PER_THREAD))
    share = builder.sdiv(builder.add(count, builder.sub(parts, INT(1))), parts)
    share = builder.select(builder.icmp_signed("<", share, INT(1)), INT(1), share)
    return builder.select(builder.icmp_signed("<=", workers, INT(1)), count, share)


def _worker(context: Any, builder: Any, record: Any, called: Any) -> Any:
    """Emit the function that a thread runs: it claims bands from the shared record until none is left."""
    kind = ir.FunctionType(ir.VoidType(), [BYTES.as_pointer(), INT.as_pointer(), INT.as_pointer(), BYTES])
    function = ir.Function(builder.module, kind, builder.module.get_unique_name(f"{builder.function.name}.worker"))
    function.linkage = "internal"
    function.attributes.add("noinline")
    start, claim, work, done = (function.append_basic_block(name) for name in ("start", "claim", "work", "done"))
    inner = ir.IRBuilder(start)
    shared = inner.bitcast(function.args[3], record.as_pointer())

    def field(i: int) -> Any:
        return cgutils.gep_inbounds(inner, shared, 0, i)

    values = [inner.load(field(i)) for i in range(FIRST_ARGUMENT, len(record.elements))]
    count, size = inner.load(field(COUNT)), inner.load(field(SIZE))
    inner.branch(claim)
    inner.position_at_end(claim)
    first = inner.atomic_rmw("add", field(NEXT), size, "monotonic")
    inner.cbranch(inner.icmp_signed("<", first, count), work, done)
    inner.position_at_end(work)
    after = inner.add(first, size)
    last = inner.select(inner.icmp_signed("<", after, count), after, count)
    callee = context.declare_function(builder.module, called)
    status, _ = context.call_conv.call_function(inner, callee, called.restype, called.argtypes, [first, last, *values])
    with inner.if_then(status.is_error, likely=False):
        inner.store(INT(1), field(FAILED))
    inner.branch(claim)
    inner.position_at_end(done)
    inner.ret_void()
    return function
