"""Occluders: triangles that can lie between pixel lights and receivers; those on the convex hull of both cannot.

A triangle whose plane has all of both on one side meets a segment of light at an end of it at most: floors, walls and
ceilings of a closed room, often most of what a map shows, and whatever lies outside of the room.
"""

import dataclasses
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from refgi.jit import kernel, prange
from refgi.rsm.buffers.extent import Extent, joined
from refgi.rsm.raster.paraboloid import CutChunks, cut_chunks, whole_chunks
from refgi.rsm.raster.triangle import Chunks, chunks
from refgi.scene.model import Geometry
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.frame import Frame
    from refgi.lights import PixelLights

# Share of the extent's diagonal by which points may lie beyond a plane that still counts as the border; below what ends
# of rays are kept from surfaces.
TOLERANCE = 1e-6
FEW_PAIRS = 1 << 24  # triangles times points that are tried without asking for the hull, which takes about as long
DIRECTIONS = 128  # along which extreme points are found before the hull: enough to tell most triangles from it
TURN = 47  # odd: steps through the directions in an order that is spread from the start
BATCH, ROWS, AT_ONCE = 64, 9, 1024  # triangles in SIMD lanes; rows of their corners; triangles that a thread takes
FEW_POINTS = 24  # that a batch looks at together
SKETCHED = 1 << 14  # points that are enough for that


class Blockers(NamedTuple):
    """Triangles that maps are drawn from, with no other vertices."""

    vertices: Array  # (n, 3) float64, m
    faces: Array  # (m, 3) int32
    chunks: Chunks  # those without holes, as maps are drawn from
    cut: CutChunks | None = None  # those that may have holes
    shape: Geometry | None = None  # all of them, for rays; None where none has holes

    def geometry(self, chosen: Array) -> Geometry:
        """Return those that are `chosen` (m,), bool, for rays."""
        if self.shape is None:
            faces = self.faces[chosen]
            return Geometry(self.vertices, faces, np.zeros(len(faces), np.int32))
        return self.shape.selected(chosen)


class Ends(NamedTuple):
    """Where segments of light end: all of them lie within the convex hull of `points`."""

    vertices: Array  # (n, 3) float64, m
    visible: Extent  # the box of what the camera sees
    illuminated: Extent  # the box of what light begins at
    lights: Array = np.zeros((3, 0))  # (3, N), m

    @property
    def points(self) -> Array:
        """Vertices, then lights, (n + N, 3) float64, m."""
        return np.ascontiguousarray(np.concatenate([self.vertices, np.asarray(self.lights, np.float64).T]))

    @property
    def extent(self) -> Extent:
        """The box of what takes part."""
        return joined(self.visible, self.illuminated)


def ends_of(frame: "Frame", lights: "PixelLights") -> Ends:
    """Return where light begins and ends: vertices of triangles seen, places of lights, the scene's extent."""
    vertices = seen_vertices(frame.scene.geometry, frame.gbuffer.triangle_id)
    return Ends(vertices, frame.visible_extent, frame.illuminated_extent, lights.position)


@stage("cluster.seen_vertices")
def seen_vertices(geometry: Geometry, triangle_id: Array) -> Array:
    """Gather the vertices of the triangles that pixels see (docs/methods/val_visibility).

    -> (seen vertex, 3): Places, m: each vertex once, in their order.
    """
    used = np.zeros(len(geometry.vertices), np.bool_)
    _flag_corners(triangle_id, geometry.faces, used)
    return np.asarray(geometry.vertices[used])


def everywhere(geometry: Geometry) -> Ends:
    """Return ends at any two points of the scene: all vertices that triangles use, and their box."""
    vertices = np.ascontiguousarray(geometry.vertices, np.float64)
    whole = Extent(*geometry.bounds)
    return Ends(vertices[_used(len(vertices), geometry.faces)], whole, whole)


@stage("cluster.occluders")
def occluders(geometry: Geometry, ends: Ends | None = None, touching: bool = False) -> Array:
    """Find the triangles that may lie between two ends of light: some on either side (docs/methods/val_visibility).

    ends: What the points lie within; absent: anywhere in the scene.
    touching: Count those on the hull of the points as well.
    -> (triangle,) bool: Whether it may lie between. False on or outside of the convex hull: a segment between two
        points meets it only where one of its ends lies in their plane, to 1e-6 of the extent's diagonal. Triangles
        without area are False, and all are where there is no point.
    """
    faces = np.ascontiguousarray(geometry.faces)
    border = np.zeros(len(faces), np.bool_)
    ends = ends or everywhere(geometry)
    used, extent = ends.points, ends.extent
    if not len(used):  # nothing is seen and nothing shines: no two points, so nothing lies between
        return border
    tolerance = TOLERANCE * extent.diagonal * (-1.0 if touching else 1.0)
    vertices = np.ascontiguousarray(geometry.vertices, np.float64)
    sketch = _extreme(np.ascontiguousarray(used[:: 1 + len(used) // SKETCHED]))
    _on_border(vertices, faces, sketch, tolerance, border)
    doubtful = np.flatnonzero(border)
    _confirm(vertices, np.ascontiguousarray(faces[doubtful]), used, tolerance, doubtful, border)
    return np.logical_not(border)


def blockers(geometry: Geometry, alone: bool, ends: Ends | None = None) -> Blockers:
    """Return the triangles that maps are drawn from, in mesh order.

    `alone` leaves out those that cannot block anything, the walls of a room; else those alone that lie outside of it.
    """
    return selected_blockers(geometry, occluders(geometry, ends, not alone))


@stage("cluster.blockers")
def selected_blockers(geometry: Geometry, chosen: Array) -> Blockers:
    """Return some triangles as maps are drawn from.

    chosen (m,) bool: Which of them.
    -> Blockers: The triangles, in mesh order.
    """
    selected = geometry.faces[chosen]
    used = _used(len(geometry.vertices), selected)
    vertices = np.ascontiguousarray(geometry.vertices[used], np.float64)
    faces = np.ascontiguousarray((np.cumsum(used) - 1)[selected], np.int32)
    if geometry.cut is None:
        return Blockers(vertices, faces, chunks(vertices, faces))
    shape = dataclasses.replace(geometry.selected(chosen), vertices=vertices, faces=faces, vertex_normals=None)
    return Blockers(vertices, faces, whole_chunks(shape), cut_chunks(shape), shape)


def _used(count: int, faces: Array) -> Array:
    """Return which of `count` vertices triangles use."""
    used = np.zeros(count, np.bool_)
    used[faces] = True
    return used


def _confirm(vertices: Array, faces: Array, points: Array, tolerance: float, doubtful: Array, border: Array) -> None:
    """Decide the triangles that extreme points alone do not tell from the border."""
    if len(doubtful) * len(points) > FEW_PAIRS:
        points = _hull(points)
    certain = np.zeros(len(doubtful), np.bool_)
    _on_border(vertices, faces, points, tolerance, certain)
    border[doubtful] = certain


def _extreme(points: Array) -> Array:
    """Return the farthest points along evenly spread directions, a first sketch of the hull."""
    step = np.arange(DIRECTIONS) * TURN % DIRECTIONS + 0.5  # the first few of them are spread already
    z, turn = 1.0 - 2.0 * step / DIRECTIONS, np.pi * (1.0 + 5.0**0.5) * step
    ring = np.sqrt(1.0 - z * z)
    farthest = np.zeros(DIRECTIONS, np.int64)
    _farthest(points, np.stack([ring * np.cos(turn), ring * np.sin(turn), z]), farthest)
    return np.ascontiguousarray(points[farthest])


@kernel(parallel=True)
def _flag_corners(triangle_id: Array, faces: Array, used: Array) -> None:
    """Flag the vertices of the triangles that pixels show; whoever comes second writes the same."""
    for row in prange(triangle_id.shape[0]):
        before = np.int32(-1)
        for column in range(triangle_id.shape[1]):
            face = triangle_id[row, column]
            if face != before and face >= 0:
                for corner in range(3):
                    used[faces[face, corner]] = True
            before = face


@kernel(parallel=True)
def _farthest(points: Array, directions: Array, farthest: Array) -> None:
    for d in prange(len(farthest)):
        x, y, z, best, place = directions[0, d], directions[1, d], directions[2, d], -np.inf, 0
        for p in range(len(points)):
            along = x * points[p, 0] + y * points[p, 1] + z * points[p, 2]
            if along > best:
                best, place = along, p
        farthest[d] = place


def _hull(points: Array) -> Array:
    """Return the corners of the convex hull; all points where they lie in one plane."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return np.ascontiguousarray(points[ConvexHull(points).vertices])
    except QhullError:
        return points


@kernel(parallel=True)
def _on_border(vertices: Array, faces: Array, points: Array, tolerance: float, border: Array) -> None:
    """Return which planes have all points on one side, up to a tolerance.

    A batch of triangles looks at a few points in SIMD lanes, after which most have some on both sides.
    """
    for part in prange(-(-len(faces) // AT_ONCE)):
        plane, above, below = np.empty(ROWS * BATCH), np.empty(BATCH, np.bool_), np.empty(BATCH, np.bool_)
        for base in range(part * AT_ONCE, min((part + 1) * AT_ONCE, len(faces)), BATCH):
            size = min(BATCH, len(faces) - base)
            for b in range(size):  # loads that wait for memory, many under way at once
                for corner in range(3):
                    vertex = faces[base + b, corner]
                    for axis in range(3):
                        plane[(3 * corner + axis) * BATCH + b] = vertices[vertex, axis]
            for b in range(size):
                ax, ay, az = plane[b], plane[BATCH + b], plane[2 * BATCH + b]
                bx, by, bz = plane[3 * BATCH + b] - ax, plane[4 * BATCH + b] - ay, plane[5 * BATCH + b] - az
                cx, cy, cz = plane[6 * BATCH + b] - ax, plane[7 * BATCH + b] - ay, plane[8 * BATCH + b] - az
                nx, ny, nz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
                plane[3 * BATCH + b], plane[4 * BATCH + b], plane[5 * BATCH + b] = nx, ny, nz
                plane[6 * BATCH + b] = tolerance * np.sqrt(nx * nx + ny * ny + nz * nz)
                above[b] = below[b] = False
            for p in range(min(FEW_POINTS, len(points))):
                x, y, z = points[p, 0], points[p, 1], points[p, 2]
                for b in range(size):
                    height = _height(plane, b, x, y, z)
                    above[b] |= height > plane[6 * BATCH + b]
                    below[b] |= height < -plane[6 * BATCH + b]
            for b in range(size):
                over, under, p, limit = above[b], below[b], FEW_POINTS, plane[6 * BATCH + b]
                while p < len(points) and not (over and under):
                    height = _height(plane, b, points[p, 0], points[p, 1], points[p, 2])
                    over, under = over or height > limit, under or height < -limit
                    p += 1
                border[base + b] = not (over and under)


@kernel
def _height(plane: Array, b: int, x: float, y: float, z: float) -> Any:
    """Return how far a point lies above the plane of triangle `b` of a batch, times its normal's length."""
    return (plane[3 * BATCH + b] * (x - plane[b]) + plane[4 * BATCH + b] * (y - plane[BATCH + b])
            + plane[5 * BATCH + b] * (z - plane[2 * BATCH + b]))
