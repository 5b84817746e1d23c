"""Meshes as read, and their validation: one at a time, or very many small ones in a batch.

A file may hold a hundred thousand meshes of a few triangles each. Checking them one by one with NumPy takes longer than
everything else that is done with them, so small ones are joined into batches first. `expect_memory` checks that a scene
fits before memory is allocated.
"""

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from refgi.errors import expect
from refgi.memory import physical_memory
from refgi.scene.material import UNPAINTED, Material
from refgi.scene.texture.image import BYTES_OF_TEXEL
from refgi.scene.values import LARGEST
from refgi.types import Array

SMALL = 1 << 12  # vertices and faces of a mesh that goes into a batch; a larger one is checked alone
BATCH = 1 << 18  # vertices and faces in a batch: some megabytes

SHORTEST, LONGEST = 1e-100, 1e100  # of a normal: its square neither vanishes nor overflows
# A vertex is 24 bytes, a face 12 and its material 4; joining the meshes holds them twice for a moment.
BYTES_OF_VERTEX, BYTES_OF_FACE = 2 * 24, 2 * (12 + 4)
BYTES_OF_COORDINATES = 2 * 48  # of a face's texture coordinates
MOST_VERTICES = 2**31 - 1  # corner indices are int32


@dataclasses.dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles of one material in world space: vertices (n, 3) m, faces (m, 3), optional vertex normals (n, 3).

    `uv` (m, 3, 2): texture coordinates of each face's corners, v = 0 at the top of the picture, or None. `colours`
    (m, 3, 3): factors of the diffuse reflectance at each face's corners, linear RGB, or None.
    """

    vertices: Array
    faces: Array
    normals: Array | None = None
    material: Material = UNPAINTED
    name: str = "mesh"
    uv: Array | None = None
    colours: Array | None = None

    def expect_sound(self, where: str) -> None:
        """Raise `InputError` naming `where` unless shapes, coordinates and indices make a mesh."""
        vertices, faces = np.asarray(self.vertices), np.asarray(self.faces)
        if not _rows_of_three(vertices, "fiu"):
            expect(False, f"{where}: vertices", "numbers in an (n, 3) array", f"{vertices.dtype} {vertices.shape}")
        if not _rows_of_three(faces, "iu"):
            expect(False, f"{where}: faces", "integers in an (m, 3) array", f"{faces.dtype} {faces.shape}")
        expect(len(faces) > 0, f"{where}: faces", "at least one triangle", 0)
        expect(len(vertices) > 0, f"{where}: vertices", "at least one", 0)
        if not (abs(vertices.min()) <= LARGEST and abs(vertices.max()) <= LARGEST):  # so that NaN fails as well
            row = int(np.argmin((np.abs(vertices) <= LARGEST).all(axis=1)))
            expect(False, f"{where}: vertex {row}", f"finite coordinates up to {LARGEST:g} m", vertices[row].tolist())
        if faces.min() < 0 or faces.max() >= len(vertices):
            row = int(np.argmax(((faces < 0) | (faces >= len(vertices))).any(axis=1)))
            expect(False, f"{where}: face {row}", f"vertex indices from 0 to {len(vertices) - 1}", faces[row].tolist())
        if self.normals is not None:
            expect(np.shape(self.normals) == vertices.shape, f"{where}: normals", f"shape {vertices.shape}",
                   np.shape(self.normals))
        if self.uv is not None:
            expect_coordinates(self.uv, len(faces), where)
        if self.colours is not None:
            expect_colours(self.colours, len(faces), where)


class Batch(NamedTuple):
    """Small meshes joined: each entry of `members` is one mesh's number among all."""

    members: Array  # (k,)
    vertices: Array  # (n, 3) float64
    faces: Array  # (m, 3) int64, within each mesh's own vertices
    normals: Array | None  # (n, 3) float64 where all members have normals, None where none has
    first_vertex: Array  # (k + 1,)
    first_face: Array  # (k + 1,)

    def any_vertex(self, flags: Array) -> Array:
        """Return (k,) whether any of a mesh's vertices is flagged."""
        return np.logical_or.reduceat(flags, self.first_vertex[:-1])

    def any_face(self, flags: Array) -> Array:
        """Return (k,) whether any of a mesh's faces is flagged."""
        return np.logical_or.reduceat(flags, self.first_face[:-1])

    def sound(self) -> Array:
        """Return (k,) whether a mesh's coordinates and indices are what `Mesh.expect_sound` asks for."""
        count = np.repeat(np.diff(self.first_vertex), np.diff(self.first_face))[:, None]
        far = np.asarray(~(np.abs(self.vertices) <= LARGEST).all(axis=1))
        wrong = np.asarray(((self.faces < 0) | (self.faces >= count)).any(axis=1))
        return np.asarray(~(self.any_vertex(far) | self.any_face(wrong)))


def batches(meshes: Sequence[Mesh]) -> Iterator[Batch]:
    """Join the small meshes, some thousand at a time.

    `meshes`: any; those that are large, or whose arrays have no usable form, are in no batch. Result: meshes in
    ascending order, all of them with normals or all without.
    """
    members: dict[bool, list[int]] = {False: [], True: []}
    size = {False: 0, True: 0}
    for number, mesh in enumerate(meshes):
        if _is_regular(mesh):
            has_normals = mesh.normals is not None
            members[has_normals].append(number)
            size[has_normals] += len(mesh.vertices) + len(mesh.faces)
            if size[has_normals] >= BATCH:
                yield _joined(meshes, members[has_normals])
                members[has_normals], size[has_normals] = [], 0
    for chosen in members.values():
        if chosen:
            yield _joined(meshes, chosen)


def expect_all_sound(meshes: Sequence[Mesh], name: Callable[[int], str]) -> None:
    """Raise `InputError` for the first mesh that is not sound.

    `name`: returns what a mesh of some number is called in the error. Raises `InputError`: as `Mesh.expect_sound`.
    """
    sound = np.zeros(len(meshes), np.bool_)
    for batch in batches(meshes):
        sound[batch.members] = batch.sound()
    for number in np.flatnonzero(~sound).tolist():
        meshes[number].expect_sound(name(number))


def expect_coordinates(uv: Array, faces: int, where: str) -> None:
    """Raise `InputError` naming `where` unless there is a finite pair of texture coordinates for each corner."""
    expect(np.shape(uv) == (faces, 3, 2), f"{where}: uv", f"shape {(faces, 3, 2)}", np.shape(uv))
    if not (uv.min(initial=0) >= -LARGEST and uv.max(initial=0) <= LARGEST):  # so that NaN fails as well
        row = int(np.argmin((np.abs(uv) <= LARGEST).all(axis=(1, 2))))
        expect(False, f"{where}: uv of face {row}", f"finite texture coordinates up to {LARGEST:g}", uv[row].tolist())


def expect_colours(colours: Array, faces: int, where: str) -> None:
    """Raise `InputError` naming `where` unless there are three factors from 0 to 1 for each corner."""
    expect(np.shape(colours) == (faces, 3, 3), f"{where}: colours", f"shape {(faces, 3, 3)}", np.shape(colours))
    if not (colours.min(initial=0) >= 0 and colours.max(initial=0) <= 1):  # so that NaN fails as well
        row = int(np.argmin(((colours >= 0) & (colours <= 1)).all(axis=(1, 2))))
        expect(False, f"{where}: colours of face {row}", "factors from 0 to 1", colours[row].tolist())


def at_corners(shape: Any, change: Callable[[Array], Array]) -> dict[str, Any]:
    """Return what a mesh or geometry has at its faces' corners, changed, by name: for `dataclasses.replace`."""
    found = {key: getattr(shape, key) for key in ("uv", "colours")}
    return {key: None if values is None else change(values) for key, values in found.items()}


def as_float64(values: Array) -> Array:
    """Return values as float64; a signalling NaN of float32 becomes a quiet one without a word."""
    with np.errstate(invalid="ignore"):
        return np.asarray(values, np.float64)


def missing_normals(normals: Array) -> Array:
    """Return which normals give no direction.

    `normals` (n, 3): vectors of any length. Returns (n,) bool: true where one is zero, not finite, or so short or long
    that its square is.
    """
    longest = np.abs(as_float64(normals)).max(axis=1, initial=0.0)
    return np.asarray(~((longest > SHORTEST) & (longest < LONGEST)))


def _is_regular(mesh: Mesh) -> bool:
    """Return whether a mesh is small, its arrays arrays and of the form that `Mesh.expect_sound` asks for."""
    vertices, faces, normals = mesh.vertices, mesh.faces, mesh.normals
    return (isinstance(vertices, np.ndarray) and isinstance(faces, np.ndarray)
            and _rows_of_three(vertices, "fiu") and _rows_of_three(faces, "iu")
            and 0 < len(vertices) <= SMALL and 0 < len(faces) <= SMALL
            and (normals is None or (isinstance(normals, np.ndarray) and normals.dtype.kind in "fiu"
                                     and normals.shape == vertices.shape)))


def _joined(meshes: Sequence[Mesh], members: list[int]) -> Batch:
    chosen = [meshes[number] for number in members]
    vertices, faces = [mesh.vertices for mesh in chosen], [mesh.faces for mesh in chosen]
    normals = [mesh.normals for mesh in chosen if mesh.normals is not None]
    return Batch(np.array(members), np.concatenate(vertices, dtype=np.float64),
                 np.concatenate(faces, dtype=np.int64, casting="unsafe"),
                 np.concatenate(normals, dtype=np.float64) if normals else None,
                 _starts([len(part) for part in vertices]), _starts([len(part) for part in faces]))


def _starts(counts: list[int]) -> Array:
    return np.concatenate([[0], np.cumsum(counts)])


def _rows_of_three(array: Array, kinds: str) -> bool:
    return array.ndim == 2 and array.shape[1] == 3 and array.dtype.kind in kinds


def expect_memory(vertices: int, faces: int, where: str, *, texels: int = 0, textured: bool = False) -> None:
    """Raise `InputError` unless indices and memory suffice for a scene's geometry and images.

    `vertices`, `faces`: of the whole scene, instances counted each. `where`: file and key, for the error's text.
    `texels`: of all images, each counted once. `textured`: faces have texture coordinates. Raises `InputError` if there
    are more vertices than an int32 can count, or more bytes than the machine has.
    """
    expect(vertices <= MOST_VERTICES, where, f"at most {MOST_VERTICES} vertices in all", vertices)
    needed = vertices * BYTES_OF_VERTEX + faces * (BYTES_OF_FACE + BYTES_OF_COORDINATES * textured)
    needed += texels * BYTES_OF_TEXEL
    present = physical_memory()
    if needed > present:  # called for every object of a file; the text is made once
        images = f" and {texels} texels" if texels else ""
        expect(False, where, f"a scene that fits in {present / 2**30:.1f} GiB of memory",
               f"{vertices} vertices and {faces} faces{images} ({needed / 2**30:.1f} GiB)")
