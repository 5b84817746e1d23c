"""Morph targets and skins of glTF 2.0 (3.7.2.2, 3.7.3): the shape that a mesh has at rest, without animation.

Vertices are first morphed, p + sum of w_k dp_k, with the node's weights, else the mesh's. Those of a skinned node then
follow its joints, each by the mean of its joints' matrices, world from joint times the inverse bind matrix; where the
node itself stands counts for nothing.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from refgi.errors import expect
from refgi.scene.gltf.container import Document, accessor
from refgi.scene.gltf.nodes import Nodes, all_nodes
from refgi.scene.mesh import as_float64
from refgi.types import Array

INFLUENCES = 4  # in one set, JOINTS_n and WEIGHTS_n


class Pose(NamedTuple):
    """What deforms a mesh under a node; nodes with the same mesh and pose show the same shape."""

    weights: tuple[float, ...] = ()  # of the morph targets
    skin: int | None = None


def pose_of(document: Document, node: dict[str, Any], where: str) -> Pose:
    """Return the pose of a node's mesh; raises `InputError` if a key is not usable."""
    mesh = document.item("meshes", node["mesh"], f"{where}.mesh")
    owner, place = (node, where) if "weights" in node else (mesh, f"meshes[{node['mesh']}]")
    weights = document.all_numbers(owner, "weights", place)
    weights = weights if any(weights) else ()
    if "skin" not in node:
        return Pose(weights)
    document.item("skins", node["skin"], f"{where}.skin")
    primitives = document.objects(mesh, "primitives", f"meshes[{node['mesh']}]")
    jointed = any("JOINTS_0" in document.member(one, "attributes", place) for one in primitives)
    return Pose(weights, node["skin"] if jointed else None)


class Deformer:
    """Morphs and skins primitives; matrices of joints are made once.

    `pass_over` takes the words for what is passed over.
    """

    def __init__(self, document: Document, nodes: Nodes, pass_over: Callable[[str], None]) -> None:
        self._document, self._nodes, self._pass_over = document, nodes, pass_over
        self._joints: dict[int, Array] = {}

    def deformed(self, entry: dict[str, Any], vertices: Array, normals: Array | None, pose: Pose,
                 where: str) -> tuple[Array, Array | None]:
        """Return vertices and normals of a primitive in its pose."""
        if pose.weights:
            vertices = self._morphed(entry, "POSITION", vertices, pose.weights, where)
            normals = None if normals is None else self._morphed(entry, "NORMAL", normals, pose.weights, where)
            keys = {key for target, weight in zip(entry.get("targets", ()), pose.weights, strict=False) if weight
                    for key in target}
            if any(key.startswith(("TEXCOORD_", "COLOR_")) for key in keys):
                self._pass_over("primitive(s)' morphed texture coordinates or colours")
        if pose.skin is None:
            return vertices, normals
        if pose.skin not in self._joints:
            self._joints[pose.skin] = _joint_matrices(self._document, pose.skin, self._nodes)
        attributes = self._document.member(entry, "attributes", where)
        return _skinned(self._document, attributes, vertices, normals, self._joints[pose.skin], where)

    def _morphed(self, entry: dict[str, Any], key: str, values: Array, weights: tuple[float, ...],
                 where: str) -> Array:
        """Return an attribute (n, 3) with its morph targets added, each by its weight."""
        total = values
        for number, (target, weight) in enumerate(zip(self._document.objects(entry, "targets", where), weights,
                                                      strict=False)):
            if weight and key in target:
                place = f"{where}.targets[{number}].{key}"
                change = accessor(self._document, target[key], "VEC3", place)
                expect(change.shape == values.shape, f"{self._document.path}: {place}",
                       f"{len(values)} elements as {key}", len(change))
                with np.errstate(over="ignore", invalid="ignore"):  # final coordinates are checked by `repair`
                    total = as_float64(total) + weight * as_float64(change)
        return total


def _joint_matrices(document: Document, index: int, nodes: Nodes) -> Array:
    """Return (j, 3, 4) world from bind pose of a skin's joints: world from joint times its inverse bind matrix.

    Raises `InputError` if a reference leads nowhere, or there are fewer matrices than joints.
    """
    skin, where = document.item("skins", index, f"skins[{index}]"), f"skins[{index}]"
    joints = skin.get("joints")
    good = isinstance(joints, list) and bool(joints) and {int}.issuperset(map(type, joints))
    expect(good, f"{document.path}: {where}.joints", "a list of indices", joints)
    for joint in joints:  # type: ignore[union-attr]
        document.item("nodes", joint, f"{where}.joints")
    position = {number: k for k, number in enumerate(nodes.number)}
    if not position.keys() >= set(joints):  # type: ignore[arg-type]
        nodes = all_nodes(document)  # joints of a skeleton that the scene does not list
        position = {number: k for k, number in enumerate(nodes.number)}
    world = nodes.world[[position[joint] for joint in joints]]  # type: ignore[union-attr]
    if "inverseBindMatrices" not in skin:
        return world[:, :3]
    columns = accessor(document, skin["inverseBindMatrices"], "MAT4", f"{where}.inverseBindMatrices")
    expect(len(columns) >= len(world), f"{document.path}: {where}.inverseBindMatrices", f"{len(world)} as joints",
           len(columns))
    inverse = as_float64(columns[: len(world)]).reshape(-1, 4, 4).swapaxes(1, 2)
    with np.errstate(over="ignore", invalid="ignore"):  # final coordinates are checked by `repair`
        return np.asarray(world[:, :3] @ inverse)


def _skinned(document: Document, attributes: dict[str, Any], vertices: Array, normals: Array | None, joints: Array,
             where: str) -> tuple[Array, Array | None]:
    """Return vertices (n, 3) and normals of a skinned primitive in world space.

    `joints` (j, 3, 4): as `_joint_matrices` has them. Raises `InputError` if an attribute has another number of
    elements, or a joint that counts is not one of the skin's.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        matrix = _mean_matrices(document, attributes, len(vertices), joints, where)
        moved = np.einsum("nij,nj->ni", matrix[:, :, :3], as_float64(vertices)) + matrix[:, :, 3]
        if normals is None:
            return moved, None
        # cofactors: a multiple of the inverse's transpose, which also turns normals as a mirror turns the winding
        a, b, c = (matrix[:, :, k] for k in range(3))
        cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=2)
        return moved, np.einsum("nij,nj->ni", cofactors, as_float64(normals))


def _mean_matrices(document: Document, attributes: dict[str, Any], count: int, joints: Array, where: str) -> Array:
    """Return (count, 3, 4) the mean of each vertex's joint matrices by its weights."""
    total, weight_sum = np.zeros((count, 3, 4)), np.zeros(count)
    number = 0
    while f"JOINTS_{number}" in attributes:
        names = f"JOINTS_{number}", f"WEIGHTS_{number}"
        expect(names[1] in attributes, f"{document.path}: {where}.attributes", names[1], sorted(attributes))
        index, weights = (accessor(document, attributes[name], "VEC4", f"{where}.attributes.{name}") for name in names)
        for name, found in zip(names, (index, weights), strict=True):
            expect(len(found) == count, f"{document.path}: {where}.attributes.{name}",
                   f"{count} elements as POSITION", len(found))
        expect(index.dtype.kind == "u", f"{document.path}: {where}.attributes.{names[0]}", "unsigned integers",
               index.dtype.name)
        weights = as_float64(weights)
        largest = int(index[weights != 0].max(initial=0))
        expect(largest < len(joints), f"{document.path}: {where}.attributes.{names[0]}",
               f"indices into the skin's {len(joints)} joints", largest)
        for k in range(INFLUENCES):
            total += weights[:, k, None, None] * joints[np.where(weights[:, k] != 0, index[:, k], 0)]
        weight_sum += weights.sum(axis=1)
        number += 1
    unweighted = weight_sum == 0  # follows the first joint, as elsewhere
    total[unweighted], weight_sum[unweighted] = joints[0], 1.0
    return total / weight_sum[:, None, None]
