"""All textures of a scene as arrays for kernels: every image with its mip levels once, in linear light."""

import weakref
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from refgi.errors import expect
from refgi.scene.texture.image import Image
from refgi.scene.texture.pyramid import level_sizes, next_level
from refgi.scene.texture.texture import Texture
from refgi.scene.values import Array

REPEAT, CLAMP, MIRROR = 0, 1, 2
NEAREST, BILINEAR, TRILINEAR = 0, 1, 2
WRAPS = {"repeat": REPEAT, "clamp": CLAMP, "mirror": MIRROR}
FILTERS = {"nearest": NEAREST, "bilinear": BILINEAR, "trilinear": TRILINEAR}
MOST_TEXELS = (1 << 31) - 1  # of all images: kernels count them in int32
FIRST, LEVELS, WRAP_U, WRAP_V, FILTER = range(5)  # columns of `TextureTable.texture`


class TextureTable(NamedTuple):
    """Textures as arrays for kernels."""

    texels: Array  # (n, 3) float32, linear: row by row, level by level, image by image
    level: Array  # (k, 3) int64: first texel, width and height of each level of each image
    texture: Array  # (t, 5) int64: first level, number of levels, wrap of u and v, filter
    of_material: Array  # (m,) int32: row of `texture`, -1 for none


class Textures:
    """The textures of a scene's materials; equal materials have the same object as long as it is in use."""

    def __init__(self, textures: "Sequence[Texture | None]") -> None:
        distinct = list(dict.fromkeys(one for one in textures if one is not None))
        images = list(dict.fromkeys(one.image for one in distinct))
        first = {image: number for image, number in zip(images, _first_levels(images), strict=True)}
        rows = [(first[one.image], len(level_sizes(one.image.width, one.image.height)), WRAPS[one.wrap[0]],
                 WRAPS[one.wrap[1]], FILTERS[one.filter]) for one in distinct]
        number = {one: k for k, one in enumerate(distinct)}
        self.table = TextureTable(
            *_stored(images), np.array(rows, np.int64).reshape(-1, 5),
            np.array([-1 if one is None else number[one] for one in textures], np.int32))


_in_use: "weakref.WeakValueDictionary[tuple[Texture | None, ...], Textures]" = weakref.WeakValueDictionary()


def textures_of(textures: "Sequence[Texture | None]") -> Textures | None:
    """Return the textures of some materials, None where no material has one.

    `textures`: that of each material.
    """
    key = tuple(textures)
    if not any(one is not None for one in key):
        return None
    found = _in_use.get(key)
    if found is None:
        found = _in_use[key] = Textures(key)
    return found


def _first_levels(images: Sequence[Image]) -> list[int]:
    counts = [len(level_sizes(image.width, image.height)) for image in images]
    return np.cumsum([0, *counts])[:-1].tolist()  # type: ignore[no-any-return]


def _stored(images: Sequence[Image]) -> tuple[Array, Array]:
    """Return texels and levels of images, each level made where it is stored."""
    sizes = [size for image in images for size in level_sizes(image.width, image.height)]
    starts = np.cumsum([0, *(width * height for width, height in sizes)])
    total = int(starts[-1])
    expect(total <= MOST_TEXELS, "textures", f"up to {MOST_TEXELS} texels with all mip levels", total)
    texels = np.empty((total, 3), np.float32)
    level = np.array([(start, *size) for start, size in zip(starts[:-1].tolist(), sizes, strict=True)], np.int64)
    row = 0
    for image in images:
        below = image.linear()
        for width, height in level_sizes(image.width, image.height):
            if (width, height) != (image.width, image.height):
                below = next_level(below)
            start = int(starts[row])
            texels[start : start + width * height] = below.reshape(-1, 3)
            row += 1
    return texels, level
