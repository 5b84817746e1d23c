"""EXT_mesh_gpu_instancing: the mesh of a node drawn many times, each by a translation, rotation and scale."""

from typing import Any

import numpy as np

from refgi.errors import expect
from refgi.scene.gltf.accessors import accessor
from refgi.scene.gltf.container import Document
from refgi.scene.gltf.nodes import rotation_rows
from refgi.scene.mesh import as_float64
from refgi.scene.values import Array

EXTENSION = "EXT_mesh_gpu_instancing"
KINDS = {"TRANSLATION": "VEC3", "ROTATION": "VEC4", "SCALE": "VEC3"}


def instances(document: Document, node: dict[str, Any], matrix: Array, where: str) -> Array | None:
    """Return (k, 4, 4) world from instance for all instances of a node's mesh, None where it is drawn once.

    `matrix` (4, 4): world from node. Result: some may have no inverse. Raises `InputError` if the attributes differ in
    number, or a number is not finite.
    """
    extensions = document.member(node, "extensions", where)
    if EXTENSION not in extensions:
        return None
    where = f"{where}.extensions.{EXTENSION}"
    attributes = document.member(document.member(extensions, EXTENSION, where), "attributes", where)
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
