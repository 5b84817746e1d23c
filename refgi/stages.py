"""@stage: the one decorator that names a step of a method, times it, records it and reuses it.

A stage is a pure function. Called plainly it is just that function. Inside `observe()` each call leaves a `Run` in
the log: what ran and for how long, what was reused because every input was the same object or an equal value, and,
through `skip`, what was left out and why. Nothing else in refgi times, caches or logs.

A stage's docstring has a line for each array that it takes, `name (shape) type: text.`, and after `->` for each that it
returns. What several stages of a module take stands once in the module's docstring, and here what stages of several do:

- position (3, h, w): Surface points of the pixels, world space, m.
- normal (3, h, w): Their unit normals, world space.
- facing (3, h, w): Unit normals of the triangles that pixels see.
- covered (h, w) bool: Whether a pixel shows a surface.
- triangle_id (h, w) int32: Nearest triangle, that a pixel sees; -1 for none.
- albedo (3, h, w): Diffuse reflectance.
- vertices (vertex, 3): Corners of the triangles, m.
- faces (triangle, corner) int32: Vertices of the triangles.
- light_position (3, light): Places of the pixel lights, m.
- light_normal (3, light): Unit normals of their surfaces.
- flux (3, light): Flux of their diffuse part, W.
- lobe_flux (3, light): Flux of their lobes, W.
- lobe_axis (3, light): Axes of their lobes, unit vectors.
- lobe_exponent (light,): Phong exponents of their lobes.
- footprint (light,): Surface that each light stands for, m^2; needed by the clamps "disc" and "sphere" alone.
- top: Coarsest level.
- dtype: Float32 or float64.
"""

import dataclasses
import functools
import importlib
import inspect
import time
import weakref
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, Literal, ParamSpec, SupportsInt, TypeVar

import numpy as np

P = ParamSpec("P")
R = TypeVar("R")
Status = Literal["ran", "reused", "skipped"]
Substitute = Callable[[str, Callable[..., Any], tuple[Any, ...], Mapping[str, Any]], Any]  # name, function, arguments
Counted = Literal["pairs", "rays", "bytes"]  # of light and receiver, before skips within a sum; traced; of arrays made

STAGES: dict[str, Callable[..., Any]] = {}  # every stage that is imported, by name
KEPT_RESULTS = 8  # per stage: one per light of a scene with several, without hoarding buffers
SMALL_ARRAY = 4096  # elements up to which two distinct arrays are compared by value
SMALL_MASK = 1 << 24  # the same of bool, which takes little time


@dataclasses.dataclass(frozen=True)
class Run:
    """One line of the log."""

    name: str
    status: Status
    seconds: float = 0.0  # including the stages called inside
    depth: int = 0  # how many stages enclose it
    reason: str = ""
    inputs: Mapping[str, Any] | None = None  # by parameter, defaults among them; kept only when recording
    output: Any = None
    arguments: Mapping[str, Any] | None = None  # the inputs as the stage was handed them, kept likewise
    value: Any = None  # the output as the stage returned it
    steps: Any = None  # what its steps made of it, by field, where they ran; their runs follow


@dataclasses.dataclass
class Log:
    """What happened inside one `observe()` block."""

    runs: list[Run] = dataclasses.field(default_factory=list)
    record: bool = False
    steps: bool = False
    memory: "Memory | None" = None
    progress: Callable[[str, float], None] | None = None
    counts: Counter[Counted] | None = None  # of what `tally` counts; None where nobody asked
    substitute: "Substitute | None" = None  # what runs stages in place of their own functions
    _depth: int = 0
    _open: list[str] = dataclasses.field(default_factory=list)
    _made: dict[int, weakref.ref[Any]] = dataclasses.field(default_factory=dict)  # arrays whose bytes are counted
    _steps: dict[int, tuple[Any, Any]] = dataclasses.field(default_factory=dict)  # outputs by id, and their steps'

    def seconds(self, name: str) -> float:
        """Return the total time of all runs of the stage `name`, s."""
        return sum(run.seconds for run in self.runs if run.name == name)

    def status(self, name: str) -> list[Status]:
        """Return what happened to each call of the stage `name`, in order."""
        return [run.status for run in self.runs if run.name == name]


@dataclasses.dataclass
class _Kept:
    """A result, what it was made of, and whether it has been of use since the last frame began."""

    inputs: tuple[Any, ...]
    output: Any
    used: bool = True


class Memory:
    """Last results of every stage, given back while the inputs stay the same."""

    MOST: int | None = KEPT_RESULTS  # of a stage; None: any number

    def __init__(self) -> None:
        self._kept: dict[str, list[_Kept]] = defaultdict(list)

    def recall(self, name: str, inputs: tuple[Any, ...]) -> tuple[bool, Any]:
        """Return whether a result for these inputs is kept, and the result."""
        for kept in self._kept[name]:
            if len(kept.inputs) == len(inputs) and all(map(_same, kept.inputs, inputs)):
                kept.used = True
                return True, kept.output
        return False, None

    def keep(self, name: str, inputs: tuple[Any, ...], output: Any) -> None:
        """Keep a result, dropping the oldest of that stage."""
        kept = self._kept[name]
        kept.append(_Kept(inputs, output))
        if self.MOST is not None:
            del kept[: -self.MOST]

    def begin_frame(self) -> None:
        """Drop what the frame before had no use for, so that memory is that of two frames and serves the next ones."""
        for name, kept in self._kept.items():
            self._kept[name] = [one for one in kept if one.used]
            for one in self._kept[name]:
                one.used = False


_log: ContextVar[Log | None] = ContextVar("refgi_stage_log", default=None)
_stands_for: ContextVar[int] = ContextVar("refgi_stands_for", default=0)


def stage(
    name: str, *, kept: bool = True, steps: Callable[..., Any] | str | None = None, each: str = ""
) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Name a pure function as one step of a method; the decorated function behaves as before.

    `name` is package.verb_or_noun and no other stage's; `kept`: whether a `Memory` keeps its results (not worth it
    where inputs are made anew in every call); `each`: what it runs once for, such as a lamp: test vectors number its
    runs even where there is one. `steps`: "inside", where the stages that run inside are its steps, or a function, or
    its module and name, that makes the same of the same arguments one step after the other, each a stage, where this
    one makes several at once.
    That runs inside `observe(record=True, steps=True)` alone and returns what the steps made, by the output's fields.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        @functools.wraps(function)
        def call(*args: P.args, **kwargs: P.kwargs) -> R:
            log = _log.get()
            if log is None:
                return function(*args, **kwargs)
            return _observed(log, name, function, args, kwargs, log.memory if kept else None, steps)

        call.stage_name, call.each, call.steps = name, each, steps  # type: ignore[attr-defined]
        known = STAGES.setdefault(name, call)
        if (known.__module__, known.__qualname__) != (function.__module__, function.__qualname__):
            raise ValueError(f"stage {name!r}: {function.__qualname__} of {function.__module__} has the name of "
                             f"{known.__qualname__} of {known.__module__}")
        return call

    return decorate


@contextmanager
def observe(
    *, record: bool = False, steps: bool = False, memory: Memory | None = None,
    progress: Callable[[str, float], None] | None = None, counting: bool = False, substitute: Substitute | None = None,
) -> Iterator[Log]:
    """Log every stage that runs inside the block, in a `Log` that fills while it runs.

    `record` keeps inputs and outputs; `steps` then follows each stage that makes several things at once by its steps;
    `memory` reuses results kept there; `progress` is called with (stage name, fraction done). `counting` counts pairs,
    rays and bytes of arrays. Steps and counts take time of their own. `substitute` is called with a stage's name,
    function and arguments, positional and by name, and returns the output.
    """
    log = Log(record=record, steps=steps, memory=memory, progress=progress, counts=Counter() if counting else None,
              substitute=substitute)
    token = _log.set(log)
    try:
        yield log
    finally:
        _log.reset(token)


@contextmanager
def reusing(memory: Memory | None) -> Iterator[list[Run]]:
    """Let the stages inside the block, a frame, reuse what the frames before left; whoever observes goes on observing.

    Yields the block's runs, filled at its end. Without a memory nothing is reused but what the observer's holds.
    """
    log, runs = _log.get(), list[Run]()
    if log is None:
        with observe(memory=memory) as log, reusing(memory) as runs:
            yield runs
        return
    others, begun = log.memory, len(log.runs)
    if memory is not None:
        memory.begin_frame()
        log.memory = memory
    try:
        yield runs
    finally:
        log.memory = others
        runs += log.runs[begun:]


@contextmanager
def sharing() -> Iterator[None]:
    """Let the stages inside the block, two passes over one frame, share their results.

    An observer's memory serves where there is one, else one that ends with the block.
    """
    log = _log.get()
    if log is None:
        with observe(memory=Memory()):
            yield
        return
    own = log.memory is None
    if own:
        log.memory = Memory()
    try:
        yield
    finally:
        if own:
            log.memory = None


@contextmanager
def standing_for(pixels: int) -> Iterator[None]:
    """Let pictures made inside the block run what one of so many pixels runs, so that its kernels are there."""
    token = _stands_for.set(pixels)
    try:
        yield
    finally:
        _stands_for.reset(token)


def counted_pixels(pixels: int) -> int:
    """Return the pixels of a picture, or of the larger one that it stands for."""
    return max(pixels, _stands_for.get())


def skip(name: str, reason: str) -> None:
    """Note in the log that a stage was left out, and why the scene at hand does not need it."""
    if (log := _log.get()) is not None:
        log.runs.append(Run(name, "skipped", reason=reason, depth=log._depth))


def tally(what: Counted, number: Callable[[], SupportsInt]) -> None:
    """Add to what whoever observes counts; `number` is called only where they are counted.

    ``"pairs"`` of light, or other sender, and receiver that a sum is given; ``"rays"`` that are traced.
    """
    log = _log.get()
    if log is not None and log.counts is not None:
        log.counts[what] += int(number())


def of_steps(output: Any) -> Any:
    """Return what steps made in place of a stage's output, for the steps of a later stage; else the output."""
    log = _log.get()
    return output if log is None else log._steps.get(id(output), (None, output))[1]


def report_progress(fraction: float) -> None:
    """Tell whoever observes what share of the running stage's work is done, 0 to 1."""
    log = _log.get()
    if log is not None and log.progress is not None and log._open:
        log.progress(log._open[-1], fraction)


def _observed(
    log: Log, name: str, function: Callable[..., R], args: tuple[Any, ...], kwargs: dict[str, Any],
    memory: Memory | None, steps: Callable[..., Any] | str | None,
) -> R:
    inputs = (*args, *(item for pair in sorted(kwargs.items()) for item in pair))
    if memory is not None:
        known, output = memory.recall(name, inputs)
        if known:
            log.runs.append(Run(name, "reused", depth=log._depth, reason="inputs unchanged"))
            return output  # type: ignore[no-any-return]
    position = len(log.runs)
    log._depth += 1
    log._open.append(name)
    if log.progress is not None:
        log.progress(name, 0.0)
    started = time.perf_counter()
    try:
        output = (function(*args, **kwargs) if log.substitute is None else
                  log.substitute(name, function, args, kwargs))
    finally:
        seconds = time.perf_counter() - started
        log._depth -= 1
        log._open.pop()
    if log.counts is not None:
        log.counts["bytes"] += _bytes_made(output, log._made)
    if log.progress is not None:
        log.progress(name, 1.0)
    run = Run(name, "ran", seconds, log._depth)
    if log.record:
        arguments = _arguments(function, args, kwargs)
        run = dataclasses.replace(run, inputs={name: recorded(value) for name, value in arguments.items()},
                                  output=recorded(output), arguments=arguments, value=output)
        if log.steps and steps == "inside":
            run = dataclasses.replace(run, steps=run.output)
        elif log.steps and steps is not None:
            del log.runs[position:]  # what ran inside; the steps say it finer
            log._depth += 1
            others, log.memory = log.memory, None  # what ran inside is not there for them to reuse
            try:
                made = (_named(steps) if isinstance(steps, str) else steps)(*args, **kwargs)
                log._steps[id(output)] = output, made
                run = dataclasses.replace(run, steps=recorded(made))
            finally:
                log._depth -= 1
                log.memory = others
    log.runs.insert(position, run)
    if memory is not None:
        memory.keep(name, inputs, output)
    return output


def _named(steps: str) -> Callable[..., Any]:
    module, _, name = steps.rpartition(".")
    function: Callable[..., Any] = getattr(importlib.import_module(module), name)
    return function


def _bytes_made(value: Any, known: dict[int, weakref.ref[Any]]) -> int:
    """Return bytes of the arrays of a value that are not known yet: a stage within another has made them already."""
    if isinstance(value, np.ndarray):
        while isinstance(value.base, np.ndarray):
            value = value.base
        held = known.get(id(value))
        if held is not None and held() is value:
            return 0
        known[id(value)] = weakref.ref(value)
        return int(value.nbytes)
    if isinstance(value, Mapping):
        value = value.values()
    elif dataclasses.is_dataclass(value):
        value = [getattr(value, field.name) for field in dataclasses.fields(value)]
    elif not isinstance(value, list | tuple):
        return 0
    return sum(_bytes_made(one, known) for one in value)


def _arguments(function: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]) -> dict[str, Any]:
    """Return what a stage was called with, by parameter."""
    bound = inspect.signature(function).bind(*args, **kwargs)
    bound.apply_defaults()
    return dict(bound.arguments)


def recorded(value: Any) -> Any:
    """Return a value as a log keeps it: what computes its arrays on first use gives them all, unobserved."""
    if type(value) in (tuple, list):
        return type(value)(map(recorded, value))
    if not hasattr(value, "recorded"):
        return value
    token = _log.set(None)
    try:
        return value.recorded()
    finally:
        _log.reset(token)


def _same(a: Any, b: Any) -> bool:
    if a is b:
        return True
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray):
        most = SMALL_MASK if a.dtype == np.bool_ else SMALL_ARRAY
        return a.shape == b.shape and a.dtype == b.dtype and a.size <= most and bool(np.array_equal(a, b))
    if isinstance(a, list | tuple):
        return len(a) == len(b) and all(map(_same, a, b))
    if dataclasses.is_dataclass(a):
        return all(_same(getattr(a, f.name), getattr(b, f.name)) for f in dataclasses.fields(a))
    try:
        return bool(a == b)
    except (TypeError, ValueError):
        return False
