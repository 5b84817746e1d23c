"""Adaptive subsplats (Nichols and Wyman 2009): where light may change, it is evaluated finely; elsewhere it is not.

`grid` names the cells, `ranges` and `criteria` find discontinuities, `refine` lists the subsplats, `evaluate` and
`visible` light them, `upsample` makes a picture of them, `detail` darkens it by Eq. 3. `per_light` refines for each
light by itself, `error_driven` until the picture is as near to the full sum as asked for.
"""
