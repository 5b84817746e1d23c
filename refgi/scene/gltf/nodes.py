"""The node tree of a glTF document: which nodes the default scene holds, in order, and where each lies in the world."""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.errors import expect
from refgi.scene.gltf.container import Document
from refgi.scene.transform import expect_affine, invertible
from refgi.scene.values import Array, Vector

NO_MATRIX = tuple(np.eye(4).ravel().tolist())


class Nodes(NamedTuple):
    """The nodes of one scene, parents before children, in the order of the tree."""

    index: list[int]  # (k,) of the file's list of nodes
    parent: list[int]  # (k,) position in this list, -1 for a root
    world: Array  # (k, 4, 4) world from node


def scene_nodes(document: Document) -> Nodes:
    """Walk the default scene of a document.

    Parameters
    ----------
    document : Document
        The file.

    Returns
    -------
    Nodes
        Every node once.

    Raises
    ------
    InputError
        If a reference leads nowhere or to a node with another parent, or a matrix is not usable.
    """
    index, parent = _order(document)
    nodes = document.items("nodes")
    world = np.tile(np.eye(4), (len(index), 1, 1))
    keys = [""] * len(index)
    for k, number in enumerate(index):
        keys[k] = _fill_local(world[k], document, nodes[number], f"nodes[{number}]")
    expect_affine(world, lambda k: f"{document.path}: nodes[{index[k]}]{keys[k]}")
    with np.errstate(over="ignore", invalid="ignore"):  # judged below, with the node's name
        for k, above in enumerate(parent):
            if above >= 0:
                world[k] = world[above] @ world[k] if keys[k] else world[above]
    for k in np.flatnonzero(~invertible(world))[:1].tolist():
        expect(False, f"{document.path}: nodes[{index[k]}]", "a finite, invertible product with its parents' matrices",
               world[k].ravel().tolist())
    return Nodes(index, parent, world)


def _order(document: Document) -> tuple[list[int], list[int]]:
    """Return the nodes, depth first and children in order, and the position of each one's parent."""
    index: list[int] = []
    parent: list[int] = []
    visited: set[int] = set()
    pending = [(root, -1) for root in reversed(_roots(document))]
    while pending:
        number, above = pending.pop()
        node = document.item("nodes", number, "a node reference")
        if number in visited:
            expect(False, f"{document.path}: nodes[{number}]", "one parent", "several, or a cycle")
        visited.add(number)
        index.append(number)
        parent.append(above)
        children = _indices(document, node, "children", f"nodes[{number}]")
        pending += [(child, len(index) - 1) for child in reversed(children)]
    return index, parent


def _roots(document: Document) -> list[int]:
    scenes = document.items("scenes")
    if scenes:
        index = document.tree.get("scene", 0)
        return _indices(document, document.item("scenes", index, "scene"), "nodes", f"scenes[{index}]")
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
    return ((1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
            (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
            (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)))
