"""Picture: what a camera sees at full resolution, as the kernels of the pyramids read it."""

from typing import Any, NamedTuple

import numpy.typing as npt

Array = npt.NDArray[Any]


class Picture(NamedTuple):
    """Planes of full resolution, all of one dtype."""

    depth: Array  # (H, W) along the view direction, m; inf where no surface is seen
    normal: Array  # (3, H, W) unit vectors on the side that is seen
    albedo: Array  # (3, H, W) diffuse reflectance
    direct: Array  # (3, H, W) direct irradiance, W/m^2
