"""A port of hssil's stages: the literal text and, for direct light, the twins, fed with the arrays of a kit."""

import re

import numpy as np

from tests.naive import crossings, direct


def outputs(case, stage, arrays):
    """Return what the port writes, or None where no text covers the stage (ids and surfaces, which tests/rsm does)."""
    kind, index = re.sub(r"\d", "", stage.name), int((re.findall(r"\d", stage.name) or [-1])[0])
    make = {"shadow": shadows, "direct": irradiance}.get(kind)
    if make is not None:
        return make(case, arrays, index)
    return stage.variants[0](arrays, np.float64) if stage.variants else None


def pixels(arrays):
    return [tuple(pixel) for pixel in np.argwhere(arrays["gbuffer.triangle_id"] >= 0)]


def points(arrays):
    return arrays["gbuffer.position"], arrays["gbuffer.normal"]


def shadows(case, arrays, index):
    position, normal = points(arrays)
    normal = arrays.get("gbuffer.facing", normal)  # planes, sides and offsets are the face's
    visible = np.zeros(position.shape[1:], bool)
    lamp = lamps(arrays).get(f"light{index}")
    for at in pixels(arrays):
        if f"rsm{index}.depth" in arrays:
            facts = case.facts[f"rsm{index}"]
            visible[at] = direct.reached(
                facts["projection"], *(arrays[f"rsm{index}.{key}"] for key in ("origin", "frame", "half")),
                (facts["rows"], facts["columns"]), arrays[f"rsm{index}.depth"], arrays[f"rsm{index}.position"],
                position[:, *at], normal[:, *at])
            continue
        corners = arrays["scene.vertices"][arrays["scene.faces"]]
        start = position[:, *at] + 1e-5 * normal[:, *at]
        end = lamp["position"] if "position" in lamp else start - 1e3 * lamp["direction"]
        faces = (end - start) @ normal[:, *at] > 0
        visible[at] = faces and crossings.free(corners, start[None], end[None], 1 - 1e-5)[0]
    return {f"shadow{index}.visible": visible}


def lamps(arrays):
    names = {name.split(".")[0] for name in arrays if re.match(r"light\d+\.(position|direction)", name)}
    return {lamp: {name.split(".")[1]: array for name, array in arrays.items() if name.startswith(lamp + ".")}
            for lamp in sorted(names)}


def irradiance(case, arrays, _):
    position, normal = points(arrays)
    light = np.zeros(position.shape)
    for lamp, values in lamps(arrays).items():
        for at in pixels(arrays):
            if arrays[f"shadow{lamp[5:]}.visible"][at]:
                light[:, *at] += direct.irradiance(case.facts[lamp], values, position[:, *at], normal[:, *at],
                                                   case.facts.get(f"{lamp}.falloff", "smoothstep"))
    return {"direct.irradiance": light}
