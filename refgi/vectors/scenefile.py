"""A case's scene as files that renderers read: scene.json and an OBJ with all digits of float32."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from refgi.scene import DirectionalLight, Material, PointLight, Scene, SpotLight
from refgi.types import Array


def is_plain(scene: Scene) -> bool:
    """Return whether the files can say all of a scene: opaque triangles without textures and glow."""
    geometry, bare = scene.geometry, Material()
    return geometry.cut_outs is None and all(
        getattr(one, key) == getattr(bare, key) for one in scene.materials
        for key in ("ior", "emission", "texture", "alpha", "cutoff", "emission_texture", "alpha_texture", "sends"))


def write_scene(scene: Scene, size: tuple[int, int], folder: Path) -> None:
    """Write scene.json and scene.obj, triangles in the order of the case's ids; `size`: columns and rows."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scene.obj").write_text(_obj(scene), encoding="utf-8", newline="\n")
    (folder / "scene.json").write_text(json.dumps(_scene(scene, size), indent=1) + "\n", encoding="utf-8", newline="\n")


def _scene(scene: Scene, size: tuple[int, int]) -> dict[str, Any]:
    camera = scene.camera
    return {
        "schema": 1,
        "name": scene.name,
        "objects": [{"mesh": "scene.obj", "smooth_normals": scene.geometry.vertex_normals is not None}],
        "materials": {_name(k): {
            "type": "phong" if any(one.specular) else "diffuse", "diffuse": list(one.diffuse),
            **({"specular": list(one.specular), "exponent": one.exponent} if any(one.specular) else {})}
            for k, one in enumerate(scene.materials)},
        "camera": {"eye": list(camera.eye), "target": list(camera.target), "up": list(camera.up),
                   "vfov_deg": math.degrees(camera.vfov), "width": size[0], "height": size[1]},
        "lights": [_light(light) for light in scene.lights],
    }


def _light(light: Any) -> dict[str, Any]:
    if isinstance(light, SpotLight):
        return {"type": "spot", "position": list(light.position), "direction": list(light.direction),
                "inner_half_angle_deg": math.degrees(light.inner_half_angle),
                "outer_half_angle_deg": math.degrees(light.outer_half_angle),
                "intensity_w_per_sr": list(light.intensity),
                **({} if light.falloff == "smoothstep" else {"falloff": light.falloff})}
    if isinstance(light, PointLight):
        return {"type": "point", "position": list(light.position), "intensity_w_per_sr": list(light.intensity)}
    assert isinstance(light, DirectionalLight)
    return {"type": "directional", "direction": list(light.direction), "irradiance_w_per_m2": list(light.irradiance)}


def _name(material: int) -> str:
    return f"material{material}"


def _obj(scene: Scene) -> str:
    geometry, lines, material = scene.geometry, ["# triangles in the order of triangle_id"], -1
    points = geometry.vertices
    if geometry.colours is not None:  # of a vertex: all faces that share it have the same one there
        of_vertex = np.ones_like(points)
        of_vertex[geometry.faces] = geometry.colours
        points = np.hstack([points, of_vertex])
    lines += [_row("v", vertex) for vertex in points]
    normals = geometry.vertex_normals
    lines += [] if normals is None else [_row("vn", normal) for normal in normals]
    for face, own in zip(geometry.faces + 1, geometry.material_of_face, strict=True):
        if own != material:
            material = int(own)
            lines.append(f"usemtl {_name(material)}")
        corners = [str(k) if normals is None else f"{k}//{k}" for k in face]
        lines.append(f"f {' '.join(corners)}")
    return "\n".join(lines) + "\n"


def _row(key: str, values: Array) -> str:
    return " ".join((key, *(f"{value:.9g}" for value in values)))
