"""What is lit: a frozen description of geometry, materials, camera and lights.

World space is right-handed, y up, metres; angles are radians; colours are linear RGB. Geometry is kept flat, one list
of triangles in world space, because every consumer (rasterizer, Embree, file writers) wants exactly that; a `Mesh` is
one piece of it on the way in. `Scene` holds the `Geometry` object itself, so a scene with another camera or another
light shares it, and whatever was computed from it stays valid.
"""

import dataclasses
import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.errors import expect

Array = npt.NDArray[Any]
Rgb = tuple[float, float, float]
Vector = tuple[float, float, float]

BLACK: Rgb = (0.0, 0.0, 0.0)
BRIGHTEST = 1e20  # W/sr or W/m^2; falls off within float32
LARGEST = 1e9  # m; squares and cubes of coordinates stay within float32


def _is_vector(value: Any) -> bool:
    try:
        return len(value) == 3 and all(math.isfinite(c) for c in value)
    except (TypeError, OverflowError):
        return False


def _is_place(value: Any) -> bool:
    return _is_vector(value) and max(map(abs, value)) <= LARGEST


def _is_direction(value: Any) -> bool:
    return _is_vector(value) and 1e-100 < math.hypot(*value) < 1e100  # squares neither vanish nor overflow


def _degrees(angle: float) -> float:
    return round(math.degrees(angle), 9)


def _expect_power(value: Rgb, key: str) -> None:
    fits = _is_vector(value) and min(value) >= 0 and max(value) <= BRIGHTEST
    expect(fits, f"light: {key}", f"three numbers from 0 to {BRIGHTEST:g}", value)


@dataclasses.dataclass(frozen=True)
class Material:
    """How a surface reflects: a diffuse part, a Phong lobe, or clear glass.

    `diffuse` and `specular` are reflectances (1), `exponent` is the Phong exponent of the lobe around the mirror
    direction (normalised so that `specular` is its reflectance), `ior` the index of refraction of a dielectric (0:
    opaque), `emission` the radiance the surface emits by itself (W/m^2/sr; seen by the camera, not a light source).
    """

    name: str = "default"
    diffuse: Rgb = (0.5, 0.5, 0.5)
    specular: Rgb = BLACK
    exponent: float = 0.0
    ior: float = 0.0
    emission: Rgb = BLACK

    def __post_init__(self) -> None:
        for key in ("diffuse", "specular"):
            value = getattr(self, key)
            expect(_is_vector(value) and all(0 <= c <= 1 for c in value), f"material {self.name!r}: {key}",
                   "three numbers from 0 to 1", value)
        expect(_is_vector(self.emission) and min(self.emission) >= 0, f"material {self.name!r}: emission",
               "three finite numbers >= 0", self.emission)
        expect(math.isfinite(self.exponent) and self.exponent >= 0, f"material {self.name!r}: exponent",
               "a finite number >= 0", self.exponent)
        expect(self.ior == 0 or (math.isfinite(self.ior) and self.ior >= 1), f"material {self.name!r}: ior",
               "0 (opaque) or a finite number >= 1", self.ior)

    @property
    def is_glossy(self) -> bool:
        """Whether the material has a Phong lobe."""
        return any(self.specular)

    @property
    def is_dielectric(self) -> bool:
        """Whether the material is clear glass."""
        return self.ior > 0


@dataclasses.dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles of one material in world space: vertices (n, 3) m, faces (m, 3), optional vertex normals (n, 3)."""

    vertices: Array
    faces: Array
    normals: Array | None = None
    material: Material = Material()
    name: str = "mesh"

    def expect_sound(self, where: str) -> None:
        """Raise `InputError` naming `where` unless shapes, coordinates and indices make a mesh."""
        vertices, faces = np.asarray(self.vertices), np.asarray(self.faces)
        expect(vertices.ndim == 2 and vertices.shape[1] == 3 and vertices.dtype.kind in "fiu",
               f"{where}: vertices", "numbers in an (n, 3) array", f"{vertices.dtype} {vertices.shape}")
        expect(faces.ndim == 2 and faces.shape[1] == 3 and faces.dtype.kind in "iu",
               f"{where}: faces", "integers in an (m, 3) array", f"{faces.dtype} {faces.shape}")
        expect(len(faces) > 0, f"{where}: faces", "at least one triangle", 0)
        expect(len(vertices) > 0, f"{where}: vertices", "at least one", 0)
        if not (abs(vertices.min()) <= LARGEST and abs(vertices.max()) <= LARGEST):  # so that NaN fails as well
            row = int(np.argmin((np.abs(vertices) <= LARGEST).all(axis=1)))
            expect(False, f"{where}: vertex {row}", f"finite coordinates up to {LARGEST:g} m", vertices[row].tolist())
        if faces.min() < 0 or faces.max() >= len(vertices):
            row = int(np.argmax(((faces < 0) | (faces >= len(vertices))).any(axis=1)))
            expect(False, f"{where}: face {row}", f"vertex indices from 0 to {len(vertices) - 1}", faces[row].tolist())
        if self.normals is not None:
            expect(np.shape(self.normals) == vertices.shape, f"{where}: normals", f"shape {vertices.shape}",
                   np.shape(self.normals))


@dataclasses.dataclass(frozen=True, eq=False)
class Geometry:
    """All triangles of a scene in world space, in mesh order.

    `vertices` (n, 3) float64, m; `faces` (m, 3) int32; `material_of_face` (m,) int32, index into the scene's
    materials; `vertex_normals` (n, 3) float64 unit vectors, or None where the scene shades with face normals.
    """

    vertices: Array
    faces: Array
    material_of_face: Array
    vertex_normals: Array | None = None

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Corners of the axis-aligned box of all used vertices, m."""
        if not len(self.faces):
            return np.zeros(3), np.zeros(3)
        used = self.vertices[np.unique(self.faces)]
        return used.min(axis=0), used.max(axis=0)

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
            expect(_is_place(getattr(self, key)), f"camera: {key}", f"three finite numbers up to {LARGEST:g} m",
                   getattr(self, key))
        expect(_is_direction(self.up), "camera: up", "a finite vector, not zero", self.up)
        view = np.subtract(self.target, self.eye)
        expect(bool(np.linalg.norm(view) > 1e-9), "camera: target", "a point away from eye", self.target)
        cross = np.cross(view / np.linalg.norm(view), np.asarray(self.up) / np.linalg.norm(self.up))
        expect(bool(np.linalg.norm(cross) > 1e-9), "camera: up", "a direction not along the view", self.up)
        expect(0 < self.vfov < math.pi, "camera: vfov_deg", "more than 0 and less than 180", _degrees(self.vfov))
        for key in ("width", "height"):
            size = getattr(self, key)
            expect(isinstance(size, int) and 1 <= size <= 65536, f"camera: {key}", "1 to 65536 pixels", size)


@dataclasses.dataclass(frozen=True)
class SpotLight:
    """A point that shines into a cone.

    On-axis radiant intensity `intensity` (W/sr), half-angles rad. With t = clamp((cos a - cos outer) / (cos inner -
    cos outer), 0, 1) the intensity at angle a off the axis is I0 t t (3 - 2t), and nothing outside `outer`.
    """

    position: Vector
    direction: Vector
    inner_half_angle: float
    outer_half_angle: float
    intensity: Rgb

    def __post_init__(self) -> None:
        expect(_is_place(self.position), "light: position", f"three finite numbers up to {LARGEST:g} m", self.position)
        expect(_is_direction(self.direction), "light: direction", "a finite vector, not zero",
               self.direction)
        expect(0 < self.outer_half_angle < math.pi / 2, "light: outer_half_angle_deg",
               "more than 0 and less than 90", _degrees(self.outer_half_angle))
        expect(0 <= self.inner_half_angle <= self.outer_half_angle, "light: inner_half_angle_deg",
               "0 to outer_half_angle_deg", _degrees(self.inner_half_angle))
        _expect_power(self.intensity, "intensity_w_per_sr")


@dataclasses.dataclass(frozen=True)
class PointLight:
    """A point that shines equally in all directions with radiant intensity `intensity`, W/sr."""

    position: Vector
    intensity: Rgb

    def __post_init__(self) -> None:
        expect(_is_place(self.position), "light: position", f"three finite numbers up to {LARGEST:g} m", self.position)
        _expect_power(self.intensity, "intensity_w_per_sr")


@dataclasses.dataclass(frozen=True)
class DirectionalLight:
    """Parallel light that travels along `direction`, with `irradiance` on a perpendicular surface, W/m^2."""

    direction: Vector
    irradiance: Rgb

    def __post_init__(self) -> None:
        expect(_is_direction(self.direction), "light: direction", "a finite vector, not zero",
               self.direction)
        _expect_power(self.irradiance, "irradiance_w_per_m2")


Light = SpotLight | PointLight | DirectionalLight


@dataclasses.dataclass(frozen=True, eq=False)
class Scene:
    """One scene: what is there, what lights it, who looks."""

    name: str
    geometry: Geometry
    materials: tuple[Material, ...]
    camera: Camera
    lights: tuple[Light, ...]
    description: str = ""
    exposure: float = 1.0  # factor before the sRGB curve in PNG pictures; of no other meaning

    def __post_init__(self) -> None:
        expect(math.isfinite(self.exposure) and self.exposure > 0, "exposure", "a finite number > 0", self.exposure)

    def with_camera(self, **changes: Any) -> "Scene":
        """Return the scene seen by a changed camera, sharing everything else."""
        return dataclasses.replace(self, camera=dataclasses.replace(self.camera, **changes))

    def with_lights(self, *lights: Light) -> "Scene":
        """Return the scene with other lights, sharing everything else."""
        return dataclasses.replace(self, lights=lights)

    @property
    def face_count(self) -> int:
        """Number of triangles."""
        return len(self.geometry.faces)


class MaterialTable(NamedTuple):
    """The materials as arrays for kernels: one row a material."""

    diffuse: Array  # (m, 3) reflectance of the diffuse part
    specular: Array  # (m, 3) reflectance of the Phong lobe
    exponent: Array  # (m,) Phong exponent
    ior: Array  # (m,) index of refraction, 0 where opaque
    emission: Array  # (m, 3) radiance, W/m^2/sr


class LightTable(NamedTuple):
    """The lights as arrays for kernels: one row a light."""

    kind: Array  # (k,) int32: 0 spot, 1 point, 2 directional
    position: Array  # (k, 3) m; zero for a directional light
    direction: Array  # (k, 3) unit vector the light travels along; zero for a point light
    cos_inner: Array  # (k,) cosine of the inner half-angle
    cos_outer: Array  # (k,) cosine of the outer half-angle
    intensity: Array  # (k, 3) W/sr on the axis; perpendicular irradiance W/m^2 for a directional light


SPOT, POINT, DIRECTIONAL = 0, 1, 2


def material_table(materials: Sequence[Material], dtype: npt.DTypeLike = np.float64) -> MaterialTable:
    """Gather materials into arrays for kernels.

    Parameters
    ----------
    materials : sequence of Material
        The scene's materials.
    dtype : dtype
        Element type of the arrays.

    Returns
    -------
    MaterialTable
        One row a material.
    """
    def column(key: str, width: int) -> Array:
        values = np.array([getattr(m, key) for m in materials], dtype)
        return values.reshape((-1, width) if width > 1 else -1)

    return MaterialTable(column("diffuse", 3), column("specular", 3), column("exponent", 1), column("ior", 1),
                         column("emission", 3))


def light_table(lights: Sequence[Light], dtype: npt.DTypeLike = np.float64) -> LightTable:
    """Gather lights into arrays for kernels.

    Parameters
    ----------
    lights : sequence of Light
        The scene's lights.
    dtype : dtype
        Element type of the arrays.

    Returns
    -------
    LightTable
        One row a light.
    """
    count = len(lights)
    table = LightTable(np.zeros(count, np.int32), np.zeros((count, 3), dtype), np.zeros((count, 3), dtype),
                       np.zeros(count, dtype), np.zeros(count, dtype), np.zeros((count, 3), dtype))
    for row, light in enumerate(lights):
        if isinstance(light, DirectionalLight):
            table.kind[row] = DIRECTIONAL
            table.intensity[row] = light.irradiance
        else:
            table.kind[row] = SPOT if isinstance(light, SpotLight) else POINT
            table.position[row] = light.position
            table.intensity[row] = light.intensity
        if not isinstance(light, PointLight):
            table.direction[row] = np.asarray(light.direction) / np.linalg.norm(light.direction)
        if isinstance(light, SpotLight):
            table.cos_inner[row] = math.cos(light.inner_half_angle)
            table.cos_outer[row] = math.cos(light.outer_half_angle)
    return table


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
        If a mesh has a coordinate that is not finite or an index out of range, or there are too many vertices.
    """
    for number, mesh in enumerate(meshes):
        mesh.expect_sound(f"mesh {number} ({mesh.name})")
    total = sum(len(mesh.vertices) for mesh in meshes)
    expect(total < 2**31, "meshes", "fewer than 2^31 vertices in all", total)
    materials = tuple(dict.fromkeys(mesh.material for mesh in meshes))
    smooth = smooth and any(mesh.normals is not None for mesh in meshes)
    if smooth:
        meshes = [mesh if mesh.normals is not None else _with_face_normals(mesh) for mesh in meshes]
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    vertices = [np.asarray(mesh.vertices, np.float64).reshape(-1, 3) for mesh in meshes]
    faces = [np.asarray(m.faces, np.int32).reshape(-1, 3) + np.int32(o) for m, o in zip(meshes, offsets, strict=False)]
    material_of_face = [np.full(len(m.faces), materials.index(m.material), np.int32) for m in meshes]
    return Geometry(
        np.concatenate(vertices) if vertices else np.zeros((0, 3)),
        np.concatenate(faces) if faces else np.zeros((0, 3), np.int32),
        np.concatenate(material_of_face) if material_of_face else np.zeros(0, np.int32),
        np.concatenate([np.asarray(m.normals, np.float64) for m in meshes]) if smooth else None,
    ), materials


def _with_face_normals(mesh: Mesh) -> Mesh:
    corners = np.asarray(mesh.vertices, np.float64)[np.asarray(mesh.faces)]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
    vertices = corners.reshape(-1, 3)
    return Mesh(vertices, np.arange(len(vertices)).reshape(-1, 3), np.repeat(normals, 3, axis=0), mesh.material,
                mesh.name)
