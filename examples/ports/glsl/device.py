"""Arrays of a kit's case, and shaders run on them in an OpenGL context without a window."""

import json
import re
from pathlib import Path

import moderngl
import numpy as np

HERE = Path(__file__).resolve().parent
GROUP = 64  # local_size_x of all shaders


class Arrays:
    """The arrays of a case: those of the kit, and in their place, where `own` says so, those that the port wrote."""

    def __init__(self, kit: Path, out: Path, case: str, own: bool) -> None:
        self.home = kit / "cases" / case
        self.manifest = json.loads((self.home / "manifest.json").read_text(encoding="utf-8"))
        self.facts = self.manifest.get("facts", {})
        self.out, self.own = out / case, own

    def __getitem__(self, name: str) -> np.ndarray:
        mine = self.out / f"{name}.npy"
        return np.load(mine if self.own and mine.is_file() else self.home / self.manifest["arrays"][name]["file"])

    def of_map(self, name: str, k: int) -> str:
        """Return an array's name for map k; maps for which a stage would make the same share that of map 0."""
        return name.format(k if name.format(k) in self.manifest["arrays"] else 0)

    def write(self, name: str, flat: np.ndarray) -> None:
        """Write an output in the shape that the manifest says."""
        self.out.mkdir(parents=True, exist_ok=True)
        shape = self.manifest["arrays"][name]["shape"]
        np.save(self.out / f"{name}.npy", flat[: np.prod(shape, dtype=int)].reshape(shape))  # no buffer is empty


class Gpu:
    """An OpenGL context, and the shaders compiled so far; `variant`: macros of all of them."""

    def __init__(self, variant: tuple[str, ...]) -> None:
        self.context = moderngl.create_standalone_context(backend="egl", require=450)
        self.variant = variant
        self.programs: dict[tuple[str, ...], moderngl.ComputeShader] = {}

    def run(self, shader: str, macros: tuple[str, ...], buffers: dict[int, np.ndarray | moderngl.Buffer],
            invocations: int, **uniforms: object) -> None:
        """Run a shader on buffers by binding; all is written when it returns."""
        key = (shader, *macros, *self.variant)
        if key not in self.programs:
            self.programs[key] = self.context.compute_shader(source_of(shader, key[1:]))
        program, made = self.programs[key], []
        for binding, data in buffers.items():
            if isinstance(data, np.ndarray):
                made.append(data := self.buffer(data))
            data.bind_to_storage_buffer(binding)
        for name, value in uniforms.items():
            if name in program:  # a compiler drops those that are not read
                program[name].value = value
        program.run(-(-invocations // GROUP))
        self.context.memory_barrier()
        for buffer in made:
            buffer.release()

    def buffer(self, array: np.ndarray) -> moderngl.Buffer:
        """Return an array as a buffer of whole words."""
        content = np.ascontiguousarray(array).tobytes()
        return self.context.buffer(content + b"\0" * (-len(content) % 4) or b"\0" * 4)

    def empty(self, count: int) -> moderngl.Buffer:
        """Return a buffer of floats to be written."""
        return self.context.buffer(reserve=4 * max(1, count))

    def read(self, buffer: moderngl.Buffer, whole: bool = False) -> np.ndarray:
        """Return a buffer of floats as the shaders' variant writes them, or of `whole` ones, and release it."""
        words = np.frombuffer(buffer.read(), np.uint32)
        buffer.release()
        half = "HALF" in self.variant and not whole
        return words.astype(np.uint16).view(np.float16) if half else words.view(np.float32)

    def stored(self, array: np.ndarray, place: bool = False) -> np.ndarray:
        """Return floats as the shaders' variant stores them."""
        half = ("HALF_PLACES" if place else "HALF") in self.variant
        with np.errstate(over="ignore"):
            return array.astype(np.float16) if half else array


def source_of(shader: str, macros: tuple[str, ...]) -> str:
    """Return a shader's text with its macros and the files that it includes."""
    def text(name: str) -> str:
        return re.sub(r'#include "([^"]+)"', lambda found: text(found[1]), (HERE / name).read_text(encoding="utf-8"))

    return "#version 450\n" + "".join(f"#define {name}\n" for name in macros) + text(shader)
