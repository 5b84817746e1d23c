"""The scene model: frozen geometry, materials, camera and lights.

World space is right-handed, y up, metres; angles are radians; colours are linear RGB. Geometry is kept flat, one list
of triangles in world space, because every consumer (rasterizer, Embree, file writers) wants exactly that; a `Mesh` is
one piece of it as read. `Scene` holds the `Geometry` object itself, so a scene with another camera or another
light shares it, and whatever was computed from it stays valid.
"""

import dataclasses
import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from refgi.errors import expect
from refgi.scene.files import Source
from refgi.scene.light import (
    DIRECTIONAL,
    POINT,
    SPOT,
    DirectionalLight,
    Light,
    LightTable,
    PointLight,
    SpotLight,
    light_table,
)
from refgi.scene.material import Material, MaterialTable, material_table
from refgi.scene.mesh import Mesh, at_corners, expect_all_sound, expect_colours, expect_coordinates, expect_memory
from refgi.scene.triangles import Clusters, CutFaces, CutOuts, clusters, cut_outs
from refgi.scene.values import (
    BLACK,
    LARGEST,
    Rgb,
    Vector,
    as_float_tuples,
    degrees,
    is_count,
    is_direction,
    is_number,
    is_place,
)
from refgi.types import Array

__all__ = [
    "BLACK",
    "DIRECTIONAL",
    "LARGEST",
    "POINT",
    "SPOT",
    "Array",
    "Camera",
    "Contents",
    "DirectionalLight",
    "Geometry",
    "Light",
    "LightTable",
    "Material",
    "MaterialTable",
    "Mesh",
    "PointLight",
    "Rgb",
    "Scene",
    "SpotLight",
    "Vector",
    "light_table",
    "material_table",
    "merge",
]


@dataclasses.dataclass(frozen=True, eq=False)
class Geometry:
    """All triangles of a scene in world space, in mesh order.

    `vertices` (n, 3) float64, m; `faces` (m, 3) int32; `material_of_face` (m,) int32, index into the scene's
    materials; `vertex_normals` (n, 3) float64 unit vectors, or None where the scene shades with face normals; `uv`
    (m, 3, 2) float64 texture coordinates of each face's corners, or None where no material has a texture; `cut_outs`
    where surfaces of the materials have holes, or None where none has: those of the scene's materials, which `merge`
    and `Scene` put here; `colours` (m, 3, 3) float64 factors of the diffuse reflectance at each face's corners, linear
    between them, or None where no mesh has vertex colours.
    """

    vertices: Array
    faces: Array
    material_of_face: Array
    vertex_normals: Array | None = None
    uv: Array | None = None
    cut_outs: CutOuts | None = None
    colours: Array | None = None

    def __post_init__(self) -> None:
        if len(self.faces):
            Mesh(self.vertices, self.faces, self.vertex_normals).expect_sound("geometry")
        expect(np.shape(self.material_of_face) == (len(self.faces),), "geometry: material_of_face",
               f"one index a face, shape {(len(self.faces),)}", np.shape(self.material_of_face))
        if self.uv is not None:
            expect_coordinates(self.uv, len(self.faces), "geometry")
        if self.colours is not None:
            expect_colours(self.colours, len(self.faces), "geometry")

    @cached_property
    def materials_needed(self) -> int:
        """One more than the highest index in `material_of_face`."""
        expect(self.material_of_face.min(initial=0) >= 0, "geometry: material_of_face", "indices >= 0",
               self.material_of_face.min(initial=0))
        return int(self.material_of_face.max(initial=-1)) + 1

    @cached_property
    def cut(self) -> CutFaces | None:
        """The triangles that may have holes, None where there are none."""
        if self.cut_outs is None:
            return None
        return self.cut_outs.faces(self.material_of_face, self.materials_needed, self.uv)

    @cached_property
    def without_cut(self) -> Array:
        """Vertices of the faces, of those that may have holes the first one three times: they show nothing."""
        if self.cut is None:
            return self.faces
        faces = self.faces.copy()
        faces[self.cut.face] = faces[self.cut.face, :1]
        return faces

    @cached_property
    def clusters(self) -> Clusters:
        """The triangles without holes, sorted by place; kept, as sorting takes about as long as drawing."""
        return clusters(self.vertices, self.faces, self.bounds, None if self.cut is None else self.cut.face)

    def selected(self, chosen: Array) -> "Geometry":
        """Return some of the faces, with the same vertices; `chosen` (m,) bool."""
        return dataclasses.replace(self, faces=self.faces[chosen], material_of_face=self.material_of_face[chosen],
                                   **at_corners(self, lambda values: values[chosen]))

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Corners of the axis-aligned box of all used vertices, m."""
        if not len(self.faces):
            return np.zeros(3), np.zeros(3)
        used = np.zeros(len(self.vertices), np.bool_)
        used[self.faces] = True
        corners = self.vertices[used]
        return corners.min(axis=0), corners.max(axis=0)

    @cached_property
    def diagonal(self) -> float:
        """Length of the diagonal of `bounds`, m."""
        low, high = self.bounds
        return float(np.linalg.norm(high - low))


@dataclasses.dataclass(frozen=True)
class Camera:
    """A pinhole camera that looks from `eye` to `target`; `vfov` is the full vertical field of view, rad."""

    eye: Vector
    target: Vector
    up: Vector = (0.0, 1.0, 0.0)
    vfov: float = math.radians(40.0)
    width: int = 512
    height: int = 512

    def __post_init__(self) -> None:
        for key in ("eye", "target"):
            expect(is_place(getattr(self, key)), f"camera: {key}", f"three finite numbers up to {LARGEST:g} m",
                   getattr(self, key))
        expect(is_direction(self.up), "camera: up", "a finite vector, not zero, up to 1e+100 long", self.up)
        as_float_tuples(self, "eye", "target", "up")
        view = np.subtract(self.target, self.eye)
        expect(bool(np.linalg.norm(view) > 1e-9), "camera: target", "a point away from eye", self.target)
        cross = np.cross(view / np.linalg.norm(view), np.asarray(self.up) / np.linalg.norm(self.up))
        expect(bool(np.linalg.norm(cross) > 1e-9), "camera: up", "a direction not along the view", self.up)
        expect(is_number(self.vfov), "camera: vfov_deg", "a number", self.vfov)
        expect(0 < self.vfov < math.pi, "camera: vfov_deg", "more than 0 and less than 180", degrees(self.vfov))
        for key in ("width", "height"):
            size = getattr(self, key)
            expect(is_count(size) and 1 <= size <= 65536, f"camera: {key}", "1 to 65536 pixels", size)


@dataclasses.dataclass(frozen=True, eq=False)
class Scene:
    """Geometry, materials, lights and camera."""

    name: str
    geometry: Geometry
    materials: tuple[Material, ...]
    camera: Camera
    lights: tuple[Light, ...]
    description: str = ""
    exposure: float = 1.0  # factor before the sRGB curve in PNG pictures; of no other meaning
    source: Source | None = None  # where `load_scene` had it from; None: it was made in Python
    emissive_lamps: int = 0  # the last of `lights`, which stand for emissive surfaces

    def __post_init__(self) -> None:
        expect(is_number(self.exposure) and self.exposure > 0, "exposure", "a finite number > 0", self.exposure)
        expect(self.geometry.materials_needed <= len(self.materials), "materials",
               f"the {self.geometry.materials_needed} that the geometry names", len(self.materials))
        textured = [material.name for material in self.materials if material.textures]
        expect(not textured or self.geometry.uv is not None, "geometry: uv", "texture coordinates for the textures of "
               f"{len(textured)} material(s)", None)
        holes = cut_outs(self.materials)
        if holes != self.geometry.cut_outs:
            object.__setattr__(self, "geometry", dataclasses.replace(self.geometry, cut_outs=holes))
        for light in self.lights:
            expect(isinstance(light, Light), "lights", "spot, point or directional lights", light)

    def with_camera(self, **changes: Any) -> "Scene":
        """Return the scene with a changed camera, sharing everything else."""
        return dataclasses.replace(self, camera=dataclasses.replace(self.camera, **changes))

    def with_lights(self, *lights: Light) -> "Scene":
        """Return the scene with other lights, sharing everything else."""
        return dataclasses.replace(self, lights=lights, emissive_lamps=0)

    @property
    def face_count(self) -> int:
        """Number of triangles."""
        return len(self.geometry.faces)


class Contents(NamedTuple):
    """What one mesh file holds, in its own world space, and the materials that it uses and does not define."""

    meshes: tuple[Mesh, ...]
    cameras: tuple[Camera, ...] = ()
    lights: tuple[Light, ...] = ()
    undefined: tuple[str, ...] = ()


def merge(meshes: Sequence[Mesh], *, smooth: bool = False) -> tuple[Geometry, tuple[Material, ...]]:
    """Join meshes into one list of triangles and one list of distinct materials, keeping their order.

    Parameters
    ----------
    meshes : sequence of Mesh
        The pieces, already in world space.
    smooth : bool
        Shade with interpolated vertex normals where a mesh has them (others get their faces' normals).

    Returns
    -------
    Geometry
        All triangles.
    tuple of Material
        What `material_of_face` indexes.

    Raises
    ------
    InputError
        If a mesh has a coordinate that is not finite or an index out of range, or all do not fit in memory.
    """
    expect_all_sound(meshes, lambda number: f"mesh {number} ({meshes[number].name})")
    textured = any(mesh.material.textures for mesh in meshes)
    expect_memory(sum(len(mesh.vertices) for mesh in meshes), sum(len(mesh.faces) for mesh in meshes), "meshes",
                  texels=_texels(meshes), textured=textured)
    index_of: dict[Material, int] = {}
    index = [index_of.setdefault(mesh.material, len(index_of)) for mesh in meshes]
    smooth = smooth and any(mesh.normals is not None for mesh in meshes)
    if smooth:
        meshes = [mesh if mesh.normals is not None else _with_face_normals(mesh) for mesh in meshes]
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    vertices = [np.asarray(mesh.vertices, np.float64).reshape(-1, 3) for mesh in meshes]
    faces = [np.asarray(m.faces, np.int32).reshape(-1, 3) + np.int32(o) for m, o in zip(meshes, offsets, strict=False)]
    return Geometry(
        np.concatenate(vertices) if vertices else np.zeros((0, 3)),
        np.concatenate(faces) if faces else np.zeros((0, 3), np.int32),
        np.repeat(np.array(index, np.int32), np.array([len(part) for part in faces], np.int64)),
        np.concatenate([np.asarray(m.normals, np.float64) for m in meshes]) if smooth else None,
        np.concatenate([_coordinates(mesh) for mesh in meshes]) if textured else None,
        cut_outs(tuple(index_of)),
        np.concatenate([_colours(mesh) for mesh in meshes]) if any(m.colours is not None for m in meshes) else None,
    ), tuple(index_of)


def _texels(meshes: Sequence[Mesh]) -> int:
    """Return the number of texels of all images, each counted once."""
    textures = dict.fromkeys(texture for mesh in meshes for texture in mesh.material.textures)
    images = dict.fromkeys(texture.image for texture in textures)
    return sum(image.width * image.height for image in images)


def _coordinates(mesh: Mesh) -> Array:
    """Return texture coordinates of a mesh's corners, (m, 3, 2); 0 where it needs none."""
    if mesh.uv is None:
        expect(not mesh.material.textures, f"mesh {mesh.name}: uv",
               f"texture coordinates for the texture of material {mesh.material.name!r}", None)
        return np.zeros((len(mesh.faces), 3, 2))
    return np.asarray(mesh.uv, np.float64)


def _colours(mesh: Mesh) -> Array:
    return np.ones((len(mesh.faces), 3, 3)) if mesh.colours is None else np.asarray(mesh.colours, np.float64)


def _with_face_normals(mesh: Mesh) -> Mesh:
    corners = np.asarray(mesh.vertices, np.float64)[np.asarray(mesh.faces)]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
    vertices = corners.reshape(-1, 3)
    return Mesh(vertices, np.arange(len(vertices)).reshape(-1, 3), np.repeat(normals, 3, axis=0), mesh.material,
                mesh.name, mesh.uv, mesh.colours)
