"""A port of hssil's stages: the literal twins, fed with the arrays of a kit.

`outputs(case, stage, arrays)` returns what the port writes, or None where no twin covers the stage (ids and surfaces,
which the rasterizer's own stages cover).
"""

import math
import re
from types import SimpleNamespace

import numpy as np

from refgi.literal import direct
from refgi.scene import Geometry
from refgi.vectors.cases.hssil import SETTINGS, TEMPORAL
from tests.naive import crown, crown_points, level_blur, reprojection, temporal, upsampling
from tests.naive import hssil as whole
from tests.naive import view_pyramid as pyramid

PLANES = {"p": "position", "n": "normal", "L": "radiance"}


def outputs(case, stage, arrays):
    kind = re.sub(r"\d", "", stage.name)
    make = {"shadow": shadows, "direct": irradiance, "level": level, "shifts of samples": shifts,
            "points of samples": shared_points, "samples": samples,
            "gather": gathered, "blur": blurred, "light": upsampled, "picture": upsampled, "motion": motion,
            "reprojected": reprojected, "entering": entering, "clamp": clamped, "temporal": blended}.get(kind)
    if make is None:
        return None
    index = int((re.findall(r"\d", stage.name) or [-1])[0])
    return make(case, arrays, index)  # some need no arrays, some no facts of the case


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


def level(case, arrays, index):
    first, camera = case.facts["hssil"]["first level"], case.facts["camera"]
    height, width = camera["rows"], camera["columns"]
    mode = SETTINGS[case.id].senders.downsample
    if mode == "average" and index > 0:
        return {key: array for key, array in arrays_of(averages(texels(arrays, index - 1, width)), index,
                                                       width).items() if not key.endswith("pixel")}
    if index == 0:
        picture = {"depth": arrays["gbuffer.depth"], "axes": arrays["camera.frame"][0],
                   "f_h": 2 * math.atan(arrays["camera.half"][0]), "f_v": 2 * math.atan(arrays["camera.half"][1]),
                   **{key: np.moveaxis(arrays[name], 0, -1) for key, name in (
                       ("normal", "gbuffer.normal"), ("albedo", "gbuffer.albedo"), ("direct", "direct.irradiance"))}}
        made = pyramid.levels(picture, first if mode == "closest" else 0, 1)[0]
        if mode != "closest":
            return from_pixels(made, first, width, mode)
    else:
        made = pyramid.closest_level(texels(arrays, index - 1, width), height, width, first + index, 2)
    made = arrays_of(made, index, width)
    if mode == "closest_average":
        light, count = (arrays[f"level{index - 1}.{key}"] for key in ("radiance", "count"))
        made |= mean_radiance(light, count, index, made[f"level{index}.radiance"].shape[1:])
    return made


def mean_radiance(light, count, index, shape):
    """Return radiance as the mean over the pixels of four texels, and how many these are."""
    total, pixels_ = np.zeros((3, *shape)), np.zeros(shape, int)
    for i, j in np.ndindex(*count.shape):
        total[:, i // 2, j // 2] += count[i, j] * light[:, i, j]
        pixels_[i // 2, j // 2] += count[i, j]
    return {f"level{index}.radiance": total / np.maximum(pixels_, 1), f"level{index}.count": pixels_}


def from_pixels(rows, first, width, mode):
    """Return the first level of means, from pixels as texels."""
    height = len(rows)
    if mode == "average":
        made = rows
        for _ in range(first):
            made = averages(made)
        return {key: array for key, array in arrays_of(made, 0, width).items() if not key.endswith("pixel")}
    made, light = arrays_of(rows, 0, width), arrays_of(rows, 0, width)["level0.radiance"]
    count, closest = np.isfinite(made["level0.depth"]).astype(int), rows
    for level_ in range(1, first + 1):
        closest = pyramid.closest_level(closest, height, width, level_, 2)
        made = arrays_of(closest, 0, width)
        found = mean_radiance(light, count, 0, made["level0.radiance"].shape[1:])
        light, count = found["level0.radiance"], found["level0.count"]
    return made | {"level0.radiance": light, "level0.count": count}


def averages(rows):
    """Return the twin's means of four texels; areas of 0 weigh nothing."""
    names = {"p": "place", "z": "depth", "n": "normal", "L": "radiance", "A": "area"}
    below = [[texel and {other: texel[key] for key, other in names.items()} | {"pixel": (0, 0)} for texel in row]
             for row in rows]
    return [[texel and {key: texel[other] for key, other in names.items()} | {"seen": 1, "pixel": (0, 0)}
             for texel in row] for row in whole.averages(below)]


def texels(arrays, index, width):
    """Return a level as rows of texels."""
    depth = arrays[f"level{index}.depth"]
    names = {key: f"level{index}.{plane}" for key, plane in PLANES.items()}

    def texel(i, j):
        if math.isinf(depth[i, j]):
            return None
        found = {key: arrays[name][:, i, j] for key, name in names.items() if name in arrays}
        found |= {"z": depth[i, j], "seen": 1}
        if f"level{index}.area" in arrays:
            found["A"] = arrays[f"level{index}.area"][i, j]
        if f"level{index}.pixel" in arrays:
            found["pixel"] = divmod(int(arrays[f"level{index}.pixel"][i, j]), width)
        return found

    return [[texel(i, j) for j in range(depth.shape[1])] for i in range(depth.shape[0])]


def arrays_of(rows, index, width):
    """Return rows of texels as a level's arrays."""
    def plane(of, none):
        return np.array([[none if texel is None else of(texel) for texel in row] for row in rows])

    made = {name: np.moveaxis(plane(lambda texel, key=key: texel[key], np.zeros(3)), 2, 0)
            for key, name in PLANES.items()}
    made |= {"depth": plane(lambda texel: texel["z"], np.inf), "area": plane(lambda texel: texel["A"], 0.0),
             "pixel": plane(lambda texel: texel["pixel"][0] * width + texel["pixel"][1], -1)}
    return {f"level{index}.{key}": array for key, array in made.items()}


def shifts(case, arrays, index):
    facts = case.facts[f"samples{index}"]
    (rows, columns), n = facts["tile"], facts["crown"]
    s, t = arrays[f"samples{index}.shift"]
    count = [*range(facts["disc"]), *range(n)]
    turns = [2 * math.pi * ((0.5 + j / crown_points.G**2) % 1) for j in count]
    shift = [[((s + k / crown_points.G) % 1, (t + k / crown_points.G**2) % 1) for k in
              ((columns * row + column) * n for column in range(columns))] for row in range(rows)]
    return {f"samples{index}.points": np.array([((0.5 + j / crown_points.G) % 1, math.cos(turn), math.sin(turn))
                                               for j, turn in zip(count, turns, strict=True)]),
            f"samples{index}.shifts": np.array(shift)}


def shared_points(case, arrays, index):  # noqa: ARG001 facts alone
    facts = case.facts[f"samples{index}"]
    count = [*range(facts["disc"]), *range(facts["crown"])]
    turns = [2 * math.pi * ((0.5 + j / crown_points.G**2) % 1) for j in count]
    return {f"samples{index}.points": np.array([((0.5 + j / crown_points.G) % 1, math.cos(turn), math.sin(turn))
                                               for j, turn in zip(count, turns, strict=True)])}


def shared_by_all(case, index):
    """Return the samples of sets that all receivers share, in the kit's order."""
    sampling, facts = SETTINGS[case.id].sampling, case.facts[f"samples{index}"]
    if sampling.pattern == "all":
        high = 2 * facts["radius"]
        far = 2 * math.ceil(high) + 1  # a picture in which all of them lie
        found = [(ox, oy, 1.0) for ox, oy, _ in crown_points.every_texel(facts["radius"], index, (far, far))]
        pairs = [(sign * ox, oy, w) for ox, oy, w in found if ox > 0 for sign in (1, -1)]
        return np.array(pairs + [one for one in found if one[0] == 0], float)
    disc = facts["disc"]
    found = crown_points.samples(sampling, facts["radius"], index, sampling.first_level + index, 0, 0)
    parts = [found[:disc], found[disc:]]
    return np.array([one for part in parts for one in part[: len(part) // 2 * 2]]
                    + [part[-1] for part in parts if len(part) % 2])


def samples(case, arrays, index):  # noqa: ARG001
    """Return the samples of the whole twin, which draws its shifts by its own hash."""
    sampling, facts = SETTINGS[case.id].sampling, case.facts[f"samples{index}"]
    if sampling.pattern in ("fixed", "all"):
        found = shared_by_all(case, index)
        return {f"samples{index}.offsets": found[None, None, :, :2].astype(int),
                f"samples{index}.weight": found[None, None, :, 2]}
    rows, columns = facts["tile"]
    found = np.array([[crown_points.samples(sampling, facts["radius"], index, sampling.first_level + index, row, column)
                       for column in range(columns)] for row in range(rows)])
    weight = found[..., 2] if sampling.density != "uniform" else found[:1, :1, :, 2]
    return {f"samples{index}.offsets": found[..., :2].astype(int), f"samples{index}.weight": weight}


def gathered(case, arrays, index):  # noqa: ARG001
    offsets, weight = arrays[f"samples{index}.offsets"], arrays[f"samples{index}.weight"]

    def around(row, column):
        return (offsets[row % len(offsets), column % offsets.shape[1]],
                weight[row % len(weight), column % weight.shape[1]])

    planes = tuple(arrays[f"level{index}.{key}"] for key in ("position", "normal", "radiance", "area"))
    return {f"gather{index}.irradiance": crown.gathered(planes, around, "disc")}


def blurred(case, arrays, index):
    rows = [[texel and {"place": texel["p"], "normal": texel["n"], "depth": texel["z"]} for texel in row]
            for row in texels(arrays, index, 1)]
    facts = case.facts["blur"]
    return {f"blur{index}.irradiance": level_blur.blurred(arrays[f"gather{index}.irradiance"], rows, facts["size"],
                                                          facts["plane_tolerance"], facts["cosine"])}


def upsampled(case, arrays, index):
    name, here = ("picture", "gbuffer") if index < 0 else (f"light{index}", f"level{index}")
    below, facts = f"level{index + 1}", case.facts["upsampling"]
    coarse = next(one for kind in ("light", "blur", "gather") if (one := f"{kind}{index + 1}.irradiance") in arrays)
    factor = 2 ** case.facts["hssil"]["first level"] if index < 0 else 2
    light = upsampling.bilateral(arrays[coarse], arrays[f"{below}.depth"], arrays[f"{below}.normal"],
                                 arrays[f"{here}.depth"], arrays[f"{here}.normal"], factor, facts["depth_sigma"],
                                 facts["normal_power"], SETTINGS[case.id].senders.downsample != "average")
    own = [one for kind in ("blur", "gather") if (one := f"{kind}{index}.irradiance") in arrays]
    return {f"{name}.irradiance": light + (arrays[own[0]] if own else 0)}


def view_of(arrays, name):
    return (arrays[f"{name}.origin"][0], *arrays[f"{name}.frame"][0], arrays[f"{name}.half"][1])


def were(arrays):
    """Return where points and normals were: as they are unless surfaces moved."""
    return (arrays.get(f"motion.{key}", arrays.get(f"gbuffer.{key}")) for key in ("position", "normal"))


def motion(case, arrays, _):
    given = {"material_of_face": arrays["scene.material_of_face"], "faces": arrays["scene.faces"],
             "vertex_normals": None}
    facts = case.facts["camera"]
    projection = SimpleNamespace(**{key: arrays[f"camera.{key}"] for key in ("origin", "frame", "half")},
                                 height=facts["rows"], width=facts["columns"])
    buffer = SimpleNamespace(resolve=lambda *names: [arrays[f"gbuffer.{name}"] for name in names],
                             covered=arrays["gbuffer.triangle_id"] >= 0, triangle_id=arrays["gbuffer.triangle_id"],
                             projection=projection)
    scene = SimpleNamespace(geometry=Geometry(vertices=arrays["scene.vertices"], **given))
    made = temporal.moved_back(SimpleNamespace(gbuffer=buffer, scene=scene),
                               Geometry(vertices=arrays["before.vertices"], **given))
    return dict(zip(("motion.position", "motion.normal", "motion.speed"), made, strict=True))


def reprojected(case, arrays, _):
    facts, (position, normal) = case.facts["temporal"], were(arrays)
    light, weight = np.zeros(position.shape), np.zeros(position.shape[1:])
    count = np.zeros(weight.shape)
    where = arrays["before.depth"], arrays["before.normal"]
    limits = facts["depth_tolerance"], facts["normal_cosine"], facts["fetch"]
    for at in pixels(arrays):
        one = position[:, *at], normal[:, *at], view_of(arrays, "before"), *limits
        light[:, *at], weight[at] = reprojection.reproject(arrays["before.irradiance"], *where, *one)
        if "before.frames" in arrays:
            count[at] = reprojection.reproject(np.stack([arrays["before.frames"]] * 3), *where, *one)[0][0]
    return {"reprojected.irradiance": light, "reprojected.weight": weight, "reprojected.frames": count}


def entering(case, arrays, _):
    settings, (position, _) = TEMPORAL[case.id], were(arrays)
    view = SimpleNamespace(**{key: arrays[f"before.{key}"] for key in ("origin", "frame", "half")})
    last = SimpleNamespace(gbuffer=SimpleNamespace(projection=view, covered=np.isfinite(arrays["before.depth"])))
    light, share = arrays["reprojected.irradiance"].copy(), np.zeros(position.shape[1:])
    for at in pixels(arrays):
        found = temporal.at_edge(last, arrays["before.irradiance"], position[:, *at], at)
        if arrays["reprojected.weight"][at] == 0 and found is not None:
            light[:, *at], share[at] = found[0], math.exp(-found[1] / settings.entering_speed)
    return {"entering.irradiance": light, "entering.share": share}


def clamped(case, arrays, _):
    settings = TEMPORAL[case.id]
    earlier, covered = arrays[next(name for name in arrays if name in (
        "entering.irradiance", "reprojected.irradiance"))].copy(), arrays["gbuffer.triangle_id"] >= 0
    for at in pixels(arrays):
        earlier[:, *at] = temporal.clamped(earlier[:, *at], arrays["new.irradiance"], covered, at, settings.clamp,
                                           settings.clamp_radius)
    return {"clamped.irradiance": earlier}


def blended(case, arrays, _):
    """Return Sec. 3.3's blend, written out: a W(F) + (1 - a) I."""
    settings, new = TEMPORAL[case.id], arrays["new.irradiance"]
    earlier = arrays[next(name for name in ("clamped.irradiance", "entering.irradiance", "reprojected.irradiance")
                          if name in arrays)]
    found, share = arrays["reprojected.weight"] > 0, np.zeros(new.shape[1:])
    share[found] = settings.weight
    n = np.where(found, arrays.get("reprojected.frames", np.full(new.shape[1:], np.inf)), 0)
    share = np.minimum(share, np.where(np.isinf(n), 1, n / (np.where(np.isinf(n), 0, n) + 1)))
    if "entering.share" in arrays:
        share = np.where(found, share, settings.weight * arrays["entering.share"])
    share = share * np.exp(-arrays.get("motion.speed", 0.0) / settings.speed)
    return {"temporal.irradiance": share * earlier + (1 - share) * new, "temporal.share": share,
            "temporal.frames": n + 1}
