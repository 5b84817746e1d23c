"""The G-buffer of a camera or a light: depth, position, normal, albedo, ids; each channel resolved on first use.

Besides, face normals where shading normals are interpolated, and backs that are seen.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.jit import kernel, prange, thread_count
from refgi.rsm.buffers.attributes import ChannelMask, Planes, allocate, resolve, tint
from refgi.rsm.buffers.surfaces import Surface
from refgi.rsm.buffers.textures import paint, painted
from refgi.rsm.pool import plane
from refgi.rsm.raster.projection import Projection, camera_projection
from refgi.rsm.raster.visibility_buffer import Visibility, rasterize
from refgi.scene.model import Camera, Geometry, MaterialTable
from refgi.skips import left_out
from refgi.stages import stage
from refgi.types import Array


@stage("rsm.facing")
def facing_normals(geometry: Geometry, triangle_id: Array, normal: Array) -> Array:
    """Return the normal of each pixel's triangle on the side of its shading normal (docs/conventions).

    normal (3, h, w): Shading normals; their dtype is that of the result.
    -> (3, h, w): Unit vectors; 0 where there is no surface. The very array `normal` where nothing is interpolated.
    """
    if geometry.vertex_normals is None:
        return normal
    facing = plane(normal.shape, normal.dtype)
    _fill_facing(geometry.vertices, geometry.faces, triangle_id, normal, facing)
    return facing


@stage("rsm.backs")
def share_of_backs(geometry: Geometry, one_sided: Array, eye: tuple[float, float, float], triangle_id: Array) -> float:
    """Return the share of pixels with a surface that show the back of one that its file leaves out.

    geometry: The triangles; fronts are counter-clockwise.
    one_sided (k,) bool: Which materials have no back.
    eye: Where the camera is, m.
    -> float: From 0 to 1.
    """
    pixels = np.bincount(triangle_id[triangle_id >= 0], minlength=1)
    seen = np.flatnonzero(pixels)
    a, b, c = (geometry.vertices[geometry.faces[seen, k]] for k in range(3))
    turned = np.einsum("ij,ij->i", np.cross(b - a, c - a), np.asarray(eye) - a) < 0
    backs = seen[turned & one_sided[geometry.material_of_face[seen]]]
    return float(pixels[backs].sum() / max(1, pixels.sum()))


@kernel(parallel=True)
def _fill_facing(vertices: Array, faces: Array, triangle_id: Array, normal: Array, facing: Array) -> None:
    for row in prange(triangle_id.shape[0]):
        last, nx, ny, nz = -1, 0.0, 0.0, 0.0
        for column in range(triangle_id.shape[1]):
            face = triangle_id[row, column]
            if face != last:  # neighbours mostly share their triangle
                nx, ny, nz = _unit_normal(vertices, faces, face)
                last = face
            along = nx * normal[0, row, column] + ny * normal[1, row, column] + nz * normal[2, row, column]
            sign = -1.0 if along < 0.0 else 1.0
            facing[0, row, column] = sign * nx
            facing[1, row, column] = sign * ny
            facing[2, row, column] = sign * nz


@kernel
def _unit_normal(vertices: Array, faces: Array, face: int) -> Any:
    if face < 0:
        return 0.0, 0.0, 0.0
    i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
    ax, ay, az = vertices[j, 0] - vertices[i, 0], vertices[j, 1] - vertices[i, 1], vertices[j, 2] - vertices[i, 2]
    bx, by, bz = vertices[k, 0] - vertices[i, 0], vertices[k, 1] - vertices[i, 1], vertices[k, 2] - vertices[i, 2]
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if length == 0.0:
        return 0.0, 0.0, 0.0
    return nx / length, ny / length, nz / length


class PlainAlbedo(NamedTuple):
    """What an albedo without textures and vertex colours is made of."""

    triangle_id: Array  # (h, w) int32, -1: no surface
    material_of_face: Array  # (m,) int32
    diffuse: Array  # (3, materials + 1), the last one black


MANY = 8  # as soon as one texel in so many is asked for, all are computed
NO_TEXELS = np.zeros(0, np.int64)


class GBuffer:
    """Channels of the visible surface; `resolve` computes several in one pass, a property one alone.

    Parameters
    ----------
    geometry : Geometry
        The triangles.
    materials : MaterialTable
        Their materials.
    projection : Projection
        The view.
    visibility : Visibility
        Which triangle each texel sees.
    dtype : dtype
        Float32 or float64, of every channel but the ids.
    known : mapping of str to ndarray, optional
        Channels that need not be computed.

    Notes
    -----
    Where there is no surface, depth and distance are inf, ids are -1 and all else is 0.
    """

    def __init__(
        self,
        geometry: Geometry,
        materials: MaterialTable,
        projection: Projection,
        visibility: Visibility,
        dtype: npt.DTypeLike,
        known: Mapping[str, Array] | None = None,
    ) -> None:
        self.projection = projection
        self.visibility = visibility
        self.dtype = np.dtype(dtype)
        self._geometry = geometry
        self._materials = materials
        self._known = known or {}
        self._channels: dict[str, Array] = dict(self._known)

    @property
    def height(self) -> int:
        """Rows, of all stacked maps."""
        return int(self.visibility.triangle_id.shape[0])

    @property
    def width(self) -> int:
        """Columns."""
        return int(self.visibility.triangle_id.shape[1])

    @property
    def triangle_id(self) -> Array:
        """Visible triangle, (h, w) int32, -1 for none."""
        return self.visibility.triangle_id

    @property
    def covered(self) -> Array:
        """Whether a surface is visible, (h, w) bool."""
        if "covered" not in self._channels:
            covered = plane(self.visibility.triangle_id.shape, np.bool_)
            self._channels["covered"] = np.greater_equal(self.visibility.triangle_id, 0, out=covered)
        return self._channels["covered"]

    @property
    def depth(self) -> Array:
        """Axial depth, (h, w), m; distance on a paraboloid map."""
        return self.resolve("depth")[0]

    @property
    def distance(self) -> Array:
        """Distance from the centre of projection, (h, w), m."""
        return self.resolve("distance")[0]

    @property
    def position(self) -> Array:
        """Surface point, (3, h, w), world space, m."""
        return self.resolve("position")[0]

    @property
    def normal(self) -> Array:
        """Unit normal on the visible side, (3, h, w): interpolated where the geometry has vertex normals."""
        return self.resolve("normal")[0]

    @property
    def facing(self) -> Array:
        """Unit normal of the face on the side of `normal`, (3, h, w); the very array `normal` on flat geometry."""
        if "facing" not in self._channels:
            self._channels["facing"] = facing_normals(self._geometry, self.triangle_id, self.normal)
        return self._channels["facing"]

    @property
    def albedo(self) -> Array:
        """Diffuse reflectance, (3, h, w)."""
        return self.resolve("albedo")[0]

    @property
    def material_of_face(self) -> Array:
        """Material of each triangle, (m,) int32."""
        return self._geometry.material_of_face

    @property
    def plain_albedo(self) -> PlainAlbedo | None:
        """What `albedo` is made of, where that is materials alone; else None."""
        materials, geometry = self._materials, self._geometry
        if "albedo" in self._known or geometry.colours is not None or painted(geometry, materials) is not None:
            return None
        return PlainAlbedo(self.triangle_id, geometry.material_of_face, _reflectances(materials, self.dtype))

    @property
    def emission(self) -> Array:
        """Radiance that the surface emits, (3, h, w), W/m^2/sr."""
        if "emission" not in self._channels:
            emission, materials = self._materials.emission.astype(self.dtype, copy=False), self._materials
            emitted = np.moveaxis(np.append(emission, np.zeros((1, 3), self.dtype), axis=0)[self.material_id], -1, 0)
            self._channels["emission"] = np.ascontiguousarray(emitted)
            paint(self._geometry, materials._replace(diffuse=emission, textures=materials.emissive), self.projection,
                  self.triangle_id, self._channels["emission"])
        return self._channels["emission"]

    @property
    def material_id(self) -> Array:
        """Visible material, (h, w) int32, -1 for none."""
        return self.resolve("material_id")[0]

    def resolve(self, *names: str) -> tuple[Array, ...]:
        """Return channels by name, in the order asked for, computing in one pass those not yet known.

        Names: depth, distance, position, normal, albedo, material_id, triangle_id, covered; InputError for another.
        """
        for name in names:
            known = name in (*ChannelMask._fields, "triangle_id", "covered")
            expect(known, "channel", "a channel of the G-buffer", name)
        missing = [name for name in ChannelMask._fields if name in names and name not in self._channels]
        if missing:
            unknown = [name for name in ChannelMask._fields if name not in self._channels]
            if not left_out("rsm.channels", lambda: (len(unknown) - len(missing), len(unknown))):
                missing = unknown
            self._channels.update(_resolve(self._geometry, self._materials, self.projection,
                                           self.visibility.triangle_id, self.dtype, tuple(missing)))  # fmt: skip
        return tuple(self._channels[n] if n in self._channels else getattr(self, n) for n in names)

    def recorded(self) -> dict[str, Array]:
        """Return the channels that stages read by name, as logs keep them."""
        names = ("triangle_id", "covered", "depth", "position", "normal", "albedo")
        return dict(zip(names, self.resolve(*names), strict=True))

    def with_channels(self, channels: Mapping[str, Array], dtype: np.dtype[Any]) -> "GBuffer":
        """Return the buffer with other channels, by name."""
        known = {name: channels[name] for name in ChannelMask._fields if name in channels}
        visibility = self.visibility._replace(triangle_id=channels["triangle_id"])
        return GBuffer(self._geometry, self._materials, self.projection, visibility, dtype, known)

    def of_materials(self, materials: MaterialTable) -> "GBuffer":
        """Return the buffer of the same view with other materials."""
        return GBuffer(self._geometry, materials, self.projection, self.visibility, self.dtype)

    def at(self, texel: Array, *names: str) -> tuple[Array, ...]:
        """Return channels at some texels alone, (n,) or (3, n), with the bits that `resolve` gives.

        `texel`: (n,) row * w + column; `names` as for `resolve`. What is not yet known is computed there.
        """
        size = self.visibility.triangle_id.size
        if MANY * len(texel) > size or not left_out("rsm.texels", lambda: (size - len(texel), size)):
            self.resolve(*names)
        missing = tuple(name for name in ChannelMask._fields if name in names and name not in self._channels)
        computed = {}
        if missing:
            planes = _filled(self._geometry, self._materials, self.projection, self.triangle_id, self.dtype, missing,
                             texel)
            computed = {name: getattr(planes, name)[..., 0, :] for name in missing}
        return tuple(computed[n] if n in computed else values_at(self.resolve(n)[0], texel) for n in names)


def values_at(channel: Array, texel: Array) -> Array:
    """Return a channel's values at some texels.

    `channel` (..., h, w): the channel. `texel` (n,) int: texels, row * w + column. Returns (..., n): the values.
    """
    return np.take(channel.reshape(*channel.shape[:-2], -1), texel, axis=-1)


@stage("rsm.gbuffer", steps="refgi.rsm.buffers.steps.gbuffer_steps")
def gbuffer(
    geometry: Geometry,
    materials: MaterialTable,
    camera: Camera,
    width: int | None = None,
    height: int | None = None,
    dtype: npt.DTypeLike = np.float32,
) -> GBuffer:
    """Rasterize triangles for a camera.

    width, height: Size in pixels; the camera's own where absent.
    -> GBuffer: Its visibility is known, its channels are resolved when asked for.

    Raises
    ------
    InputError
        If the size or type cannot be used.
    """
    expect(np.dtype(dtype) in (np.float32, np.float64), "dtype", "float32 or float64", np.dtype(dtype).name)
    projection = camera_projection(camera, width, height)
    return GBuffer(geometry, materials, projection, rasterize(geometry, projection), dtype)


@stage("rsm.resolve")
def _resolve(
    geometry: Geometry,
    materials: MaterialTable,
    projection: Projection,
    triangle_id: Array,
    dtype: np.dtype[Any],
    names: tuple[str, ...],
) -> dict[str, Array]:
    """Compute channels of the visible surface in one pass.

    triangle_id (h, w) int32: Visible triangle of each texel, -1 for none.
    dtype: Of the channels.
    names: Channels to compute.
    -> dict of str to (h, w) or (3, h, w): The channels by name, units as `GBuffer` states them.
    """
    planes = _filled(geometry, materials, projection, triangle_id, dtype, names)
    return {name: getattr(planes, name) for name in names}


def _filled(
    geometry: Geometry, materials: MaterialTable, projection: Projection, triangle_id: Array, dtype: np.dtype[Any],
    names: tuple[str, ...], texel: Array | None = None,
) -> Planes:
    """Return planes of the named channels, of all texels or, in one row, of those listed (n,)."""
    seen = triangle_id if texel is None else np.take(triangle_id.reshape(1, -1), texel, axis=1)
    planes = _planes(names, seen.shape, dtype)
    if seen.size:
        channels = ChannelMask(*(name in names for name in ChannelMask._fields))
        surface = Surface(geometry.vertices, geometry.faces, geometry.vertex_normals, geometry.material_of_face,
                          _reflectances(materials, dtype))
        resolve(surface, projection, triangle_id, NO_TEXELS if texel is None else texel, seen, channels, planes,
                allocate(thread_count()) if texel is None else allocate(1, 1))
    paint(geometry, materials, projection, triangle_id, planes.albedo, texel)
    tint(geometry, projection, triangle_id, planes.albedo, texel)
    return planes


def _reflectances(materials: MaterialTable, dtype: np.dtype[Any]) -> Array:
    """Return the materials' diffuse reflectances, (3, materials + 1), the last one black."""
    return np.append(materials.diffuse.T.astype(dtype), np.zeros((3, 1), dtype), axis=1)


def _planes(names: tuple[str, ...], shape: tuple[int, ...], dtype: np.dtype[Any]) -> Planes:
    """Allocate the planes of the named channels."""
    planes = {}
    for name in ChannelMask._fields:
        size = shape if name in names else (0, 0)
        planes[name] = plane((3, *size) if name in ("position", "normal", "albedo") else size,
                             np.int32 if name == "material_id" else dtype)  # fmt: skip
    return Planes(**planes)
