"""Refinement until an error target is met; beyond Nichols and Wyman.

`error_driven` searches the threshold and estimates the error from samples, `trial` refines by one threshold and carries
irradiance down the levels. `interpolate` computes its blend weights by the similarity of surfaces, and `near` sums the
unbounded part of near pairs at every pixel.
"""
