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


def irradiance(gpu: Gpu, arrays: Arrays, stage: dict) -> None:
    """Run pairs.comp, each receiver with the light of its number, or sum.comp, with all lights."""
    one_each, reads = kind_of(stage) == "pairs.pairs", list(stage["reads"])
    lobes, disc = any(name.endswith("lobe_flux") for name in reads), arrays.facts[stage["name"]]["clamp"] == "disc"
    if not one_each:
        covered = arrays[reads.pop(2)]  # ids of triangles, or whether there are any
    places = {0: reads[0], 3: reads[2]}  # positions of receivers and lights
    plain = {1: reads[1], **dict(zip((4, 5, *((6, 7, 8) if lobes else ()), *((10,) if disc else ())), reads[3:],
                                     strict=True))}
    buffers: dict[int, np.ndarray | moderngl.Buffer] = {at: gpu.stored(arrays[name]) for at, name in plain.items()}
    buffers |= {at: gpu.stored(arrays[name], place=True) for at, name in places.items()}
    lights, receivers = arrays[reads[4]].shape[1], arrays[reads[1]][0].size
    buffers[2] = np.zeros(receivers, np.int32) if one_each else (
        covered.astype(np.int32) - 1 if covered.dtype == bool else covered)
    result = buffers[11] = gpu.empty(3 * receivers)
    if lobes:
        peaks = buffers[9] = gpu.empty(lights)
        gpu.run("lobe_norm.comp", (), {0: buffers[4], 1: buffers[7], 2: buffers[8], 3: peaks}, lights,
                light_count=lights)
    tree = GROUP if "TREE" in gpu.variant and not one_each else 1
    gpu.run("pairs.comp" if one_each else "sum.comp", ("LOBES",) * lobes + ("DISC",) * disc, buffers, receivers * tree,
            light_count=lights, receiver_count=receivers)
    if lobes:
        peaks.release()
    arrays.write(stage["writes"][0], gpu.read(result))


def footprints(gpu: Gpu, arrays: Arrays, stage: dict) -> None:
    """Run footprints.comp on each map of lights."""
    common = {k: arrays[f"lights.pixel_lights.{name}"] for k, name in enumerate(
        ("position", "normal", "texel", "map_index"))}
    lights = len(common[2])
    areas = gpu.empty(lights)
    for k, near in enumerate(arrays.facts[stage["name"]]["near"]):
        chosen = arrays[arrays.of_map("lights.texels{}.texel", k)]
        gpu.run("footprints.comp", (), {
            **common, 4: arrays[arrays.of_map("rsm.reflected_flux{}.solid_angle", k)], 5: chosen,
            6: arrays[arrays.of_map("lights.texels{}.weight", k)], 7: areas,
        }, lights, light_count=lights, chosen_count=len(chosen), map=k, near=int(near),
            lamp=tuple(arrays[f"rsm.reflected_flux{k}.lamp.{'place' if near else 'direction'}"].tolist()))
    arrays.write(stage["writes"][0], gpu.read(areas, whole=True))


def gather(gpu: Gpu, arrays: Arrays, stage: dict) -> None:
    """Run gather.comp on a level."""
    position, normal, *senders, radiance, area, offsets, weight = (arrays[name] for name in stage["reads"])
    sender_position, sender_normal = senders or (position, normal)
    result = gpu.empty(3 * area.size)
    gpu.run("gather.comp", (), {
        0: gpu.stored(position, place=True), 1: gpu.stored(normal), 2: gpu.stored(radiance), 3: gpu.stored(area),
        4: offsets, 5: gpu.stored(weight), 6: result, 7: gpu.stored(sender_position, place=True),
        8: gpu.stored(sender_normal),
    }, area.size * (GROUP if "TREE" in gpu.variant else 1), size=area.shape[::-1], tile=offsets.shape[1::-1],
        weight_tile=weight.shape[1::-1], samples=offsets.shape[2], share=arrays.facts[stage["name"]]["share"])
    arrays.write(stage["writes"][0], gpu.read(result))


STAGES: dict[str, Callable[[Gpu, Arrays, dict], None]] = {  # by their names, numbers of runs left out
    "pairs.pairs": irradiance, "pairs.sum": irradiance, "lights.footprints": footprints,
    "sssil.gather_samples": gather, "cluster.basis": csm.basis, "cluster.mip_levels": csm.mip,
    "cluster.mip_means": csm.means, "cluster.csm": csm.visibility,
}


def kind_of(stage: dict) -> str:
    """Return a stage's name without the number of its run."""
    return re.sub(r"\d+$", "", stage["name"])


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
            run, facts = STAGES.get(kind_of(stage)), arrays.facts.get(stage["name"], {})
            if run is None or facts.get("in_bytes"):  # a basis in 8 and 16 bits
                continue
            if facts.get("form_factor", "disc") == "disc" and facts.get("factor", 1) == 1:  # as Eq. 4 is meant
                run(gpu, arrays, stage)
                print(case["id"], stage["name"])
    return 0


if __name__ == "__main__":
    sys.exit(main())
