"""From a glTF document to meshes in world space: the node tree, primitives and materials.

Textures of base colour and emission are decoded when a primitive first shows their material; texture coordinates take
the material's choice of set and its `KHR_texture_transform` at once, as both are affine.
"""

import dataclasses
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from refgi.errors import InputError, RefgiWarning, expect
from refgi.scene.gltf.container import DRACO, Document, accessor, packed, unread
from refgi.scene.gltf.deform import Deformer, Pose, pose_of
from refgi.scene.gltf.materials import UNPAINTED, Look, base_colour, emissive, read_material, transformed
from refgi.scene.gltf.nodes import EXTENSION as LIGHTS
from refgi.scene.gltf.nodes import instances, node_camera, node_light, scene_nodes
from refgi.scene.material import factors
from refgi.scene.mesh import as_float64, expect_memory
from refgi.scene.model import Camera, Contents, Light, Material, Mesh
from refgi.scene.motion import IDENTITY, invertible, transformed_all
from refgi.types import Array

TRIANGLES, STRIP, FAN = 4, 5, 6
COLOURS = "COLOR_0"


def read_gltf(path: Path) -> Contents:
    """Read the default scene of a ``.gltf`` or ``.glb`` file.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    Contents
        One mesh per primitive in the order of the node tree, and the cameras and lights on the way.

    Raises
    ------
    InputError
        If the file is damaged or needs what is not read (compressed meshes).
    """
    document = Document(path)
    return _Reader(document).contents()


class _Reader:
    """Meshes, materials, cameras and lights of one document, each read once."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.path = document.path
        self.vertices = self.faces = 0
        self.cameras: list[Camera] = []
        self.lights: list[Light] = []
        self.counts: dict[str, int] = {}  # of what is not as the file has it, by the text that says so
        self.materials: list[Material] = [read_material(document, index, self._say)
                                          for index in range(len(document.items("materials")))]
        self._looks: dict[int, Look | None] = {}
        self._shapes: dict[tuple[int, Pose], list[Mesh]] = {}
        self._nodes = scene_nodes(document)
        self._deformer = Deformer(document, self._nodes, self._pass_over)

    def contents(self) -> Contents:
        shapes: list[Mesh] = []
        matrices: list[Array] = []
        for k, index in enumerate(self._nodes.number):
            node, where = self.document.items("nodes")[index], f"nodes[{index}]"
            if "mesh" in node:
                pose = pose_of(self.document, node, where)
                placed = self._placements(node, pose, self._nodes.world[k], where)
                found = self._shapes_of(node, where, pose, len(placed))
                shapes += found * len(placed)
                matrices += [matrix for matrix in placed for _ in found]
            self._view_and_light(node, self._nodes.world[k], where)
        self._pass_over_the_rest()
        for text, count in self.counts.items():
            warnings.warn(RefgiWarning(f"{self.path}: {count} {text}"), stacklevel=4)
        meshes = transformed_all(shapes, np.array(matrices)) if shapes else []
        return Contents(tuple(meshes), tuple(self.cameras), tuple(self.lights))

    def _placements(self, node: dict[str, Any], pose: Pose, matrix: Array, where: str) -> Sequence[Array]:
        """Return world from mesh, (4, 4) each, for all times that a node's mesh is drawn."""
        placed = instances(self.document, node, matrix, where)
        if pose.skin is not None:  # in the world by its joints
            self._pass_over("skinned mesh(es)' instances", int(placed is not None))
            return (IDENTITY,)
        self._pass_over("skin(s) of meshes without joints", int("skin" in node))
        if not matrix[:3, :3].any():
            return ()
        if placed is None:
            return (matrix,)
        good = invertible(placed)
        self._pass_over("instance(s) without size", int(np.count_nonzero(~good)))
        return list(placed[good])

    def _shapes_of(self, node: dict[str, Any], where: str, pose: Pose, count: int) -> list[Mesh]:
        """Return the meshes of a node that is drawn so many times, not yet in the world unless they follow a skin."""
        found = self._mesh(node["mesh"], f"{where}.mesh", pose)
        self.vertices += count * sum(len(mesh.vertices) for mesh in found)
        self.faces += count * sum(len(mesh.faces) for mesh in found)
        expect_memory(self.vertices, self.faces, f"{self.path}: {where}.mesh")
        return found

    def _view_and_light(self, node: dict[str, Any], matrix: Array, where: str) -> None:
        if not matrix[:3, :3].any():
            self._pass_over("camera(s) or light(s) of zero scale", int("camera" in node or "extensions" in node))
            return
        if camera := node_camera(self.document, node, matrix, where):
            self.cameras.append(camera)
        elif "camera" in node:
            self._pass_over("orthographic camera(s)")
        if light := node_light(self.document, node, matrix, where):
            self.lights.append(light)

    def _mesh(self, index: Any, referrer: str, pose: Pose) -> list[Mesh]:
        entry = self.document.item("meshes", index, referrer)
        if (index, pose) not in self._shapes:
            name = self.document.name(entry, f"meshes[{index}]")
            primitives = self.document.objects(entry, "primitives", f"meshes[{index}]")
            read = (self._primitive(p, f"meshes[{index}].primitives[{k}]", name, pose)
                    for k, p in enumerate(primitives))
            self._shapes[index, pose] = [mesh for mesh in read if mesh is not None]
        return self._shapes[index, pose]

    def _primitive(self, entry: dict[str, Any], where: str, name: str, pose: Pose) -> Mesh | None:
        mode = entry.get("mode", TRIANGLES)
        if mode not in (TRIANGLES, STRIP, FAN):
            self._pass_over("primitive(s) without triangles")
            return None
        attributes = self.document.member(entry, "attributes", where)
        expect("POSITION" in attributes, f"{self.path}: {where}.attributes", "a POSITION", sorted(attributes))
        if DRACO in self.document.member(entry, "extensions", where) and "bufferView" not in self.document.item(
                "accessors", attributes["POSITION"], f"{where}.attributes.POSITION"):
            raise packed(f"{self.path}: {where}", "Draco-compressed meshes", DRACO)
        vertices = accessor(self.document, attributes["POSITION"], "VEC3", f"{where}.attributes.POSITION")
        if any(key.startswith("COLOR_") and key != COLOURS for key in attributes):
            self._pass_over("primitive(s)' further vertex colours (COLOR_1 ...)")
        normals = None
        if "NORMAL" in attributes:
            normals = accessor(self.document, attributes["NORMAL"], "VEC3", f"{where}.attributes.NORMAL")
        vertices, normals = self._deformer.deformed(entry, vertices, normals, pose, where)
        corners = np.arange(len(vertices), dtype=np.int64)
        if "indices" in entry:
            indices = accessor(self.document, entry["indices"], "SCALAR", f"{where}.indices")
            whole = indices.dtype.kind in "iu"
            expect(whole, f"{self.path}: {where}.indices", "an accessor of integers", indices.dtype)
            corners = indices.astype(np.int64)
        material, look = self._material_of(entry, where)
        mesh = Mesh(vertices, _triangles(corners, mode, f"{self.path}: {where}"), normals, material, name)
        mesh.expect_sound(f"{self.path}: {where}")
        if COLOURS in attributes:
            mesh = dataclasses.replace(mesh, colours=self._colours(mesh, attributes[COLOURS], where))
        return self._with_coordinates(mesh, attributes, look, where)

    def _colours(self, mesh: Mesh, index: Any, where: str) -> Array | None:
        """Return the colours of a mesh's corners, linear as the file has them; alpha counts for nothing."""
        where = f"{where}.attributes.{COLOURS}"
        kind = self.document.item("accessors", index, where).get("type")
        values = accessor(self.document, index, kind if kind in ("VEC3", "VEC4") else "VEC3", where)
        if values.dtype.kind in "iu":  # whole numbers without `normalized`
            values = values / np.iinfo(values.dtype).max
        expect(len(values) == len(mesh.vertices), f"{self.path}: {where}",
               f"{len(mesh.vertices)} elements as POSITION", len(values))
        if mesh.material.cutoff is not None and values.shape[1] == 4 and values[:, 3].min(initial=1) < 1:
            self._pass_over("primitive(s)' alpha of vertex colours")
        found = factors(values[:, :3], f"{self.path}: {where}")
        return None if found is None else found[mesh.faces]

    def _with_coordinates(self, mesh: Mesh, attributes: dict[str, Any], look: Look | None, where: str) -> Mesh:
        """Return the mesh with the texture coordinates that its material asks for, or without texture."""
        key = f"TEXCOORD_{0 if look is None else look.coordinates}"
        if look is None:  # another material may be put on the mesh, which then has a texture
            return dataclasses.replace(mesh, uv=self._spare_coordinates(mesh, attributes, key))
        if key not in attributes:
            self._pass_over(f"primitive(s)' textures for lack of {key}")
            return dataclasses.replace(mesh, material=dataclasses.replace(mesh.material, texture=None,
                                                                          emission_texture=None))
        uv = as_float64(accessor(self.document, attributes[key], "VEC2", f"{where}.attributes.{key}"))
        expect(len(uv) == len(mesh.vertices), f"{self.path}: {where}.attributes.{key}",
               f"{len(mesh.vertices)} elements as POSITION", len(uv))
        mesh = dataclasses.replace(mesh, uv=transformed(uv, look.transform)[mesh.faces])
        mesh.expect_sound(f"{self.path}: {where}")
        return mesh

    def _spare_coordinates(self, mesh: Mesh, attributes: dict[str, Any], key: str) -> Array | None:
        """Return texture coordinates that no material here asks for, None where they cannot be used."""
        if key not in attributes:
            return None
        try:
            uv = as_float64(accessor(self.document, attributes[key], "VEC2", key))
        except InputError:
            return None
        return uv[mesh.faces] if len(uv) == len(mesh.vertices) and np.isfinite(uv).all() else None

    def _material_of(self, entry: dict[str, Any], where: str) -> tuple[Material, Look | None]:
        """Return a primitive's material and how its texture lies on it, the image decoded when first asked for."""
        if "material" not in entry:
            return UNPAINTED, None
        index = entry["material"]
        found = self.document.item("materials", index, f"{where}.material")
        if index not in self._looks:
            clear = self.materials[index].is_dielectric
            look = None if clear else base_colour(self.document, found, f"materials[{index}]", self._say)
            glows = any(self.materials[index].emission)
            shining = emissive(self.document, found, f"materials[{index}]", self._say) if glows else None
            if look is not None:
                self.materials[index] = dataclasses.replace(self.materials[index], texture=look.texture)
            self._looks[index] = look or shining
            if shining is not None and look is not None and not shining.lies_as(look):
                self._pass_over("material(s)' emissive textures, which lie other than the base colour's,")
            elif shining is not None:
                self.materials[index] = dataclasses.replace(self.materials[index], emission_texture=shining.texture)
        return self.materials[index], self._looks[index]

    def _pass_over_the_rest(self) -> None:
        """Count what the document has and no part of the reader looks at."""
        tree = self.document.tree
        self._pass_over("animation(s)", len(self.document.items("animations")))
        self._pass_over("scene(s) beside the first or default one", len(self.document.items("scenes")) - 1)
        punctual = self.document.member(self.document.member(tree, "extensions", ""), LIGHTS, "extensions")
        lights = punctual.get("lights", [])
        self._pass_over("light(s)' range (light falls with the square of the distance)", sum(
            isinstance(light, dict) and "range" in light for light in (lights if isinstance(lights, list) else ())))
        for name, count in unread(tree):
            self._pass_over(f"use(s) of the extension {name}", count)

    def _pass_over(self, what: str, count: int = 1) -> None:
        self._say(f"{what} passed over", count)

    def _say(self, text: str, count: int = 1) -> None:
        if count > 0:
            self.counts[text] = self.counts.get(text, 0) + count


def _triangles(corners: Array, mode: int, where: str) -> Array:
    """Return (m, 3) faces from the corner list of a triangle list, strip or fan."""
    if mode == TRIANGLES:
        expect(len(corners) % 3 == 0, f"{where}.indices", "three per triangle", len(corners))
        return corners.reshape(-1, 3)
    count = max(len(corners) - 2, 0)
    if mode == FAN:
        return np.stack([np.repeat(corners[:1], count), corners[1:-1][:count], corners[2:]], axis=1)
    faces = np.stack([corners[:count], corners[1 : count + 1], corners[2 : count + 2]], axis=1)
    faces[1::2, :2] = faces[1::2, 1::-1]
    return faces
