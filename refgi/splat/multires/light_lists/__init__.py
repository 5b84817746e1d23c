"""Subsplats that each light refines for itself, by its own light (Nichols and Wyman 2009, Sec. 3.3.1).

`per_light` sums the lights' pictures, `lists` refines for a batch of them over the `tree` of cells, `one_light` is what
one light gives one cell.
"""
