"""The G-buffer: what a camera or a light sees through every texel, each channel resolved when first asked for."""

from typing import Any

import numba
import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.rsm.attributes import Planes, Surface, Wanted, resolve
from refgi.rsm.memory import plane
from refgi.rsm.projection import Projection, camera_projection
from refgi.rsm.raster import Visibility, rasterize
from refgi.scene.model import Camera, Geometry, MaterialTable
from refgi.stages import stage

Array = npt.NDArray[Any]


class GBuffer:
    """Channels of the visible surface; `resolve` computes several in one pass, a property one alone.

    Parameters
    ----------
    geometry : Geometry
        The triangles.
    materials : MaterialTable
        Their materials.
    projection : Projection
        Who looks.
    visibility : Visibility
        Which triangle each texel sees.
    dtype : dtype
        Float32 or float64, of every channel but the ids.

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
    ) -> None:
        self.projection = projection
        self.visibility = visibility
        self.dtype = np.dtype(dtype)
        self._geometry = geometry
        self._materials = materials
        self._channels: dict[str, Array] = {}

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
        """Triangle that is seen, (h, w) int32, -1 for none."""
        return self.visibility.triangle_id

    @property
    def covered(self) -> Array:
        """Whether any surface is seen, (h, w) bool."""
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
        """Unit normal on the side that is seen, (3, h, w): interpolated where the geometry has vertex normals."""
        return self.resolve("normal")[0]

    @property
    def albedo(self) -> Array:
        """Diffuse reflectance, (3, h, w)."""
        return self.resolve("albedo")[0]

    @property
    def material_id(self) -> Array:
        """Material that is seen, (h, w) int32, -1 for none."""
        return self.resolve("material_id")[0]

    def resolve(self, *names: str) -> tuple[Array, ...]:
        """Return channels by name, computing in one pass those not yet known.

        Parameters
        ----------
        *names : str
            Among depth, distance, position, normal, albedo, material_id, triangle_id, covered.

        Returns
        -------
        tuple of ndarray
            The channels, in the order asked for.

        Raises
        ------
        InputError
            If a name is not a channel.
        """
        for name in names:
            expect(name in (*Wanted._fields, "triangle_id", "covered"), "channel", "a channel of the G-buffer", name)
        missing = [name for name in Wanted._fields if name in names and name not in self._channels]
        if missing:
            self._channels.update(_resolve(self._geometry, self._materials, self.projection,
                                           self.visibility.triangle_id, self.dtype, tuple(missing)))  # fmt: skip
        return tuple(self._channels[n] if n in self._channels else getattr(self, n) for n in names)


@stage("rsm.gbuffer")
def gbuffer(
    geometry: Geometry,
    materials: MaterialTable,
    camera: Camera,
    width: int | None = None,
    height: int | None = None,
    dtype: npt.DTypeLike = np.float32,
) -> GBuffer:
    """Look at triangles through a camera.

    Parameters
    ----------
    geometry : Geometry
        The triangles.
    materials : MaterialTable
        Their materials.
    camera : Camera
        Who looks.
    width, height : int, optional
        Size in pixels; the camera's own where absent.
    dtype : dtype
        Float32 or float64.

    Returns
    -------
    GBuffer
        Its visibility is known, its channels are resolved when asked for.

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
    """Return the named channels, computed in one pass."""
    shape = triangle_id.shape
    planes = {name: np.empty((3, 0, 0) if name in ("position", "normal", "albedo") else (0, 0), dtype)
              for name in Wanted._fields}  # fmt: skip
    planes["material_id"] = np.empty((0, 0), np.int32)
    for name in names:
        full = (3, *shape) if planes[name].ndim == 3 else shape
        planes[name] = plane(full, planes[name].dtype)
    normals = np.zeros((0, 3)) if geometry.vertex_normals is None else geometry.vertex_normals
    diffuse = materials.diffuse.astype(dtype, copy=False)
    surface = Surface(geometry.vertices, geometry.faces, normals, geometry.material_of_face, diffuse)
    wanted = Wanted(*(name in names for name in Wanted._fields))
    resolve(surface, projection, triangle_id, wanted, Planes(**planes), numba.get_num_threads())
    return {name: planes[name] for name in names}
