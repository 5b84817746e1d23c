"""The node tree of a glTF document: what the default scene holds, in order, and where each lies, instances too.

KHR_lights_punctual lights and cameras are placed by their node. glTF measures spot and point lights in candela (lm/sr)
and directional lights in lux (lm/m^2). They become W/sr and W/m^2 by the luminous efficacy that defines the candela,
683 lm/W, the factor that exporters use as well, unless another unit is asked for. `range` is ignored (light falls with
the square of the distance). Between its cone angles a spot has the extension's falloff.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.errors import InputError, expect
from refgi.scene.files import per_watt
from refgi.scene.gltf.container import Document, accessor
from refgi.scene.mesh import as_float64
from refgi.scene.model import Camera, DirectionalLight, Light, PointLight, SpotLight
from refgi.scene.motion import expect_affine, invertible
from refgi.scene.values import Vector
from refgi.types import Array

NO_MATRIX = tuple(np.eye(4).ravel().tolist())
EXTENSION = "KHR_lights_punctual"
ROUNDING = 1e-6  # rad; a float32 near pi / 2 is within 6e-8, and written with 7 digits within 5e-7
PICTURE_HEIGHT = 512  # pixels; a glTF camera has an aspect ratio only


class Nodes(NamedTuple):
    """The nodes of one scene, parents before children, in the order of the tree."""

    number: list[int]  # (k,) of the file's list of nodes
    parent: list[int]  # (k,) position in this list, -1 for a root
    world: Array  # (k, 4, 4) world from node


def scene_nodes(document: Document) -> Nodes:
    """Walk the default scene of a document.

    Raises `InputError` if a reference leads nowhere or to a node with another parent, or a matrix is not usable.
    """
    return _placed(document, _roots(document))


def all_nodes(document: Document) -> Nodes:
    """Walk all nodes of a document, those of its default scene among others; raises as `scene_nodes`."""
    return _placed(document, _parentless(document))


def _placed(document: Document, roots: list[int]) -> Nodes:
    numbers, parent = _order(document, roots)
    nodes = document.items("nodes")
    world = np.tile(np.eye(4), (len(numbers), 1, 1))
    keys = [_fill_local(world[k], document, nodes[number], f"nodes[{number}]") for k, number in enumerate(numbers)]
    # a scale of 0, 0, 0 hides the meshes of a node and of all below it
    hidden = np.asarray(~world[:, :3, :3].any(axis=(1, 2)) & (world[:, 3] == (0, 0, 0, 1)).all(axis=1))
    shown = np.flatnonzero(~hidden)
    expect_affine(world[shown], lambda k: f"{document.path}: nodes[{numbers[shown[k]]}]{keys[shown[k]]}")
    with np.errstate(over="ignore", invalid="ignore"):  # judged below, with the node's name
        for k, above in enumerate(parent):
            if above >= 0:
                world[k] = world[above] @ world[k] if keys[k] else world[above]
                hidden[k] |= hidden[above]
    for k in np.flatnonzero(~(hidden | invertible(world)))[:1].tolist():
        expect(False, f"{document.path}: nodes[{numbers[k]}]",
               "a finite, invertible product with its parents' matrices", world[k].ravel().tolist())
    return Nodes(numbers, parent, world)


def _order(document: Document, roots: list[int]) -> tuple[list[int], list[int]]:
    """Return the nodes, depth first and children in order, and the position of each one's parent."""
    numbers: list[int] = []
    parent: list[int] = []
    visited: set[int] = set()
    pending = [(root, -1) for root in reversed(roots)]
    while pending:
        number, above = pending.pop()
        node = document.item("nodes", number, "a node reference")
        if number in visited:
            expect(False, f"{document.path}: nodes[{number}]", "one parent", "several, or a cycle")
        visited.add(number)
        numbers.append(number)
        parent.append(above)
        children = _indices(document, node, "children", f"nodes[{number}]")
        pending += [(child, len(numbers) - 1) for child in reversed(children)]
    return numbers, parent


def _roots(document: Document) -> list[int]:
    scenes = document.items("scenes")
    if scenes:
        index = document.tree.get("scene", 0)
        return _indices(document, document.item("scenes", index, "scene"), "nodes", f"scenes[{index}]")
    return _parentless(document)


def _parentless(document: Document) -> list[int]:
    nodes = document.items("nodes")
    children = {c for i, node in enumerate(nodes) for c in _indices(document, node, "children", f"nodes[{i}]")}
    return [index for index in range(len(nodes)) if index not in children]


def _indices(document: Document, owner: dict[str, Any], key: str, where: str) -> list[int]:
    found = owner.get(key, [])
    if not (isinstance(found, list) and {int}.issuperset(map(type, found))):
        expect(False, f"{document.path}: {where}.{key}", "a list of indices", found)
    return found  # type: ignore[no-any-return]


def _fill_local(matrix: Array, document: Document, node: dict[str, Any], where: str) -> str:
    """Write the matrix parent from node; return the key it comes from, nothing where the node has none."""
    if "matrix" in node:
        columns = document.numbers(node, "matrix", where, NO_MATRIX)
        matrix[...] = np.reshape(columns, (4, 4)).T
        return ".matrix"
    if not ("translation" in node or "rotation" in node or "scale" in node):
        return ""
    sx, sy, sz = document.numbers(node, "scale", where, (1.0, 1.0, 1.0))
    tx, ty, tz = document.numbers(node, "translation", where, (0.0, 0.0, 0.0))
    if "rotation" in node:
        quaternion = document.numbers(node, "rotation", where, (0.0, 0.0, 0.0, 1.0))
        a, b, c = _rotation(quaternion, f"{document.path}: {where}.rotation")
        matrix[:3] = ((a[0] * sx, a[1] * sy, a[2] * sz, tx), (b[0] * sx, b[1] * sy, b[2] * sz, ty),
                      (c[0] * sx, c[1] * sy, c[2] * sz, tz))
    else:
        matrix[:3] = (sx, 0.0, 0.0, tx), (0.0, sy, 0.0, ty), (0.0, 0.0, sz, tz)
    return " (translation, rotation, scale)"


def _rotation(quaternion: tuple[float, ...], where: str) -> tuple[Vector, Vector, Vector]:
    """Return the rows of the rotation of a quaternion (x, y, z, w) of any length but zero."""
    length = math.hypot(*quaternion)
    expect(length > 0, where, "a quaternion that is not zero", quaternion)
    x, y, z, w = (c / length for c in quaternion)
    return rotation_rows(x, y, z, w)


def rotation_rows(x: Any, y: Any, z: Any, w: Any) -> tuple[Any, Any, Any]:
    """Return the rows of the rotations of unit quaternions, numbers or arrays (k,)."""
    return ((1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
            (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
            (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)))


def node_light(document: Document, node: dict[str, Any], matrix: Array, where: str) -> Light | None:
    """Return the light a node carries, in world space.

    `matrix` (4, 4): world from node. `where`: the node's place in the JSON. Result: none where the node has none.
    Raises `InputError` if the light's keys do not make a light.
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
    kind = entry.get("type")
    power = document.number(entry, "intensity", where, 1.0) / per_watt(directional=kind == "directional")
    intensity = (colour[0] * power, colour[1] * power, colour[2] * power)
    position, direction = _vector(matrix[:3, 3]), _vector(-_unit(matrix[:3, 2]))
    if kind == "directional":
        return DirectionalLight(direction, intensity)
    if kind == "point":
        return PointLight(position, intensity)
    expect(kind == "spot", f"{document.path}: {where}.type", "'spot', 'point' or 'directional'", kind)
    cone = document.member(entry, "spot", where)
    inner = document.number(cone, "innerConeAngle", f"{where}.spot", 0.0)
    outer = document.number(cone, "outerConeAngle", f"{where}.spot", math.pi / 4)
    return SpotLight(position, direction, _not_over_flat(inner), _not_over_flat(outer), intensity, "squared_ramp")


def _not_over_flat(angle: float) -> float:
    """Return an angle, or 90 degrees for one that is more by rounding: a float32 exporter writes 1.5707964."""
    return math.pi / 2 if math.pi / 2 < angle < math.pi / 2 + ROUNDING else angle


def node_camera(document: Document, node: dict[str, Any], matrix: Array, where: str) -> Camera | None:
    """Return the perspective camera a node carries, in world space.

    `matrix` (4, 4): world from node. `where`: the node's place in the JSON. Result: none where the node has none, or an
    orthographic one. Raises `InputError` if the camera's keys do not make a camera.
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


INSTANCING = "EXT_mesh_gpu_instancing"
KINDS = {"TRANSLATION": "VEC3", "ROTATION": "VEC4", "SCALE": "VEC3"}


def instances(document: Document, node: dict[str, Any], matrix: Array, where: str) -> Array | None:
    """Return (k, 4, 4) world from instance for all instances of a node's mesh, None where it is drawn once.

    `matrix` (4, 4): world from node. Result: some may have no inverse. Raises `InputError` if the attributes differ in
    number, or a number is not finite.
    """
    extensions = document.member(node, "extensions", where)
    if INSTANCING not in extensions:
        return None
    where = f"{where}.extensions.{INSTANCING}"
    attributes = document.member(document.member(extensions, INSTANCING, where), "attributes", where)
    found = {key: as_float64(accessor(document, attributes[key], kind, f"{where}.attributes.{key}"))
             for key, kind in KINDS.items() if key in attributes}
    if not found:
        return None
    count = len(next(iter(found.values())))
    for key, values in found.items():
        place = f"{document.path}: {where}.attributes.{key}"
        expect(len(values) == count, place, f"{count} elements as in the others", len(values))
        for number in np.flatnonzero(~np.isfinite(values).all(axis=1))[:1].tolist():
            expect(False, f"{place}: instance {number}", "finite numbers", values[number].tolist())
    matrices = np.tile(np.eye(4), (count, 1, 1))
    if "ROTATION" in found:
        matrices[:, :3, :3] = _rotations(found["ROTATION"])
    if "SCALE" in found:
        matrices[:, :3, :3] *= found["SCALE"][:, None, :]
    if "TRANSLATION" in found:
        matrices[:, :3, 3] = found["TRANSLATION"]
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(matrix @ matrices)


def _rotations(quaternions: Array) -> Array:
    """Return (k, 3, 3) rotations of quaternions (k, 4), x, y, z, w, of any length; none of zero length turns."""
    length = np.linalg.norm(quaternions, axis=1, keepdims=True)
    x, y, z, w = np.where(length > 0, quaternions / np.where(length > 0, length, 1), (0, 0, 0, 1)).T
    return np.moveaxis(np.array(rotation_rows(x, y, z, w)), 2, 0)
