"""Arrays in what a stage is handed and returns, by where they are, and the stage run with others in their places."""

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from refgi import stages
from refgi.types import Array
from refgi.vectors.docstrings import returned
from refgi.vectors.spec import Arrays, Run


def named_outputs(function: Callable[..., Any], output: Any) -> dict[str, Array]:
    """Return the arrays that a stage has returned, by the names in its docstring."""
    names = tuple(returned(function))
    if type(output) is tuple and len(names) == len(output) and "" not in names:
        output = dict(zip(names, output, strict=True))
    return dict(leaves(output))


def run_of(
    function: Callable[..., Any], arguments: Mapping[str, Any], reads: Mapping[str, str], writes: Mapping[str, str]
) -> Run:
    """Return a stage on arrays by name: its function with the arguments as they were, but for the arrays."""
    def run(arrays: Arrays, real: Any) -> Arrays:
        def handed(leaf: str, array: Array) -> Array:
            new = arrays[reads[leaf]]
            if array.dtype == np.bool_ and new.dtype != np.bool_:
                return np.ascontiguousarray(new >= 0)
            return np.ascontiguousarray(new, real if array.dtype.kind == "f" else array.dtype)

        floats = {key for key, value in arguments.items() if isinstance(value, type | np.dtype)
                  and np.dtype(value).kind == "f"}
        changed = {key: np.dtype(real) if key in floats else rebuilt(value, key, handed, real)
                   for key, value in arguments.items()}
        made = named_outputs(function, stages.recorded(function(**changed)))
        return {array: made[leaf] for leaf, array in writes.items()}

    return run


def leaves(value: Any, name: str = "") -> Iterator[tuple[str, Array]]:
    """Yield the arrays in a value and where they are: names of fields and indices, joined by dots."""
    if isinstance(value, np.ndarray):
        if value.dtype.kind in "fiub":
            yield name, value
    else:
        for field, part in _parts(value):
            yield from leaves(part, f"{name}.{field}" if name else field)


def _parts(value: Any) -> Iterator[tuple[str, Any]]:
    if hasattr(value, "recorded"):
        yield from stages.recorded(value).items()
    elif isinstance(value, Mapping):
        yield from ((str(key), part) for key, part in value.items())
    elif isinstance(value, tuple) and hasattr(value, "_fields"):
        yield from zip(value._fields, value, strict=True)
    elif isinstance(value, list | tuple):
        yield from ((str(index), part) for index, part in enumerate(value))
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        yield from ((field.name, getattr(value, field.name)) for field in dataclasses.fields(value) if field.init)


def rebuilt(value: Any, name: str, handed: Callable[[str, Array], Array], real: Any) -> Any:
    """Return a value with other arrays: what `handed` returns for each one's name and the array that was there."""
    if isinstance(value, np.ndarray):
        return handed(name, value) if value.dtype.kind in "fiub" else value
    before = dict(_parts(value))
    parts = {field: rebuilt(part, f"{name}.{field}", handed, real) for field, part in before.items()}
    if all(parts[field] is part for field, part in before.items()):
        return value
    if hasattr(value, "recorded"):
        return value.with_channels(parts, np.dtype(real))
    if isinstance(value, Mapping):
        return {key: parts[str(key)] for key in value}
    if hasattr(value, "_fields"):
        return value._replace(**parts)
    if isinstance(value, list | tuple):
        return type(value)(parts.values())
    return dataclasses.replace(value, **parts)
