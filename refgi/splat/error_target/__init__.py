"""Refinement until the picture is as near to the full sum as asked for; beyond Nichols and Wyman.

`error_driven` seeks the threshold, `trial` refines by one, over the surfaces of `levels`; `interpolate` weighs what
surfaces have in common and `descent` carries light down by it; `near` is what no interpolation holds, `samples` say how
near the picture is.
"""
