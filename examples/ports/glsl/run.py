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

import csm
import moderngl
import numpy as np
from device import GROUP, Arrays, Gpu

VARIANTS = {  # what a port may do otherwise: macros of the shaders
    "plain": (), "fused": ("FUSED",), "rsqrt": ("RSQRT",), "reversed": ("REVERSED",), "tree": ("TREE",),
    "unnormalised": ("UNNORMALISED",), "pow": ("POW",), "pow-dot": ("POW_DOT",), "accurate-dot": ("ACCURATE_DOT",),
    "built-in": ("BUILT_IN",), "half": ("HALF",), "half-places": ("HALF", "HALF_PLACES"),
}


def irradiance(gpu: Gpu, arrays: Arrays, stage: str) -> None:
    """Run sum.comp or pairs.comp."""
    receivers, lights = arrays["gbuffer.triangle_id"].size, arrays["lights.flux"].shape[1]
    lobes, disc = "lights.lobe_flux" in arrays, arrays.facts.get("sum.clamp") == "disc"
    result = gpu.empty(3 * receivers)
    buffers: dict[int, np.ndarray | moderngl.Buffer] = {2: arrays["gbuffer.triangle_id"], 11: result}
    plain = {1: "gbuffer.normal", 4: "lights.normal", 5: "lights.flux"}
    plain |= {6: "lights.lobe_flux", 7: "lights.lobe_axis", 8: "lights.lobe_exponent"} if lobes else {}
    plain |= {10: "lights.area"} if disc else {}
    buffers |= {binding: gpu.stored(arrays[name]) for binding, name in plain.items()}
    buffers |= {binding: gpu.stored(arrays[name], place=True) for binding, name in
                {0: "gbuffer.position", 3: "lights.position"}.items()}
    if lobes:
        peaks = buffers[9] = gpu.empty(lights)
        gpu.run("lobe_norm.comp", (), {0: buffers[4], 1: buffers[7], 2: buffers[8], 3: peaks}, lights,
                light_count=lights)
    tree = GROUP if "TREE" in gpu.variant and stage == "sum" else 1
    gpu.run(f"{stage}.comp", ("LOBES",) * lobes + ("DISC",) * disc, buffers, receivers * tree, light_count=lights,
            receiver_count=receivers)
    if lobes:
        peaks.release()
    arrays.write(f"{stage}.irradiance", gpu.read(result))


def footprints(gpu: Gpu, arrays: Arrays, _: str) -> None:
    """Run footprints.comp on each map of lights."""
    lights = arrays["lights.flux"].shape[1]
    areas = gpu.empty(lights)
    common = {k: arrays[f"lights.{name}"] for k, name in enumerate(("position", "normal", "texel", "map"))}
    for k in range(sum(f"rsm{k}.texel" in arrays for k in range(100))):
        near, chosen = f"light{k}.position" in arrays, arrays[f"rsm{k}.texel"]
        gpu.run("footprints.comp", (), {**common, 4: arrays[f"rsm{k}.solid_angle"], 5: chosen,
                                        6: arrays[f"rsm{k}.weight"], 7: areas}, lights,
                light_count=lights, chosen_count=len(chosen), map=k, near=int(near),
                lamp=tuple(arrays[f"light{k}.{'position' if near else 'direction'}"].tolist()))
    arrays.write("lights.area", gpu.read(areas, whole=True))


def gather(gpu: Gpu, arrays: Arrays, stage: str) -> None:
    """Run gather.comp on a level."""
    index = stage.removeprefix("gather")
    area, offsets = arrays[f"level{index}.area"], arrays[f"samples{index}.offsets"]
    weight = arrays[f"samples{index}.weight"]
    result = gpu.empty(3 * area.size)
    places = gpu.stored(arrays[f"level{index}.position"], place=True)
    gpu.run("gather.comp", (), {
        0: places, 1: gpu.stored(arrays[f"level{index}.normal"]), 2: gpu.stored(arrays[f"level{index}.radiance"]),
        3: gpu.stored(area), 4: offsets, 5: gpu.stored(weight), 6: result,
    }, area.size * (GROUP if "TREE" in gpu.variant else 1), size=area.shape[::-1], tile=offsets.shape[1::-1],
        weight_tile=weight.shape[1::-1], samples=offsets.shape[2])
    arrays.write(f"{stage}.irradiance", gpu.read(result))


STAGES: dict[tuple[str, str], Callable[[Gpu, Arrays, str], None]] = {  # by what is first written, numbers left out
    ("pairs", "pairs.irradiance"): irradiance, ("sum", "sum.irradiance"): irradiance,
    ("footprints", "lights.area"): footprints, ("gather", "gather.irradiance"): gather,
    ("basis", "basis."): csm.basis, ("mip", "basis."): csm.mip, ("search.means", "search.means"): csm.means,
    ("penumbra.means", "penumbra.means"): csm.means, ("visibility", "visibility.share"): csm.visibility,
}


def runner_of(stage: dict, method: str, facts: dict) -> Callable[[Gpu, Arrays, str], None] | None:
    """Return what runs a stage, None where this port has it not."""
    name, written = (re.sub(r"\d", "", text) for text in (stage["name"], stage["writes"][0]))
    if (name == "sum" and method == "val") or (name == "visibility" and "csm" not in facts):
        return None  # of other inputs, by the same name
    if name in ("basis", "mip") and "basis.stored" in facts:
        return None  # in 8 and 16 bits
    return STAGES.get((name, written))


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
            run = runner_of(stage, case["method"], arrays.facts)
            if run is not None:
                run(gpu, arrays, stage["name"])
                print(case["id"], stage["name"])
    return 0


if __name__ == "__main__":
    sys.exit(main())
