"""Run compute shaders on the inputs of a conformance kit: `python run.py KIT OUT [CASE ...]`.

Every stage that this port has is run, its inputs read from the kit, or with `--chained` from the port's own output
where there is such. Results go to `OUT/<case>/<array>.npy`, which `refgi vectors check KIT OUT` judges.
"""

import argparse
import json
import re
import sys
from collections.abc import Callable
from pathlib import Path

import moderngl
import numpy as np

HERE = Path(__file__).resolve().parent
GROUP = 64  # local_size_x of all shaders
VARIANTS = {  # what a port may do otherwise: macros of the shaders
    "plain": (), "fused": ("FUSED",), "rsqrt": ("RSQRT",), "reversed": ("REVERSED",), "tree": ("TREE",),
    "unnormalised": ("UNNORMALISED",), "pow": ("POW",), "pow-dot": ("POW_DOT",), "accurate-dot": ("ACCURATE_DOT",),
    "half": ("HALF",), "half-places": ("HALF", "HALF_PLACES"),
}


class Arrays:
    """The arrays of a case: those of the kit, and in their place, where `own` says so, those that the port wrote."""

    def __init__(self, kit: Path, out: Path, case: str, own: bool) -> None:
        self.home = kit / "cases" / case
        self.manifest = json.loads((self.home / "manifest.json").read_text(encoding="utf-8"))
        self.out, self.own = out / case, own

    def __getitem__(self, name: str) -> np.ndarray:
        mine = self.out / f"{name}.npy"
        return np.load(mine if self.own and mine.is_file() else self.home / self.manifest["arrays"][name]["file"])

    def __contains__(self, name: str) -> bool:
        return name in self.manifest["arrays"]

    def write(self, name: str, flat: np.ndarray) -> None:
        """Write an output in the shape that the manifest says."""
        self.out.mkdir(parents=True, exist_ok=True)
        np.save(self.out / f"{name}.npy", flat.reshape(self.manifest["arrays"][name]["shape"]))


class Gpu:
    """A GL context without a window, and the shaders compiled so far."""

    def __init__(self, variant: tuple[str, ...]) -> None:
        self.context = moderngl.create_standalone_context(backend="egl", require=450)
        self.variant = variant
        self.programs: dict[tuple[str, ...], moderngl.ComputeShader] = {}

    def run(self, shader: str, macros: tuple[str, ...], buffers: dict[int, np.ndarray | moderngl.Buffer], groups: int,
            **uniforms: object) -> None:
        """Run a shader on buffers by binding; it waits until all is written."""
        key = (shader, *macros, *self.variant)
        if key not in self.programs:
            self.programs[key] = self.context.compute_shader(source_of(shader, key[1:]))
        program = self.programs[key]
        made = []
        for binding, data in buffers.items():
            if isinstance(data, np.ndarray):
                made.append(data := self.buffer(data))
            data.bind_to_storage_buffer(binding)
        for name, value in uniforms.items():
            if name in program:  # a compiler drops those that are not read
                program[name].value = value
        program.run(groups)
        self.context.memory_barrier()
        for buffer in made:
            buffer.release()

    def buffer(self, array: np.ndarray) -> moderngl.Buffer:
        """Return an array as a buffer of whole words."""
        content = np.ascontiguousarray(array).tobytes()
        return self.context.buffer(content + b"\0" * (-len(content) % 4) or b"\0" * 4)

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


def read(buffer: moderngl.Buffer) -> np.ndarray:
    """Return a buffer of floats and release it."""
    array = np.frombuffer(buffer.read(), np.float32)
    buffer.release()
    return array


def irradiance(gpu: Gpu, arrays: Arrays, shader: str, output: str) -> None:
    """Run sum.comp or pairs.comp."""
    receivers, lights = arrays["gbuffer.triangle_id"].size, arrays["lights.flux"].shape[1]
    lobes, disc = "lights.lobe_flux" in arrays, arrays.manifest["facts"].get("sum.clamp") == "disc"
    result = gpu.context.buffer(reserve=12 * receivers)
    buffers: dict[int, np.ndarray | moderngl.Buffer] = {2: arrays["gbuffer.triangle_id"], 11: result}
    plain = {1: "gbuffer.normal", 4: "lights.normal", 5: "lights.flux"}
    plain |= {6: "lights.lobe_flux", 7: "lights.lobe_axis", 8: "lights.lobe_exponent"} if lobes else {}
    plain |= {10: "lights.area"} if disc else {}
    buffers |= {binding: gpu.stored(arrays[name]) for binding, name in plain.items()}
    buffers |= {binding: gpu.stored(arrays[name], place=True) for binding, name in
                {0: "gbuffer.position", 3: "lights.position"}.items()}
    if lobes:
        peaks = buffers[9] = gpu.context.buffer(reserve=4 * max(1, lights))
        gpu.run("lobe_norm.comp", (), {0: buffers[4], 1: buffers[7], 2: buffers[8], 3: peaks}, -(-lights // GROUP),
                light_count=lights)
    tree = "TREE" in gpu.variant and shader == "sum.comp"
    gpu.run(shader, ("LOBES",) * lobes + ("DISC",) * disc, buffers, receivers if tree else -(-receivers // GROUP),
            light_count=lights, receiver_count=receivers)
    if lobes:
        peaks.release()
    arrays.write(output, read(result))


def footprints(gpu: Gpu, arrays: Arrays) -> None:
    """Run footprints.comp on each map of lights."""
    lights = arrays["lights.flux"].shape[1]
    areas = gpu.context.buffer(reserve=4 * max(1, lights))
    common = {k: arrays[f"lights.{name}"] for k, name in enumerate(("position", "normal", "texel", "map"))}
    for k in range(sum(f"rsm{k}.texel" in arrays for k in range(100))):
        near = f"light{k}.position" in arrays
        chosen = arrays[f"rsm{k}.texel"]
        gpu.run("footprints.comp", (), {**common, 4: arrays[f"rsm{k}.solid_angle"], 5: chosen,
                                        6: arrays[f"rsm{k}.weight"], 7: areas}, -(-lights // GROUP),
                light_count=lights, chosen_count=len(chosen), map=k, near=int(near),
                lamp=tuple(arrays[f"light{k}.{'position' if near else 'direction'}"].tolist()))
    arrays.write("lights.area", read(areas))


def gather(gpu: Gpu, arrays: Arrays, stage: str) -> None:
    """Run gather.comp on a level."""
    index = stage.removeprefix("gather")
    area, offsets = arrays[f"level{index}.area"], arrays[f"samples{index}.offsets"]
    weight = arrays[f"samples{index}.weight"]
    result = gpu.context.buffer(reserve=12 * area.size)
    places = gpu.stored(arrays[f"level{index}.position"], place=True)
    gpu.run("gather.comp", (), {
        0: places, 1: gpu.stored(arrays[f"level{index}.normal"]), 2: gpu.stored(arrays[f"level{index}.radiance"]),
        3: gpu.stored(area), 4: offsets, 5: gpu.stored(weight), 6: result,
    }, area.size if "TREE" in gpu.variant else -(-area.size // GROUP), size=area.shape[::-1],
        tile=offsets.shape[1::-1], weight_tile=weight.shape[1::-1], samples=offsets.shape[2])
    arrays.write(f"{stage}.irradiance", read(result))


STAGES: dict[str, Callable[[Gpu, Arrays, str], None]] = {  # by name without numbers of maps and levels
    "pairs": lambda gpu, arrays, _: irradiance(gpu, arrays, "pairs.comp", "pairs.irradiance"),
    "footprints": lambda gpu, arrays, _: footprints(gpu, arrays),
    "sum": lambda gpu, arrays, _: irradiance(gpu, arrays, "sum.comp", "sum.irradiance"),
    "gather": gather,
}


def main() -> int:
    """Run the stages of all cases, or of those whose ids begin as asked."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("kit", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("cases", nargs="*")
    parser.add_argument("--chained", action="store_true", help="read the port's own outputs where there are such")
    parser.add_argument("--variant", choices=VARIANTS, default="plain")
    asked = parser.parse_args()
    gpu = Gpu(VARIANTS[asked.variant])
    print(gpu.context.info["GL_RENDERER"], gpu.context.info["GL_VERSION"], sep=", ")
    for case in json.loads((asked.kit / "kit.json").read_text(encoding="utf-8"))["cases"]:
        if asked.cases and not case["id"].startswith(tuple(asked.cases)):
            continue
        arrays = Arrays(asked.kit, asked.out, case["id"], asked.chained)
        for stage in arrays.manifest["stages"]:
            name = stage["name"]
            if (kind := re.sub(r"\d", "", name)) in STAGES:
                STAGES[kind](gpu, arrays, name)
                print(case["id"], name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
