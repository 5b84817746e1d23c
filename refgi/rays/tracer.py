"""Tracer: batches of rays against one geometry, checked, with misses decided in float64; direct light's shadows."""

import threading
from functools import cached_property
from typing import NamedTuple

import numpy as np

from refgi.errors import expect
from refgi.rays.cutouts import ray_holes
from refgi.rays.embree import MISS, Backend, Cut, open_backend
from refgi.rays.watertight import GRAIN, STEPS, Corners, Pieces, closest_around, corners, cut, grain_of
from refgi.scene import DirectionalLight, Geometry, Light
from refgi.scene.light import Lamp, lamp_of, light_of
from refgi.stages import stage, tally
from refgi.types import Array

# Sideways shift that tells a slip between triangles from a miss: many float32 steps, far below any detail.
RELATIVE_SHIFT = 4e-6


class Hits(NamedTuple):
    """Nearest hits of a batch of rays."""

    triangle_id: Array  # (n,) int32, -1 where nothing was hit
    distance: Array  # (n,) float64 in lengths of the direction, inf where nothing was hit


class Tracer:
    """Traces rays against a geometry.

    Parameters
    ----------
    geometry : Geometry
        The triangles; copied. May be empty: then every ray misses. Rays pass through the holes of cut-outs.

    Notes
    -----
    `closest`, `occluded` and `segments_blocked` check their input, convert it to float32 and decide misses that may
    have slipped between triangles in float64. `fill_closest` and `fill_occluded` are the bare traversal for
    estimators: random rays meet such a slip with a probability of about 1e-7.
    """

    def __init__(self, geometry: Geometry) -> None:
        self._vertices = np.array(geometry.vertices, np.float32).reshape(-1, 3)
        self._faces = np.array(geometry.faces, np.int32).reshape(-1, 3)
        self.grain = grain_of(self._vertices, self._faces)  # m, of `ray_offset`
        self._holes = ray_holes(geometry)
        self._lock = threading.Lock()

    def offsets(self, points: Array) -> Array:
        """Return how far ray ends at `points`, (..., 3), must stay from a surface not to hit it; float64, m."""
        return np.asarray(STEPS * (np.abs(points).sum(axis=-1, dtype=np.float64) + self.grain))

    def closest(self, origins: Array, directions: Array, reach: Array | float = np.inf) -> Hits:
        """Find the nearest triangle along each ray; distances are in lengths of the direction.

        `origins`: (n, 3), world space, m; `directions`: (n, 3), not zero, any length; `reach`: (n,) or one, how far to
        look, in lengths of the direction. Raises InputError for shapes that do not fit, numbers not finite, or a
        direction of zero.
        """
        o, d, far = _checked(origins, directions, reach)
        triangle_id, distance = np.full(len(o), MISS, np.int32), np.full(len(o), np.inf, np.float32)
        self.fill_closest(o, d, far, triangle_id, distance)
        exact = distance.astype(np.float64)
        for ray, triangle, t in self._slipped(o, d, far, np.flatnonzero(triangle_id == MISS)):
            triangle_id[ray], exact[ray] = triangle, t
        return Hits(triangle_id, exact)

    def occluded(self, origins: Array, directions: Array, distances: Array | float = np.inf) -> Array:
        """Return, (n,) bool, whether anything lies on each ray before a distance; input and errors as in `closest`."""
        o, d, far = _checked(origins, directions, distances)
        blocked = np.zeros(len(o), np.bool_)
        self.fill_occluded(o, d, far, blocked)
        for ray, _, _ in self._slipped(o, d, far, np.flatnonzero(~blocked)):
            blocked[ray] = True
        return blocked

    def segments_blocked(self, starts: Array, ends: Array, start_normals: Array | None = None,
                         end_normals: Array | None = None) -> Array:
        """Return, (n,) bool, whether anything lies between pairs of surface points, (n, 3), world space, m.

        `start_normals, end_normals`: (n, 3) unit normals on the side the segment leaves to: that end is lifted by its
        offset along it; without, the segment is cut short by as much at that end. Segments of no length are free.
        """
        a, b = np.array(starts, np.float64).reshape(-1, 3), np.array(ends, np.float64).reshape(-1, 3)
        expect(a.shape == b.shape, "ends", f"shape {a.shape} as starts", b.shape)
        length = np.linalg.norm(b - a, axis=1, keepdims=True)
        along = np.divide(b - a, length, out=np.zeros_like(a), where=length > 0)
        off_a, off_b = self.offsets(a)[:, None], self.offsets(b)[:, None] + STEPS * length
        a += off_a * (along if start_normals is None else np.asarray(start_normals, np.float64))
        b += off_b * (-along if end_normals is None else np.asarray(end_normals, np.float64))
        blocked = np.zeros(len(a), np.bool_)
        traced = (length > off_a + off_b)[:, 0]
        blocked[traced] = self.occluded(a[traced], (b - a)[traced], 1.0)
        return blocked

    def visible_from_light(self, position: Array, normal: Array, covered: Array, light: Light) -> Array:
        """Return, (h, w) bool, which points of a G-buffer a light reaches, by shadow rays that know no cone.

        `position, normal`: (3, h, w), m, and unit normals of the faces, world space; `covered`: (h, w), where there is
        a surface. False without surface and where the light is behind the face.
        """
        at, up = position[:, covered].T.astype(np.float64), normal[:, covered].T.astype(np.float64)
        origins = at + self.offsets(at)[:, None] * up
        reach: Array | float = np.inf
        if isinstance(light, DirectionalLight):
            toward = np.broadcast_to(-np.asarray(light.direction, np.float64), at.shape)
        else:
            lamp = np.asarray(light.position, np.float64)
            toward = lamp - origins
            away = np.linalg.norm(toward, axis=1)
            reach = 1 - STEPS - self.offsets(lamp) / np.where(away > 0, away, 1)  # the lamp may lie in a surface
        far = np.where((toward * up).sum(axis=1) > 0, reach, 0).astype(np.float32)
        blocked = np.zeros(len(at), np.bool_)
        self.fill_occluded(origins.astype(np.float32), np.ascontiguousarray(toward, np.float32), far, blocked)
        visible = np.zeros(covered.shape, np.bool_)
        visible[covered] = ~blocked
        return visible

    def fill_closest(self, origins: Array, directions: Array, reach: Array, triangle_id: Array,
                     distance: Array) -> None:
        """Fill nearest hits, unchecked and in float32 alone.

        `origins, directions`: (n, 3), world space; `reach`: (n,), rays of `reach` <= 0 miss untraced. `triangle_id`,
        int32, is -1 and `distance` inf for a miss.
        """
        tally("rays", lambda: np.count_nonzero(reach > 0))
        if self._backend is None:
            triangle_id[:], distance[:] = MISS, np.inf
        else:
            self._backend.closest(origins, directions, reach, triangle_id, distance)
            if self._pieces.face is not None:
                hit = triangle_id != MISS
                triangle_id[hit] = self._pieces.face[triangle_id[hit]]

    def fill_occluded(self, origins: Array, directions: Array, reach: Array, blocked: Array) -> None:
        """Fill whether rays are blocked, (n,) bool, unchecked and in float32 alone.

        As `fill_closest`, but rays of `reach` <= 0 count as blocked and are not traced.
        """
        tally("rays", lambda: np.count_nonzero(reach > 0))
        if self._backend is None:
            np.less_equal(reach, 0, out=blocked)
        else:
            self._backend.occluded(origins, directions, reach, blocked)

    @property
    def _backend(self) -> Backend | None:
        with self._lock:
            return self._built_backend

    @cached_property
    def _built_backend(self) -> Backend | None:
        if not len(self._faces):
            return None
        pieces, holes = self._pieces, self._holes
        if not len(holes.of_face) or pieces.face is None:
            return open_backend(pieces.vertices, pieces.faces)
        numbers = holes.of_face[pieces.face]
        return open_backend(pieces.vertices, pieces.faces, Cut(holes, numbers[numbers >= 0], self.grain))

    @cached_property
    def _pieces(self) -> Pieces:
        """What Embree is given; triangles that may have holes come last."""
        pieces = cut(self._vertices, self._faces, self.grain)
        if not len(self._holes.of_face):
            return pieces
        face = np.arange(len(self._faces), dtype=np.int32) if pieces.face is None else pieces.face
        order = np.argsort(self._holes.of_face[face] >= 0, kind="stable")
        return Pieces(pieces.vertices, pieces.faces[order], face[order])

    @cached_property
    def _corners(self) -> Corners:
        return corners(self._vertices, self._faces)

    def _slipped(self, origins: Array, directions: Array, reach: Array,
                 missed: Array) -> list[tuple[int, int, float]]:
        """Return (ray, triangle, distance) of the misses that float64 turns into hits."""
        missed = missed[reach[missed] > 0]
        if self._backend is None or not len(missed):
            return []
        shift = RELATIVE_SHIFT * (np.abs(origins[missed]).max(axis=1, keepdims=True) + self.grain / GRAIN)
        shifted = (origins[missed] + shift * _sideways(directions[missed])).astype(np.float32)
        doubtful = np.zeros(len(missed), np.bool_)
        self.fill_occluded(shifted, directions[missed], reach[missed], doubtful)
        missed, shifted = missed[doubtful], shifted[doubtful]
        near, distance = np.empty(len(missed), np.int32), np.empty(len(missed), np.float32)
        self.fill_closest(shifted, directions[missed], reach[missed], near, distance)
        found = []
        for ray, triangle in zip(missed[near != MISS], near[near != MISS], strict=True):
            hit, t = closest_around(self._corners, self._holes, int(triangle), origins[ray].astype(np.float64),
                                    directions[ray].astype(np.float64), float(reach[ray]))
            if hit != MISS:
                found.append((int(ray), hit, t))
        return found


def _sideways(directions: Array) -> Array:
    """Return a unit vector across each direction, along no axis of common models."""
    d = directions / np.abs(directions).max(axis=1, keepdims=True).astype(np.float64)
    u = np.cross(d, (0.3713906763541037, 0.5570860145311556, 0.7427813527082074))
    size = np.linalg.norm(u, axis=1, keepdims=True)
    along = size[:, 0] < 1e-3
    u[along] = np.cross(d[along], (1.0, 0.0, 0.0))
    size[along] = np.linalg.norm(u[along], axis=1, keepdims=True)
    return np.asarray(u / size)


def _checked(origins: Array, directions: Array, reach: Array | float) -> tuple[Array, Array, Array]:
    o, d = (np.array(rays, np.float32, order="C") for rays in (origins, directions))
    expect(o.ndim == 2 and o.shape[1] == 3, "origins", "shape (n, 3)", o.shape)
    expect(d.shape == o.shape, "directions", f"shape {o.shape} as origins", d.shape)
    expect(bool(np.isfinite(o).all()), "origins", "finite numbers", "NaN or infinity")
    expect(bool(np.isfinite(d).all()), "directions", "finite numbers", "NaN or infinity")
    expect(bool(d.any(axis=1).all()), "directions", "vectors of some length", "zero vectors")
    far = np.array(reach, np.float32)
    expect(far.shape in ((), (len(o),)), "reach", f"one number or shape ({len(o)},)", far.shape)
    expect(not np.isnan(far).any(), "reach", "numbers", "NaN")
    return o, d, np.ascontiguousarray(np.broadcast_to(far, len(o)))


def _steps(
    tracer: Tracer, geometry: Geometry, position: Array, normal: Array, covered: Array, light: Light  # noqa: ARG001
) -> Array:
    return shadow_rays(geometry, position, normal, covered, lamp_of(light))


@stage("rays.visible_from_light", kept=False, steps=_steps)
def visible_from_light(
    tracer: Tracer, geometry: Geometry, position: Array, normal: Array, covered: Array, light: Light  # noqa: ARG001
) -> Array:
    """Trace a ray from each receiver to a light.

    normal (3, h, w): Unit normals of the pixels' faces.
    -> (h, w) bool: Whether the light reaches the receiver; false without surface.
    """
    return tracer.visible_from_light(position, normal, covered, light)


@stage("rays.shadow_rays", kept=False, each="lamp")
def shadow_rays(geometry: Geometry, position: Array, normal: Array, covered: Array, lamp: Lamp) -> Array:
    """Test whether no triangle lies between each receiver and a lamp (docs/conventions).

    normal (3, h, w): Unit normals of the pixels' faces.
    lamp: The lamp; its cone does not matter here.
    -> (h, w) bool: Whether the lamp reaches the receiver; false without surface.
    """
    return Tracer(geometry).visible_from_light(position, normal, covered, light_of(lamp))
