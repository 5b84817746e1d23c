"""Perspective, orthographic and paraboloid projections of one or several maps at once.

A `Projection` holds k maps of equal size, stacked along rows: one for a camera, six for a cube, two for a dual
paraboloid, any number for a batch. Each map has an origin and a right-handed frame (right, down, forward). Texel
(row, column) covers [row, row + 1) x [column, column + 1), its centre lies at + 1/2, row 0 is the top row. On the
image plane the map spans [-half[0], half[0]] x [-half[1], half[1]] in the coordinates

- perspective: (x, y) / z, the plane z = 1,
- orthographic: (x, y), m,
- paraboloid: (x, y) / (|p| + z), where the unit disc is the hemisphere z >= 0 (the stereographic projection).
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.scene.model import Camera, DirectionalLight, SpotLight
from refgi.types import Array

PERSPECTIVE, ORTHOGRAPHIC, PARABOLOID = 0, 1, 2
LARGEST_SIDE = 65536  # texels; boxes of triangles are kept as 16-bit integers
CUBE_FORWARD = ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))
CUBE_UP = ((0, 1, 0), (0, 1, 0), (0, 0, 1), (0, 0, -1), (0, 1, 0), (0, 1, 0))


class Projection(NamedTuple):
    """k stacked maps of `height` x `width` texels each."""

    kind: int  # PERSPECTIVE, ORTHOGRAPHIC or PARABOLOID
    height: int  # rows of one map
    width: int
    origin: Array  # (k, 3) float64, m: centre of projection; orthographic: centre of the plane at depth 0
    frame: Array  # (k, 3, 3) float64: rows right, down, forward, unit vectors
    half: Array  # (2,) float64: half extent of the map on the image plane, horizontal and vertical
    reach: float  # orthographic: depth where nothing may lie any more, m; else inf

    @property
    def maps(self) -> int:
        """Number of stacked maps."""
        return len(self.origin)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the stacked maps."""
        return self.maps * self.height, self.width


def camera_projection(camera: Camera, width: int | None = None, height: int | None = None) -> Projection:
    """Return the perspective map of a camera.

    Parameters
    ----------
    camera : Camera
        The camera.
    width, height : int, optional
        Size in pixels; the camera's own where absent.

    Returns
    -------
    Projection
        One perspective map with square pixels.

    Raises
    ------
    InputError
        If the size is not 1 to 65536.
    """
    width = camera.width if width is None else width
    height = camera.height if height is None else height
    _expect_size(height, width)
    half_v = math.tan(camera.vfov / 2)
    frame = view_frame(np.subtract(camera.target, camera.eye), camera.up)
    return _maps(PERSPECTIVE, height, width, [camera.eye], [frame], (half_v * width / height, half_v))


def spot_projection(light: SpotLight, n: int) -> Projection:
    """Return the square perspective map whose inscribed circle is the spot's outer cone; `n`: texels along a side."""
    half = math.tan(light.outer_half_angle)
    return _maps(PERSPECTIVE, n, n, [light.position], [view_frame(light.direction)], (half, half))


def cube_projection(position: npt.ArrayLike, n: int) -> Projection:
    """Return the six faces of a cube around a point: +x, -x, +y, -y, +z, -z, 90 degrees each.

    `position` (3,) array_like: centre, m. `n`: texels along a side of a face.
    """
    frames = [view_frame(forward, up) for forward, up in zip(CUBE_FORWARD, CUBE_UP, strict=True)]
    return _maps(PERSPECTIVE, n, n, [position] * 6, frames, (1.0, 1.0))


def paraboloid_projection(centers: npt.ArrayLike, axes: npt.ArrayLike, n: int, half: float = 1.0) -> Projection:
    """Return one paraboloid map per pair of centre and axis.

    `centers`, `axes` (k, 3) array_like: where each map looks from (m) and to (any length). `n`: texels along a side.
    `half`: radius of the map's inscribed circle on the image plane, tan(angle/2); 1 is the hemisphere.
    """
    axes = np.reshape(np.asarray(axes, np.float64), (-1, 3))
    return _maps(PARABOLOID, n, n, centers, [view_frame(axis) for axis in axes], (half, half))


def dual_paraboloid_projection(position: npt.ArrayLike, n: int) -> Projection:
    """Return two paraboloid maps, towards +z and -z, that see all directions.

    `position` (3,) array_like: centre, m. `n`: texels along a side of a map.
    """
    return paraboloid_projection(np.stack([position, position]), [(0, 0, 1), (0, 0, -1)], n)


def directional_projection(light: DirectionalLight, bounds: tuple[Array, Array], n: int) -> Projection:
    """Return the orthographic map along a directional light that encloses a box.

    `bounds`: corners of the box, m. `n`: texels along a side; they need not be square. Result: one orthographic map;
    depth 0 lies just before the box.
    """
    frame = view_frame(light.direction)
    corners = np.array(np.meshgrid(*np.stack(bounds, axis=1))).reshape(3, -1).T
    inside = corners @ frame.T
    low, high = inside.min(axis=0), inside.max(axis=0)
    margin = 1e-6 * float(np.linalg.norm(high - low)) or 1.0
    half = (high - low)[:2] / 2 + margin
    origin = (*(low + high)[:2] / 2, low[2] - margin) @ frame
    reach = 1.25 * (high[2] - low[2] + 2 * margin)  # nearness 1 - depth/reach stays well above the empty map's 0
    return _maps(ORTHOGRAPHIC, n, n, [origin], [frame], half, reach)


def view_frame(forward: npt.ArrayLike, up: npt.ArrayLike | None = None) -> Array:
    """Return the frame (right, down, forward) of a view.

    `forward` (3,) array_like: view direction, any length. `up` (3,) array_like, optional: what appears upwards; +y
    where absent, or -z when the view is along y. Returns (3, 3): unit vectors as rows, right-handed.
    """
    ahead = _unit(forward)
    if up is None:
        up = (0.0, 1.0, 0.0) if abs(ahead[1]) < 0.999 else (0.0, 0.0, -1.0)
    right = _unit(np.cross(ahead, _unit(up)))
    return np.stack([right, np.cross(ahead, right), ahead])


def project(projection: Projection, position: Array) -> tuple[Array, Array, Array]:
    """Return where points appear on the stacked maps.

    Parameters
    ----------
    projection : Projection
        The maps; a point seen by several belongs to the first.
    position : (3, ...) ndarray
        World space, m.

    Returns
    -------
    row, column : (...) ndarray
        Continuous texel coordinates (centres at + 1/2); nan outside every map.
    depth : (...) ndarray
        Axial depth, or distance for paraboloid maps, m; nan outside every map.
    """
    flat = np.ascontiguousarray(position).reshape(3, -1)
    out = np.empty_like(flat)
    _project_all(projection, flat, out)
    row, column, depth = out.reshape(position.shape)
    return row, column, depth


@kernel(parallel=True)
def _project_all(projection: Projection, position: Array, out: Array) -> None:
    for i in prange(position.shape[1]):
        out[0, i], out[1, i], out[2, i] = texel_of(projection, position[0, i], position[1, i], position[2, i])


@kernel
def texel_of(projection: Projection, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return row, column and depth of a world point on the first map that sees it, or nan thrice.

    `x`, `y`, `z`: the point, world space, m. Result: continuous row and column in the stacked maps, and depth as in
    `project`.
    """
    half = projection.half[0], projection.half[1]
    for m in range(projection.origin.shape[0]):
        u, v, depth = image_point(projection, m, x, y, z)
        if abs(u) <= half[0] and abs(v) <= half[1]:
            column, row = texel_coordinates(half, projection.height, projection.width, m, u, v)
            return row, column, depth
    return np.nan, np.nan, np.nan


@kernel
def image_point(projection: Projection, m: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return where map `m` sees a world point on its image plane, nan where it looks away, and its depth.

    `x`, `y`, `z`: the point, world space, m. Result: horizontal and vertical coordinate, perhaps beyond the map, and
    depth as in `project`.
    """
    a, b, depth = view_coordinates(projection, m, x, y, z)
    return image_of_view(projection.kind, a, b, depth)


@kernel
def image_of_view(kind: int, a: float, b: float, depth: float) -> tuple[float, float, float]:
    """Return the image point, as `image_point` does, of a point given along right, down and forward."""
    if kind == ORTHOGRAPHIC:
        return a, b, depth
    scale, ahead = depth, depth > 0.0
    if kind == PARABOLOID:
        distance = math.sqrt(a * a + b * b + depth * depth)
        scale, ahead, depth = distance + depth, (depth >= 0.0) & (distance > 0.0), distance
    return (a / scale if ahead else np.nan), (b / scale if ahead else np.nan), depth


@kernel
def texel_coordinates(
    half: tuple[float, float], height: int, width: int, m: int, u: float, v: float
) -> tuple[float, float]:
    """Return continuous column and row, in the stacked maps, of a point of the image plane of map `m`.

    `half`: half extent of the map. `height`, `width`: its rows and columns. `u`, `v`: horizontal and vertical
    coordinate.
    """
    column = (u / half[0] + 1.0) * 0.5 * width
    row = (v / half[1] + 1.0) * 0.5 * height
    # the bottom border is the map's own; of the sum, as adding rounds up to the next map's first row
    return column, min(row + m * height, (m + 1) * height * (1.0 - 1e-16))


@kernel
def view_coordinates(projection: Projection, m: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return a world point in the frame of map `m`: along right, down and forward, m.

    `x`, `y`, `z`: the point, world space, m. Result: coordinates along right, down, forward.
    """
    frame, origin = projection.frame, projection.origin
    px, py, pz = x - origin[m, 0], y - origin[m, 1], z - origin[m, 2]
    return (
        frame[m, 0, 0] * px + frame[m, 0, 1] * py + frame[m, 0, 2] * pz,
        frame[m, 1, 0] * px + frame[m, 1, 1] * py + frame[m, 1, 2] * pz,
        frame[m, 2, 0] * px + frame[m, 2, 1] * py + frame[m, 2, 2] * pz,
    )


def _maps(
    kind: int, height: int, width: int, origin: Any, frames: Any, half: Any, reach: float = math.inf
) -> Projection:
    _expect_size(height, width)
    return Projection(
        kind,
        int(height),
        int(width),
        np.ascontiguousarray(np.reshape(np.asarray(origin, np.float64), (-1, 3))),
        np.ascontiguousarray(np.reshape(np.asarray(frames, np.float64), (-1, 3, 3))),
        np.array(half, np.float64),
        float(reach),
    )


def _expect_size(height: int, width: int) -> None:
    for name, size in (("height", height), ("width", width)):
        expect(1 <= size <= LARGEST_SIDE, name, f"1 to {LARGEST_SIDE} texels", size)


def _unit(vector: npt.ArrayLike) -> Array:
    values = np.asarray(vector, np.float64)
    return values / np.linalg.norm(values)
