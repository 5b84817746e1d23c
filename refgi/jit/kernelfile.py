"""The file of a compiled kernel: types as text, object code, LLVM's bitcode and a SHA-256 of all of it.

Types as text are what Numba prints, as far as kernels need it: `float32`, `none`, `float32[:, ::1]`, `(int64, none,)`;
`named('package.module.Class', float32, ...)` is a named tuple, `omitted(1.0)` a default value, `readonly(...)` an array
that is not written to.

The file's first line is the format's name, the second a JSON object: names of symbols, the type of the result as
`text_of` writes it, how many bytes of each code follow. Nothing of it is unpickled; modules and classes are looked up
among those that are loaded.
"""

import ast
import hashlib
import json
import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
from numba import types
from numba.core import environment as untyped_environment
from numba.core.compiler import CompileResult
from numba.core.funcdesc import PythonFunctionDescriptor
from numba.core.typing.templates import Signature as UntypedSignature

from refgi.jit.launcher import start_threads

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


FORMAT = b"refgi kernel 2\n"
DIGEST = 32  # bytes of SHA-256

environments: Any = untyped_environment
Signature: Any = UntypedSignature


def packed(compiled: Any) -> bytes:
    """Return the content of a specialisation's file: format, head, codes, digest.

    `compiled`: Numba's CompileResult. Raises TypeError if it needs what the format has no words for.
    """
    library, start = compiled.library, compiled.reload_init
    if any(function is not start_threads for function in start) or compiled.lifted or compiled.objectmode:
        raise TypeError("it is more than compiled code")
    name, _, (code, bitcode) = library.serialize_using_object_code()
    function = compiled.fndesc
    reached = {one.env_name: one for one in (compiled.environment, *compiled._find_referenced_environments())}
    head = {"library": name, "bytes": [len(code), len(bitcode)], "symbol": function.mangled_name,
            "unique_name": function.unique_name, "uid": function.uid, "arguments": function.args,
            "returns": text_of(compiled.signature.return_type), "threads": bool(start),
            "environments": [[one.env_name, one.globals["__name__"], [_constant(value) for value in one.consts]]
                             for one in reached.values()]}
    content: bytes = FORMAT + json.dumps(head).encode() + b"\n" + code + bitcode
    return content + hashlib.sha256(content).digest()


def unpacked(content: bytes, function: Callable[..., Any], signature: Any, target: Any) -> Any:
    """Return the specialisation that a file's `content` holds: a CompileResult, ready to be called.

    `function`: the kernel before it is compiled; `signature`: Numba types of its arguments; `target`: the target
    context. Raises ValueError if the file is damaged or not of this format; other exceptions where its words mean
    nothing here.
    """
    entry = verified(content)
    end = content.index(b"\n", len(FORMAT)) + 1
    head = json.loads(content[len(FORMAT):end])
    middle = end + head["bytes"][0]
    returns, = types_of(head["returns"])
    arguments = tuple(signature)
    descriptor = PythonFunctionDescriptor(
        True, function.__module__, function.__qualname__, head["unique_name"], "", None, returns, None,
        tuple(head["arguments"]), (), mangler=lambda *_, **__: head["symbol"], argtypes=arguments,
        env_name=head["environments"][0][0], uid=head["uid"])
    own, *others = [_environment(*one) for one in head["environments"]]
    return CompileResult._rebuild(
        target, (head["library"], "object", (bytes(entry[end:middle]), bytes(entry[middle:]))), descriptor, own,
        Signature(returns, arguments, None), False, (), "", (start_threads,) if head["threads"] else (), [own, *others])


def verified(content: bytes) -> memoryview:
    """Return a file's content without its digest, or raise `ValueError`.

    A flipped bit of machine code would compute something else and say nothing of it.
    """
    entry = memoryview(content)[:-DIGEST]
    if not content.startswith(FORMAT) or hashlib.sha256(entry).digest() != content[-DIGEST:]:
        raise ValueError("damaged")
    return entry


def _environment(name: str, module: str, constants: list[str]) -> Any:
    """Return what compiled code of a function knows of Python: its module, and the types of arrays that it makes."""
    sys.modules[module]  # a KeyError where it is not loaded
    return environments._rebuild_env(module, [np.dtype(one) for one in constants], name)


def _constant(value: Any) -> str:
    if isinstance(value, np.dtype) and value.fields is None and not value.hasobject:
        return value.str
    raise TypeError(f"it needs the constant {value!r}")
