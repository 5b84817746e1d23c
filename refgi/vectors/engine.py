"""Methods by the literal text: stages that have a literal form run it in place of their kernels."""

import inspect
import time
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from refgi.types import Array
from refgi.vectors.forms import described
from refgi.vectors.recorded import leaves, rebuilt


class Timed(NamedTuple):
    """A stage that ran by its literal form."""

    stage: str
    literal: float  # s
    kernel: float  # s, of the stage's own function, compiling included


class Literal:
    """What runs stages: `stages.observe(substitute=Literal())`; afterwards `timed` says which, and how slowly."""

    def __init__(self) -> None:
        self.timed: list[Timed] = []

    def __call__(
        self, name: str, function: Callable[..., Any], args: tuple[Any, ...], kwargs: Mapping[str, Any]
    ) -> Any:
        """Return what a stage returns: an object as its own function makes it, with the arrays of its literal form."""
        bound = inspect.signature(function).bind(*args, **kwargs)
        bound.apply_defaults()
        beside = described(name, bound.arguments)
        started = time.perf_counter()
        value = function(*args, **kwargs)
        kernel = time.perf_counter() - started
        if beside.form is None:
            return value
        arrays = {leaf: array for parameter, part in bound.arguments.items() for leaf, array in leaves(part, parameter)}
        started = time.perf_counter()
        made = beside.form(arrays, None)
        self.timed.append(Timed(name, time.perf_counter() - started, kernel))

        def handed(leaf: str, array: Array) -> Array:
            new = made.get(leaf.removeprefix("."), array)
            return np.ascontiguousarray(new, array.dtype)

        return rebuilt(value, "", handed, np.float64)
