"""Stages of pixel lights: importance, sample points, warp, chosen texels, lights (SII Sec. 3.1, 3.5; P2)."""

from typing import Any, Literal

import numpy as np

from refgi.lights.pixel_lights import Drawn, lights_of
from refgi.lights.warp import Warp, texel_of, warp_stacked
from refgi.literal import lights as literal
from refgi.literal.warp import warp as literal_warp
from refgi.pairs.pixel_lights import PixelLights
from refgi.rsm.buffers.light_projection import light_projection
from refgi.sampling import grid, halton
from refgi.scene import Scene
from refgi.vectors.recipe import Recipe, reading
from refgi.vectors.rows import Form
from refgi.vectors.spec import Array, Arrays, Spec
from refgi.vectors.stages.buffers import REFLECTANCE, SCENE, VECTOR, _light_names, _map_names, rsm_of

Pattern = Literal["halton", "grid", "given"]
LIGHT = ("position", "normal", "flux")
LOBE = ("lobe_flux", "lobe_axis", "lobe_exponent")


def add_lights(
    recipe: Recipe, scene: Scene, resolution: int, counts: tuple[int, ...], *, pattern: Pattern = "halton",
    warp: Warp | None = None, shifts: tuple[tuple[float, float], ...] = (),
) -> None:
    """Add the pixel lights of all maps: `counts` texels of each map, the first ones of `lights` from the first map.

    `shifts`: what is added to the points of each map modulo 1; none where absent.
    """
    moved = shifts or ((0.0, 0.0),) * len(counts)
    for index in range(len(counts)):
        if pattern == "grid" and recipe.facts[f"rsm{index}"]["maps"] > 1:
            raise ValueError(f"{recipe.id}: a grid on stacked maps: refgi lays one on each")
        add_points(recipe, index, counts, pattern, moved, bool(shifts))
        _add_texels(recipe, scene, resolution, index, counts, warp)
    _add_chosen(recipe, scene, resolution, counts)


def below_1(points: Array) -> Array:
    """Return points that stay below 1 in float32."""
    return np.minimum(points, literal.BELOW_1)


def add_points(
    recipe: Recipe, index: int, counts: tuple[int, ...], pattern: Pattern, shifts: tuple[tuple[float, float], ...],
    shifted: bool,
) -> None:
    """Add the points of the unit square that texels of a map are chosen by: computed, or given as random numbers.

    `counts` and `shifts` are those of all maps; the map's own shift is given where points are `shifted`.
    """
    name, count = f"rsm{index}.points", counts[index]
    recipe.facts[name] = pattern
    spec = Spec("point, uv", "1", "points of the unit square in [0, 1): u along columns, v along rows downwards")
    if pattern == "given":
        recipe.give(name, below_1(np.random.default_rng([7, index]).random((count, 2))), spec)
        return
    shift = f"rsm{index}.shift"
    if shifted:
        recipe.give(shift, np.array(shifts[index]), Spec("uv", "1", "added to every point, modulo 1"))

    def points(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001 numbers, the same in any type
        if pattern == "grid":
            return {name: grid(int(np.sqrt(count)))}
        return {name: below_1(halton(count, shift=arrays[shift].tolist() if shifted else None))}

    if pattern == "grid":
        form, lists = Form(literal.grid_points, {}, (name,), {"n": int(np.sqrt(count))}), ["grid"]
    else:
        known = np.array(shifts, np.float32).astype(np.float64)
        form = Form(literal.halton_points, {}, (name,), {"counts": counts, "shifts": known, "number": index})
        lists = ["halton", *(["halton/shifted"] if shifted else []), *(["halton/later"] if index else []),
                 *(["halton/shifted later"] if shifted and index else [])]
    recipe.add(f"rsm{index}.points", "Halton points in bases 2 and 3 from index 0" if pattern == "halton" else
               "centres of n x n cells, row by row", points, (shift,) if shifted else (), {name: spec},
               paper="SII Sec. 3.1", bugs=form.bugs(*lists), variants=(form,))


def _add_texels(
    recipe: Recipe, scene: Scene, resolution: int, index: int, counts: tuple[int, ...], warp: Warp | None
) -> None:
    name, light, count = f"rsm{index}", scene.lights[index], counts[index]
    maps = light_projection(light, scene.geometry, resolution)
    points, texel, weight = f"{name}.points", f"{name}.texel", f"{name}.weight"
    rows, columns = maps.shape
    if warp is not None:
        _add_importance(recipe, name, maps.maps)
        points = _add_warped(recipe, name, maps.maps, warp)

    own = {"density_weight": f"{name}.density_weight"} if warp is not None else {}

    def chosen(arrays: Arrays, real: Any) -> Arrays:
        at = np.asarray(arrays[points], np.float64)
        w = arrays[own["density_weight"]] if own else np.ones(len(at), real)
        return {texel: texel_of(at[:, 1], rows) * columns + texel_of(at[:, 0], columns),
                weight: (rows * columns / count * w).astype(real)}

    recipe.factors |= {f"T/N of rsm{index}": rows * columns / count, f"number of lights N of rsm{index}": count,
                       f"number of texels T of rsm{index}": rows * columns}
    recipe.facts[f"{name}.lights"] = {"T": rows * columns, "N": count}
    form = Form(literal.texels, {"points": points, **own}, (texel, weight), {
        "counts": counts, "number": index, "maps": maps.maps, "rows": rows // maps.maps, "columns": columns})
    recipe.add(f"{name}.texels", "the texel that each point falls on, and T/N w", chosen, (points, *own.values()), {
        texel: Spec("light", "1", "row * columns + column over the stacked maps", tier="T0", index_of=(rows, columns)),
        weight: Spec("light", "1", "T/N times the weight of the warp: how many texels a light stands for"),
    }, paper="SII Sec. 3.1", exact=(points,), bugs=form.bugs("texels", *(["texels/warped"] if own else [])),
        variants=(form,))


def _add_importance(recipe: Recipe, name: str, maps: int) -> None:
    glossy = f"{name}.lobe_flux" in recipe.specs
    reads = {"flux": f"{name}.flux"}
    reads |= {key: f"{name}.{key}" for key in ("lobe_flux", "lobe_exponent")} if glossy else {}

    def largest(arrays: Arrays, real: Any) -> Arrays:
        lobe = arrays[f"{name}.lobe_flux"] if glossy else 0.0
        return {f"{name}.importance": (arrays[f"{name}.flux"] + lobe).max(axis=0).astype(real)}

    form = Form(literal.importance, reads, (f"{name}.importance",))
    recipe.add(f"{name}.importance", "largest channel of a texel's flux, lobe included", largest,
               tuple(reads.values()), {f"{name}.importance": Spec("row, column", "W", "importance of each texel")},
               paper="SII Sec. 3.5", bugs=form.bugs("importance", *(["importance/glossy"] if glossy else []), *(
                   ["importance/cube"] if maps > 1 else [])), variants=(form,))


def _summed_row_by_row(importance: Array) -> Array:
    """Return an importance whose sums over halves are off as those of n texels one after the other in float32 are."""
    tilt = importance.size * 2.0**-24 / 8
    rows, columns = (np.linspace(-tilt, tilt, size) for size in importance.shape)
    return np.asarray(importance * (1.0 + rows[:, None] + columns), importance.dtype)


def _add_warped(recipe: Recipe, name: str, maps: int, warp: Warp) -> str:
    warped, weight = f"{name}.warped", f"{name}.density_weight"

    def run(arrays: Arrays, real: Any) -> Arrays:
        points, weights = warp_stacked(np.asarray(arrays[f"{name}.points"], np.float64),
                                       np.asarray(arrays[f"{name}.importance"]), maps, warp)
        return {warped: below_1(points), weight: weights.astype(real)}

    form = Form(literal_warp, {"points": f"{name}.points", "importance": f"{name}.importance"}, (warped, weight), {
        "maps": maps, "levels": warp.levels, "method": warp.method})
    recipe.facts[f"{name}.warp"] = {"method": warp.method, "levels": warp.levels}
    recipe.add(f"{name}.warp", f"points follow the importance over {warp.levels} levels, method {warp.method}", run,
               (f"{name}.points", f"{name}.importance"), {
                   warped: Spec("point, uv", "1", "warped points over the stacked maps"),
                   weight: Spec("point", "1", "w, 1 / density over the unit square")},
               paper="SII Sec. 3.5, Eq. 5 and 6",
               bugs=form.bugs("warp", f"warp/{warp.method}", *(["warp/cube"] if maps > 1 else [])),
               variants=(reading(run, **{f"{name}__importance": _summed_row_by_row}), form))
    return warped


def _add_chosen(recipe: Recipe, scene: Scene, resolution: int, counts: tuple[int, ...]) -> None:
    glossy = "rsm0.lobe_flux" in recipe.specs
    kinds = [*LIGHT, *(LOBE if glossy else ())]
    numbers = range(len(counts))
    lamps = [(f"light{k}", scene.lights[k], light_projection(scene.lights[k], scene.geometry, resolution))
             for k in numbers]
    reads = [*SCENE, *REFLECTANCE]
    reads += ["scene.vertex_normals"] if "scene.vertex_normals" in recipe.specs else []
    for k, (lamp, light, _) in enumerate(lamps):
        name = f"rsm{k}"
        reads += [*_map_names(name), *_light_names(lamp, light), f"{name}.triangle_id"]
        reads += [f"{name}.{key}" for key in (*kinds, "texel", "weight")]

    def run(arrays: Arrays, real: Any) -> Arrays:
        rsms = [rsm_of(arrays, f"rsm{k}", *lamps[k], real, scene) for k in numbers]
        drawn = [Drawn(np.asarray(arrays[f"rsm{k}.texel"], np.int64), arrays[f"rsm{k}.weight"], None) for k in numbers]
        lights = lights_of(rsms, drawn)
        made = {f"lights.{key}": getattr(lights, key) for key in kinds}
        return made | {"lights.texel": lights.texel, "lights.map": lights.map_index}

    specs = {
        "position": Spec("xyz, light", "m", "places of the lights", "world"),
        "normal": Spec("xyz, light", VECTOR, "their surfaces' normals", "world"),
        "flux": Spec("rgb, light", "W", "diffuse flux, T/N w included", "linear RGB", "Phi_i = T/N w Phi_t"),
        "lobe_flux": Spec("rgb, light", "W", "flux of the lobe, T/N w included", "linear RGB", "SII Eq. 3"),
        "lobe_axis": Spec("xyz, light", VECTOR, "axis of the lobe", "world"),
        "lobe_exponent": Spec("light", "1", "Phong exponent of the lobe"),
    }
    writes = {f"lights.{key}": specs[key] for key in kinds}
    writes |= {"lights.texel": Spec("light", "1", "each light's texel", tier="T0"),
               "lights.map": Spec("light", "1", "each light's map", tier="T0")}
    form = Form(literal.pixel_lights, {key: tuple(f"rsm{k}.{key}" for k in numbers) for key in (
        "texel", "weight", *kinds)}, (*(f"lights.{key}" for key in kinds), "lights.texel", "lights.map"))
    lists = ["lights", *(["lights/glossy"] if glossy else []), *(["lights/maps"] if len(counts) > 1 else []),
             *(["lights/warped"] if any(f"rsm{k}.density_weight" in recipe.specs for k in numbers) else []),
             *(["lights/cube"] if any(maps.maps > 1 for _, _, maps in lamps) else [])]
    recipe.add("lights", "texels with flux as pixel lights; those without are dropped", run, tuple(reads), writes,
               paper="SII Sec. 3.1", bugs=form.bugs(*lists), variants=(form,))


def pixel_lights_of(arrays: Arrays, real: Any) -> PixelLights:
    """Return the pixel lights among arrays."""
    glossy = "lights.lobe_flux" in arrays
    position, normal, flux = (np.ascontiguousarray(arrays[f"lights.{key}"], real) for key in LIGHT)
    lobe = [np.ascontiguousarray(arrays[f"lights.{key}"], real) if glossy else None for key in LOBE]
    return PixelLights(position, normal, flux, lobe[0], lobe[1], lobe[2], position.shape[1])


def light_names(recipe: Recipe) -> tuple[str, ...]:
    """Return the names of the pixel lights' arrays."""
    return tuple(f"lights.{key}" for key in (*LIGHT, *LOBE) if f"lights.{key}" in recipe.specs)
