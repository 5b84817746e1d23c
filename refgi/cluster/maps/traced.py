"""The maps' twin: each texel's distance by a ray through its centre."""

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.cluster.maps.occluders import Blockers
from refgi.rsm.raster.paraboloid import Ignored
from refgi.rsm.raster.projection import Projection

if TYPE_CHECKING:
    from refgi.rays import Tracer

Array = npt.NDArray[Any]


def traced_maps(
    projection: Projection, drawn: Blockers, ignored: Ignored, dtype: npt.DTypeLike, tracer: "Tracer | None" = None
) -> tuple[Array, Array, Array]:
    """Measure distances on paraboloid maps by rays.

    Parameters
    ----------
    projection : Projection
        k paraboloid maps of n x n texels.
    drawn : Blockers
        The triangles.
    ignored : Ignored
        What lies too near the centres to count.
    dtype : dtype
        Float32 or float64; rays themselves are float32.
    tracer : Tracer, optional
        Rays against the same triangles; made where it is absent.

    Returns
    -------
    distance : (k, n, n) ndarray
        Distance, m; inf where nothing is seen and outside the disc.
    nearest : (k,) ndarray
        Float64: smallest distance on each map, m; inf where nothing is.
    left_out : (k,) ndarray
        Int64: triangles that reach into each map's hemisphere and are ignored for their planes or lie in its ball.
    """
    n = projection.width
    distance, left_out = np.full((projection.maps, n, n), np.inf, dtype), np.zeros(projection.maps, np.int64)
    directions, inside = _texel_directions(n)
    for m in range(projection.maps):
        kept, left_out[m] = _kept(drawn, projection, m, ignored)
        if kept.all():
            tracer = tracer or _tracer(drawn, kept)
        rays = tracer if kept.all() and tracer else _tracer(drawn, kept)
        toward, start = directions @ projection.frame[m], ignored.ball[m]
        hits = rays.closest(projection.origin[m] + start * toward, toward)
        distance[m][inside] = hits.distance + start
    return distance, distance.min(axis=(1, 2), initial=np.inf).astype(np.float64), left_out


def _texel_directions(n: int) -> tuple[Array, Array]:
    """Return unit vectors through the texels inside the disc, and which these are."""
    s, t = np.meshgrid(*[(2.0 * np.arange(n) + 1.0) / n - 1.0] * 2)
    square = s * s + t * t
    inside = square <= 1.0
    local = np.stack([2.0 * s, 2.0 * t, 1.0 - square], axis=-1) / (1.0 + square)[..., None]
    return local[inside], inside


def _kept(drawn: Blockers, projection: Projection, m: int, ignored: Ignored) -> tuple[Array, int]:
    """Tell which planes do not pass too near the centre; count what reaches ahead and is ignored."""
    corners = drawn.vertices[drawn.faces] - projection.origin[m]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    height = np.abs((normal * corners[:, 0]).sum(axis=1))
    near_plane = (height < ignored.planes[m] * np.linalg.norm(normal, axis=1)) & (height > 0.0)
    inside = ((corners * corners).sum(axis=2) < ignored.ball[m] ** 2).all(axis=1)
    ahead = (corners @ projection.frame[m, 2] >= 0.0).any(axis=1)
    return ~near_plane, int((ahead & (near_plane | inside)).sum())


def _tracer(drawn: Blockers, kept: Array) -> "Tracer":
    from refgi.rays import Tracer
    from refgi.scene import Geometry

    faces = drawn.faces[kept]
    return Tracer(Geometry(drawn.vertices, faces, np.zeros(len(faces), np.int32)))
