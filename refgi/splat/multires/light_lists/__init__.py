"""Refinement by illumination: subsplats of each light's own (Nichols and Wyman 2009, Sec. 3.3.1).

`per_light` sums the pictures of all lights, `lists` refines a batch of lights over the tree of cells, `one_light`
evaluates one light at cells.
"""
