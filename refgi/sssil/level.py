"""Level: what a camera sees, as one level of the pyramids holds it.

Picture: what a camera sees at full resolution, as the kernels of the pyramids read it.
"""

from typing import Any, NamedTuple

import numpy.typing as npt

Array = npt.NDArray[Any]


class Level(NamedTuple):
    """The surfaces of one view at a resolution of 1 / 2^number; where a texel sees none, all is 0 and `pixel` is -1.

    Positions are relative to the eye, along the axes of the world: a sum over pairs knows differences and scalar
    products alone, so the view is not rotated. At level k texel (row, column) covers the pixels from 2^k row and
    2^k column on, as many of its 2^k x 2^k as the picture has.
    """

    number: int  # k: 0 is full resolution
    position: Array  # (3, h, w) from the eye, m
    depth: Array  # (h, w) along the view direction, m; inf where no surface is seen
    normal: Array  # (3, h, w) unit vectors, on the side that is seen
    radiance: Array  # (3, h, w) diffusely reflected direct light, W/m^2/sr
    area: Array  # (h, w) surface that the texel stands for, m^2
    pixel: Array  # (h, w) int32 pixel of full resolution whose position and normal these are, row * width + column

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.area.shape[0], self.area.shape[1]


class Picture(NamedTuple):
    """Planes of full resolution, all of one dtype."""

    depth: Array  # (H, W) along the view direction, m; inf where no surface is seen
    normal: Array  # (3, H, W) unit vectors on the side that is seen
    albedo: Array  # (3, H, W) diffuse reflectance
    direct: Array  # (3, H, W) direct irradiance, W/m^2
