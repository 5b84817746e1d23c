"""`Kernel`: a compiled function that is native code for Python and plain LLVM code for other kernels.

Numba makes native code of every compiled function, also of one that is only ever called from others, where it is
optimised and made native once more as a part of each. A `Kernel` therefore holds two dispatchers: itself, for calls
from Python, with the cache on disk, and a `Callee`, which types and lowers the function for its callers and leaves
the rest to them.

A call with arrays counts references, atomically, so that threads wait for each other. Of a borrowed array nothing is
counted; whoever lends it keeps it alive.
"""

import gc
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, ParamSpec, TypeVar

import llvmlite.binding
from numba.core import types
from numba.core.analysis import compute_cfg_from_blocks
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder, Flags
from numba.core.compiler_machinery import register_pass
from numba.core.imputils import impl_ret_untracked
from numba.core.registry import CPUDispatcher
from numba.core.target_extension import CPU, jit_registry
from numba.core.typed_passes import NativeLowering
from numba.extending import intrinsic
from numba.extending import overload as numba_overload
from numba.np.arrayobj import make_array

from refgi.jit.cache import OVERLOADS, KernelCache

WIDEST = "avx512f"
WIDE_VECTORS = '"prefer-vector-width"="512"'


def has_wide_registers() -> bool:
    """Return whether kernels are compiled for AVX-512, which masks out what lies beside a span at no cost.

    Returns
    -------
    bool
        Of the processor, unless NUMBA_CPU_NAME and NUMBA_CPU_FEATURES name another target.
    """
    features = os.environ.get("NUMBA_CPU_FEATURES")
    if features is not None:
        return f"+{WIDEST}" in features.split(",")
    if os.environ.get("NUMBA_CPU_NAME") not in (None, "host"):
        return False
    return bool(llvmlite.binding.get_host_cpu_features().get(WIDEST))


def _without_count(_: Any, array: Any) -> Any:
    """Type and emit the same array, owned by nobody."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kind = signature.args[0]
        lent = make_array(kind)(context, builder, value=arguments[0])
        lent.meminfo = context.get_constant_null(types.MemInfoPointer(kind.dtype))
        lent.parent = context.get_constant_null(types.pyobject)
        return impl_ret_untracked(context, builder, signature.return_type, lent._getvalue())

    return array(array), generate


borrowed: Any = intrinsic(_without_count)


P = ParamSpec("P")
R = TypeVar("R")

OPTIONS = {"nopython": True, "nogil": True, "fastmath": False, "error_model": "numpy", "boundscheck": None,
           "no_cfunc_wrapper": True}


class Library(JITCodeLibrary):
    """LLVM code whose loops take registers of 512 bits where there are such.

    Unless told so, LLVM takes 256 bits on processors that once ran slower with wider ones.
    """

    def add_ir_module(self, ir_module: Any) -> None:
        """Add a module, its functions marked."""
        for function in ir_module.functions:
            if function.blocks:
                set.add(function.attributes, WIDE_VECTORS)  # past llvmlite's list, which has no attributes with values
        super().add_ir_module(ir_module)

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout
        passes, builder = self._codegen._function_pass_manager()  # one for all: Numba builds one for each function
        for function in ll_module.functions:
            if not function.is_declaration:
                passes.run(function, builder)


class CalleeLibrary(Library):
    """LLVM code of a callee: linked into its callers, not made native by itself.

    Loops are optimised before that: as a part of a large caller the compiler would no longer find that their arrays do
    not overlap, and run them one number at a time. What has no loop is optimised in its callers alone.
    """

    has_loops = False

    def _optimize_final_module(self) -> None:
        if self.has_loops:
            super()._optimize_final_module()

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


class EntryPoint:
    """What stands for a callee's native code where Numba looks its implementation up."""


@register_pass(mutates_CFG=True, analysis_only=False)
class KernelLowering(NativeLowering):
    """Lower a function to LLVM code of a `Library`, and make it native."""

    _name = "kernel_lowering"

    def run_pass(self, state: Any) -> bool:
        """Lower."""
        state.library = Library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return bool(super().run_pass(state))


@register_pass(mutates_CFG=True, analysis_only=False)
class CalleeLowering(NativeLowering):
    """Lower a function to LLVM code without an interface to Python."""

    _name = "callee_lowering"

    def run_pass(self, state: Any) -> bool:
        """Lower, and register the result for callers."""
        state.library = CalleeLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.has_loops = bool(compute_cfg_from_blocks(state.func_ir.blocks).loops())
        state.flags.no_compile = state.flags.no_cpython_wrapper = state.flags.no_cfunc_wrapper = True
        super().run_pass(state)
        state.library.finalize()
        lowered = state["cr"]._replace(cfunc=EntryPoint())
        state.targetctx.insert_user_function(lowered.cfunc, lowered.fndesc, [state.library])
        state["cr"] = lowered
        return True


class KernelCompiler(CompilerBase):
    """Numba's usual passes, with a lowering of ours at their end."""

    lowering: type[NativeLowering] = KernelLowering

    def define_pipelines(self) -> list[Any]:
        """Return the one pipeline."""
        manager = DefaultPassBuilder.define_nopython_pipeline(self.state)
        manager.passes = [(self.lowering if step is NativeLowering else step, text) for step, text in manager.passes]
        manager._finalized = False  # so that the pass that is new is looked up
        manager.finalize()
        return [manager]


class CalleeCompiler(KernelCompiler):
    """The same for what other kernels call."""

    lowering = CalleeLowering


class KernelFlags(Flags):
    """Numba's flags, all of them read at once: it compares them whenever it types a call."""

    __slots__ = ()

    def values(self) -> dict[str, Any]:
        """Return all flags."""
        return DEFAULTS | self._values


def _set_flags(dispatcher: Any) -> None:
    dispatcher._compiler._customize_flags = KernelFlags


DEFAULTS = {name: option.default for name, option in Flags.options.items()}
NATIVE = jit_registry[CPU]  # how Numba makes its own functions


class Callee(CPUDispatcher):
    """A function as other kernels call it."""

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        super().__init__(function, {}, options, CalleeCompiler)
        _set_flags(self)

    def add_overload(self, compiled: Any) -> None:
        """Keep a specialisation; there is nothing that Python could call."""
        self.overloads[tuple(compiled.signature.args)] = compiled


def _callee(**options: Any) -> Callable[[Callable[..., Any]], Callee]:
    """Return what makes callees of the functions that Numba brings, such as `max`: else each is native by itself."""
    return lambda function: Callee(function, {"nopython": True, "boundscheck": None} | options)


@contextmanager
def _callees_only() -> Iterator[None]:
    """Have Numba's functions made by `_callee` in the block; another thread that leaves it does no harm."""
    dict.__setitem__(jit_registry, CPU, _callee)  # its own method refuses keys that are there
    try:
        yield
    finally:
        dict.__setitem__(jit_registry, CPU, NATIVE)


class Kernel(CPUDispatcher):
    """A compiled function: an entry point from Python, and a callee of other kernels.

    Parameters
    ----------
    function : callable
        A function on arrays and numbers.
    compiled : callable, optional
        Returns what is compiled in its place, with the same parameters; asked only when something is compiled.
    """

    def __init__(self, function: Callable[..., Any], compiled: Callable[[], Callable[..., Any]] | None = None) -> None:
        super().__init__(function, {}, dict(OPTIONS), KernelCompiler)
        self._cache = KernelCache(function)
        _set_flags(self)
        self.callee = Callee(function, dict(OPTIONS))
        if compiled is not None:
            dispatchers: tuple[Any, ...] = self, self.callee
            for dispatcher in dispatchers:
                dispatcher._compiler._get_implementation = lambda *_: compiled()

    def compile(self, signature: Any) -> Any:
        """Return the entry point for argument types, from the disk or made anew."""
        collecting = gc.isenabled()
        gc.disable()  # a compiler makes millions of objects and no garbage of size: a tenth of its time
        try:
            with self._cache.made_by_one(signature), _callees_only():
                return super().compile(signature)
        finally:
            if collecting:
                gc.enable()

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Return how a call from another kernel is typed."""
        return self.callee.get_call_template(args, kws)

    def get_overload(self, signature: Any) -> Any:
        """Return what stands for the implementation that another kernel calls."""
        return self.callee.get_overload(signature)

    def lowered(self, arguments: tuple[Any, ...]) -> Any:
        """Return the compile result of the callee for some argument types."""
        self.callee.get_call_template(arguments, {})
        return self.callee.overloads[arguments]


def by_type(function: Callable[P, R]) -> Callable[[Callable[..., Any]], None]:
    """Register what a function stands for inside kernels, chosen by the types of its arguments.

    Parameters
    ----------
    function : callable
        Called in kernels; from Python it is itself.

    Returns
    -------
    callable
        Takes a function that returns the implementation for argument types, as for `numba.extending.overload`, and
        makes its code a part of the key of every kernel that calls `function`.
    """

    def register(choose: Callable[..., Any]) -> None:
        numba_overload(function)(choose)
        setattr(function, OVERLOADS, (*getattr(function, OVERLOADS, ()), choose))

    return register
