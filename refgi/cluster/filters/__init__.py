"""Means of a depth map over discs and boxes: the basis of the series, mip maps, summed areas, texel by texel."""
