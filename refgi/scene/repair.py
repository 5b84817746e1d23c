"""Validation and repair of meshes as read, and of lights; polygons as triangles: fans, or ears where a fan would leave.

Errors: a shape that is not a mesh, a coordinate that is not finite, an index without a vertex. Repaired: zero-area
faces are dropped, vertex normals are brought to unit length, and a vertex whose normal is zero or not finite gets the
mean of its faces' normals. Lights without power are left out, with a count; a scene needs at least one with power.
"""

import dataclasses
import warnings
from collections.abc import Callable, Sequence

import numpy as np

from refgi.errors import InputError, RefgiWarning, expect
from refgi.scene.mesh import Batch, Mesh, as_float64, at_corners, batches, missing_normals
from refgi.scene.model import DirectionalLight, Geometry, Light
from refgi.types import Array

# A face counts as flat when twice its area is lost in the rounding of the cross product that gives it.
FLAT = 16 * float(np.finfo(np.float64).eps)
FAINTEST, NEAREST = 1e-9, 1e-6  # of a picture's light; m
SMALLEST_USUAL, LARGEST_USUAL = 0.01, 1000.0  # m across


def repaired_all(meshes: Sequence[Mesh], where: Callable[[int], str], faults: list[str]) -> tuple[list[Mesh], int]:
    """Return the meshes of a file as `repaired` returns each, the sound small ones looked at together.

    `where`: returns file and object of the mesh of some number, for the error's text. `faults`: gets the text of the
    error for each mesh that `repaired` refuses. Result: as many; those that are refused stay as they were. Result:
    number of faces dropped.
    """
    remaining, done, dropped = list(meshes), np.zeros(len(meshes), np.bool_), 0
    for batch in batches(meshes):
        good = _needs_no_repair(batch)
        done[batch.members] = good
        if batch.normals is not None:
            usable = np.repeat(good, np.diff(batch.first_vertex))[:, None]
            normals = np.where(usable, batch.normals, 1.0)
            normals /= np.linalg.norm(normals, axis=1)[:, None]
            for k in np.flatnonzero(good).tolist():
                number, part = batch.members[k], slice(batch.first_vertex[k], batch.first_vertex[k + 1])
                remaining[number] = dataclasses.replace(meshes[number], normals=normals[part])
    for number in np.flatnonzero(~done).tolist():
        try:
            remaining[number], flat = repaired(meshes[number], where(number))
            dropped += flat
        except InputError as error:
            faults.append(str(error))
    return remaining, dropped


def _needs_no_repair(batch: Batch) -> Array:
    """Return (k,) which meshes are sound and have neither flat faces nor missing normals."""
    good = batch.sound()
    if not good.all():
        return np.zeros(len(good), np.bool_)  # an index may lead out of the batch
    faces = batch.faces + np.repeat(batch.first_vertex[:-1], np.diff(batch.first_face))[:, None]
    good &= ~batch.any_face(zero_area(batch.vertices, faces))
    return good if batch.normals is None else good & ~batch.any_vertex(missing_normals(batch.normals))


def repaired(mesh: Mesh, where: str) -> tuple[Mesh, int]:
    """Return the mesh without its zero-area faces and with unit vertex normals.

    `mesh`: a mesh as read. `where`: file and object, for the error's text. Result: the same object where nothing had to
    change. Result: number of faces dropped. Raises `InputError` if coordinates are not finite, indices out of range, or
    no face has an area.
    """
    mesh.expect_sound(where)
    flat = zero_area(mesh.vertices, mesh.faces)
    dropped = int(np.count_nonzero(flat))
    expect(dropped < len(mesh.faces), f"{where}: faces", "at least one with an area", f"{dropped} of zero area")
    if dropped:
        mesh = dataclasses.replace(mesh, faces=mesh.faces[~flat], **at_corners(mesh, lambda values: values[~flat]))
    if mesh.normals is not None:
        mesh = dataclasses.replace(mesh, normals=unit_normals(mesh))
    return mesh, dropped


def warn_of_flat_faces(count: int, where: str) -> None:
    """Say how many zero-area faces were passed over, if any; `where`: the scene or file they came from."""
    if count:
        noun = "face" if count == 1 else "faces"
        warnings.warn(RefgiWarning(f"{where}: {count} {noun} of zero area skipped"), stacklevel=3)


def warn_of_unit(geometry: Geometry, where: str) -> None:
    """Say that a file's unit may not be the metre, if its size is no usual one; `where`: the file they came from."""
    if not SMALLEST_USUAL <= geometry.diagonal <= LARGEST_USUAL:
        text = (f"{where}: {geometry.diagonal:.3g} m across; lengths are taken as metres. If the file has another unit "
                "of s metres, scale its objects in a scene file: \"transform\": "
                "[s, 0, 0, 0,  0, s, 0, 0,  0, 0, s, 0,  0, 0, 0, 1], such as s = 0.001 for millimetres")
        warnings.warn(RefgiWarning(text), stacklevel=4)


def zero_area(vertices: Array, faces: Array) -> Array:
    """Return which faces have no area beyond rounding.

    `vertices` (n, 3): positions, m. `faces` (m, 3): vertex indices. Returns (m,) bool: true where the cross product of
    two edges vanishes against their lengths.
    """
    a, b, c = (np.asarray(vertices, np.float64)[faces[:, k]] for k in range(3))
    scale = np.abs(b - a).max(axis=1, initial=0.0) * np.abs(c - a).max(axis=1, initial=0.0)
    return np.asarray(np.abs(np.cross(b - a, c - a)).max(axis=1, initial=0.0) <= FLAT * scale)


def unit_normals(mesh: Mesh) -> Array:
    """Return the vertex normals at unit length, those that are missing filled in from the faces.

    `mesh`: a mesh with normals. Returns (n, 3) float64: unit vectors; (0, 1, 0) at a vertex that no face with an area
    uses.
    """
    normals = as_float64(np.asarray(mesh.normals))
    missing = missing_normals(normals)
    if missing.any():
        normals = np.where(missing[:, None], mean_face_normals(mesh.vertices, mesh.faces), normals)
    return np.asarray(normals / np.linalg.norm(normals, axis=1)[:, None])


def mean_face_normals(vertices: Array, faces: Array) -> Array:
    """Return the area-weighted mean of the normals of the faces around each vertex.

    `vertices` (n, 3): positions, m. `faces` (m, 3): vertex indices. Returns (n, 3) float64: unit vectors; (0, 1, 0)
    where the mean vanishes.
    """
    a, b, c = (np.asarray(vertices, np.float64)[faces[:, k]] for k in range(3))
    cross = np.repeat(np.cross(b - a, c - a), 3, axis=0)
    total = np.stack([np.bincount(faces.ravel(), cross[:, k], len(vertices)) for k in range(3)], axis=1)
    length = np.linalg.norm(total, axis=1)
    total[length == 0] = (0.0, 1.0, 0.0)
    length[length == 0] = 1.0
    return np.asarray(total / length[:, None])


def lights_with_power(lights: Sequence[Light], where: str) -> tuple[Light, ...]:
    """Return the lights that have power.

    `lights`: all lights of a scene. `where`: file and key, for texts. Result: in the given order, at least one. Raises
    `InputError` if none has power: the picture would be silently black.
    """
    remaining = tuple(light for light in lights if max(_power(light)) > 0)
    without = f"{len(lights)} without" if lights else "none"
    expect(bool(remaining), where, "at least one light of power above 0", without)
    if dropped := len(lights) - len(remaining):
        noun = "light" if dropped == 1 else "lights"
        warnings.warn(RefgiWarning(f"{where}: {dropped} {noun} of zero power left out"), stacklevel=3)
    return remaining


def faintest_irradiance(lights: Sequence[Light], geometry: Geometry) -> float:
    """Return the irradiance (W/m^2) below which a picture under these lights is black: theirs at the middle times 1e-9.

    A light in the middle counts as a hundredth of the diagonal away.
    """
    middle, nearest = np.mean(geometry.bounds, axis=0), max(geometry.diagonal / 100, NEAREST)
    total = sum(max(_power(light)) / (1.0 if isinstance(light, DirectionalLight) else
                                      max(float(np.linalg.norm(middle - light.position)), nearest) ** 2)
                for light in lights)
    return FAINTEST * total


def _power(light: Light) -> tuple[float, float, float]:
    return light.irradiance if isinstance(light, DirectionalLight) else light.intensity


TURNED = 1e-6  # of a polygon's area: a triangle of its fan that is turned over by less is rounding
MOST_CORNERS = 4096  # of a polygon that is cut into ears, which takes the square of their number


def triangles_of(vertices: Array, corners: Array, counts: Array) -> tuple[Array, int]:
    """Return the triangles of polygons, in their order.

    `vertices` (n, 3): positions, m. `corners` (k,): vertex of each corner, polygon after polygon. `counts` (p,):
    corners of each polygon, 3 or more. Returns (m, 3) int64: positions in `corners`. Result: number of polygons that
    have no ears (they cross themselves) or too many corners; they are fans from their first corner, as convex ones are.
    """
    if (counts == 3).all():
        return np.arange(len(corners)).reshape(-1, 3), 0
    counts = np.asarray(counts, np.int64)
    first = np.cumsum(counts) - counts
    of_polygon = np.repeat(np.arange(len(counts)), counts - 2)
    step = np.arange(len(of_polygon)) - np.repeat(np.cumsum(counts - 2) - (counts - 2), counts - 2)
    start = first[of_polygon]
    triangles = np.stack([start, start + step + 1, start + step + 2], axis=1)
    left = 0
    for number in _turned_over(vertices, corners, triangles, of_polygon, counts).tolist():
        chosen = slice(first[number], first[number] + counts[number])
        ears = _ears(_flattened(vertices[corners[chosen]]))
        left += ears is None
        if ears is not None:
            at = first[number] - 2 * number  # two triangles fewer than corners in each polygon before
            triangles[at : at + len(ears)] = np.array(ears) + first[number]
    return triangles, left


def _turned_over(vertices: Array, corners: Array, triangles: Array, of_polygon: Array, counts: Array) -> Array:
    """Return the polygons of which a triangle of the fan faces the other way than the whole."""
    large = np.flatnonzero(counts[of_polygon] > 3)
    a, b, c = (np.asarray(vertices[corners[triangles[large, k]]], np.float64) for k in range(3))
    with np.errstate(over="ignore", invalid="ignore"):  # coordinates are checked later
        cross = np.cross(b - a, c - a)
        owner = of_polygon[large]
        starts = np.flatnonzero(np.diff(owner, prepend=-1))
        area = np.add.reduceat(cross, starts, axis=0)
        size = np.diff(starts, append=len(owner))
        share = np.einsum("ij,ij->i", cross, np.repeat(area, size, axis=0))
        limit = -TURNED * np.repeat(np.einsum("ij,ij->i", area, area), size)
    return np.unique(owner[share < limit])


def _flattened(points: Array) -> Array:
    """Return (k, 2) the points of a polygon in the coordinate plane that it is most parallel to, counter-clockwise."""
    points = np.asarray(points, np.float64) - points[0]
    normal = np.cross(points[1:-1], points[2:]).sum(axis=0)
    axis = int(np.argmax(np.abs(normal)))
    flat = points[:, [(axis + 1) % 3, (axis + 2) % 3]]
    return flat if normal[axis] > 0 else flat * (-1.0, 1.0)


def _ears(points: Array) -> list[tuple[int, int, int]] | None:
    """Return the triangles of a counter-clockwise polygon (k, 2), None where it crosses itself or is too large.

    An ear is a corner whose triangle holds no other corner. Corners at the same place, as of a hole that a slit joins
    to the outline, are in nobody's way; a corner without an angle is cut only where there is no ear.
    """
    if len(points) > MOST_CORNERS:
        return None
    ring, ears, last = np.arange(len(points)), [], 0
    while len(ring) > 3:
        a, b, c = points[np.roll(ring, 1)], points[ring], points[np.roll(ring, -1)]
        angle = _cross(b - a, c - b)
        convex, others = np.flatnonzero(angle > 0), b[angle <= 0]
        # the next ear is often beside the last one
        beside = np.roll(convex, -int(np.searchsorted(convex, last - 1))).tolist()
        chosen = next((k for k in beside if _is_ear(a[k], b[k], c[k], others)), None)
        if chosen is None:
            flat = np.flatnonzero(angle == 0)
            if not len(flat):
                return None
            chosen = int(flat[0])
        ears.append((int(ring[chosen - 1]), int(ring[chosen]), int(ring[(chosen + 1) % len(ring)])))
        ring, last = np.delete(ring, chosen), chosen
    return [*ears, (int(ring[0]), int(ring[1]), int(ring[2]))]


def _is_ear(a: Array, b: Array, c: Array, others: Array) -> bool:
    """Return whether none of the points (k, 2) lies in a triangle, its border included and its corners not."""
    inside = (_cross(b - a, others - a) >= 0) & (_cross(c - b, others - b) >= 0) & (_cross(a - c, others - c) >= 0)
    at_corner = np.logical_or.reduce([(others == corner).all(axis=1) for corner in (a, b, c)])
    return not bool((inside & ~at_corner).any())


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
