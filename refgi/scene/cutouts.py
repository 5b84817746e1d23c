"""Cut-outs of a scene: which materials have holes, and which triangles show them.

They belong to the geometry: whatever finds a triangle, on a map or along a ray, passes over its holes. A scene's
materials say where these are; `Scene` keeps its geometry in step with them.
"""

import weakref
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from refgi.errors import expect
from refgi.scene.material import Material
from refgi.scene.texture.image import Image
from refgi.scene.texture.lookup import NO_MASKS, AlphaTable
from refgi.scene.texture.table import WRAPS, Texture
from refgi.types import Array

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
