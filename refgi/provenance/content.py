"""What a scene consists of, as JSON values and back: digests of its surfaces, its camera and lights in full.

Values of Python as values of JSON.
"""

import dataclasses
import hashlib
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from refgi.errors import InputError
from refgi.image import canonical_json
from refgi.scene import Camera, DirectionalLight, Light, Material, PointLight, Scene, SpotLight
from refgi.scene.material import TEXTURES
from refgi.settings import Settings, flat

LIGHTS: dict[str, type[SpotLight] | type[PointLight] | type[DirectionalLight]] = {
    "spot": SpotLight, "point": PointLight, "directional": DirectionalLight}


def plain(value: Any) -> Any:
    """Turn settings and figures into finite JSON values.

    Parameters
    ----------
    value : object
        Dataclasses, mappings, sequences, sets, numbers, text, types.

    Returns
    -------
    object
        The same as dict, list, str, int, float, bool and None.
    """
    if isinstance(value, Settings):
        return {key: plain(item) for key, item in flat(value).items()}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, dict) or hasattr(value, "items"):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, set | frozenset):
        return sorted(map(plain, value))
    if isinstance(value, list | tuple | np.ndarray):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else str(value)
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)


def geometry_digest(scene: Scene) -> str:
    """Return SHA-256 over all triangles, their normals, texture coordinates and which material each has.

    Equal on every machine.
    """
    shape, digest = scene.geometry, hashlib.sha256()
    for array, kind in ((shape.vertices, "<f8"), (shape.faces, "<i4"), (shape.material_of_face, "<i4"),
                        (shape.vertex_normals, "<f8")):
        plane = np.zeros(0, kind) if array is None else np.ascontiguousarray(array, kind)
        digest.update(f"{plane.shape}\0".encode() + plane.tobytes())
    for key in ("uv", "colours"):
        if getattr(shape, key) is not None:  # absent, the digest is that of earlier versions
            plane = np.ascontiguousarray(getattr(shape, key), "<f8")
            digest.update(f"{key} {plane.shape}\0".encode() + plane.tobytes())
    return digest.hexdigest()


def materials_digest(scene: Scene) -> str:
    """Return SHA-256 over all materials, their names and their order, and every texel of their images.

    Equal on every machine.
    """
    return hashlib.sha256(canonical_json([_material_json(one) for one in scene.materials]).encode()).hexdigest()


def _material_json(material: Material) -> dict[str, Any]:
    """Return a material as JSON values; textures, alpha and cutoff only where it has some, images by their digests."""
    without: dict[str, Any] = dict.fromkeys(TEXTURES)
    fields: dict[str, Any] = plain(dataclasses.replace(material, **without))
    del fields["one_sided"]
    for key in TEXTURES:
        del fields[key]
        texture = getattr(material, key)
        if texture is not None:
            fields[key] = {"image": texture.image.digest, "wrap": list(texture.wrap), "filter": texture.filter}
    if material.cutoff is None:  # absent, the digest is that of earlier versions
        del fields["alpha"], fields["cutoff"]
    for key in ("sends", "solid"):
        if getattr(material, key) == getattr(Material, key):
            del fields[key]
    return fields


def light_json(light: Light) -> dict[str, Any]:
    """Return a light's type and fields as JSON values, angles in rad, so that no bit is lost.

    A spot's falloff is left out where it is the smoothstep.
    """
    kind = next(name for name, one in LIGHTS.items() if isinstance(light, one))
    fields: dict[str, Any] = plain(light)
    if isinstance(light, SpotLight) and light.falloff == SpotLight.falloff:  # as in earlier versions
        del fields["falloff"]
    return {"type": kind} | fields


def light_from(content: Mapping[str, Any]) -> Light:
    """Return the light that `light_json` wrote, equal to the bit. Raises InputError if the content is not a light's."""
    kind = LIGHTS.get(str(content.get("type")), PointLight)
    usual = {"falloff": SpotLight.falloff} if kind is SpotLight else {}
    made: Light = _made(kind, usual | {key: value for key, value in content.items() if key != "type"}, "light")
    return made


def camera_from(content: Mapping[str, Any]) -> Camera:
    """Return the camera that `plain` wrote, equal to the bit. Raises InputError if the content is not a camera's."""
    camera: Camera = _made(Camera, content, "camera")
    return camera


def _made(kind: type[Any], content: Mapping[str, Any], key: str) -> Any:
    known = {field.name for field in dataclasses.fields(kind)}
    if set(content) != known:
        raise InputError(f"{key}: expected the keys {', '.join(sorted(known))}, got {', '.join(sorted(content))}",
                         key=key)
    return kind(**content)
