"""`Texture`: an image, and how it continues beyond its edges and between its texels."""

import dataclasses
from typing import Literal, get_args

from refgi.errors import expect
from refgi.scene.texture.image import Image

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
