"""A port of hssil's stages: the literal text and, for direct light, the twins, fed with the arrays of a kit."""

import re

import numpy as np

from refgi.literal import direct


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
    at = dict(zip(("position", "normal"), points(arrays), strict=True), triangle_id=arrays["gbuffer.triangle_id"])
    at["normal"] = arrays.get("gbuffer.facing", at["normal"])  # planes, sides and offsets are the face's
    rsm = f"rsm{index}"
    if f"{rsm}.depth" not in arrays:
        lamp = lamps(arrays)[f"light{index}"]
        end = {"place": lamp["position"]} if "position" in lamp else {"direction": lamp["direction"]}
        visible = direct.shadow_rays(**at, vertices=arrays["scene.vertices"], faces=arrays["scene.faces"], **end)
    else:
        facts, view = case.facts[rsm], {key: arrays[f"{rsm}.{key}"] for key in ("origin", "frame", "half", "depth")}
        visible = direct.shadow_map(**at, **view, map_position=arrays[f"{rsm}.position"], rows=facts["rows"],
                                    columns=facts["columns"], parallel=facts["projection"] == "orthographic")
    return {f"shadow{index}.visible": visible}


def lamps(arrays):
    names = {name.split(".")[0] for name in arrays if re.match(r"light\d+\.(position|direction)", name)}
    return {lamp: {name.split(".")[1]: array for name, array in arrays.items() if name.startswith(lamp + ".")}
            for lamp in sorted(names)}


def irradiance(case, arrays, _):
    values = lamps(arrays)
    light = direct.direct_irradiance(
        *points(arrays), arrays["gbuffer.triangle_id"], [arrays[f"shadow{lamp[5:]}.visible"] for lamp in values],
        [one.get("intensity", one.get("irradiance")) for one in values.values()],
        *([one.get(key) for one in values.values()] for key in ("position", "direction", "half_angles")),
        [case.facts.get(f"{lamp}.falloff", "smoothstep") for lamp in values])
    return {"direct.irradiance": light}
