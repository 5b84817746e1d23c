"""Reference visibility of area lights: rays to the rectangle or to its pixel lights, and back projection of the map.

Each gives the visibility of area light m at any points, in place of the filtered maps. From the picture of exact
shadows for every light to the published one, each takes one approximation more: `refgi.bench.split` measures them.
"""

from refgi.cluster.reference.back_projection import back_projection_visibility
from refgi.cluster.reference.rays import rectangle_visibility, reference_visibility, vpl_visibility

__all__ = ["back_projection_visibility", "rectangle_visibility", "reference_visibility", "vpl_visibility"]
