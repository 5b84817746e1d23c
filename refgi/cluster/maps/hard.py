"""Hard visibility: one test of one texel, as an area light without extent casts its shadow (Sec. 4.2, 5.1).

The texel that a receiver is seen through knows the distance along its own centre's direction, not along the
receiver's. So the receiver is moved there as well, on its tangent plane: of a surface that the map itself holds, no
texel is nearer than its own plane, and no bias is needed for sloping surfaces.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.cluster.clustering.rectangle import AreaLights
from refgi.cluster.maps.shadow_maps import BACKWARD, ShadowMaps
from refgi.errors import expect
from refgi.jit import kernel, prange

Array = npt.NDArray[Any]

SLACK = 1e-3  # share of its distance that a surface must lie before the receiver to hide it
TILE = 1024  # receivers of one task


def hard_visibility(maps: ShadowMaps, areas: AreaLights, m: int, points: Array, facing: Array) -> Array:
    """Tell which points the centre of an area light sees, by its map.

    Parameters
    ----------
    maps : ShadowMaps
        The maps.
    areas : AreaLights
        The area lights that the maps were drawn for.
    m : int
        Which area light.
    points : (3, n) ndarray
        Receivers, world space, m.
    facing : (3, n) ndarray
        Normals of their surfaces, on either side.

    Returns
    -------
    (n,) ndarray
        1 where nothing lies between, else 0, in the type of `points`. 1 behind the plane of the area light, as
        published, unless there are maps of the hemispheres behind.

    Raises
    ------
    InputError
        If there is no such area light.

    Notes
    -----
    What hides a receiver is nearer by a thousandth than both the receiver and its tangent plane along the texel's
    direction: where that plane recedes, what stands behind the receiver must not count. The paper uses a bias.
    """
    expect(0 <= m < len(areas.members), "m", f"an area light, 0 to {len(areas.members) - 1}", m)
    visible = np.ones(points.shape[1], points.dtype)
    k = int(maps.map_of[m])
    if k >= 0:
        points, facing = np.ascontiguousarray(points), np.ascontiguousarray(facing, points.dtype)
        _hard_tiles(maps.depth[k], maps.center[k], maps.frame[k], points, facing, visible)
        if maps.behind is not None:
            turned = BACKWARD @ maps.frame[k]
            _hard_tiles(maps.behind[k], maps.center[k], turned, points, facing, visible)
    return visible


@kernel(parallel=True)
def _hard_tiles(depth: Array, center: Array, frame: Array, points: Array, facing: Array, visible: Array) -> None:
    count = points.shape[1]
    for tile in prange((count + TILE - 1) // TILE):
        first = np.int64(tile) * TILE
        hard_tile(depth, center, frame, points, facing, first, min(count, first + TILE), visible)


@kernel
def hard_tile(
    depth: Array, center: Array, frame: Array, points: Array, facing: Array, first: Any, last: Any, visible: Array
) -> None:
    """Set V of the receivers that one map hides to 0, and leave the others as they are.

    Parameters
    ----------
    depth : (n, n) ndarray
        Distances of one map, m; inf where nothing is seen.
    center : (3,) float64 ndarray
        Its centre, m.
    frame : (3, 3) float64 ndarray
        Rows right, down, forward.
    points, facing : (3, count) ndarray
        Receivers, world space, m, and normals of their surfaces on either side.
    first, last : int
        First receiver and one past the last.
    visible : (count,) ndarray
        Receives 0 where a receiver in the map's hemisphere is hidden.
    """
    real = points.dtype.type
    one, half, keep = real(1), real(0.5), real(1 - SLACK)
    cx, cy, cz = real(center[0]), real(center[1]), real(center[2])
    rx, ry, rz = real(frame[0, 0]), real(frame[0, 1]), real(frame[0, 2])
    dx, dy, dz = real(frame[1, 0]), real(frame[1, 1]), real(frame[1, 2])
    fx, fy, fz = real(frame[2, 0]), real(frame[2, 1]), real(frame[2, 2])
    n = depth.shape[0]
    size = real(n)
    for i in range(first, last):
        vx, vy, vz = points[0, i] - cx, points[1, i] - cy, points[2, i] - cz
        x, y, z = rx * vx + ry * vy + rz * vz, dx * vx + dy * vy + dz * vz, fx * vx + fy * vy + fz * vz
        distance = math.sqrt(x * x + y * y + z * z)
        if not z > real(0):
            continue
        scale = one / (distance + z)
        column = min(int((x * scale + one) * half * size), n - 1)
        row = min(int((y * scale + one) * half * size), n - 1)
        s, t = (real(column) + half) / size * real(2) - one, (real(row) + half) / size * real(2) - one
        nx, ny, nz = facing[0, i], facing[1, i], facing[2, i]
        # along right, down, forward
        a, b, c = rx * nx + ry * ny + rz * nz, dx * nx + dy * ny + dz * nz, fx * nx + fy * ny + fz * nz
        length = one + s * s + t * t
        height = a * x + b * y + c * z
        slope = (real(2) * (a * s + b * t) + c * (real(2) - length)) / length
        # the tangent plane along the texel's direction, but no farther than the receiver itself
        limit = distance
        if height * slope > real(0):
            limit = min(distance, height / slope)
        if depth[row, column] < limit * keep:
            visible[i] = real(0)
