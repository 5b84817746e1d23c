"""Visibility of samples by what the depth map holds between them and the receiver."""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.sssil.crown.gather import gather
from refgi.sssil.level import Level
from refgi.sssil.settings import HssilSettings
from refgi.stages import stage

Array = npt.NDArray[Any]


@stage("sssil.bitmask")
def bitmask_gather(level: Level, index: int, settings: HssilSettings, diagonal: float) -> Array:
    """Sum what the samples around each texel of a level send to it.

    Parameters
    ----------
    level : Level
        Receivers and senders.
    index : int
        0 for the first level, whose inner disc is sampled as well.
    settings : HssilSettings
        How many samples in how many directions.
    diagonal : float
        Of the scene, m.

    Returns
    -------
    (3, h, w) ndarray
        Irradiance, W/m^2.
    """
    return gather(level, index, settings) if diagonal else np.zeros_like(level.radiance)
