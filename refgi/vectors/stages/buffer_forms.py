"""Literal forms of the stages of buffers, and which rows of likely bugs they have."""

from typing import Any

from refgi.literal import buffers, light_flux
from refgi.rsm.raster.projection import ORTHOGRAPHIC, Projection
from refgi.scene import DirectionalLight, SpotLight
from refgi.scene.model import Light
from refgi.vectors.forms import falloff_lists
from refgi.vectors.rows import Form

VIEWS = "view/centre", "view/resolution", "view/frame", "view/origin", "view/extent"
TRIANGLES = {"vertices": "scene.vertices", "faces": "scene.faces"}
MATERIAL, NORMALS = {"material_of_face": "scene.material_of_face"}, {"vertex_normals": "scene.vertex_normals"}


def view_reads(view: str) -> dict[str, Any]:
    """Return what the literal text reads of a camera or light's map."""
    return {key: f"{view}.{key}" for key in ("origin", "frame", "half")}


def view_numbers(maps: Projection) -> dict[str, Any]:
    """Return sizes and kind of maps."""
    return {"rows": maps.height, "columns": maps.width, "parallel": maps.kind == ORTHOGRAPHIC}


def ids_form(name: str, view: str, maps: Projection) -> Form:
    """Return the literal form of a view's ids."""
    return Form(buffers.visible_triangles, {**TRIANGLES, **view_reads(view)}, (f"{name}.triangle_id",),
                view_numbers(maps), double=True)


def ids_lists(maps: Projection) -> tuple[str, ...]:
    """Return the lists of rows of ids."""
    return ("triangles", f"triangles/{_kind(maps)}", *VIEWS,
            *(("triangles/cube", "view/cube", "view/cube down") if maps.maps > 1 else ()))


def surface_form(name: str, view: str, maps: Projection, smooth: bool) -> Form:
    """Return the literal form of what a view sees; `smooth`: normals are interpolated."""
    reads = {**TRIANGLES, **MATERIAL, **(NORMALS if smooth else {}), "diffuse": "materials.diffuse",
             "triangle_id": f"{name}.triangle_id", **view_reads(view)}
    return Form(buffers.surface, reads, tuple(f"{name}.{key}" for key in ("depth", "position", "normal", "albedo")),
                view_numbers(maps), double=True)


def surface_lists(maps: Projection, smooth: bool, albedo: bool) -> tuple[str, ...]:
    """Return the lists of rows of surfaces."""
    return ("surface", f"surface/{_kind(maps)}", *VIEWS, *(("surface/smooth",) if smooth else ()),
            *(("surface/albedo",) if albedo else ()),
            *(("view/cube", "view/cube down", "view/cube rows") if maps.maps > 1 else ()))


def flux_form(name: str, lamp: str, light: Light, maps: Projection, smooth: bool) -> Form:
    """Return the literal form of a light map's flux."""
    strength = "irradiance" if isinstance(light, DirectionalLight) else "intensity"
    reads = {**TRIANGLES, **MATERIAL, **(NORMALS if smooth else {}), "triangle_id": f"{name}.triangle_id",
             **{key: f"materials.{key}" for key in ("diffuse", "specular", "exponent")},
             **view_reads(name), "strength": f"{lamp}.{strength}"}
    numbers = view_numbers(maps)
    if isinstance(light, SpotLight):
        reads["half_angles"], numbers["falloff"] = f"{lamp}.half_angles", light.falloff
    return Form(light_flux.reflected_flux, reads, tuple(f"{name}.{key}" for key in (
        "solid_angle", "flux", "lobe_flux", "lobe_axis", "lobe_exponent")), numbers, double=True)


def flux_lists(light: Light, maps: Projection, glossy: bool) -> tuple[str, ...]:
    """Return the lists of rows of a map's flux."""
    cube = maps.maps > 1
    return ("flux", f"flux/{_kind(maps)}", *(("flux/spot",) if isinstance(light, SpotLight) else ()),
            *falloff_lists([light]), *(("flux/cube",) if cube else ()), *(("flux/glossy",) if glossy else ()),
            *(("flux/glossy cube",) if glossy and cube else ()))


def view_lists_of_flux(maps: Projection, glossy: bool) -> tuple[str, ...]:
    """Return the lists of rows of a view that solid angles, and mirror directions of lobes, tell."""
    cube = maps.maps > 1
    return (*(("view/frame",) if glossy else ()), *(("view/cube rows",) if cube else ()),
            *(("view/cube",) if glossy and cube else ()))


def _kind(maps: Projection) -> str:
    return "parallel" if maps.kind == ORTHOGRAPHIC else "perspective"
