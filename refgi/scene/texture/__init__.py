"""Textures: images decoded to linear light (`image`), how materials use them (`material.Texture`), and their look-up.

A texture multiplies the diffuse reflectance of its material. Row 0 of an image is v = 0, and the centre of texel i of n
lies at (i + 1/2) / n. Images are decoded texel by texel; everything after that, mip levels among it, is linear light.
"""

from refgi.scene.texture.image import Image
from refgi.scene.texture.table import Texture

__all__ = ["Image", "Texture"]
