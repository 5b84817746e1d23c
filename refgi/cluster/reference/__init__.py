"""What the fast chain is measured against: rays to an area light's rectangle or to its lights, its map projected back.

Each gives the visibility of area light m at any points, in place of the filtered maps. From the picture of exact
shadows for every light to the published one, each takes one approximation more; `split` says what each costs.
"""

from refgi.cluster.reference.back_projection import back_projected_visibility
from refgi.cluster.reference.chosen import reference_visibility
from refgi.cluster.reference.rays import member_visibility, rectangle_visibility

__all__ = ["back_projected_visibility", "member_visibility", "rectangle_visibility", "reference_visibility"]
