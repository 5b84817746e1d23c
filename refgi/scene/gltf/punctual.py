"""KHR_lights_punctual lights and cameras of a glTF document, placed by their node.

glTF measures spot and point lights in candela (lm/sr) and directional lights in lux (lm/m^2). They become W/sr and
W/m^2 by the luminous efficacy that defines the candela, 683 lm/W, the factor that exporters use as well. `range` is
ignored (light falls with the square of the distance). Between its two cone angles a glTF spot falls with the square of
a linear ramp in the cosine, ours with the smoothstep of `SpotLight`; inside and outside they agree.
"""

import math
from typing import Any

import numpy as np

from refgi.errors import InputError, expect
from refgi.scene.gltf.container import Document
from refgi.scene.model import Array, Camera, DirectionalLight, Light, PointLight, SpotLight, Vector

LUMEN_PER_WATT = 683.0
EXTENSION = "KHR_lights_punctual"
ROUNDING = 1e-6  # rad; a float32 near pi / 2 is within 6e-8, and written with 7 digits within 5e-7
PICTURE_HEIGHT = 512  # pixels; a glTF camera has an aspect ratio only


def node_light(document: Document, node: dict[str, Any], matrix: Array, where: str) -> Light | None:
    """Return the light a node carries, in world space.

    Parameters
    ----------
    document : Document
        The file.
    node : dict
        The node's JSON.
    matrix : (4, 4) ndarray
        World from node.
    where : str
        The node's place in the JSON.

    Returns
    -------
    Light or None
        None where the node has none.

    Raises
    ------
    InputError
        If the light's keys do not make a light.
    """
    reference = document.member(document.member(node, "extensions", where), EXTENSION, where)
    if "light" not in reference:
        return None
    listed = document.member(document.member(document.tree, "extensions", ""), EXTENSION, "extensions").get("lights")
    index = reference["light"]
    listed = listed if isinstance(listed, list) else []
    good = type(index) is int and 0 <= index < len(listed) and isinstance(listed[index], dict)
    expect(good, f"{document.path}: {where}.extensions.{EXTENSION}.light", "an index into the file's lights", index)
    label = f"extensions.{EXTENSION}.lights[{index}]"
    try:
        return _light(document, listed[index], matrix, label)
    except InputError as error:
        raise error if str(document.path) in str(error) else InputError(f"{document.path}: {label}: {error}") from error


def _light(document: Document, entry: dict[str, Any], matrix: Array, where: str) -> Light:
    colour = document.numbers(entry, "color", where, (1.0, 1.0, 1.0))
    power = document.number(entry, "intensity", where, 1.0) / LUMEN_PER_WATT
    intensity = (colour[0] * power, colour[1] * power, colour[2] * power)
    position, direction = _vector(matrix[:3, 3]), _vector(-_unit(matrix[:3, 2]))
    kind = entry.get("type")
    if kind == "directional":
        return DirectionalLight(direction, intensity)
    if kind == "point":
        return PointLight(position, intensity)
    expect(kind == "spot", f"{document.path}: {where}.type", "'spot', 'point' or 'directional'", kind)
    cone = document.member(entry, "spot", where)
    inner = document.number(cone, "innerConeAngle", f"{where}.spot", 0.0)
    outer = document.number(cone, "outerConeAngle", f"{where}.spot", math.pi / 4)
    return SpotLight(position, direction, _not_over_flat(inner), _not_over_flat(outer), intensity)


def _not_over_flat(angle: float) -> float:
    """Return an angle, or 90 degrees for one that is more by rounding: a float32 exporter writes 1.5707964."""
    return math.pi / 2 if math.pi / 2 < angle < math.pi / 2 + ROUNDING else angle


def node_camera(document: Document, node: dict[str, Any], matrix: Array, where: str) -> Camera | None:
    """Return the perspective camera a node carries, in world space.

    Parameters
    ----------
    document : Document
        The file.
    node : dict
        The node's JSON.
    matrix : (4, 4) ndarray
        World from node.
    where : str
        The node's place in the JSON.

    Returns
    -------
    Camera or None
        None where the node has none, or an orthographic one.

    Raises
    ------
    InputError
        If the camera's keys do not make a camera.
    """
    if "camera" not in node:
        return None
    entry = document.item("cameras", node["camera"], f"{where}.camera")
    label = f"cameras[{node['camera']}]"
    if entry.get("type") != "perspective":
        return None
    lens = document.member(entry, "perspective", label)
    vfov = document.number(lens, "yfov", f"{label}.perspective", 0.0)
    aspect = document.number(lens, "aspectRatio", f"{label}.perspective", 1.0)
    expect(0.01 <= aspect <= 100, f"{document.path}: {label}.perspective.aspectRatio", "0.01 to 100", aspect)
    eye = matrix[:3, 3]
    try:
        return Camera(_vector(eye), _vector(eye - _unit(matrix[:3, 2])), _vector(_unit(matrix[:3, 1])), vfov,
                      max(1, round(PICTURE_HEIGHT * aspect)), PICTURE_HEIGHT)
    except InputError as error:
        raise InputError(f"{document.path}: {label}: {error}") from error


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))


def _vector(values: Array) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z
