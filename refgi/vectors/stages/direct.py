"""Stages of direct light at the camera's pixels: shadows from a map's depths or by rays, irradiance of all lights."""

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from refgi.literal import direct as literal
from refgi.rays import Tracer
from refgi.rsm.buffers.direct import direct_irradiance, shadow_map_visibility
from refgi.rsm.buffers.gbuffer import GBuffer
from refgi.rsm.buffers.light_projection import light_projection
from refgi.rsm.buffers.reflective import Rsm
from refgi.rsm.raster.projection import Projection, camera_projection
from refgi.scene import DirectionalLight, Scene, SpotLight, material_table
from refgi.scene.model import Light
from refgi.vectors.forms import falloff_lists
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Arrays, Spec
from refgi.vectors.stages.buffer_forms import view_numbers, view_reads
from refgi.vectors.stages.buffers import (
    SCENE,
    _add_ids,
    _add_surface,
    _give_light,
    _give_maps,
    _light_names,
    _map_names,
    _maps_of,
    _visible,
    geometry_of,
    light_of,
)
from refgi.vectors.stages.facing import FACING, add_facing

POINTS = ("gbuffer.position", "gbuffer.normal", "gbuffer.triangle_id")
Shadows = Literal["map", "exact"]


def add_direct(recipe: Recipe, scene: Scene, size: tuple[int, int], shadows: Shadows, resolution: int = 32) -> None:
    """Add shadows and direct irradiance of all lights: `size` (columns, rows), texels of a shadow map's side."""
    view = camera_projection(scene.camera, *size)
    if scene.geometry.vertex_normals is not None:
        add_facing(recipe, scene)
    for index, light in enumerate(scene.lights):
        _give_light(recipe, f"light{index}", light)
        if shadows == "exact":
            _add_rays(recipe, scene, index)
        else:
            _add_map(recipe, scene, index, resolution)
    _add_sum(recipe, scene, view)


def surface_points(arrays: Arrays, real: Any, scene: Scene, view: Projection) -> GBuffer:
    """Return the camera's G-buffer with the positions and normals among arrays."""
    known = {key: np.ascontiguousarray(arrays[f"gbuffer.{key}"], real) for key in
             ("depth", "position", "normal", "albedo") if f"gbuffer.{key}" in arrays}
    materials, ids = material_table(scene.materials, real), _visible(arrays[POINTS[2]])
    return GBuffer(scene.geometry, materials, view, ids, real, known)


def _faces(scene: Scene) -> tuple[str, str, str]:
    """Return the names of the pixels' positions, of their faces' normals and of their ids."""
    return (POINTS[0], POINTS[1] if scene.geometry.vertex_normals is None else FACING, POINTS[2])


def _add_map(recipe: Recipe, scene: Scene, index: int, resolution: int) -> None:
    """Add the depths that a light sees, and whether it sees what the camera does."""
    name, light = f"rsm{index}", scene.lights[index]
    maps = light_projection(light, scene.geometry, resolution)
    _give_maps(recipe, name, maps)
    _add_ids(recipe, name, name, maps, scene)
    _add_surface(recipe, name, name, maps, scene, ("depth", "position", "normal"))
    depths, points = (f"{name}.depth", f"{name}.position"), _faces(scene)

    def test(arrays: Arrays, real: Any) -> Arrays:
        projection = _maps_of(arrays, name, maps)
        view = GBuffer(scene.geometry, material_table(scene.materials, real), projection,
                       _visible(np.zeros(maps.shape, np.int32)), real)
        known = {key.split(".")[1]: np.ascontiguousarray(arrays[key], real) for key in depths}
        position, normal = (np.ascontiguousarray(arrays[key], real) for key in points[:2])
        rsm = Rsm(light, view, material_table(scene.materials, real), known)
        return {f"shadow{index}.visible": shadow_map_visibility(position, normal, np.asarray(arrays[POINTS[2]]) >= 0,
                                                                rsm, None, points[1] == FACING)}

    smooth = points[1] == FACING
    form = Form(literal.shadow_map, {
        **_points(points), **view_reads(name), "depth": depths[0], "map_position": depths[1]},
        (f"shadow{index}.visible",), view_numbers(maps), double=True)
    lists = (*(("shadow_map/cube",) if maps.maps > 1 else ()), *(("shadow_map/smooth",) if smooth else ()))
    # faces turned away from the light, which the literal text does not know, are dark where normals are interpolated
    variants = () if smooth else (form,)
    recipe.add(f"shadow{index}", "the nearest texel's point does not lie above the receiver's own plane", test,
               (*points, *_map_names(name), *depths), {f"shadow{index}.visible": _visible_spec()},
               paper="docs/rasterizer, receiver-plane bias", exact=(*points[:2], *depths),
               bugs=form.bugs("shadow_map", *lists), variants=variants)


def _add_rays(recipe: Recipe, scene: Scene, index: int) -> None:
    """Add whether a ray from each pixel's point reaches a light."""
    lamp, light, points = f"light{index}", scene.lights[index], _faces(scene)

    def test(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001 rays have one precision
        tracer = Tracer(geometry_of(arrays, scene))
        position, normal, triangle_id = (np.asarray(arrays[key]) for key in points)
        return {f"shadow{index}.visible": tracer.visible_from_light(position, normal, triangle_id >= 0,
                                                                    light_of(arrays, lamp, light))}

    key = "direction" if isinstance(light, DirectionalLight) else "place"
    form = Form(literal.shadow_rays, {
        **_points(points), "vertices": "scene.vertices", "faces": "scene.faces",
        key: f"{lamp}.direction" if key == "direction" else f"{lamp}.position"}, (f"shadow{index}.visible",),
        double=True)
    recipe.add(f"shadow{index}", "no triangle lies between the pixel's point and the light", test,
               (*SCENE, *points, *_light_names(lamp, light)), {f"shadow{index}.visible": _visible_spec()},
               paper="shadow rays", exact=("scene.vertices", *points[:2]),
               bugs=form.bugs("shadow_rays", f"shadow_rays/{key}"), variants=(form,))


def _points(points: Sequence[str]) -> dict[str, Any]:
    return dict(zip(("position", "normal", "triangle_id"), points, strict=True))


def _add_sum(recipe: Recipe, scene: Scene, view: Projection) -> None:
    """Add the irradiance of all lights."""
    lights = [(f"light{k}", light) for k, light in enumerate(scene.lights)]
    names = [name for lamp, light in lights for name in _light_names(lamp, light)]
    shadows = [f"shadow{k}.visible" for k in range(len(lights))]

    def run(arrays: Arrays, real: Any) -> Arrays:
        buffer = surface_points(arrays, real, scene, view)
        parts = [direct_irradiance(buffer, light_of(arrays, lamp, light), np.asarray(arrays[shadow]))
                 for (lamp, light), shadow in zip(lights, shadows, strict=True)]
        return {"direct.irradiance": np.sum(parts, axis=0, dtype=real)}

    positions = tuple(name for name in names if name.endswith("position"))
    form = _irradiance_form(lights, shadows)
    some = (any(one.endswith("position") for one in names), any(one.endswith("half_angles") for one in names),
            len(lights) > 1)
    lists = ("direct", *(name for name, has in zip(
        ("direct/place", "direct/spot", "direct/several"), some, strict=True) if has))
    recipe.add("direct", "direct irradiance of all lights, without albedo/pi", run, (*POINTS, *names, *shadows),
               {"direct.irradiance": Spec("rgb, row, column", "W/m^2", "direct irradiance; 0 without surface",
                                          "linear RGB", "E = I(w) cos / d^2")},
               paper="HSS Sec. 4; docs/radiometry", exact=(POINTS[0], *positions), variants=(form,),
               bugs=(*form.bugs(*lists), *form.bugs(*falloff_lists(scene.lights), of="light_flux")))


def _irradiance_form(lights: Sequence[tuple[str, Light]], shadows: Sequence[str]) -> Form:
    def of_each(*keys: str) -> tuple[str | None, ...]:
        return tuple(next((f"{lamp}.{key}" for key in keys if f"{lamp}.{key}" in _light_names(lamp, light)), None)
                     for lamp, light in lights)

    falloffs = tuple(light.falloff if isinstance(light, SpotLight) else None for _, light in lights)
    return Form(literal.direct_irradiance, {
        **_points(POINTS), "visible": tuple(shadows), "strength": of_each("intensity", "irradiance"),
        "place": of_each("position"), "direction": of_each("direction"), "half_angles": of_each("half_angles")},
        ("direct.irradiance",), {"falloff": falloffs}, double=True)


def _visible_spec() -> Spec:
    return Spec("row, column", "1", "whether the light reaches the pixel's point; false without surface", tier="T0")
