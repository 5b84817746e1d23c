"""Paraboloid depth maps: distance to the nearest surface over the hemisphere of each of many points."""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.jit import thread_count
from refgi.rsm.pool import plane
from refgi.rsm.raster.paraboloid import CutChunks, Ignored, cut_chunks, draw_distances
from refgi.rsm.raster.projection import Projection, paraboloid_projection
from refgi.rsm.raster.triangle import Chunks, chunks
from refgi.scene.model import Geometry
from refgi.stages import stage

Array = npt.NDArray[Any]


@stage("rsm.paraboloid_depth_maps")
def paraboloid_depth_maps(
    geometry: Geometry, centers: Array, axes: Array, size: int, dtype: npt.DTypeLike = np.float32
) -> Array:
    """Measure the distance to the nearest surface from many points, on a hemisphere each.

    centers, axes (k, 3): Where each map looks from (m) and to (any length).
    size: Texels along a side.
    -> (k, n, n): Distance, m; inf without surface and outside the disc. Map m's frame is
        ``refgi.rsm.raster.projection.paraboloid_projection(centers, axes, size).frame[m]``.

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
    projection = paraboloid_projection(centers, axes, size)
    return distance_maps(projection, whole_chunks(geometry), dtype, cut=cut_chunks(geometry))[0]


def whole_chunks(geometry: Geometry) -> Chunks:
    """Group the triangles that have no holes in chunks."""
    faces = geometry.faces if geometry.cut is None else np.delete(geometry.faces, geometry.cut.face, axis=0)
    return chunks(geometry.vertices, faces)


def distance_maps(
    projection: Projection, triangles: Chunks, dtype: npt.DTypeLike, ignored: Ignored | None = None,
    cut: CutChunks | None = None,
) -> tuple[Array, Array, Array]:
    """Measure the distance to the nearest of some triangles on paraboloid maps.

    `projection`: k paraboloid maps of n x n texels. `ignored`: what lies too near the centres to count; nothing where
    absent. `cut`: further triangles, that may have holes. Returns `distance` (k, n, n): distance, m; inf without
    surface and outside the disc. `nearest` (k,): float64: smallest distance on each map, m; inf where nothing is.
    `left_out` (k,): int64: triangles that reach into each map's hemisphere and are ignored for their planes or lie in
    its ball.
    """
    n, none = projection.width, np.zeros(projection.maps)
    distance = plane((projection.maps * n, n), dtype)
    workers = thread_count()
    found = draw_distances(projection, triangles, ignored or Ignored(none, none), workers, distance, cut)
    return distance.reshape(-1, n, n), *found
