"""Refinement until an error target is met; beyond Nichols and Wyman.

`error_driven` searches the threshold and estimates the error from samples, `trial` refines by one threshold.
`interpolate` computes blend weights between levels by the similarity of their surfaces, `descent` carries irradiance
down the levels by them, and `near` sums the unbounded part of near pairs at every pixel.
"""
