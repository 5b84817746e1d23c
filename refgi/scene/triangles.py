"""What a geometry keeps of its triangles for those that look for them: clusters, and which have holes.

Clusters are near one another on a Z-order curve, with copies of their vertices side by side: whatever draws them
projects each once and passes over clusters as a whole. Whatever finds a triangle, on a map or along a ray, passes over
the holes of a cut-out; a scene's materials say where these are, and `Scene` keeps its geometry in step with them.
"""

import math
import weakref
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.scene.material import Material
from refgi.scene.texture.image import Image
from refgi.scene.texture.lookup import NO_MASKS, AlphaTable
from refgi.scene.texture.table import WRAPS, Texture
from refgi.types import Array

CLUSTER = 64  # triangles
TABLE = 256  # places where a cluster's vertex is looked for; a power of two
SPARE = 8  # vertices of no meaning at the end, so that whole SIMD lanes may be read
MOST_BITS = 10  # of an axis' part of a place on the curve


class Clusters(NamedTuple):
    """Triangles without holes, cluster by cluster: the last one may have fewer than `CLUSTER`."""

    face: Array  # (m,) int32: which triangle of the geometry
    corner: Array  # (m, 3) uint8: its vertices, as places within those of its cluster
    start: Array  # (c + 1,) int64: first vertex of each cluster, then one past the last
    vertex: Array  # (3, n + SPARE) float64, m: x, y, z; mostly once in a cluster
    box: Array  # (c, 6) float64, m: least x, y, z of each cluster, then greatest
    plane: Array  # (4, m) float32: N = e1 x e2 of each triangle, m^2, and N . (v0 - q), m^3, q the middle of the box
    product: Array  # (c,) float64: greatest |e1| |e2| of a cluster's triangles, m^2


def clusters(vertices: Array, faces: Array, bounds: tuple[Array, Array], holed: Array | None) -> Clusters:
    """Sort triangles but those numbered as `holed` along a Z-order curve, and cut it into pieces.

    Which triangles share a cluster changes no picture.
    """
    number = len(faces)
    bits = min(max(math.ceil(math.log2(max(number, 1)) / 2 - 2), 1), MOST_BITS)  # some triangles share a cell
    low, high = bounds
    side = float((high - low).max())
    places = _places_on_curve(vertices[faces[:, 0]] - low, (1 << bits) / side if side > 0 else 0.0, bits)
    if holed is not None:
        places = np.delete(places, holed)
    places.sort()
    number = len(places)
    face, corner = np.empty(number, np.int32), np.empty((number, 3), np.uint8)
    count = -(-number // CLUSTER)
    used, box = np.empty((count, 3 * CLUSTER + 1), np.int32), np.empty((count, 6))
    start = np.zeros(count + 1, np.int64)
    _find_vertices(faces, places, face, corner, used, start)
    np.cumsum(start, out=start)
    vertex = np.zeros((3, start[-1] + SPARE))
    vertex[:, : start[-1]] = vertices[used[np.arange(used.shape[1]) < np.diff(start)[:, None]]].T
    if count:
        box[:, :3] = np.minimum.reduceat(vertex[:, : start[-1]], start[:-1], axis=1).T
        box[:, 3:] = np.maximum.reduceat(vertex[:, : start[-1]], start[:-1], axis=1).T
    plane, product = np.empty((4, number), np.float32), np.empty(count)
    _find_planes(corner, start, vertex, box, plane, product)
    return Clusters(face, corner, start, vertex, box, plane, product)


def _places_on_curve(corner: Array, scale: float, bits: int) -> Array:
    """Return the place of each triangle on the curve, by a corner's (m, 3) distance from the least one, and its number.

    The number is in the lower half, (m,) int64.
    """
    cells = np.minimum((corner * scale).astype(np.int64), (1 << bits) - 1)
    for shift, mask in ((16, 0x30000FF), (8, 0x300F00F), (4, 0x30C30C3), (2, 0x9249249)):  # two zeros before each bit
        cells = (cells | (cells << shift)) & mask
    place = cells[:, 0] | cells[:, 1] << 1 | cells[:, 2] << 2
    return np.asarray(place << 32 | np.arange(len(place)))


@kernel(parallel=True)
def _find_vertices(faces: Array, places: Array, face: Array, corner: Array, used: Array, start: Array) -> None:
    """List the vertices that each cluster uses, mostly once, and count them one place further on in `start`."""
    for cluster in prange(len(used)):
        table = np.zeros(TABLE, np.int32)  # where a vertex may be listed
        known = 0
        for place in range(cluster * CLUSTER, min((cluster + 1) * CLUSTER, len(places))):
            face[place] = places[place] & 0xFFFFFFFF
            for c in range(3):
                vertex = faces[face[place], c]
                entry = vertex & (TABLE - 1)
                there = np.int64(table[entry])
                new = (there >= known) | (used[cluster, there] != vertex)  # free of branches, which nothing foretells
                slot = known if new else there
                used[cluster, known] = vertex
                known += new
                table[entry] = slot
                corner[place, c] = slot
        start[cluster + 1] = known


@kernel(parallel=True)
def _find_planes(corner: Array, start: Array, vertex: Array, box: Array, plane: Array, product: Array) -> None:
    for cluster in prange(len(box)):
        first, last = cluster * CLUSTER, min((cluster + 1) * CLUSTER, len(corner))
        low, high, greatest = box[cluster, :3], box[cluster, 3:], 0.0
        qx, qy, qz = 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2])
        for at in range(first, last):
            i, j, k = start[cluster] + corner[at, 0], start[cluster] + corner[at, 1], start[cluster] + corner[at, 2]
            x, y, z = vertex[0, i], vertex[1, i], vertex[2, i]
            ax, ay, az = vertex[0, j] - x, vertex[1, j] - y, vertex[2, j] - z
            bx, by, bz = vertex[0, k] - x, vertex[1, k] - y, vertex[2, k] - z
            nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
            offset = nx * (x - qx) + ny * (y - qy) + nz * (z - qz)
            plane[0, at], plane[1, at], plane[2, at], plane[3, at] = nx, ny, nz, offset
            greatest = max(greatest, (ax * ax + ay * ay + az * az) * (bx * bx + by * by + bz * bz))
        product[cluster] = math.sqrt(greatest)


Key = tuple[tuple[Texture | None, float, float] | None, ...]  # of each material: what decides about holes


class CutFaces(NamedTuple):
    """The triangles that may have holes, for kernels: c of them."""

    face: Array  # (c,) int32: which triangles, in mesh order
    of_face: Array  # (m,) int32: which of them each triangle is, -1 for one without holes
    uv: Array  # (c, 6) float64: u and v at the first corner, the second, the third
    mask: Array  # (c,) int64: row of the table
    table: AlphaTable


class CutOuts:
    """Which materials have holes; equal ones have the same object as long as it is in use.

    `key`: texture, factor and cutoff of each material, None for one that has no holes.
    """

    def __init__(self, key: Key) -> None:
        self.key = key
        distinct = list(dict.fromkeys(one for one in key if one is not None))
        textures = [texture for texture, _, _ in distinct if texture is not None]
        images = list(dict.fromkeys(texture.image for texture in textures))
        starts = np.cumsum([0, *(image.width * image.height for image in images)]).tolist()
        first = dict(zip(images, starts, strict=False))
        rows = [(0,) * 6 if texture is None else _row(texture, first) for texture, _, _ in distinct]
        number = {one: k for k, one in enumerate(distinct)}
        self.of_material = np.array([-1 if one is None else number[one] for one in key], np.int32)
        self.table = AlphaTable(
            np.concatenate([np.zeros(0, np.float32), *(image.linear_alpha().reshape(-1) for image in images)]),
            np.array(rows, np.int64).reshape(-1, 6),
            np.array([limits for _, *limits in distinct], np.float64).reshape(-1, 2))

    def faces(self, material_of_face: Array, needed: int, uv: Array | None) -> CutFaces | None:
        """Return those of m triangles that may have holes, None where none has; `needed`: materials that they name."""
        expect(needed <= len(self.of_material), "geometry: cut_outs", f"those of {needed} materials",
               len(self.of_material))
        mask = self.of_material[material_of_face].astype(np.int64)
        face = np.flatnonzero(mask >= 0).astype(np.int32)
        if not len(face):
            return None
        textured = self.table.mask[mask[face], 1].any()
        expect(uv is not None or not textured, "geometry: uv", "texture coordinates for its cut-outs", None)
        uv = np.zeros((len(face), 6)) if uv is None else uv[face].reshape(-1, 6)
        of_face = np.full(len(mask), -1, np.int32)
        of_face[face] = np.arange(len(face))
        return CutFaces(face, of_face, np.ascontiguousarray(uv, np.float64), mask[face], self.table)

    def __eq__(self, other: object) -> bool:
        return self is other or (isinstance(other, CutOuts) and self.key == other.key)

    def __hash__(self) -> int:
        return hash(self.key)


NO_CUT = CutFaces(np.zeros(0, np.int32), np.zeros(0, np.int32), np.zeros((0, 6)), np.zeros(0, np.int64), NO_MASKS)


_in_use: "weakref.WeakValueDictionary[Key, CutOuts]" = weakref.WeakValueDictionary()


def cut_outs(materials: Sequence[Material]) -> CutOuts | None:
    """Return where surfaces of some materials have holes; None where none of them has any."""
    key = tuple(_holes(material) for material in materials)
    if not any(one is not None for one in key):
        return None
    found = _in_use.get(key)
    if found is None:
        found = _in_use[key] = CutOuts(key)
    return found


def _holes(material: Material) -> tuple[Texture | None, float, float] | None:
    """Return what decides where a material has holes, None where it has none."""
    if material.cutoff is None:
        return None
    texture = material.alpha_texture or material.texture
    image = None if texture is None else texture.image
    least, most = (1.0, 1.0) if image is None else image.alpha_range
    if material.alpha * least >= material.cutoff:
        return None
    if material.alpha * most < material.cutoff:
        return None, material.alpha, material.cutoff  # one hole
    return texture, material.alpha, material.cutoff


def _row(texture: Texture, first: dict[Image, int]) -> tuple[int, ...]:
    image = texture.image
    return (first[image], image.width, image.height, WRAPS[texture.wrap[0]], WRAPS[texture.wrap[1]],
            int(texture.filter == "nearest"))
