"""Stages of buffers: ids, G-buffer of the camera, reflective shadow map of each light (SII Sec. 3.1; docs/radiometry).

A map or camera is given as `origin` (k, 3), `frame` (k, 3, 3) with rows right, down and forward, and `half` (2,), the
half extent of the image plane. Row 0 is the top row; texel centres lie at + 1/2.
"""

import dataclasses
from typing import Any

import numpy as np

from refgi.rsm.buffers.gbuffer import GBuffer
from refgi.rsm.buffers.light_projection import light_projection
from refgi.rsm.buffers.reflective import Rsm
from refgi.rsm.buffers.solid_angle import texel_solid_angles
from refgi.rsm.raster.projection import Projection, camera_projection
from refgi.rsm.raster.visibility_buffer import Visibility, rasterize
from refgi.scene import DirectionalLight, Geometry, PointLight, Scene, SpotLight, material_table
from refgi.scene.material import MaterialTable
from refgi.scene.model import Light
from refgi.vectors.bounds import ROUNDING
from refgi.vectors.recipe import Recipe, writing
from refgi.vectors.spec import Array, Arrays, Spec
from refgi.vectors.stages.buffer_forms import (
    flux_form,
    flux_lists,
    ids_form,
    ids_lists,
    surface_form,
    surface_lists,
    view_lists_of_flux,
)
from refgi.vectors.stages.vertex_colours import COLOURS, Tinted, colours_read, give_colours

VECTOR, POINT = "unit vector", "m"
QUADRATURE = 8.0  # roundings that a float32 sum over a texel's nodes gathers; the bound is SAFETY times as wide
SCENE = ("scene.vertices", "scene.faces", "scene.material_of_face")
REFLECTANCE = ("materials.diffuse", "materials.specular", "materials.exponent")
EARLIER = "before"  # the camera of the frame before, whose bugs are those of the camera
NAMES = {SpotLight: "spot", PointLight: "point", DirectionalLight: "directional"}


def give_scene(recipe: Recipe, scene: Scene) -> None:
    """Give the triangles and materials of a scene."""
    recipe.scene = scene
    geometry, materials = scene.geometry, material_table(scene.materials)
    recipe.give("scene.vertices", geometry.vertices, Spec("vertex, xyz", "m", "corners of triangles", "world"))
    recipe.give("scene.faces", geometry.faces, Spec("triangle, corner", "1", "indices of vertices", tier="T0"))
    recipe.give("scene.material_of_face", geometry.material_of_face,
                Spec("triangle", "1", "indices of materials", tier="T0"))
    if geometry.vertex_normals is not None:
        recipe.give("scene.vertex_normals", geometry.vertex_normals,
                    Spec("vertex, xyz", VECTOR, "normals, interpolated over triangles", "world"))
    give_colours(recipe, geometry)
    recipe.give("materials.diffuse", materials.diffuse, Spec("material, rgb", "1", "reflectance of the diffuse part"))
    recipe.give("materials.specular", materials.specular, Spec("material, rgb", "1", "reflectance of the Phong lobe"))
    recipe.give("materials.exponent", materials.exponent, Spec("material", "1", "Phong exponent"))


def add_gbuffer(recipe: Recipe, scene: Scene, width: int, height: int) -> None:
    """Add the camera's ids and G-buffer."""
    maps = camera_projection(scene.camera, width, height)
    _give_maps(recipe, "camera", maps)
    _add_ids(recipe, "gbuffer", "camera", maps, scene)
    _add_surface(recipe, "gbuffer", "camera", maps, scene, ("depth", "position", "normal", "albedo"))


def add_rsm(recipe: Recipe, scene: Scene, index: int, resolution: int) -> None:
    """Add ids, surface and flux of one light's reflective shadow map, `rsm0` for the first light."""
    light, name, lamp = scene.lights[index], f"rsm{index}", f"light{index}"
    maps = light_projection(light, scene.geometry, resolution)
    _give_light(recipe, lamp, light)
    _give_maps(recipe, name, maps)
    _add_ids(recipe, name, name, maps, scene)
    _add_surface(recipe, name, name, maps, scene, ("depth", "position", "normal"))
    glossy = any(any(material.specular) for material in scene.materials)
    reads = (*SCENE, *_normals(recipe), *colours_read(recipe, f"{name}.position"), *REFLECTANCE, *_map_names(name),
             f"{name}.triangle_id", *_light_names(lamp, light))

    def flux(arrays: Arrays, real: Any) -> Arrays:
        map_here = rsm_of(arrays, name, lamp, light, maps, real, scene)
        made = {f"{name}.solid_angle": texel_solid_angles(_maps_of(arrays, name, maps)), f"{name}.flux": map_here.flux}
        lobes = {f"{name}.{key}": getattr(map_here, key) for key in ("lobe_flux", "lobe_axis", "lobe_exponent")}
        return made | (lobes if glossy else {})

    sheet = "row, column"
    writes = {f"{name}.solid_angle": Spec(sheet, "m^2" if isinstance(light, DirectionalLight) else "sr",
                                          "solid angle of the whole texel; directional: area across the light",
                                          paper="Phi_t = albedo int_t I dw: docs/rasterizer, flux"),
              f"{name}.flux": Spec(f"rgb, {sheet}", "W", "flux that the diffuse part of the surface reflects",
                                   "linear RGB", "SII Sec. 3.1, calibrated")}
    if glossy:
        writes |= {f"{name}.lobe_flux": Spec(f"rgb, {sheet}", "W", "flux that the lobe reflects", "linear RGB",
                                             "SII Eq. 3"),
                   f"{name}.lobe_axis": Spec(f"xyz, {sheet}", VECTOR, "mirror direction; 0 without lobe or light",
                                             "world", "r = d - 2 (n . d) n"),
                   f"{name}.lobe_exponent": Spec(sheet, "1", "Phong exponent; 0 without lobe or light")}
    # a spot's flux is an integral over each texel, which refgi takes in float64 in any run
    summed = writing(flux, **{f"{name}__flux": lambda a: (a * (1.0 + QUADRATURE * ROUNDING)).astype(a.dtype)})
    if COLOURS in recipe.specs:
        tinted = Tinted(flux, name, f"{name}.flux")
        recipe.add(f"{name}.flux", "flux that leaves each texel's surface", flux, reads, writes,
                   paper="SII Sec. 3.1; docs/radiometry",
                   variants=(*((summed,) if isinstance(light, SpotLight) else ()), tinted.variant()),
                   bugs=(*tinted.bugs(), *((tinted.specular_bug(f"{name}.lobe_flux"),) if glossy else ())))
        return
    form = flux_form(name, lamp, light, maps, bool(_normals(recipe)))
    recipe.add(f"{name}.flux", "flux that leaves each texel's surface", flux, reads, writes,
               paper="SII Sec. 3.1; docs/radiometry",
               variants=(form, *((summed,) if isinstance(light, SpotLight) else ())),
               bugs=(*form.bugs(*flux_lists(light, maps, glossy)),
                     *form.bugs(*view_lists_of_flux(maps, glossy), of="buffers")))


def rsm_of(
    arrays: Arrays, name: str, lamp: str, light: Light, maps: Projection, real: Any, scene: Scene
) -> Rsm:
    """Return the reflective shadow map whose inputs are arrays, and as many of its channels as are among them."""
    projection = _maps_of(arrays, name, maps)
    geometry, materials = geometry_of(arrays, scene), materials_of(arrays, real)
    view = GBuffer(geometry, materials, projection, _visible(arrays[f"{name}.triangle_id"]), real)
    given = ("depth", "position", "normal", "solid_angle", "flux", "lobe_flux", "lobe_axis", "lobe_exponent")
    known = {key: np.ascontiguousarray(arrays[f"{name}.{key}"], real) for key in given if f"{name}.{key}" in arrays}
    return Rsm(light_of(arrays, lamp, light), view, materials, known)


def geometry_of(arrays: Arrays, scene: Scene) -> Geometry:
    """Return the triangles among arrays."""
    normals, colours = arrays.get("scene.vertex_normals"), arrays.get(COLOURS)
    return dataclasses.replace(scene.geometry, vertices=np.asarray(arrays["scene.vertices"], np.float64),
                               faces=np.asarray(arrays["scene.faces"], np.int32),
                               material_of_face=np.asarray(arrays["scene.material_of_face"], np.int32),
                               vertex_normals=None if normals is None else np.asarray(normals, np.float64),
                               colours=None if colours is None else np.asarray(colours, np.float64))


def materials_of(arrays: Arrays, real: Any) -> MaterialTable:
    """Return the materials among arrays: opaque, without emission."""
    diffuse, specular, exponent = (np.ascontiguousarray(arrays[name], real) for name in REFLECTANCE)
    return MaterialTable(diffuse, specular, exponent, np.zeros_like(exponent), np.zeros_like(diffuse))


def light_of(arrays: Arrays, lamp: str, light: Light) -> Light:
    """Return the light among arrays."""
    value: dict[str, Any] = {key: tuple(np.asarray(arrays[f"{lamp}.{key}"], np.float64).tolist())
                             for key in _light_keys(light)}
    if isinstance(light, SpotLight):
        inner, outer = value.pop("half_angles")
        value |= {"inner_half_angle": min(inner, outer), "outer_half_angle": outer, "falloff": light.falloff}
    made: Light = type(light)(**value)
    return made


def _normals(recipe: Recipe) -> tuple[str, ...]:
    return ("scene.vertex_normals",) if "scene.vertex_normals" in recipe.specs else ()


def _map_names(name: str) -> tuple[str, str, str]:
    return f"{name}.origin", f"{name}.frame", f"{name}.half"


def _light_keys(light: Light) -> tuple[str, ...]:
    if isinstance(light, SpotLight):
        return "position", "direction", "half_angles", "intensity"
    return ("position", "intensity") if isinstance(light, PointLight) else ("direction", "irradiance")


def _light_names(lamp: str, light: Light) -> tuple[str, ...]:
    return tuple(f"{lamp}.{key}" for key in _light_keys(light))


def _give_light(recipe: Recipe, lamp: str, light: Light) -> None:
    spec = {"position": Spec("xyz", "m", f"place of the {NAMES[type(light)]} light", "world"),
            "direction": Spec("xyz", "1", "where it shines to, any length", "world"),
            "half_angles": Spec("(inner, outer)", "rad", "half-angles of the cone: full light within, none beyond"),
            "intensity": Spec("rgb", "W/sr", "radiant intensity, of a spot on its axis", "linear RGB"),
            "irradiance": Spec("rgb", "W/m^2", "irradiance of a surface across the light", "linear RGB")}
    for key in _light_keys(light):
        value = getattr(light, key, None)
        if value is None and isinstance(light, SpotLight):
            value = light.inner_half_angle, light.outer_half_angle
        recipe.give(f"{lamp}.{key}", value, spec[key])
    recipe.facts[lamp] = NAMES[type(light)]
    if isinstance(light, SpotLight) and light.falloff != SpotLight.falloff:
        recipe.facts[f"{lamp}.falloff"] = light.falloff


def _give_maps(recipe: Recipe, name: str, maps: Projection) -> None:
    kind = ("perspective", "orthographic", "paraboloid")[maps.kind]
    recipe.give(f"{name}.origin", maps.origin, Spec("map, xyz", "m", f"centre of each {kind} map", "world"))
    recipe.give(f"{name}.frame", maps.frame, Spec("map, (right, down, forward), xyz", VECTOR, "axes of each map",
                                                  "world"))
    recipe.give(f"{name}.half", maps.half, Spec("(horizontal, vertical)", "m" if maps.kind == 1 else "1",
                                                "half extent of the map on the image plane"))
    recipe.facts[name] = {"projection": kind, "maps": maps.maps, "rows": maps.height, "columns": maps.width}


def _maps_of(arrays: Arrays, name: str, maps: Projection) -> Projection:
    origin, frame, half = (np.ascontiguousarray(arrays[one], np.float64) for one in _map_names(name))
    return maps._replace(origin=origin, frame=frame, half=half)


def _visible(triangle_id: Array) -> Visibility:
    ids = np.ascontiguousarray(triangle_id, np.int32)
    return Visibility(ids, (ids >= 0).astype(np.float32))


def _add_ids(recipe: Recipe, name: str, view: str, maps: Projection, scene: Scene) -> None:
    form = ids_form(name, view, maps)

    def ids(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001 the rasterizer has one precision
        return {f"{name}.triangle_id": rasterize(geometry_of(arrays, scene), _maps_of(arrays, view, maps)).triangle_id}

    lists = () if name == EARLIER else ids_lists(maps)
    recipe.add(f"{name}.ids", "nearest triangle at each texel's centre", ids, (*SCENE, *_map_names(view)),
               {f"{name}.triangle_id": Spec("row, column", "1", "nearest triangle, -1 for none", tier="T0")},
               paper="docs/rasterizer", bugs=form.bugs("view/upwards", *lists), variants=(form,))


def _add_surface(
    recipe: Recipe, name: str, view: str, maps: Projection, scene: Scene, channels: tuple[str, ...]
) -> None:
    smooth = bool(_normals(recipe))
    form = surface_form(name, view, maps, smooth)

    def surface(arrays: Arrays, real: Any) -> Arrays:
        buffer = GBuffer(geometry_of(arrays, scene), materials_of(arrays, real), _maps_of(arrays, view, maps),
                         _visible(arrays[f"{name}.triangle_id"]), real)
        return {f"{name}.{key}": one for key, one in zip(channels, buffer.resolve(*channels), strict=True)}

    specs = {"depth": Spec("row, column", "m", "depth along the view's axis; inf without surface"),
             "position": Spec("xyz, row, column", "m", "surface point; 0 without surface", "world"),
             "normal": Spec("xyz, row, column", VECTOR, "on the side that is seen; 0 without surface", "world"),
             "albedo": Spec("rgb, row, column", "1", "diffuse reflectance; 0 without surface", "linear RGB")}
    lists = () if name == EARLIER else surface_lists(maps, smooth, "albedo" in channels)
    tinted = Tinted(surface, name, f"{name}.albedo") if "albedo" in channels and COLOURS in recipe.specs else None
    recipe.add(f"{name}.surface", "depth, position and normal of what each texel sees", surface,
               (*SCENE, *_normals(recipe), *(colours_read(recipe) if tinted else ()), *REFLECTANCE, *_map_names(view),
                f"{name}.triangle_id"), {f"{name}.{key}": specs[key] for key in channels}, paper="SII Sec. 3.1",
               bugs=tinted.bugs() if tinted else form.bugs("surface/side", *lists),
               variants=(tinted.variant() if tinted else form,))
