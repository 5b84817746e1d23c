"""A picture of the subsplats (Nichols and Wyman 2009, Fig. 5): the finer, the brighter."""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.splat.refinement.grid import Subsplats

Array = npt.NDArray[Any]

FRAMED = 2  # finest level whose cells have an edge to see
EDGE = 0.6  # of a cell's brightness


def level_picture(subsplats: Subsplats, *, edges: bool = True) -> Array:
    """Return the picture of which level lights each pixel.

    Parameters
    ----------
    subsplats : Subsplats
        The leaves.
    edges : bool
        Darken the upper and left edge of cells of 4 x 4 pixels and more.

    Returns
    -------
    (h, w) ndarray of float32
        1 where pixels are lit one by one, less by equal steps for every coarser level, 0 where nothing is lit.
    """
    height, width = subsplats.shape
    picture = np.zeros((height, width), np.float32)
    for level, leaf in enumerate(subsplats.leaf):
        side = 1 << level
        cell = np.full((side, side), 1 - level / len(subsplats.leaf), np.float32)
        if edges and level >= FRAMED:
            cell[0], cell[1:, 0] = EDGE * cell[0], EDGE * cell[1:, 0]
        picture += np.kron(leaf, cell)[:height, :width]
    return picture
