"""`Texture`, mip levels that keep the energy, and all textures of a scene as arrays for kernels.

The mean of every level is the image's. A level has half the texels of the one below along each axis, rounded down, at
least 1. Where that does not divide, a texel covers parts of texels, which count with their area.
"""

import dataclasses
import weakref
from collections.abc import Sequence
from typing import Literal, NamedTuple, get_args

import numpy as np

from refgi.errors import expect
from refgi.scene.texture.image import Image
from refgi.types import Array

Wrap = Literal["repeat", "clamp", "mirror"]
Filter = Literal["nearest", "bilinear", "trilinear"]


@dataclasses.dataclass(frozen=True)
class Texture:
    """An image that multiplies a reflectance, looked up at the texture coordinates (u, v) of its triangles.

    `wrap` of u and of v: "repeat", "clamp" to the edge's texels, or "mirror" (every other repetition turned round).
    `filter`: "nearest" texel; "bilinear" between the four around; "trilinear": the mean over what a pixel covers, from
    mip levels. At the hits of rays both latter are bilinear.
    """

    image: Image
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    filter: Filter = "trilinear"

    def __post_init__(self) -> None:
        expect(isinstance(self.image, Image), "texture: image", "an Image", type(self.image).__name__)
        good = isinstance(self.wrap, tuple) and len(self.wrap) == 2 and all(one in get_args(Wrap) for one in self.wrap)
        expect(good, "texture: wrap", f"two of {', '.join(get_args(Wrap))}", self.wrap)
        expect(self.filter in get_args(Filter), "texture: filter", f"one of {', '.join(get_args(Filter))}",
               self.filter)


def level_sizes(width: int, height: int) -> list[tuple[int, int]]:
    """Return (width, height) of each level, the image itself first, down to 1 x 1."""
    sizes = [(width, height)]
    while sizes[-1] != (1, 1):
        width, height = max(1, width // 2), max(1, height // 2)
        sizes.append((width, height))
    return sizes


def next_level(level: Array) -> Array:
    """Return the level above (h', w', 3) of one (h, w, 3), in its dtype; summed in float64."""
    halved = _halved(level.astype(np.float64), 0)
    return _halved(halved, 1).astype(level.dtype)


def _halved(level: Array, axis: int) -> Array:
    """Return area-weighted means along an axis."""
    count = level.shape[axis]
    if count == 1:
        return level
    level = np.moveaxis(level, axis, 0)
    fewer = count // 2
    if count == 2 * fewer:
        return np.moveaxis((level[0::2] + level[1::2]) / 2, 0, axis)
    # texel k of n covers from k (2 n + 1) / n on: the rest of texel 2 k, all of 2 k + 1, and what 2 k + 2 still has
    k = np.arange(fewer).reshape(-1, *(1,) * (level.ndim - 1))
    parts = (fewer - k) * level[0:-1:2] + fewer * level[1::2] + (k + 1) * level[2::2]
    return np.moveaxis(parts / count, 0, axis)


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
    """Return the textures of some materials, None where no material has one; `textures`: that of each material."""
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
