"""Refinement until the picture is as near to the full sum as asked for; beyond Nichols and Wyman.

`error_driven` seeks the threshold and says from samples how near the picture is, `trial` refines by one;
`interpolate` weighs what the surfaces of levels have in common and `descent` carries light down by it; `near` is what
no interpolation holds.
"""
