"""What the arrays of a scene, its lamps and views are, which no stage makes and no docstring of a stage describes."""

from collections.abc import Collection
from typing import Any

from refgi.rsm.raster.projection import ORTHOGRAPHIC
from refgi.vectors.spec import Spec

INPUTS = {
    "scene.vertices": Spec("vertex, xyz", "m", "Corners of triangles.", "world"),
    "scene.faces": Spec("triangle, corner", "1", "Indices of vertices."),
    "scene.material_of_face": Spec("triangle", "1", "Indices of materials."),
    "scene.vertex_normals": Spec("vertex, xyz", "1", "Unit normals, interpolated over triangles.", "world"),
    "scene.uv": Spec("triangle, corner, uv", "1", "Texture coordinates."),
    "scene.colours": Spec("triangle, corner, rgb", "1", "Factors of the diffuse reflectance, linear between corners.",
                          "linear RGB"),
    "materials.diffuse": Spec("material, rgb", "1", "Reflectance of the diffuse part.", "linear RGB"),
    "materials.specular": Spec("material, rgb", "1", "Reflectance of the Phong lobe.", "linear RGB"),
    "materials.exponent": Spec("material", "1", "Phong exponent."),
    "materials.ior": Spec("material", "1", "Index of refraction; 0 where opaque."),
    "materials.emission": Spec("material, rgb", "W/m^2/sr", "Radiance.", "linear RGB"),
    "projection.origin": Spec("map, xyz", "m", "Centre of each perspective map; of a parallel one that of depth 0.",
                              "world"),
    "projection.frame": Spec("map, (right, down, forward), xyz", "1", "Axes of each map, unit vectors.", "world"),
    "projection.half": Spec("(horizontal, vertical)", "1", "Half extent of the map on the image plane at distance 1."),
    "parallel.half": Spec("(horizontal, vertical)", "m", "Half extent of the map."),
    "lamp.strength": Spec("rgb", "W/sr", "Radiant intensity, of a spot on its axis.", "linear RGB"),
    "sun.strength": Spec("rgb", "W/m^2", "Irradiance of a surface across the light.", "linear RGB"),
    "lamp.place": Spec("xyz", "m", "Place of the lamp.", "world"),
    "lamp.direction": Spec("xyz", "1", "Where it shines to, any length.", "world"),
    "lamp.half_angles": Spec("(inner, outer)", "rad", "Half-angles of the cone: full light within, none beyond."),
}


def input_spec(name: str, value: Any, beside: Collection[str]) -> Spec | None:
    """Return what a given array is, from its name, the parameter it is in and the leaves beside it; None: unknown."""
    start, _, field = name.rpartition(".")
    last = start.rpartition(".")[2]
    if last == "lamp" and field == "strength" and not any(leaf.endswith("lamp.place") for leaf in beside):
        last = "sun"
    if last == "projection" and field == "half" and value.kind == ORTHOGRAPHIC:
        last = "parallel"
    return INPUTS.get(f"{last}.{field}")
