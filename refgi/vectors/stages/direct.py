"""Stages of direct light at the camera's pixels: shadows from a map's depths or by rays, irradiance of all lights."""

from typing import Any, Literal

import numpy as np

from refgi.rays import Tracer
from refgi.rsm.buffers.direct import direct_irradiance, shadow_map_visibility
from refgi.rsm.buffers.gbuffer import GBuffer
from refgi.rsm.buffers.light_projection import light_projection
from refgi.rsm.buffers.reflective import Rsm
from refgi.rsm.raster.projection import Projection, camera_projection
from refgi.scene import Scene, material_table
from refgi.vectors.bugs.direct import direct_family
from refgi.vectors.bugs.shadow import shadow_map_family
from refgi.vectors.recipe import Recipe, reading, writing
from refgi.vectors.spec import Array, Arrays, Bug, Spec
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


def _interpolated(run: Any, scene: Scene) -> tuple[Bug, ...]:
    """Return the bug of shadows that take interpolated normals, of a smooth scene."""
    def altered(arrays: Arrays, real: Any) -> Arrays:
        return dict(run({**arrays, FACING: arrays[POINTS[1]]}, real))

    smooth = scene.geometry.vertex_normals is not None
    return (Bug("interpolated normals in place of faces'", altered, "docs/conventions: which normal serves what"),
            ) if smooth else ()


def _add_map(recipe: Recipe, scene: Scene, index: int, resolution: int) -> None:
    """Add the depths that a light sees, and whether it sees what the camera does."""
    name, light = f"rsm{index}", scene.lights[index]
    maps = light_projection(light, scene.geometry, resolution)
    _give_maps(recipe, name, maps)
    _add_ids(recipe, name, name, maps, scene)
    _add_surface(recipe, name, name, maps, scene, ("depth", "position", "normal"))
    depths, points = (f"{name}.depth", f"{name}.position"), _faces(scene)

    def test(arrays: Arrays, real: Any, bias: float | None = None) -> Arrays:
        projection = _maps_of(arrays, name, maps)
        view = GBuffer(scene.geometry, material_table(scene.materials, real), projection,
                       _visible(np.zeros(maps.shape, np.int32)), real)
        known = {key.split(".")[1]: np.ascontiguousarray(arrays[key], real) for key in depths}
        position, normal = (np.ascontiguousarray(arrays[key], real) for key in points[:2])
        rsm = Rsm(light, view, material_table(scene.materials, real), known)
        return {f"shadow{index}.visible": shadow_map_visibility(position, normal, np.asarray(arrays[POINTS[2]]) >= 0,
                                                                rsm, bias, points[1] == FACING)}

    printed = name.replace(".", "__")
    recipe.add(f"shadow{index}", "the nearest texel's point does not lie above the receiver's own plane", test,
               (*points, *_map_names(name), *depths), {f"shadow{index}.visible": _visible_spec()},
               paper="docs/rasterizer: receiver-plane bias", exact=(*points[:2], *depths), bugs=(
                   Bug("the bias is a constant 0", lambda a, r: test(a, r, 0.0), "receiver-plane bias"),
                   Bug("the bias is a constant tenth of the scene's size", lambda a, r: test(a, r, 0.2),
                       "receiver-plane bias"),
                   Bug("rows of the map run upwards", reading(test, **{f"{printed}__frame": _upside_down}),
                       "row 0 is the top row"),
                   Bug("the map's depths are those at its texels' corners", reading(test, **{
                       f"{printed}__depth": _moved, f"{printed}__position": _moved}), "texel centres at + 1/2"),
                   Bug("nothing is in shadow", writing(test, **{f"shadow{index}__visible": np.ones_like}), ""),
                   *_interpolated(test, scene), *shadow_map_family(test, name, maps, index, points[1])))


def _add_rays(recipe: Recipe, scene: Scene, index: int) -> None:
    """Add whether a ray from each pixel's point reaches a light."""
    lamp, light, points = f"light{index}", scene.lights[index], _faces(scene)

    def test(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001 rays have one precision
        tracer = Tracer(geometry_of(arrays, scene))
        position, normal, triangle_id = (np.asarray(arrays[key]) for key in points)
        return {f"shadow{index}.visible": tracer.visible_from_light(position, normal, triangle_id >= 0,
                                                                    light_of(arrays, lamp, light))}

    place = [name for name in _light_names(lamp, light) if name.endswith("position")]
    wrong = (Bug("the light is looked for at the origin", reading(test, **{
        place[0].replace(".", "__"): np.zeros_like}), "a ray to the light"),) if place else ()
    recipe.add(f"shadow{index}", "no triangle lies between the pixel's point and the light", test,
               (*SCENE, *points, *_light_names(lamp, light)), {f"shadow{index}.visible": _visible_spec()},
               paper="shadow rays", exact=("scene.vertices", *points[:2]), bugs=(
                   Bug("nothing is in shadow", writing(test, **{f"shadow{index}__visible": np.ones_like}), ""),
                   Bug("rays start below the surface", reading(test, **{points[1].replace(".", "__"): np.negative}),
                       "off the surface, on the side that is seen"), *wrong))


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

    def unshadowed(array: Array) -> Array:
        return np.ones_like(array)

    positions = tuple(name for name in names if name.endswith("position"))
    spots = [name.replace(".", "__") for name in names if name.endswith("half_angles")]
    cones = (Bug("the outer half-angle for both: the cone's edge is hard", reading(run, **{
        name: lambda a: a[[1, 1]] for name in spots}), "docs/conventions: smooth edge of a spot"),) if spots else ()
    recipe.add("direct", "direct irradiance of all lights, without albedo/pi", run, (*POINTS, *names, *shadows),
               {"direct.irradiance": Spec("rgb, row, column", "W/m^2", "direct irradiance; 0 without surface",
                                          "linear RGB", "E = I(w) cos / d^2")},
               paper="HSS Sec. 4; docs/radiometry", exact=(POINTS[0], *positions), bugs=(
                   Bug("shadows are missing", reading(run, **{name.replace(".", "__"): unshadowed for name in
                                                              shadows}), "HSS Sec. 4"),
                   Bug("the normal points inwards", reading(run, gbuffer__normal=lambda a: -a), "E = I cos / d^2"),
                   Bug("irradiance is divided by pi", writing(run, direct__irradiance=lambda a: a / np.pi),
                       "albedo/pi comes with the radiance"), *cones, *direct_family(lights)))


def _visible_spec() -> Spec:
    return Spec("row, column", "1", "whether the light reaches the pixel's point; false without surface", tier="T0")


def _upside_down(frame: Array) -> Array:
    return np.asarray(frame * np.array([1.0, -1.0, 1.0]).reshape(3, 1))


def _moved(array: Array) -> Array:
    return np.roll(array, (1, 1), axis=(-2, -1))
