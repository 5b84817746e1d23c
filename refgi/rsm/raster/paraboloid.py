"""Exact rasterization of paraboloid maps, and the depth maps of many points drawn by it.

Straight edges are arcs on a paraboloid map, so the test is made in direction space. With vertices v_i in the map's
frame, n_i = v_j x v_k, and the texel's direction d = (2s, 2t, 1 - s^2 - t^2) of length 1 + s^2 + t^2:

- e_i = d . n_i = -n_z s^2 + 2 n_x s + (2 t n_y + (1 - t^2) n_z), along a row a quadratic in s,
- inside where all e_i have the sign of det(v); on a plane the sign of n's first component that is not zero decides,
- the hit is tau d with 1/tau = sum(e_i)/det, its distance tau (1 + s^2 + t^2).

Adjacent triangles get exactly negated n, so a texel on a shared edge belongs to exactly one.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.jit import kernel, prange, thread_count
from refgi.rsm.pool import plane
from refgi.rsm.raster.batch import EMPTY, unpack
from refgi.rsm.raster.paraboloid_batch import ANY, KINDS, gather, next_batch, orient, transform
from refgi.rsm.raster.paraboloid_texels import Scratch, draw_rows, draw_texels, scratch
from refgi.rsm.raster.projection import Projection, paraboloid_projection
from refgi.rsm.raster.triangle import CHUNK, LANES, Chunks, chunks
from refgi.scene.model import Geometry
from refgi.scene.triangles import CutFaces
from refgi.stages import stage
from refgi.types import Array


class Ignored(NamedTuple):
    """Which geometry near its centre each map ignores."""

    planes: Array  # (k,) float64, m: triangles whose plane passes nearer than this
    ball: Array  # (k,) float64, m: surfaces nearer than this, as if cut away


class CutChunks(NamedTuple):
    """Triangles that may have holes."""

    triangles: Chunks
    holes: CutFaces


def cut_chunks(geometry: Geometry) -> CutChunks | None:
    """Group the triangles that may have holes in chunks, None where there are none."""
    holes = geometry.cut
    return None if holes is None else CutChunks(chunks(geometry.vertices, geometry.faces[holes.face]), holes)


def draw_paraboloids(
    projection: Projection, vertices: Array, faces: Array, workers: int, nearness: Array, ids: Array,
    cut: CutChunks | None = None,
) -> None:
    """Draw triangles on every paraboloid map, inside the hemisphere's disc.

    `vertices` (n, 3): world space, m. `faces` (m, 3): vertices of each triangle. `workers`: threads; maps are assigned
    to them round-robin. `nearness` (H, W): float32, receives 1/tau; 0 where nothing is. `ids` (H, W): int32, receives
    the triangle's id, -1 where nothing is. `cut`: those that may have holes, which `faces` show nothing of.
    """
    _draw_maps(projection, chunks(vertices, faces), cut, _keys(projection, workers), nearness, ids)


def draw_distances(
    projection: Projection, triangles: Chunks, ignored: Ignored, workers: int, distance: Array,
    cut: CutChunks | None = None,
) -> tuple[Array, Array]:
    """Draw triangles on every paraboloid map and turn nearness into distance.

    `ignored`: what lies too near the centres to count. `workers`: threads; maps are assigned to them round-robin.
    `distance` (H, W): float32 or float64, of any content; receives the distance, m, inf where nothing is and outside
    the disc. Returns `nearest` (k,): float64: smallest distance on each map, m; inf where nothing is. `left_out` (k,):
    int64: triangles that reach into each map's hemisphere and are ignored for their planes or lie in its ball. `cut`:
    further triangles, that may have holes.
    """
    left_out, nearest = np.zeros(projection.maps, np.int64), np.full(projection.maps, np.inf)
    _draw_distances(projection, triangles, cut, ignored, _keys(projection, workers), distance, left_out, nearest)
    return nearest, left_out


def _keys(projection: Projection, workers: int) -> Array:
    """Return a row of keys for each worker: those of a map, with LANES columns more that nobody reads."""
    return plane((workers, projection.height * (projection.width + LANES)), np.int64)


@kernel(parallel=True)
def _draw_maps(
    projection: Projection, triangles: Chunks, cut: CutChunks | None, keys: Array, nearness: Array, ids: Array
) -> None:
    workers, height, width = len(keys), projection.height, projection.width
    for worker in prange(workers):
        work, map_keys = scratch(), keys[worker]
        for m in range(worker, len(projection.origin), workers):
            rows = slice(m * height, (m + 1) * height)
            map_keys[:] = EMPTY
            draw(projection, m, triangles, None, (np.inf, 0.0), work, None, map_keys)
            if cut is not None:
                draw(projection, m, cut.triangles, cut.holes, (np.inf, 0.0), work, None, map_keys)
            unpack(map_keys, width, 0, height - 1, nearness[rows], ids[rows])
            clear_outside_disc(projection, nearness[rows], ids[rows])


@kernel(parallel=True)
def _draw_distances(
    projection: Projection, triangles: Chunks, cut: CutChunks | None, ignored: Ignored, keys: Array, distance: Array,
    left_out: Array, nearest: Array,
) -> None:
    workers, height = len(keys), projection.height
    for worker in prange(workers):
        work, map_keys = scratch(), keys[worker]
        for m in range(worker, len(projection.origin), workers):
            shown = distance[m * height : (m + 1) * height]
            limits = 1.0 / (ignored.planes[m] * ignored.planes[m]), ignored.ball[m]
            map_keys[:] = 0
            left_out[m] = draw(projection, m, triangles, None, limits, work, shown, map_keys)
            if cut is not None:
                left_out[m] += draw(projection, m, cut.triangles, cut.holes, limits, work, shown, map_keys)
            nearest[m] = to_distance(projection, map_keys, shown)


@kernel
def clear_outside_disc(projection: Projection, nearness: Array, ids: Array) -> None:
    """Empty the texels beyond the hemisphere."""
    n, half = projection.width, projection.half[0]
    step = 2.0 * half / n
    for row in range(n):
        t = (row + 0.5) * step - half
        for column in range(n):
            s = (column + 0.5) * step - half
            if s * s + t * t > 1.0:
                nearness[row, column] = 0.0
                ids[row, column] = -1


@kernel
def to_distance(projection: Projection, keys: Array, distance: Array) -> float:
    """Write distances of a map from its keys, inf where there is no surface and outside the disc."""
    n, half, real = projection.width, projection.half[0], distance.dtype.type
    step, nearness, least = 2.0 * half / n, keys.view(np.float64), np.full(n, real(np.inf))
    for row in range(n):
        t = (row + 0.5) * step - half
        line, place = np.uint64(row), np.uint64(row * (n + LANES))
        for column in range(n):
            s = (column + 0.5) * step - half
            square = s * s + t * t
            # no surface: nearness 0, distance inf
            far = (1.0 + square) / nearness[place + np.uint64(column)]
            distance[line, np.uint64(column)] = real(far if square <= 1.0 else np.inf)
        for column in range(n):  # of each column: one least of all would wait for the one before
            least[column] = min(least[column], distance[line, np.uint64(column)])
    nearest = np.inf
    for column in range(n):
        nearest = min(nearest, least[column])
    return nearest


@kernel
def draw(
    projection: Projection, m: int, triangles: Chunks, holes: CutFaces | None, limits: tuple[float, float],
    work: Scratch, rounded: Array | None, keys: Array,
) -> int:
    """Keep the greatest key at each texel of one map, a batch of triangles of one kind at a time.

    With `holes`, those of `triangles`, a mask is asked only where its triangle would be seen. `limits`: 1 / distance^2
    of planes, distance of hits that are ignored. `rounded`: distances that become of the keys; None where these hold
    ids as well. `keys` (n (n + LANES),). Result: how many triangles ahead are left out.
    """
    n, half, origin, frame = projection.width, projection.half[0], projection.origin, projection.frame
    view = (origin[m, 0], origin[m, 1], origin[m, 2], frame[m, 0, 0], frame[m, 0, 1], frame[m, 0, 2],
            frame[m, 1, 0], frame[m, 1, 1], frame[m, 1, 2], frame[m, 2, 0], frame[m, 2, 1], frame[m, 2, 2])  # fmt: skip
    steepest, ball = limits
    counted = ball if steepest == np.inf else np.inf  # the plane of any triangle may pass near the centre
    chunk, count, left_out = 0, len(triangles.box), 0
    work.waiting[:] = 0
    while True:
        chunk = next_batch(triangles, chunk, view, half, n, counted, holes is None, work)
        for kind in range(KINDS):
            while work.waiting[kind] >= CHUNK or (chunk == count and work.waiting[kind] > 0):
                members, size = work.members[kind], min(work.waiting[kind], CHUNK)
                gather(triangles.vertices, triangles.faces, members, size, work.setup)
                transform(view, half, n, ball, work.setup)
                orient(work.setup)
                if kind == ANY:
                    left_out += draw_rows(n, half, members, size, holes, limits, work, rounded, keys)
                else:
                    draw_texels(n, half, members, size, 1 << kind, ball, work, rounded, keys)
                work.waiting[kind] -= size
                for b in range(work.waiting[kind]):
                    members[b] = members[size + b]
        if chunk == count:
            return left_out


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
