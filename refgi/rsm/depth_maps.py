"""Distances to the nearest surface on hemispheres around many points, one paraboloid map each."""

from typing import Any

import numba
import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.rsm.attributes import Planes, Wanted, resolve
from refgi.rsm.paraboloid import Ignored, draw_paraboloids
from refgi.rsm.projection import Projection, paraboloid_projection
from refgi.rsm.runs import Surface
from refgi.rsm.triangle import LANES
from refgi.scene.model import Geometry
from refgi.stages import stage

Array = npt.NDArray[Any]


@stage("rsm.paraboloid_depth_maps")
def paraboloid_depth_maps(
    geometry: Geometry, centers: Array, axes: Array, size: int, dtype: npt.DTypeLike = np.float32
) -> Array:
    """Measure the distance to the nearest surface from many points, on a hemisphere each.

    Parameters
    ----------
    geometry : Geometry
        The triangles.
    centers, axes : (k, 3) ndarray
        Where each map looks from (m) and to (any length).
    size : int
        Texels along a side.
    dtype : dtype
        Float32 or float64.

    Returns
    -------
    (k, n, n) ndarray
        Distance, m; inf where nothing is seen and outside the disc. Map m's frame is
        ``refgi.rsm.projection.paraboloid_projection(centers, axes, size).frame[m]``.

    Raises
    ------
    InputError
        If centres and axes do not match or are not finite, an axis is zero, or the size cannot be used.
    """
    centers = np.reshape(np.asarray(centers, np.float64), (-1, 3))
    axes = np.reshape(np.asarray(axes, np.float64), (-1, 3))
    expect(np.dtype(dtype) in (np.float32, np.float64), "dtype", "float32 or float64", np.dtype(dtype).name)
    expect(len(centers) == len(axes), "axes", f"{len(centers)} as many as centres", len(axes))
    expect(bool(np.isfinite(centers).all()), "centers", "finite coordinates", centers)
    expect(bool(np.isfinite(axes).all() and axes.any(axis=1).all()), "axes", "finite vectors, not zero", axes)
    return distance_maps(paraboloid_projection(centers, axes, size), geometry.vertices, geometry.faces, dtype)[0]


def distance_maps(
    projection: Projection, vertices: Array, faces: Array, dtype: npt.DTypeLike, ignored: Ignored | None = None
) -> tuple[Array, Array]:
    """Measure the distance to the nearest of some triangles on paraboloid maps.

    Parameters
    ----------
    projection : Projection
        k paraboloid maps of n x n texels.
    vertices : (v, 3) float64 ndarray
        World space, m.
    faces : (m, 3) int32 ndarray
        Vertices of each triangle.
    dtype : dtype
        Float32 or float64.
    ignored : Ignored, optional
        What lies too near the centres to count; nothing where absent.

    Returns
    -------
    distance : (k, n, n) ndarray
        Distance, m; inf where nothing is seen and outside the disc.
    left_out : (k,) ndarray
        Int64: triangles of each map's hemisphere that were ignored for their planes.
    """
    height, width = projection.shape
    nearness = np.full((height, max(width, LANES)), 0.0, np.float32)
    ids = np.full(nearness.shape, -1, np.int32)
    left_out = np.zeros(projection.maps, np.int64)
    if len(faces):
        left_out = draw_paraboloids(projection, vertices, faces, numba.get_num_threads(), nearness, ids, ignored)
    if np.dtype(dtype) == np.float64:
        return _exact_distances(vertices, faces, projection, ids[:, :width]).reshape(-1, width, width), left_out
    distance = np.empty((projection.maps, width, width), np.float32)
    _distances(projection, nearness, distance)
    return distance, left_out


def _exact_distances(vertices: Array, faces: Array, projection: Projection, ids: Array) -> Array:
    """Return the distance to the plane of each texel's triangle, float64."""
    distance, none, no_vectors = np.zeros(ids.shape), np.zeros((0, 0)), np.zeros((3, 0, 0))
    surface = Surface(vertices, faces, np.zeros((0, 3)), np.zeros(len(faces), np.int32), np.zeros((1, 3)))
    planes = Planes(distance, none, no_vectors, no_vectors, no_vectors, np.zeros((0, 0), np.int32))
    wanted = Wanted(True, False, False, False, False, False)
    resolve(surface, projection, np.ascontiguousarray(ids), wanted, planes, numba.get_num_threads())
    return distance


@kernel(parallel=True)
def _distances(projection: Projection, nearness: Array, distance: Array) -> None:
    n, half = projection.width, projection.half[0]
    step = 2.0 * half / n
    for m in prange(len(distance)):
        for row in range(n):
            t = (row + 0.5) * step - half
            for column in range(n):
                s = (column + 0.5) * step - half
                # nothing seen: nearness 0, distance inf
                distance[m, row, column] = (1.0 + s * s + t * t) / nearness[m * n + row, column]
