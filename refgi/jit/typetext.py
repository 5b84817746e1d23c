"""Types of Numba as text, and text as types: a table and four forms, nothing that is run.

Text is what Numba prints, as far as kernels need it: `float32`, `none`, `float32[:, ::1]`, `(int64, none,)`;
`named('package.module.Class', float32, ...)` is a named tuple, `omitted(1.0)` a default value, `readonly(...)` an array
that is not written to.
"""

import ast
import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any

from numba import types

LAYOUTS = {"C": (":", "::1"), "F": ("::1", ":"), "A": (":", ":")}  # first and last axis as Numba writes them
ARRAY: Any = types.Array
PLAIN: dict[str, Any] = {
    "none": types.none, "boolean": types.boolean,
    **{str(kind): kind for kind in (*types.integer_domain, *types.real_domain, *types.complex_domain)}}


def text_of(kind: Any) -> str:
    """Write a Numba type as the text that `types_of` reads. Raises TypeError if there is no text for it."""
    if isinstance(kind, types.Array) and kind.aligned:
        first, last = LAYOUTS[kind.layout]
        axes = [last] if kind.ndim == 1 else [first, *[":"] * (kind.ndim - 2), last]
        plain = f"{text_of(kind.dtype)}[{', '.join(axes)}]"
        return plain if kind.mutable else f"readonly({plain})"
    if isinstance(kind, types.BaseTuple):
        items: Any = kind
        parts = [text_of(item) for item in items]
        if (named := getattr(kind, "instance_class", None)) is not None:
            return f"named({', '.join([repr(f'{named.__module__}.{named.__qualname__}'), *parts])})"
        return f"({', '.join(parts)},)" if parts else "()"
    if isinstance(kind, types.Omitted):
        return f"omitted({kind.value!r})"
    text = "boolean" if kind == types.boolean else str(kind)
    if PLAIN.get(text) != kind:
        raise TypeError(f"{kind}: no text for this type")
    return text


def types_of(text: str, module: Callable[[str], ModuleType] = sys.modules.__getitem__) -> tuple[Any, ...]:
    """Read Numba types from their texts, with commas between them. Raises ValueError if a text is not that of a type.

    `module` returns the module that holds the class of a named tuple, by name; by default only one that is loaded.
    """
    whole: Any = ast.parse(f"({text},)" if text else "()", mode="eval").body
    return tuple(_type(node, module) for node in whole.elts)


def _type(node: Any, module: Callable[[str], ModuleType]) -> Any:
    match node:
        case ast.Name(id=name) if name in PLAIN:
            return PLAIN[name]
        case ast.Subscript(value=element, slice=axes):
            return _array(_type(element, module), axes.elts if isinstance(axes, ast.Tuple) else [axes])
        case ast.Tuple(elts=parts):
            return types.BaseTuple.from_types(tuple(_type(part, module) for part in parts))
        case ast.Call(func=ast.Name(id="named"), args=[ast.Constant(value=str(name)), *parts]):
            return types.BaseTuple.from_types(tuple(_type(part, module) for part in parts), _class(name, module))
        case ast.Call(func=ast.Name(id="readonly"), args=[array]):
            return _type(array, module).copy(readonly=True)
        case ast.Call(func=ast.Name(id="omitted"), args=[value]):
            return types.Omitted(ast.literal_eval(value))
    raise ValueError(f"{ast.unparse(node)}: expected a type")


def _array(element: Any, axes: list[Any]) -> Any:
    written = [ast.unparse(axis) for axis in axes]
    if any(axis not in (":", "::1") for axis in written):
        raise ValueError(f"{written}: expected axes of an array")
    layout = "C" if written[-1] == "::1" else "F" if written[0] == "::1" else "A"
    return ARRAY(element, len(written), layout)


def _class(name: str, module: Callable[[str], ModuleType]) -> type[Any]:
    home, _, qualname = name.rpartition(".")
    owner = getattr(module(home), qualname)
    if not (isinstance(owner, type) and issubclass(owner, tuple) and hasattr(owner, "_fields")):
        raise ValueError(f"{name}: expected a named tuple")
    return owner
