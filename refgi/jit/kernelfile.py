"""The file of a compiled kernel: two lines of text, object code, LLVM's bitcode and a SHA-256 of all of it.

The first line is the format's name, the second a JSON object: names of symbols, the type of the result as
`refgi.jit.typetext` writes it, how many bytes of each code follow. Nothing of it is unpickled; modules and classes are
looked up among those that are loaded.
"""

import hashlib
import json
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from numba.core import environment as untyped_environment
from numba.core.compiler import CompileResult
from numba.core.funcdesc import PythonFunctionDescriptor
from numba.core.typing.templates import Signature as UntypedSignature

from refgi.jit.launcher import start_threads
from refgi.jit.typetext import text_of, types_of

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
